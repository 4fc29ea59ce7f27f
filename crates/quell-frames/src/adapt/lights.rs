//! Passes to lights: which passes make the beauty, with which colour, and what is left over.

use super::planes::{colour, gather, single};
use super::reflectance::{ROUNDED_ONE, reflectance, whiten};
use crate::error::Error;
use crate::image::{ExrImage, Window};
use crate::roles::{Mapped, Mapping, Role};
use quell::sequence::{Light, LightKind};
use quell::{Plane, Rgb};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Residual below which passes count as complete. Half rounding of three factors leaves 0.0003 (frames README).
const COMPLETE: f64 = 0.02;

/// Colour is never divided by less: what is divided by is what multiplies back, so nothing is lost; dark surfaces are
/// filtered as if they were this bright.
const FLOOR: f32 = 0.02;
/// Colours below are black: no light is divided by them.
const BLACK: f32 = 1e-4;

/// The light group that holds what no group of the file holds.
pub(super) const NO_GROUP: &str = "quell: no light group";
/// What the passes do not explain of the beauty.
pub(super) const REST: &str = "quell: rest";

/// How a file's passes make its beauty.
#[derive(Clone, Debug, PartialEq)]
pub struct SumRule {
    /// True where the light passes hold the surface's colour already.
    pub colour_inside: bool,
    /// Mean difference, tone-mapped, between the sum of passes and the beauty over the beauty's mean, with the colour multiplied in
    /// and without; `None` without a beauty or without passes.
    pub residual: Option<[f64; 2]>,
    /// True where the passes add up to the beauty; false: what is left over is filtered as one more light.
    pub complete: bool,
    /// True where the file has light passes that are filtered.
    pub factored: bool,
}

/// Light passes with the pass of their colour.
fn terms(mapping: &Mapping) -> Vec<(&Mapped, LightKind, Option<&Mapped>)> {
    mapping
        .passes
        .iter()
        .filter_map(|pass| {
            let kind = pass.role.light()?;
            // A sum beside its parts would count twice.
            let parts: &[Role] = match pass.role {
                Role::Matte => &[Role::MatteDirect, Role::MatteIndirect],
                Role::Glossy => &[Role::GlossyDirect, Role::GlossyIndirect],
                Role::Subsurface => &[Role::SubsurfaceDirect, Role::SubsurfaceIndirect],
                Role::Coat => &[Role::CoatDirect, Role::CoatIndirect],
                Role::Sheen => &[Role::SheenDirect, Role::SheenIndirect],
                Role::Transmission => &[Role::TransmissionDirect, Role::TransmissionIndirect],
                Role::Volume => &[Role::VolumeDirect, Role::VolumeIndirect],
                _ => &[],
            };
            if !parts.is_empty() && parts.iter().all(|part| mapping.get(*part).is_some()) {
                return None;
            }
            let colour = pass.role.colour().and_then(|role| mapping.get(role));
            Some((pass, kind, colour))
        })
        .collect()
}

impl SumRule {
    pub(super) fn find(
        mapping: &Mapping,
        canvas: Window,
        images: &[ExrImage],
        beauty_only: bool,
    ) -> Result<Self, Error> {
        let usual = mapping.renderer.colour_inside.unwrap_or(true);
        let terms = terms(mapping);
        let steady = |kind: &LightKind| *kind == LightKind::NoiseFree;
        let factored = !beauty_only && terms.iter().any(|(_, kind, _)| !steady(kind));
        let Some(beauty) = mapping.get(Role::Beauty) else {
            return Ok(Self { colour_inside: usual, residual: None, complete: true, factored: true });
        };
        if !factored {
            return Ok(Self { colour_inside: usual, residual: None, complete: false, factored });
        }
        let beauty = colour(images, beauty, canvas)?;
        let mut sums = [Plane::filled(canvas.size, [0.0; 3]), Plane::filled(canvas.size, [0.0; 3])];
        for (pass, _, factor) in &terms {
            let light = colour(images, pass, canvas)?;
            let factor = factor.map(|pass| colour(images, pass, canvas)).transpose()?;
            for (i, value) in light.data().iter().enumerate() {
                let factor = factor.as_ref().and_then(|f| f.data().get(i)).copied().unwrap_or([1.0; 3]);
                for c in 0..3 {
                    for (sum, factor) in sums.iter_mut().zip([factor[c], 1.0]) {
                        if let Some(sum) = sum.data_mut().get_mut(i) {
                            sum[c] += value[c] * factor;
                        }
                    }
                }
            }
        }
        let residual = sums.each_ref().map(|sum| {
            let (mut off, mut all) = (0.0, 0.0);
            for (a, b) in sum.data().iter().zip(beauty.data()) {
                for c in 0..3 {
                    if a[c].is_finite() && b[c].is_finite() {
                        // Tone-mapped: one firefly that a half float clamps must not decide.
                        let tone = |v: f32| f64::from(v / (1.0 + v.abs()));
                        off += (tone(a[c]) - tone(b[c])).abs();
                        all += tone(b[c]).abs();
                    }
                }
            }
            if all > 0.0 { off / all } else { off }
        });
        let has_colour = terms.iter().any(|(_, _, colour)| colour.is_some());
        // Without colours both rules are one; the renderer's habit says which.
        let colour_inside = if has_colour { residual[1] < residual[0] } else { usual };
        let complete = residual[usize::from(colour_inside)] <= COMPLETE;
        Ok(Self { colour_inside, residual: Some(residual), complete, factored })
    }

    /// One line.
    pub fn describe(&self) -> String {
        let Some([outside, inside]) = self.residual else {
            let what = if self.factored { "no beauty to check the passes against" } else { "beauty alone is filtered" };
            return what.to_owned();
        };
        let rule =
            if self.colour_inside { "light passes hold the colour" } else { "colour multiplies the light passes" };
        format!(
            "{rule}: their sum differs from the beauty by {outside:.4} with colours multiplied, {inside:.4} without"
        )
    }

    /// What to say where neither rule fits.
    pub(super) fn warning(&self) -> Option<String> {
        let [outside, inside] = self.residual?;
        (!self.complete).then(|| {
            format!(
                "the light passes do not add up to the beauty (off by {:.1} % at best): what is missing is filtered as one \
                 more light; render the missing passes, or map them with --map",
                outside.min(inside) * 100.0
            )
        })
    }
}

/// How many lights a frame has at most, and how many planes multiply them back.
pub(super) fn count(mapping: &Mapping, rule: &SumRule) -> (usize, usize) {
    let terms = if rule.factored { terms(mapping) } else { Vec::new() };
    let groups = mapping.all(Role::LightGroup).count();
    let rest = usize::from(!rule.complete);
    let shared: std::collections::BTreeSet<&str> =
        terms.iter().filter_map(|(_, _, colour)| Some(colour.as_ref()?.name.as_str())).collect();
    // Where the colour is inside, every light has a weight of its own.
    let weights = if rule.colour_inside { terms.len() } else { shared.len() };
    (terms.len() + rest + if groups > 0 { groups + 1 } else { 0 }, weights + usize::from(rest + groups > 0))
}

/// The lights of a frame; those of the file's passes first, in the mapping's order, then the rest, then light groups.
pub(super) fn make(
    mapping: &Mapping,
    rule: &SumRule,
    canvas: Window,
    images: &[ExrImage],
) -> Result<Vec<Light>, Error> {
    let terms = if rule.factored { terms(mapping) } else { Vec::new() };
    // A colour that multiplies several passes is one plane.
    let mut colours: BTreeMap<&str, Arc<Plane<Rgb>>> = BTreeMap::new();
    for factor in terms.iter().filter_map(|(_, _, factor)| *factor) {
        if !colours.contains_key(factor.name.as_str()) {
            colours.insert(&factor.name, Arc::new(colour(images, factor, canvas)?));
        }
    }
    let mut lights: Vec<Light> = terms
        .par_iter()
        .map(|(pass, kind, factor)| {
            let mut light = Light::new(pass.name.clone(), *kind, colour(images, pass, canvas)?);
            light.weight = factor.and_then(|factor| colours.get(factor.name.as_str()).cloned());
            if rule.colour_inside {
                let matte = matches!(kind, LightKind::MatteDirect | LightKind::MatteIndirect);
                if light.weight.is_none() && matte {
                    let albedo = mapping.get(Role::Albedo).map(|pass| colour(images, pass, canvas)).transpose()?;
                    light.weight = albedo.map(Arc::new);
                }
                demodulate(&mut light);
            }
            Ok(light)
        })
        .collect::<Result<_, Error>>()?;
    let beauty = mapping.get(Role::Beauty).map(|pass| colour(images, pass, canvas)).transpose()?;
    if let Some(beauty) = &beauty
        && !rule.complete
    {
        let mut rest = beauty.clone();
        subtract(&mut rest, lights.iter().filter(|light| light.in_beauty));
        let mut light =
            Light::new(if lights.is_empty() { String::new() } else { REST.to_owned() }, LightKind::Beauty, rest);
        let has_matte = lights.iter().any(|l| matches!(l.kind, LightKind::MatteDirect | LightKind::MatteIndirect));
        if !has_matte {
            light.weight = surface_colour(mapping, canvas, images)?.map(|colour| Arc::new(divisor(&colour)));
            demodulate(&mut light);
        }
        lights.push(light);
    }
    let groups: Vec<&Mapped> = mapping.all(Role::LightGroup).collect();
    if let Some(beauty) = beauty
        && !groups.is_empty()
    {
        let weight = surface_colour(mapping, canvas, images)?.map(|colour| Arc::new(divisor(&colour)));
        let mut none = beauty;
        let first = lights.len();
        for pass in groups {
            let mut light = Light::new(pass.name.clone(), LightKind::Beauty, colour(images, pass, canvas)?);
            light.in_beauty = false;
            subtract(&mut none, std::iter::once(&light));
            lights.push(light);
        }
        lights.push(Light { in_beauty: false, ..Light::new(NO_GROUP, LightKind::Beauty, none) });
        for light in lights.iter_mut().skip(first) {
            light.weight.clone_from(&weight);
            demodulate(light);
        }
    }
    Ok(lights)
}

/// Colour of the surface, all lobes together: a pass of its own, else the lobes' colours added up, else what is seen
/// through mirrors and glass, else the picture that the renderer denoised itself: what it missed of the raw picture is
/// smooth, and the filter adds it.
pub(super) fn surface_colour(
    mapping: &Mapping,
    canvas: Window,
    images: &[ExrImage],
) -> Result<Option<Plane<Rgb>>, Error> {
    if let Some(pass) = mapping.get(Role::Albedo) {
        let (normal, depth) = (normals(mapping, canvas, images)?, depths(mapping, canvas, images)?);
        return Ok(Some(reflectance(colour(images, pass, canvas)?, normal.as_ref(), depth.as_ref())));
    }
    let lobes = [Role::MatteColour, Role::GlossyColour, Role::TransmissionColour, Role::SubsurfaceColour];
    let mut sum: Option<Plane<Rgb>> = None;
    for pass in lobes.into_iter().filter_map(|role| mapping.get(role)) {
        let plane = gather(images, &pass.channels, canvas, [0.0; 3])?;
        match &mut sum {
            None => sum = Some(plane),
            Some(sum) => {
                for (sum, value) in sum.data_mut().iter_mut().zip(plane.data()) {
                    for c in 0..3 {
                        sum[c] += value[c];
                    }
                }
            }
        }
    }
    match (sum, mapping.get(Role::SeenAlbedo)) {
        (Some(sum), _) => Ok(Some(sum)),
        (None, Some(pass)) => colour(images, pass, canvas).map(|albedo| Some(reflectance(albedo, None, None))),
        (None, None) => mapping.denoised().map(|pass| colour(images, pass, canvas)).transpose(),
    }
}

fn normals(mapping: &Mapping, canvas: Window, images: &[ExrImage]) -> Result<Option<Plane<[f32; 3]>>, Error> {
    let normal = mapping.get(Role::Normal).filter(|normal| normal.channels.len() >= 3);
    normal.map(|normal| gather(images, &normal.channels, canvas, [0.0; 3])).transpose()
}

fn depths(mapping: &Mapping, canvas: Window, images: &[ExrImage]) -> Result<Option<Plane<f32>>, Error> {
    let depth = mapping.get(Role::Depth).and_then(|depth| depth.channels.first());
    depth.map(|id| single(images, *id, canvas, 0.0)).transpose()
}

/// Share of pixels above 1 from which an albedo is none: dividing by it would put its noise into the light. A lamp in the
/// picture is a percent or two (2.4 % in the sample files of `exr_aov`) and is scaled to 1.
pub(super) const MOST_BEYOND: f32 = 0.04;
/// Depths beyond are background, whatever a renderer writes there (Cycles: 1e10).
const FARTHEST: f32 = 1e9;

/// Share of the pixels in which a surface's albedo is above 1. Surfaces that are known to have a sampled weight for it, and become white, do
/// not count (Mitsuba's metals: 7 % in `mitsuba_box`), nor what mirrors show, which may hold lamps, nor the
/// sky: renderers write its radiance there, and it is divided out and multiplied back.
pub(super) fn beyond_reflectance(mapping: &Mapping, canvas: Window, images: &[ExrImage]) -> Result<f32, Error> {
    let Some(pass) = mapping.get(Role::Albedo) else { return Ok(0.0) };
    let mut albedo = colour(images, pass, canvas)?;
    let (normal, depth) = (normals(mapping, canvas, images)?, depths(mapping, canvas, images)?);
    whiten(&mut albedo, normal.as_ref(), depth.as_ref());
    let surface = |i: usize| match depth.as_ref().and_then(|depth| depth.data().get(i)) {
        Some(&depth) => depth > 0.0 && depth < FARTHEST,
        None => true,
    };
    let above = |value: &Rgb| value.iter().any(|&c| c > ROUNDED_ONE);
    let beyond = albedo.data().iter().enumerate().filter(|(i, value)| above(value) && surface(*i)).count();
    Ok(beyond as f32 / albedo.data().len().max(1) as f32)
}

/// What all of the light is divided by: the colour of surfaces, 1 where they are black (mirrors and glass in most albedos). A pixel at
/// the edge of what is black shows both, in shares that its colour gives; divided by its colour alone, what it shows of the
/// mirror would shine.
fn divisor(colour: &Plane<Rgb>) -> Plane<Rgb> {
    let size = colour.size();
    let most = |value: Rgb| value.into_iter().fold(0.0, f32::max);
    Plane::from_fn(size, |x, y| {
        let value = colour.at(x, y);
        let (mut darkest, mut brightest) = (f32::INFINITY, 0.0f32);
        for v in y.saturating_sub(1)..(y + 2).min(size.height) {
            for u in x.saturating_sub(1)..(x + 2).min(size.width) {
                let most = most(colour.at(u, v));
                (darkest, brightest) = (darkest.min(most), brightest.max(most));
            }
        }
        if darkest >= BLACK || brightest < BLACK {
            return value;
        }
        let black = (1.0 - most(value) / brightest).clamp(0.0, 1.0);
        value.map(|c| (c + black).min(1.0))
    })
}

/// Takes the weight out of the light. Where the colour is black, or no number, the weight becomes 1.
fn demodulate(light: &mut Light) {
    let Some(weight) = light.weight.as_mut().map(Arc::make_mut) else { return };
    light.light.data_mut().par_iter_mut().zip(weight.data_mut().par_iter_mut()).for_each(|(light, weight)| {
        if !weight.iter().all(|w| w.is_finite()) || weight.iter().all(|w| *w < BLACK) {
            *weight = [1.0; 3];
        }
        for c in 0..3 {
            weight[c] = weight[c].max(FLOOR);
            light[c] /= weight[c];
        }
    });
}

fn subtract<'l>(from: &mut Plane<Rgb>, lights: impl Iterator<Item = &'l Light>) {
    for light in lights {
        for (i, (from, value)) in from.data_mut().iter_mut().zip(light.light.data()).enumerate() {
            let weight = light.weight.as_ref().and_then(|w| w.data().get(i)).copied().unwrap_or([1.0; 3]);
            for c in 0..3 {
                from[c] -= value[c] * weight[c];
            }
        }
    }
}
