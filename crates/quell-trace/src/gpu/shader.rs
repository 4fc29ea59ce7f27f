//! The program: WGSL files, constants from Rust, and what a scene does not need left out.

use super::layout;
use super::pack::images::HEAP_WIDTH;
use crate::integrator::{self, Domain};
use crate::{appearance, bsdf, bvh, cone, curved_mirror, environment, geometry, lights, material, primary, world};

/// What a program can do. Drivers drop what it cannot: kernels become smaller and faster.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Variant {
    /// Entries of the stack of a walk through the hierarchy.
    pub(super) stack: u32,
    /// Surfaces with holes, or partly there.
    pub(super) coverage: bool,
    /// Surfaces that cover a share of each point.
    pub(super) blends: bool,
    /// Textures or vertex colours.
    pub(super) painted: bool,
    pub(super) patterned: bool,
    pub(super) transmissive: bool,
    /// The eye looks through smooth glass.
    pub(super) looks_through: bool,
    /// The eye looks into perfect mirrors.
    pub(super) mirrors: bool,
    /// Parallel light, or an environment.
    pub(super) infinite: bool,
    pub(super) environment: bool,
    pub(super) map: bool,
    /// Lamps whose radiance differs from point to point.
    pub(super) varying: bool,
}

impl Variant {
    /// One size serves many frames.
    pub(super) fn rounded_stack(needed: u32) -> u32 {
        needed.max(1).next_multiple_of(32)
    }

    const fn glass_slots(self) -> u32 {
        if self.looks_through { MAX_CHAIN } else { 0 }
    }

    const fn veil_slots(self) -> u32 {
        if self.blends { MAX_CHAIN } else { 0 }
    }

    /// What shows behind surfaces that are not all there: at most one for each vertex of the chain and its end.
    const fn behind_slots(self) -> u32 {
        if self.blends { MAX_CHAIN + 1 } else { 0 }
    }

    /// First slot of the glass on the way; slot 0 is the primary surface.
    pub(super) const fn glass_slot(self) -> u32 {
        1
    }

    pub(super) const fn veil_slot(self) -> u32 {
        self.glass_slot() + self.glass_slots()
    }

    pub(super) const fn behind_slot(self) -> u32 {
        self.veil_slot() + self.veil_slots()
    }

    pub(super) const fn slots(self) -> u32 {
        self.behind_slot() + self.behind_slots()
    }
}

pub(super) const MAX_CHAIN: u32 = primary::MAX_CHAIN as u32;

const FILES: [&str; 20] = [
    include_str!("scene.wgsl"),
    include_str!("../warp.wgsl"),
    include_str!("../sampler.wgsl"),
    include_str!("../material.wgsl"),
    include_str!("../pattern.wgsl"),
    include_str!("../bsdf/fresnel.wgsl"),
    include_str!("../bsdf/ggx.wgsl"),
    include_str!("../bsdf/glass.wgsl"),
    include_str!("../bsdf/mod.wgsl"),
    include_str!("../texture/mod.wgsl"),
    include_str!("../cone.wgsl"),
    include_str!("../appearance.wgsl"),
    include_str!("../bvh.wgsl"),
    include_str!("../world.wgsl"),
    include_str!("../lights/tree.wgsl"),
    include_str!("../lights/lamp.wgsl"),
    include_str!("../lights/mod.wgsl"),
    include_str!("../environment.wgsl"),
    include_str!("../curved_mirror.wgsl"),
    include_str!("../primary.wgsl"),
];

/// The rest: passes.
const PASSES: [&str; 4] = [
    include_str!("../integrator.wgsl"),
    include_str!("../tracer/unfiltered.wgsl"),
    include_str!("../tracer/frame.wgsl"),
    include_str!("../tracer/reference.wgsl"),
];

/// The whole program.
pub(super) fn source(variant: Variant) -> String {
    let mut text = constants(variant);
    for file in FILES.iter().chain(&PASSES) {
        text.push_str(file);
        text.push('\n');
    }
    text
}

/// The program that makes textures of planes.
pub(super) fn planes_source() -> String {
    let text = include_str!("planes.wgsl");
    let is_read = |name: &str| text.split(|c: char| !c.is_ascii_alphanumeric() && c != '_').any(|word| word == name);
    let read = WHOLE.iter().filter(|(name, _)| is_read(name));
    let constants: String = read.map(|(name, value)| format!("const {name}: u32 = {value}u;\n")).collect();
    constants + text
}

fn constants(v: Variant) -> String {
    let mut text = String::new();
    let mut declare = |name: &str, kind: &str, value: String| {
        text.push_str(&format!("const {name}: {kind} = {value};\n"));
    };
    for (name, value) in [
        ("HAS_COVERAGE", v.coverage),
        ("BLENDS", v.blends),
        ("PAINTED", v.painted),
        ("PATTERNED", v.patterned),
        ("TRANSMISSIVE", v.transmissive),
        ("GLASS", v.looks_through),
        ("MIRRORS", v.mirrors),
        ("HAS_INFINITE", v.infinite),
        ("HAS_ENVIRONMENT", v.environment),
        ("HAS_MAP", v.map),
        ("VARYING", v.varying),
    ] {
        declare(name, "bool", value.to_string());
    }
    for (name, value) in [
        ("STACK", v.stack),
        ("SLOTS", v.slots()),
        ("GLASS_SLOT", v.glass_slot()),
        ("VEIL_SLOT", v.veil_slot()),
        ("BEHIND_SLOT", v.behind_slot()),
        ("HEAP_WIDTH", HEAP_WIDTH),
        ("MAX_CHAIN", MAX_CHAIN),
        ("NEWTON_STEPS", curved_mirror::NEWTON_STEPS),
    ] {
        declare(name, "u32", format!("{value}u"));
    }
    for (name, value) in WHOLE {
        declare(name, "u32", format!("{value}u"));
    }
    for (name, value) in NUMBERS {
        declare(name, "f32", format!("{value:?}"));
    }
    for (name, (x, y)) in PAIRS {
        declare(name, "vec2f", format!("vec2f({x:?}, {y:?})"));
    }
    let [r, g, b] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(quell::luminance);
    declare("LUMINANCE", "vec3f", format!("vec3f({r:?}, {g:?}, {b:?})"));
    text
}

const WHOLE: &[(&str, u32)] = &[
    ("TEXTURES", layout::TEXTURES),
    ("BASE_COLOR_TEXTURE", layout::BASE_COLOR_TEXTURE),
    ("METALLIC_ROUGHNESS_TEXTURE", layout::METALLIC_ROUGHNESS_TEXTURE),
    ("TRANSMISSION_TEXTURE", layout::TRANSMISSION_TEXTURE),
    ("SPECULAR_TEXTURE", layout::SPECULAR_TEXTURE),
    ("SPECULAR_COLOR_TEXTURE", layout::SPECULAR_COLOR_TEXTURE),
    ("EMISSIVE_TEXTURE", layout::EMISSIVE_TEXTURE),
    ("NORMAL_TEXTURE", layout::NORMAL_TEXTURE),
    ("WRAP_REPEAT", layout::WRAP_REPEAT),
    ("WRAP_MIRROR", layout::WRAP_MIRROR),
    ("WRAP_CLAMP", layout::WRAP_CLAMP),
    ("MIRRORED", layout::MIRRORED),
    ("STILL", layout::STILL),
    ("IS_PAINTED", layout::IS_PAINTED),
    ("MASKED", layout::MASKED),
    ("BLENDED", layout::BLENDED),
    ("TWO_SIDED_EMISSION", layout::TWO_SIDED_EMISSION),
    ("THIN_WALLED", layout::THIN_WALLED),
    ("UNLIT", layout::UNLIT),
    ("PLAIN", layout::PLAIN),
    ("CHECKER", layout::CHECKER),
    ("TILES", layout::TILES),
    ("STRIPES", layout::STRIPES),
    ("WOOD", layout::WOOD),
    ("MARBLE", layout::MARBLE),
    ("MOTTLED", layout::MOTTLED),
    ("PLANKS", layout::PLANKS),
    ("PICTURE", layout::PICTURE),
    ("TRIANGLE", layout::TRIANGLE),
    ("PATCH", layout::PATCH),
    ("POINT", layout::POINT),
    ("SPOT", layout::SPOT),
    ("DIRECTIONAL", layout::DIRECTIONAL),
    ("FAR_TURNS", layout::FAR_TURNS),
    ("FAR_IS_STILL", layout::FAR_IS_STILL),
    ("MATTE_PATH", layout::MATTE_PATH),
    ("GLOSSY_PATH", layout::GLOSSY_PATH),
    ("TRANSMISSION_PATH", layout::TRANSMISSION_PATH),
    ("EYE_PATH", layout::EYE_PATH),
    ("IS_SIGNAL", layout::IS_SIGNAL),
    ("IN_HALVES", layout::IN_HALVES),
    ("IS_FIRST", layout::IS_FIRST),
    ("IN_AREA", layout::IN_AREA),
    ("OCCUPIED", layout::OCCUPIED),
    ("ESCAPED", layout::ESCAPED),
    ("BEHIND_GLASS", layout::BEHIND_GLASS),
    ("DIRECT", layout::DIRECT),
    ("MATTE", layout::MATTE),
    ("GLOSSY", layout::GLOSSY),
    ("MATTE_WEIGHT", layout::MATTE_WEIGHT),
    ("GLOSSY_WEIGHT", layout::GLOSSY_WEIGHT),
    ("NORMAL", layout::NORMAL),
    ("VIEW_DEPTH", layout::VIEW_DEPTH),
    ("ROUGHNESS", layout::ROUGHNESS),
    ("MOTION", layout::MOTION),
    ("SURFACE_ID", layout::SURFACE_ID),
    ("MATTE_DISTANCE", layout::MATTE_DISTANCE),
    ("GLOSSY_DISTANCE", layout::GLOSSY_DISTANCE),
    ("MATTE_VARIANCE", layout::MATTE_VARIANCE),
    ("GLOSSY_VARIANCE", layout::GLOSSY_VARIANCE),
    ("CLOSEST_RAYS", layout::CLOSEST_RAYS),
    ("SHADOW_RAYS", layout::SHADOW_RAYS),
    ("MATTE_HALF_A", layout::MATTE_HALF_A),
    ("MATTE_HALF_B", layout::MATTE_HALF_B),
    ("GLOSSY_HALF_A", layout::GLOSSY_HALF_A),
    ("GLOSSY_HALF_B", layout::GLOSSY_HALF_B),
    ("BEAUTY_MEAN", layout::BEAUTY_MEAN),
    ("BEAUTY_SQUARES", layout::BEAUTY_SQUARES),
    ("DIRECT_MEAN", layout::DIRECT_MEAN),
    ("MATTE_MEAN", layout::MATTE_MEAN),
    ("GLOSSY_MEAN", layout::GLOSSY_MEAN),
    ("MATTE_DOMAIN", Domain::Matte as u32),
    ("GLOSSY_DOMAIN", Domain::Glossy as u32),
    ("TRANSMISSION_DOMAIN", Domain::Transmission as u32),
    ("PIXEL_DOMAIN", Domain::Pixel as u32),
    ("DIRECT_LIGHT_DOMAIN", Domain::DirectLight as u32),
    ("DIRECT_MATTE_DOMAIN", Domain::DirectMatte as u32),
    ("DIRECT_GLOSSY_DOMAIN", Domain::DirectGlossy as u32),
    ("ROULETTE_FROM", integrator::ROULETTE_FROM),
    ("GLOSSY_RAYS_DIVISOR", integrator::GLOSSY_RAYS_DIVISOR),
];

const NUMBERS: &[(&str, f32)] = &[
    ("INFINITE", layout::INFINITE),
    ("UNKNOWN_MOTION", layout::UNKNOWN_MOTION),
    ("MIRROR_ROUGHNESS", material::MIRROR_ROUGHNESS),
    ("MATTE_FRESNEL_CAP", bsdf::MATTE_FRESNEL_CAP),
    ("GLOSSY_FRESNEL_FLOOR", bsdf::GLOSSY_FRESNEL_FLOOR),
    ("MIN_VIEW_COS", bsdf::MIN_VIEW_COS),
    ("MIN_LOBE_SHARE", bsdf::MIN_LOBE_SHARE),
    ("MAX_IOR", bsdf::MAX_IOR),
    ("STRAIGHT_ETA", bsdf::STRAIGHT_ETA),
    ("ROULETTE_FLOOR", integrator::ROULETTE_FLOOR),
    ("GLOSSY_RAYS_MAX_ROUGHNESS", integrator::GLOSSY_RAYS_MAX_ROUGHNESS),
    ("VEIL_OPACITY", primary::VEIL_OPACITY),
    ("LEAST_BEND", world::LEAST_BEND),
    ("NEWTON_FOUND", curved_mirror::NEWTON_FOUND),
    ("NEWTON_DETERMINANT", curved_mirror::NEWTON_DETERMINANT),
    ("SLACK", bvh::SLACK),
    ("LEAST_COMPONENT", bvh::LEAST_COMPONENT),
    ("OFFSET_SHARE", geometry::OFFSET_SHARE),
    ("SHADOW_END", geometry::SHADOW_END),
    ("LOBE_SHARE", cone::LOBE_SHARE),
    ("MAX_LOOKUPS", cone::MAX_LOOKUPS),
    ("BOUND_SHARE", lights::BOUND_SHARE),
    ("CONE_SLACK", lights::CONE_SLACK),
    ("MIN_SPHERICAL_SOLID_ANGLE", lights::MIN_SPHERICAL_SOLID_ANGLE as f32),
    ("MAX_SPHERICAL_SOLID_ANGLE", lights::MAX_SPHERICAL_SOLID_ANGLE as f32),
    ("MIN_POLAR_SIN", environment::MIN_POLAR_SIN),
];

const PAIRS: &[(&str, (f32, f32))] = &[
    ("MIRROR_COS", appearance::MIRROR_COS),
    ("LAMP_IN_GLOSSY", integrator::LAMP_IN_GLOSSY),
    ("INFINITE_PROBABILITY", (*lights::INFINITE_PROBABILITY.start(), *lights::INFINITE_PROBABILITY.end())),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_constant_is_used() {
        let text: String = FILES.iter().chain(&PASSES).copied().collect();
        let used: std::collections::HashSet<&str> =
            text.split(|c: char| !c.is_ascii_alphanumeric() && c != '_').collect();
        let names = WHOLE.iter().map(|(name, _)| *name).chain(NUMBERS.iter().map(|(name, _)| *name));
        let unused: Vec<&str> =
            names.chain(PAIRS.iter().map(|(name, _)| *name)).filter(|name| !used.contains(name)).collect();
        assert!(unused.is_empty(), "{unused:?}");
    }
}
