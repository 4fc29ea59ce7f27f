//! Small differences, planted in every file of the program, must be seen. All are planted in one program, which shows one
//! at a time: programs take long to compile.

use super::device::Device;
use super::everything;
use super::pixels::{SIZE, agreement, assert_same, least_of_everything};
use quell_trace::gpu::Kernels;
use quell_trace::{Control, RenderOptions};

/// The text of the program, and what stands in its place: `SHOWN` is true while this difference shows.
const PLANTED: &[(&str, &str)] = &[
    // sampler.wgsl
    ("x += seed;", "x += select(seed, seed ^ 1u, SHOWN);"),
    // warp.wgsl
    (
        "return radius * vec2f(cos(angle), sin(angle));",
        "return radius * vec2f(cos(angle), sin(angle)) * select(1.0, 0.99, SHOWN);",
    ),
    // fresnel.wgsl
    (
        "return f.f0 + f.rise * (grazing2 * grazing2 * grazing);",
        "return f.f0 + f.rise * (grazing2 * grazing2 * select(grazing, 1.0, SHOWN));",
    ),
    // ggx.wgsl
    ("let a2 = alpha * alpha;\n    let d =", "let a2 = alpha * alpha * select(1.0, 1.1, SHOWN);\n    let d ="),
    // bsdf/mod.wgsl
    ("return ratio * ratio;", "return ratio * select(ratio, vec3f(1.0), SHOWN);"),
    // pattern.wgsl
    ("h *= 0x7feb352du;", "h *= select(0x7feb352du, 0x7feb352fu, SHOWN);"),
    // texture/mod.wgsl
    ("let scaled = uv * vec2f(level.extent);", "let scaled = uv * vec2f(level.extent) + select(0.0, 0.5, SHOWN);"),
    // bvh.wgsl
    (
        "return select(missed, vec3f(t, u / sum, v / sum), t > 0.0 && t <= limit);",
        "return select(missed, vec3f(t, u / sum, select(v, u, SHOWN) / sum), t > 0.0 && t <= limit);",
    ),
    // world.wgsl
    ("p.offset = largest * OFFSET_SHARE", "p.offset = select(1.0, 1e4, SHOWN) * largest * OFFSET_SHARE"),
    // lights/tree.wgsl
    (
        "return g.intensity * (typical + nearest) + BOUND_SHARE * bound;",
        "return g.intensity * (typical + nearest * select(1.0, 1.2, SHOWN)) + BOUND_SHARE * bound;",
    ),
    // lights/mod.wgsl
    (
        "let radiance = e.radiance * falloff / (distance * distance);",
        "let radiance = e.radiance * falloff / (distance * select(distance, 1.0, SHOWN));",
    ),
    // environment.wgsl
    ("return map_lookup(w).w *", "return select(1.0, 1.05, SHOWN) * map_lookup(w).w *"),
    // primary.wgsl
    (
        "return select(vec2f(UNKNOWN_MOTION), then.xy - to.xy,",
        "return select(vec2f(UNKNOWN_MOTION), then.xy - to.xy * select(1.0, 0.999, SHOWN),",
    ),
    // integrator.wgsl
    ("let ratio = min(b / a, 1e18);", "let ratio = min(b / a, 1e18) * select(1.0, 1.1, SHOWN);"),
    // tracer/unfiltered.wgsl
    ("light *= slot.throughput;", "light *= slot.throughput * select(1.0, 1.01, SHOWN);"),
    // tracer/frame.wgsl
    ("(*m).mean += delta / (*m).count;", "(*m).mean += delta / ((*m).count + select(0.0, 0.01, SHOWN));"),
];

/// Differences that few pixels of this scene show: those of near lamps, of glass, of cones, of normals that are mapped.
const FEW: &[(&str, &str)] = &[
    // lights/lamp.wgsl
    ("let half_area = 0.5 * u.x", "let half_area = select(0.5, 0.45, SHOWN) * u.x"),
    // glass.wgsl
    ("let cos_far = sqrt(1.0 - sin2_far);", "let cos_far = sqrt(1.0 - sin2_far) * select(1.0, 0.9, SHOWN);"),
    // material.wgsl
    ("vec3f(distance / m.attenuation_distance)", "vec3f(select(1.0, 1.5, SHOWN) * distance / m.attenuation_distance)"),
    // cone.wgsl
    ("let stretch = 1.0 / max(abs(cosine), 1e-2);", "let stretch = select(1.0, 8.0, SHOWN) / max(abs(cosine), 1e-2);"),
    // appearance.wgsl
    ("let slope = v.xy * surfaces", "let slope = select(1.0, 1.5, SHOWN) * v.xy * surfaces"),
];

/// Share of one plane's pixels that each difference must change.
const SEEN: f64 = 0.02;
const SEEN_BY_FEW: f64 = 0.002;

#[test]
fn everything_has_the_cpus_values_and_planted_differences_are_seen() {
    let all: Vec<(&str, String)> = (1..)
        .zip(PLANTED.iter().chain(FEW))
        .map(|(number, (from, to))| (*from, to.replace("SHOWN", &format!("(frame.planted == {number}u)"))))
        .collect();
    let texts: Vec<(&str, &str)> = all.iter().map(|(from, to)| (*from, to.as_str())).collect();
    // One program for all of this: it takes long to compile.
    let Some(device) = Device::with(Kernels::planted(&texts)) else { return };
    let scene = everything::scene();
    let options = RenderOptions { direct_samples: 4, jitter: true, seed: 7 << 40 | 1, ..RenderOptions::new(SIZE) };
    // Behind the first frame, and as an orthographic camera sees it.
    assert_same(&device, &scene, -3, 1, &options);
    assert_same(&device, &scene, 4, 2, &options);

    let mut gpu = device.tracer(&scene, 4, 1);
    let expected = gpu.tracer().render(&options, &Control::default()).unwrap().frame;
    let mut shares = |number: u32| {
        gpu.show_planted(number);
        agreement(&device.render(&gpu, &options).unwrap().frame, &expected)
    };
    let none = shares(0);
    assert!(none.iter().all(|(_, share)| *share >= least_of_everything(&device)), "{none:.4?}");
    for (number, (from, _)) in (1..).zip(PLANTED.iter().chain(FEW)) {
        let found = shares(number);
        let lost = none.iter().zip(&found).map(|((_, before), (_, now))| before - now).fold(0.0, f64::max);
        println!("{number}: {lost:.3} of a plane by `{from}`");
        let least = if number as usize <= PLANTED.len() { SEEN } else { SEEN_BY_FEW };
        assert!(lost >= least, "nobody sees `{from}` changed: {found:.4?}");
    }
}
