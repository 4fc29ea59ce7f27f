// The parameters of all stages as settings.rs declares them, lengths in pixels of this image. Switches are 0 or 1.

// `Rejection`
const REJECTION_OFF: u32 = 0u;
const REJECTION_PLANE: u32 = 1u;
const REJECTION_POINT: u32 = 2u;
// `Clip`
const CLIP_OFF: u32 = 0u;
const CLIP_BOX: u32 = 1u;
const CLIP_SIGMA: u32 = 2u;
// `HitFilter`
const HIT_FILTER_OFF: u32 = 0u;
const HIT_FILTER_MIN: u32 = 1u;
const HIT_FILTER_MEDIAN: u32 = 2u;
// `GlossyRadius`
const RADIUS_FOOTPRINT: u32 = 0u;
const RADIUS_CONSTANT: u32 = 1u;

struct SurfaceSettings {
    @align(16) rejection: u32,
    plane_distance: f32,
    pixel_distance: f32,
    point_distance: f32,
    falloff: f32,
    normal_min: f32,
    static_motion: f32,
    moving_depth: f32,
    guard_band: f32,
    lost_footprint: f32,
}

struct Blend {
    @align(16) alpha: f32,
    ramp: u32,
    clip: u32,
    clip_radius: i32,
    clip_gamma: f32,
    confidence_frames: f32,
    // Of the detector of changed light: most that history counts in the fast mean, and that mean's frames; 0: there is none.
    fast: f32,
    fast_frames: f32,
    // Most frames of the long mean.
    long_frames: f32,
    change_begin: f32,
    change_slope: f32,
    change_least: f32,
    change_radius: i32,
    change_spacing: i32,
}

struct EdgeStops {
    @align(16) depth: f32,
    normal: f32,
    plane: f32,
    gloss: f32,
    // Closeness of another surface from which a pair counts nothing; 0: no such stop.
    contact: f32,
}

struct YoungSettings {
    @align(16) frames: f32,
    end_1: f32,
    end_3: f32,
    end_9: f32,
    end_27: f32,
    glossy_end_1: f32,
    glossy_end_3: f32,
    glossy_end_9: f32,
    lobe: f32,
    least_lobe: f32,
    // Of the luminance stop from the second level on; 0: none.
    deviations: f32,
    // Of the first level's luminance stop; 0: none.
    matte_contrast: f32,
    glossy_contrast: f32,
    // Of those, what bounds the noise of the other levels; 0: nothing does.
    further_contrast: f32,
    // Relative variance of a pair's difference from which the contact stop is off; 0: it always acts.
    contact_noise: f32,
    isolated: f32,
    // Pixels between the taps of the matte level that hands the confidence on; 0: none does.
    last: i32,
}

struct SpiralSettings {
    @align(16) taps: u32,
    mirror: u32,
}

struct DisocclusionSettings {
    @align(16) radius: i32,
    blur: i32,
    floor: f32,
    feedback_floor: f32,
}

struct FireflySettings {
    @align(16) luminance: u32,
    threshold: f32,
    plain: u32,
}

struct MirrorSettings {
    @align(16) virtual_reprojection: u32,
    hit_filter: u32,
    curvature: u32,
    max_hit_distance: f32,
    reflector_normal_min: f32,
    reflector_roughness: f32,
    farthest_bent_px: f32,
    mirror_roughness: f32,
    hit_tolerance: f32,
    spline_below: f32,
}

struct GlossyBilateralSettings {
    @align(16) radius: u32,
    curvature: u32,
    monotone: u32,
    step_px: i32,
    reach: i32,
    max_radius_px: f32,
    constant_radius_px: f32,
    min_radius: f32,
    sigma: f32,
}

struct DirectTaaSettings {
    @align(16) history: f32,
    falloff_px: f32,
    clamp_falloff: f32,
}

struct AntialiasingSettings {
    @align(16) least: f32,
    resampling: f32,
    gamma: f32,
    change_falloff: f32,
    thin_radius: u32,
    thin_depth: f32,
    thin_motion: f32,
}

// Which terms the composite adds, and which weights are there.
struct CompositeSettings {
    @align(16) direct: u32,
    matte: u32,
    glossy: u32,
    direct_matte: u32,
    direct_glossy: u32,
    matte_weight: u32,
    glossy_weight: u32,
}

struct Settings {
    surface: SurfaceSettings,
    matte_blend: Blend,
    glossy_blend: Blend,
    matte_edge: EdgeStops,
    glossy_edge: EdgeStops,
    young: YoungSettings,
    matte_prefilter: SpiralSettings,
    matte_bilateral: SpiralSettings,
    disocclusion: DisocclusionSettings,
    firefly: FireflySettings,
    mirror: MirrorSettings,
    glossy_bilateral: GlossyBilateralSettings,
    direct_taa: DirectTaaSettings,
    antialiasing: AntialiasingSettings,
    composite: CompositeSettings,
}
