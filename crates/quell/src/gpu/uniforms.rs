//! Per-frame uniforms: the frame's cameras, and the settings. Twins of `frame.wgsl` and `settings.wgsl`.

use super::guides::SpiralTap;
use super::tile::Tile;
use super::uniform::{Uniform, Value, uniforms};
use crate::border::Guides;
use crate::camera::Projection;
use crate::frame::Signal;
use crate::history::Validity;
use crate::kernels::mirror_image::FARTHEST_BENT_PX;
use crate::kernels::temporal;
use crate::plane::Size;
use crate::settings::{
    Clip, GlossyRadius, HitFilter, Median, OffScreen, REFERENCE_ROWS, Rejection, Settings, SurfaceSettings,
};
use crate::stages::glossy_bilateral::KernelSize;
use crate::stages::young_filter;
use glam::{DVec3, UVec2, Vec2, Vec3, Vec4};

uniforms! {
    /// `Projection` for the GPU: relative to an eye, because f32 has to hold it.
    View as "View" {
        origin: [Vec3; 3],
        direction: [Vec3; 3],
        u: Vec4,
        v: Vec4,
        w: Vec4,
        forward: Vec3,
        focal_px: f32,
        eye: Vec3,
        perspective: u32,
    }

    /// One frame's cameras and extent.
    pub FrameUniforms as "Frame" {
        view: View,
        previous_view: View,
        before_view: View,
        jitter: Vec2,
        before_jitter: Vec2,
        size: UVec2,
        before_size: UVec2,
        to_before: Vec2,
        matte_history: u32,
        glossy_history: u32,
        direct_history: u32,
        has_glossy_hit: u32,
        has_roughness: u32,
        picture_history: u32,
        origin: UVec2,
        whole: UVec2,
    }

    Surface as "SurfaceSettings" {
        rejection: u32,
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

    Blend as "Blend" {
        alpha: f32,
        ramp: u32,
        clip: u32,
        clip_radius: u32,
        clip_gamma: f32,
        confidence_frames: f32,
        fast: f32,
        fast_frames: f32,
        long_frames: f32,
        change_begin: f32,
        change_slope: f32,
        change_least: f32,
        change_radius: u32,
        change_spacing: u32,
    }

    EdgeStops as "EdgeStops" {
        depth: f32,
        normal: f32,
        plane: f32,
        gloss: f32,
        contact: f32,
    }

    Spiral as "SpiralSettings" {
        taps: u32,
        mirror: u32,
    }

    Young as "YoungSettings" {
        frames: f32,
        end_1: f32,
        end_3: f32,
        end_9: f32,
        end_27: f32,
        glossy_end_1: f32,
        glossy_end_3: f32,
        glossy_end_9: f32,
        lobe: f32,
        least_lobe: f32,
        deviations: f32,
        matte_contrast: f32,
        glossy_contrast: f32,
        further_contrast: f32,
        contact_noise: f32,
        isolated: f32,
        last: u32,
    }

    Disocclusion as "DisocclusionSettings" {
        radius: u32,
        blur: u32,
        floor: f32,
        feedback_floor: f32,
    }

    Firefly as "FireflySettings" {
        luminance: u32,
        threshold: f32,
        plain: u32,
    }

    Mirror as "MirrorSettings" {
        virtual_reprojection: u32,
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

    GlossyBilateral as "GlossyBilateralSettings" {
        radius: u32,
        curvature: u32,
        monotone: u32,
        step_px: u32,
        reach: u32,
        max_radius_px: f32,
        constant_radius_px: f32,
        min_radius: f32,
        sigma: f32,
    }

    DirectTaa as "DirectTaaSettings" {
        history: f32,
        falloff_px: f32,
        clamp_falloff: f32,
    }

    Antialiasing as "AntialiasingSettings" {
        least: f32,
        resampling: f32,
        gamma: f32,
        change_falloff: f32,
        thin_radius: u32,
        thin_depth: f32,
        thin_motion: f32,
    }

    Composite as "CompositeSettings" {
        direct: u32,
        matte: u32,
        glossy: u32,
        direct_matte: u32,
        direct_glossy: u32,
        matte_weight: u32,
        glossy_weight: u32,
    }

    /// The settings of all stages, lengths in pixels of one image size.
    pub SettingsUniforms as "Settings" {
        surface: Surface,
        matte_blend: Blend,
        glossy_blend: Blend,
        matte_edge: EdgeStops,
        glossy_edge: EdgeStops,
        young: Young,
        matte_prefilter: Spiral,
        matte_bilateral: Spiral,
        disocclusion: Disocclusion,
        firefly: Firefly,
        mirror: Mirror,
        glossy_bilateral: GlossyBilateral,
        direct_taa: DirectTaa,
        antialiasing: Antialiasing,
        composite: Composite,
    }
}

/// The layout of every struct that shaders read.
pub fn layouts() -> Vec<Uniform> {
    let mut all = vec![
        View::layout(),
        FrameUniforms::layout(),
        SpiralTap::layout(),
        Surface::layout(),
        Blend::layout(),
        EdgeStops::layout(),
        Young::layout(),
        Spiral::layout(),
        Disocclusion::layout(),
        Firefly::layout(),
        Mirror::layout(),
        GlossyBilateral::layout(),
        DirectTaa::layout(),
        Antialiasing::layout(),
        Composite::layout(),
        SettingsUniforms::layout(),
        super::convention::PrepareUniforms::layout(),
        super::debug::DebugUniforms::layout(),
    ];
    all.extend(super::sequence::layouts());
    all
}

impl View {
    /// `eye`: the eye of the frame whose shader reads it.
    fn new(projection: &Projection, eye: Vec3) -> Self {
        let own = projection.eye.as_dvec3();
        // For points relative to the view's own eye: a . (X - e) + (a . e + b), in f64, where the second term cancels.
        let row = |(a, b): (DVec3, f64)| a.extend(a.dot(own) + b).as_vec4();
        Self {
            origin: [projection.origin[0] - projection.eye, projection.origin[1], projection.origin[2]],
            direction: projection.direction,
            u: row(projection.u),
            v: row(projection.v),
            w: row(projection.w),
            forward: projection.forward,
            focal_px: projection.focal_px,
            eye: (own - eye.as_dvec3()).as_vec3(),
            perspective: u32::from(projection.perspective),
        }
    }
}

/// The cameras of a frame, and which guides it has.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cameras {
    pub(super) view: Projection,
    pub(super) previous_view: Projection,
    pub(super) jitter: Vec2,
    pub(super) size: Size,
    /// Where the frame lies in the whole picture, whose views those are.
    pub(super) tile: Tile,
    pub(super) has_glossy_hit: bool,
    pub(super) has_roughness: bool,
}

impl FrameUniforms {
    /// Of a frame and the one before; `None`: there is no history.
    pub fn new(now: &Guides, before: Option<&Guides>) -> Self {
        let cameras = |guides: &Guides| Cameras {
            view: guides.view,
            previous_view: guides.previous_view,
            jitter: guides.jitter,
            size: guides.size,
            tile: Tile::whole(guides.size),
            has_glossy_hit: guides.has_glossy_hit,
            has_roughness: guides.has_roughness,
        };
        let there = before.is_some();
        let valid = Validity { matte: there, glossy: there, direct: there, picture: there };
        Self::from_cameras(&cameras(now), before.map(cameras).as_ref(), valid)
    }

    /// The same from cameras alone, and from what of the frame before may be used.
    pub(super) fn from_cameras(now: &Cameras, before: Option<&Cameras>, valid: Validity) -> Self {
        let eye = now.view.eye;
        let before_or_now = before.unwrap_or(now);
        let extent = |size: Size| UVec2::new(size.width as u32, size.height as u32);
        Self {
            view: View::new(&now.view, eye),
            previous_view: View::new(&now.previous_view, eye),
            before_view: View::new(&before_or_now.view, eye),
            jitter: now.jitter,
            before_jitter: before_or_now.jitter,
            size: extent(now.size),
            before_size: extent(before_or_now.size),
            to_before: extent(before_or_now.tile.whole).as_vec2() / extent(now.tile.whole).as_vec2(),
            matte_history: u32::from(before.is_some() && valid.matte),
            glossy_history: u32::from(before.is_some() && valid.glossy),
            direct_history: u32::from(before.is_some() && valid.direct),
            has_glossy_hit: u32::from(now.has_glossy_hit),
            has_roughness: u32::from(now.has_roughness),
            picture_history: u32::from(before.is_some() && valid.picture),
            origin: UVec2::from(now.tile.origin),
            whole: extent(now.tile.whole),
        }
    }

    /// What the uniform buffer holds.
    pub fn bytes(&self) -> Vec<u8> {
        bytes(self)
    }
}

impl SettingsUniforms {
    /// For images of `size`. The composite adds matte and glossy light; see [`SettingsUniforms::with_terms`].
    pub fn new(settings: &Settings, size: Size) -> Self {
        let s = settings;
        let off_screen = |o: OffScreen| u32::from(o == OffScreen::Mirror);
        let rows = size.height as f32;
        let kernel = KernelSize::new(&s.glossy_bilateral, size.height);
        let edge = |gloss, contact| EdgeStops {
            depth: s.edge.depth,
            normal: s.edge.normal,
            plane: s.edge.plane,
            gloss,
            contact,
        };
        Self {
            surface: surface(&s.surface),
            matte_blend: blend(&temporal::Blend::matte(settings)),
            glossy_blend: blend(&temporal::Blend::glossy(settings)),
            matte_edge: edge(s.edge.matte_gloss, s.edge.contact),
            glossy_edge: edge(s.edge.glossy_gloss, 0.0),
            young: young(s),
            matte_prefilter: Spiral { taps: s.matte_prefilter.taps, mirror: off_screen(s.matte_prefilter.off_screen) },
            matte_bilateral: Spiral { taps: s.matte_bilateral.taps, mirror: off_screen(s.matte_bilateral.off_screen) },
            disocclusion: Disocclusion {
                radius: s.disocclusion.radius,
                blur: s.disocclusion.blur,
                floor: s.disocclusion.floor,
                feedback_floor: s.disocclusion.feedback_floor,
            },
            firefly: Firefly {
                luminance: u32::from(s.firefly.median == Median::Luminance),
                threshold: s.firefly.threshold,
                plain: u32::from(s.firefly.plain),
            },
            mirror: Mirror {
                virtual_reprojection: u32::from(s.glossy_temporal.virtual_reprojection),
                hit_filter: match s.glossy_temporal.hit_filter {
                    HitFilter::Off => 0,
                    HitFilter::Min => 1,
                    HitFilter::Median => 2,
                },
                curvature: u32::from(s.glossy_temporal.curvature),
                max_hit_distance: s.glossy_temporal.max_hit_distance,
                reflector_normal_min: s.glossy_temporal.reflector_normal_min,
                reflector_roughness: s.glossy_temporal.reflector_roughness,
                farthest_bent_px: FARTHEST_BENT_PX * rows / REFERENCE_ROWS,
                mirror_roughness: s.glossy_temporal.mirror_roughness,
                hit_tolerance: s.glossy_temporal.hit_tolerance,
                spline_below: s.glossy_temporal.spline_below(),
            },
            glossy_bilateral: GlossyBilateral {
                radius: match s.glossy_bilateral.radius {
                    GlossyRadius::Footprint => 0,
                    GlossyRadius::Constant => 1,
                },
                curvature: u32::from(s.glossy_bilateral.curvature),
                monotone: u32::from(s.edge.monotone),
                step_px: kernel.step_px as u32,
                reach: kernel.reach as u32,
                max_radius_px: kernel.max_radius_px,
                constant_radius_px: kernel.constant_radius_px,
                min_radius: s.glossy_bilateral.min_radius,
                sigma: s.glossy_bilateral.sigma,
            },
            direct_taa: DirectTaa {
                history: s.direct_taa.history,
                falloff_px: s.direct_taa.motion_falloff * rows / REFERENCE_ROWS,
                clamp_falloff: s.direct_taa.clamp_falloff,
            },
            antialiasing: Antialiasing {
                least: s.antialiasing.least,
                resampling: s.antialiasing.resampling,
                gamma: s.antialiasing.gamma,
                change_falloff: s.antialiasing.change_falloff,
                thin_radius: s.antialiasing.thin_radius,
                thin_depth: s.antialiasing.thin_depth,
                thin_motion: s.antialiasing.thin_motion,
            },
            composite: Composite {
                direct: 1,
                matte: 1,
                glossy: 1,
                direct_matte: 0,
                direct_glossy: 0,
                matte_weight: 1,
                glossy_weight: 1,
            },
        }
    }

    /// Which terms the composite adds to direct light: matte, glossy, noisy direct light of each.
    #[must_use]
    pub fn with_terms(self, matte: bool, glossy: bool, direct_matte: bool, direct_glossy: bool) -> Self {
        let [matte, glossy, direct_matte, direct_glossy] = [matte, glossy, direct_matte, direct_glossy].map(u32::from);
        Self { composite: Composite { matte, glossy, direct_matte, direct_glossy, ..self.composite }, ..self }
    }

    /// Whether there is direct light.
    #[must_use]
    pub fn with_direct(self, direct: bool) -> Self {
        Self { composite: Composite { direct: u32::from(direct), ..self.composite }, ..self }
    }

    /// Whether the matte and the glossy terms have weights; without, they count as they are.
    #[must_use]
    pub fn with_weights(self, matte: bool, glossy: bool) -> Self {
        let (matte_weight, glossy_weight) = (u32::from(matte), u32::from(glossy));
        Self { composite: Composite { matte_weight, glossy_weight, ..self.composite }, ..self }
    }

    /// What the uniform buffer holds.
    pub fn bytes(&self) -> Vec<u8> {
        bytes(self)
    }
}

fn blend(blend: &temporal::Blend) -> Blend {
    let change = blend.change;
    Blend {
        alpha: blend.alpha,
        ramp: u32::from(blend.ramp),
        clip: clip(blend.clip),
        clip_radius: blend.clip_radius,
        clip_gamma: blend.clip_gamma,
        confidence_frames: blend.confidence_frames,
        fast: change.map_or(0.0, |c| c.fast),
        fast_frames: change.map_or(0.0, |c| c.fast_frames),
        long_frames: change.map_or(0.0, |c| c.long_frames),
        change_begin: change.map_or(0.0, |c| c.begin),
        change_slope: change.map_or(0.0, |c| c.slope),
        change_least: change.map_or(0.0, |c| c.least),
        change_radius: change.map_or(0, |c| c.radius),
        change_spacing: change.map_or(0, |c| c.spacing),
    }
}

fn surface(s: &SurfaceSettings) -> Surface {
    Surface {
        rejection: match s.rejection {
            Rejection::Off => 0,
            Rejection::Plane => 1,
            Rejection::Point => 2,
        },
        plane_distance: s.plane_distance,
        pixel_distance: s.pixel_distance,
        point_distance: s.point_distance,
        falloff: s.falloff,
        normal_min: s.normal_min,
        static_motion: s.static_motion,
        moving_depth: s.moving_depth,
        guard_band: s.guard_band,
        lost_footprint: s.lost_footprint,
    }
}

fn young(settings: &Settings) -> Young {
    let s = &settings.young_filter;
    let [end_1, end_3, end_9, end_27] = young_filter::ends(s, Signal::Matte);
    let [glossy_end_1, glossy_end_3, glossy_end_9, _] = young_filter::ends(s, Signal::Glossy);
    Young {
        frames: s.frames,
        end_1,
        end_3,
        end_9,
        end_27,
        glossy_end_1,
        glossy_end_3,
        glossy_end_9,
        lobe: s.lobe,
        least_lobe: s.least_lobe,
        deviations: s.deviations,
        matte_contrast: s.matte_contrast,
        glossy_contrast: s.glossy_contrast,
        further_contrast: s.further_contrast,
        contact_noise: s.contact_noise,
        isolated: s.isolated,
        last: young_filter::last_before_blend(settings).unwrap_or(0) as u32,
    }
}

fn clip(clip: Clip) -> u32 {
    match clip {
        Clip::Off => 0,
        Clip::Box => 1,
        Clip::Sigma => 2,
    }
}

fn bytes(value: &impl Value) -> Vec<u8> {
    let mut out = Vec::new();
    value.write(&mut out);
    out
}
