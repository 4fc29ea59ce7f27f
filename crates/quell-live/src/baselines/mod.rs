//! What renderers build themselves today, to be seen beside quell: the a-trous wavelet and SVGF, twins of `quell-lab`'s
//! `atrous` and `svgf` (docs/baselines.md) in WGSL, on WebGPU's default limits.
//!
//! ```text
//! constants.rs  what a user may change, and its ranges
//! common.wgsl   the frame, the pattern of taps
//! guides.wgsl   normal and depth in one texel, and how both change
//! atrous.wgsl   Dammertz et al. 2010
//! svgf.wgsl     Schied et al. 2017
//! ```
//!
//! Planes are read as the tracer wrote them; everything else is in single precision, as in the lab and in the code of SVGF's
//! authors. Nothing is made before a pane shows one of them, and nothing is kept when none does.

mod constants;

pub use self::constants::{
    AtrousConstants, BASELINE_CONSTANTS, BaselineConstant, BaselineConstants, MOST_LEVELS, SvgfConstants,
};
use crate::display::{Stamp, writes};
use bytemuck::{Pod, Zeroable, bytes_of};
use glam::{Vec2, Vec3};
use quell::gpu::wgpu;
use quell::{Projection, Size};
use quell_trace::gpu::Planes;
use std::fmt::Write as _;

/// Pixels along both axes of a workgroup's sum of luminances.
const SUMMED: u32 = 32;

/// Constants of the shaders, beside [`BaselineConstants`]. Those with a source are the lab's, and `tests/main/baselines.rs` compares what comes of them.
const CONSTANTS: &[(&str, f32)] = &[
    // View depth of the background; what no difference reaches; what keeps a division from 0; exp(-MOST) is as good as 0.
    ("BACKGROUND", 1e30),
    ("NONE", 3e38),
    ("LEAST", 1e-30),
    ("MOST", 80.0),
    // SVGF: frames that are counted at most, and those that make a long history.
    ("LONGEST", 32.0),
    ("SHORT", 4.0),
    ("DEPTH_EPSILON", 1e-3),
    ("LUMINANCE_EPSILON", 1e-10),
    // What history must show.
    ("DEPTH_WIDTHS", 10.0),
    ("DEPTH_SLACK", 0.002),
    ("NORMAL_WIDTHS", 16.0),
    ("NORMAL_SLACK", 0.01),
    ("LEAST_WEIGHT", 0.01),
];
/// Of the window in which SVGF estimates variances while history is short.
const SHORT_RADIUS: i32 = 3;

/// Bytes a pixel that both methods share: normal and depth of two frames, their change.
const SHARED_BYTES: u64 = 3 * 16;
/// Of the a-trous wavelet: two signals, written in turn.
const ATROUS_BYTES: u64 = 4 * 16;
/// Of SVGF: two signals in turn and as history, moments and marks of two frames.
const SVGF_BYTES: u64 = 6 * 16 + 2 * 16 + 2 * 8;

/// Twin of `Frame` in `common.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Frame {
    size: [u32; 2],
    step: i32,
    follows: u32,
    origin: [[f32; 4]; 3],
    direction: [[f32; 4]; 3],
    forward_before: [f32; 4],
    eye_moved: [f32; 4],
    /// Colour, normal, position.
    atrous: [f32; 4],
    /// Alpha of colour and of moments, sigma_z, sigma_l.
    svgf: [f32; 4],
}

/// A level's uniform begins at a multiple of this, WebGPU's default.
const ALIGNED: u64 = 256;

/// Matte and glossy light.
type Pair = [wgpu::TextureView; 2];

/// What was filtered, to be shown.
pub(crate) struct Filtered<'a> {
    pub(crate) atrous: Option<&'a Pair>,
    pub(crate) svgf: Option<&'a Pair>,
}

/// Which of both a pane shows, and with what constants.
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct Wanted {
    pub(crate) atrous: bool,
    pub(crate) svgf: bool,
    pub(crate) constants: BaselineConstants,
}

struct Kernels {
    guides: wgpu::ComputePipeline,
    tile_sums: wgpu::ComputePipeline,
    whole_sum: wgpu::ComputePipeline,
    atrous_level: wgpu::ComputePipeline,
    accumulate: wgpu::ComputePipeline,
    estimate: wgpu::ComputePipeline,
    svgf_level: wgpu::ComputePipeline,
}

struct Atrous {
    light: [Pair; 2],
    sums: wgpu::Buffer,
}

struct Svgf {
    /// Two to filter from and to, then the history ([`ways`]).
    light: [Pair; 3],
    moments: [wgpu::TextureView; 2],
    marks: [wgpu::TextureView; 2],
}

struct Images {
    size: Size,
    /// Normal and depth, written in turn.
    surface: [wgpu::TextureView; 2],
    slope: wgpu::TextureView,
    atrous: Option<Atrous>,
    svgf: Option<Svgf>,
    turn: usize,
}

/// Both baselines on one device.
pub(crate) struct Baselines {
    device: wgpu::Device,
    kernels: Option<Kernels>,
    images: Option<Images>,
    /// Number of the last frame that SVGF saw.
    last: Option<i64>,
}

fn header() -> String {
    let mut text = String::new();
    for (name, value) in CONSTANTS {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "const {name}: f32 = {value:e};");
    }
    let luminance = [0, 1, 2].map(|c| quell::luminance(std::array::from_fn(|i| if i == c { 1.0 } else { 0.0 })));
    let [r, g, b] = luminance;
    let _ = writeln!(text, "const LUMINANCE = vec3f({r:e}, {g:e}, {b:e});\nconst SHORT_RADIUS: i32 = {SHORT_RADIUS};");
    text
}

fn groups(size: Size, side: u32) -> [u32; 2] {
    [(size.width as u32).div_ceil(side), (size.height as u32).div_ceil(side)]
}

impl Kernels {
    fn new(device: &wgpu::Device) -> Self {
        let module = |name, source: &str| {
            let source = header() + include_str!("common.wgsl") + source;
            let source = wgpu::ShaderSource::Wgsl(source.into());
            device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some(name), source })
        };
        let pipeline = |module: &wgpu::ShaderModule, entry| {
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(entry),
                layout: None,
                module,
                entry_point: Some(entry),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                cache: None,
            })
        };
        let guides = module("guides of the baselines", include_str!("guides.wgsl"));
        let atrous = module("a-trous", include_str!("atrous.wgsl"));
        let svgf = module("SVGF", include_str!("svgf.wgsl"));
        Self {
            guides: pipeline(&guides, "guides"),
            tile_sums: pipeline(&atrous, "tile_sums"),
            whole_sum: pipeline(&atrous, "whole_sum"),
            atrous_level: pipeline(&atrous, "level"),
            accumulate: pipeline(&svgf, "accumulate"),
            estimate: pipeline(&svgf, "estimate"),
            svgf_level: pipeline(&svgf, "level"),
        }
    }
}

impl Images {
    fn new(device: &wgpu::Device, size: Size) -> Self {
        let make = || texture(device, size, wgpu::TextureFormat::Rgba32Float);
        Self { size, surface: [make(), make()], slope: make(), atrous: None, svgf: None, turn: 0 }
    }

    /// Makes what is wanted and lets go of what is not.
    fn keep(&mut self, device: &wgpu::Device, wanted: Wanted) {
        let size = self.size;
        let make = |format| texture(device, size, format);
        let pair = || [0; 2].map(|_| make(wgpu::TextureFormat::Rgba32Float));
        self.atrous = wanted.atrous.then(|| {
            self.atrous.take().unwrap_or_else(|| {
                let [x, y] = groups(size, SUMMED);
                let sums = wgpu::BufferDescriptor {
                    label: Some("sums of luminances"),
                    size: 16 * u64::from(x) * u64::from(y),
                    usage: wgpu::BufferUsages::STORAGE,
                    mapped_at_creation: false,
                };
                Atrous { light: [pair(), pair()], sums: device.create_buffer(&sums) }
            })
        });
        self.svgf = wanted.svgf.then(|| {
            self.svgf.take().unwrap_or_else(|| Svgf {
                light: [pair(), pair(), pair()],
                moments: pair(),
                marks: [0; 2].map(|_| make(wgpu::TextureFormat::Rg32Uint)),
            })
        });
    }
}

fn texture(device: &wgpu::Device, size: Size, format: wgpu::TextureFormat) -> wgpu::TextureView {
    let texture = device.create_texture(&wgpu::TextureDescriptor {
        label: Some("baseline"),
        size: wgpu::Extent3d { width: size.width as u32, height: size.height as u32, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::STORAGE_BINDING | wgpu::TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    });
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

fn four(v: Vec3) -> [f32; 4] {
    v.extend(0.0).to_array()
}

/// An affine function of the pixel coordinate by its value at the origin and its changes.
fn affine(f: impl Fn(Vec2) -> Vec3) -> [[f32; 4]; 3] {
    let base = f(Vec2::ZERO);
    [four(base), four(f(Vec2::X) - base), four(f(Vec2::Y) - base)]
}

/// Among SVGF's three pairs, which each level reads and which it writes. The first level reads number 1; the output of level
/// `feedback` stays in number 2, the next frame's history.
fn ways(levels: u32, feedback: u32) -> Vec<[usize; 2]> {
    let mut from = 1;
    let mut way = |level| {
        let to = if level == feedback { HISTORY } else { usize::from(from == 0) };
        [std::mem::replace(&mut from, to), to]
    };
    (0..levels).map(&mut way).collect()
}

/// Number of the pair that is SVGF's history.
const HISTORY: usize = 2;

/// A dispatch being recorded.
struct Recorder<'a> {
    device: &'a wgpu::Device,
    pass: wgpu::ComputePass<'a>,
    uniforms: &'a wgpu::Buffer,
}

impl Recorder<'_> {
    /// Appends a dispatch. `level` chooses the uniform; resources by their bindings.
    fn run(
        &mut self,
        pipeline: &wgpu::ComputePipeline,
        level: u32,
        views: &[(u32, &wgpu::TextureView)],
        buffer: Option<(u32, &wgpu::Buffer)>,
        [x, y]: [u32; 2],
    ) {
        let uniform = wgpu::BufferBinding {
            buffer: self.uniforms,
            offset: ALIGNED * u64::from(level),
            size: wgpu::BufferSize::new(size_of::<Frame>() as u64),
        };
        // What sums up the sums knows no frame.
        let frame = (!views.is_empty()).then_some((0, wgpu::BindingResource::Buffer(uniform)));
        let buffer = buffer.map(|(binding, buffer)| (binding, buffer.as_entire_binding()));
        let textures = views.iter().map(|&(binding, view)| (binding, wgpu::BindingResource::TextureView(view)));
        let resources = frame.into_iter().chain(textures).chain(buffer);
        let entries: Vec<_> = resources.map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource }).collect();
        let layout = pipeline.get_bind_group_layout(0);
        let group = wgpu::BindGroupDescriptor { label: Some("baseline"), layout: &layout, entries: &entries };
        self.pass.set_pipeline(pipeline);
        self.pass.set_bind_group(0, &self.device.create_bind_group(&group), &[]);
        self.pass.dispatch_workgroups(x, y, 1);
    }
}

impl Baselines {
    pub(crate) fn new(device: &wgpu::Device) -> Self {
        Self { device: device.clone(), kernels: None, images: None, last: None }
    }

    /// Forgets history.
    pub(crate) fn reset(&mut self) {
        self.last = None;
    }

    /// Bytes of textures.
    pub(crate) fn memory(&self) -> u64 {
        self.images.as_ref().map_or(0, |images| {
            let atrous = if images.atrous.is_some() { ATROUS_BYTES } else { 0 };
            let svgf = if images.svgf.is_some() { SVGF_BYTES } else { 0 };
            images.size.pixels() as u64 * (SHARED_BYTES + atrous + svgf)
        })
    }

    /// Appends what is wanted. `views`: of this frame and of the one before. A frame whose number does not follow is a cut.
    pub(crate) fn encode(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        planes: &Planes,
        views: [&Projection; 2],
        number: i64,
        wanted: Wanted,
        mut stamp: impl FnMut(&'static str) -> Stamp,
    ) -> Filtered<'_> {
        let size = planes.size();
        let follows = self.last.take().is_some_and(|last| last.checked_add(1) == Some(number));
        if !wanted.atrous && !wanted.svgf {
            self.images = None;
            return Filtered { atrous: None, svgf: None };
        }
        let is_kept = self.images.as_ref().is_some_and(|images| images.size == size);
        let kept = self.images.take().filter(|_| is_kept);
        let had_svgf = kept.as_ref().is_some_and(|images| images.svgf.is_some());
        let images = self.images.insert(kept.unwrap_or_else(|| Images::new(&self.device, size)));
        images.keep(&self.device, wanted);
        images.turn = 1 - images.turn;
        self.last = wanted.svgf.then_some(number);
        let kernels = self.kernels.get_or_insert_with(|| Kernels::new(&self.device));
        let constants = wanted.constants.held();
        let uniforms = uniforms(&self.device, size, views, follows && had_svgf, &constants);
        let images = &*images;
        let (now, before) = (images.turn, 1 - images.turn);
        let (surface, slope) = (&images.surface[now], &images.slope);
        let all = groups(size, 8);
        let mut recorder = |encoder: &mut wgpu::CommandEncoder, name, record: &dyn Fn(&mut Recorder<'_>)| {
            let stamp = stamp(name);
            let pass = wgpu::ComputePassDescriptor { label: Some(name), timestamp_writes: writes(&stamp) };
            let pass = encoder.begin_compute_pass(&pass);
            record(&mut Recorder { device: &self.device, pass, uniforms: &uniforms });
        };
        recorder(encoder, "guides of a-trous, SVGF", &|r| {
            let read = [(1, &planes.depth_hit), (2, &planes.normal_roughness), (3, &planes.surface_id)];
            let views = [read[0], read[1], read[2], (4, surface), (5, slope)];
            r.run(&kernels.guides, 0, &views, None, all);
        });
        if let Some(Atrous { light, sums }) = &images.atrous {
            recorder(encoder, "a-trous", &|r| {
                let traced = [(1, surface), (2, &planes.matte), (3, &planes.glossy)];
                r.run(&kernels.tile_sums, 0, &traced, Some((6, sums)), groups(size, SUMMED));
                r.run(&kernels.whole_sum, 0, &[], Some((6, sums)), [1, 1]);
                for level in 0..constants.atrous.levels {
                    let out = &light[level as usize % 2];
                    let from = [&light[1 - level as usize % 2][0], &light[1 - level as usize % 2][1]];
                    let [matte, glossy] = if level == 0 { [&planes.matte, &planes.glossy] } else { from };
                    let views = [(1, surface), (2, matte), (3, glossy), (4, &out[0]), (5, &out[1])];
                    r.run(&kernels.atrous_level, level, &views, Some((7, sums)), all);
                }
            });
        }
        let ways = ways(constants.svgf.levels, constants.svgf.feedback);
        if let Some(Svgf { light, moments, marks }) = &images.svgf {
            let [a, b, history] = light;
            recorder(encoder, "SVGF", &|r| {
                let views = [
                    (1, surface),
                    (2, slope),
                    (3, &planes.matte),
                    (4, &planes.glossy),
                    (5, &moments[before]),
                    (6, &marks[before]),
                    (7, &images.surface[before]),
                    (8, &history[0]),
                    (9, &history[1]),
                    (10, &planes.motion),
                    (11, &planes.surface_id),
                    (12, &a[0]),
                    (13, &a[1]),
                    (14, &moments[now]),
                    (15, &marks[now]),
                ];
                r.run(&kernels.accumulate, 0, &views, None, all);
                let filter = |from: &Pair, to: &Pair| -> [(u32, wgpu::TextureView); 4] {
                    [(3, from[0].clone()), (4, from[1].clone()), (12, to[0].clone()), (13, to[1].clone())]
                };
                let pairs = filter(a, b);
                let pairs = pairs.iter().map(|(binding, view)| (*binding, view));
                let views: Vec<_> =
                    pairs.chain([(1, surface), (2, slope), (5, &moments[now]), (6, &marks[now])]).collect();
                r.run(&kernels.estimate, 0, &views, None, all);
                for (level, [from, to]) in (0..).zip(&ways) {
                    let pairs = filter(&light[*from], &light[*to]);
                    let pairs = pairs.iter().map(|(binding, view)| (*binding, view));
                    let views: Vec<_> = pairs.chain([(1, surface), (2, slope)]).collect();
                    r.run(&kernels.svgf_level, level, &views, None, all);
                }
            });
        }
        let last = ways.last().map_or(1, |[_, to]| *to);
        Filtered {
            atrous: images.atrous.as_ref().map(|atrous| &atrous.light[(constants.atrous.levels as usize + 1) % 2]),
            svgf: images.svgf.as_ref().map(|svgf| &svgf.light[last]),
        }
    }
}

/// A uniform for each level.
fn uniforms(
    device: &wgpu::Device,
    size: Size,
    [now, before]: [&Projection; 2],
    follows: bool,
    constants: &BaselineConstants,
) -> wgpu::Buffer {
    let BaselineConstants { atrous, svgf } = constants;
    let levels = atrous.levels.max(svgf.levels);
    let [eye, eye_before] = [now, before].map(|view| Vec3::from(view.eye()));
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("baselines"),
        size: ALIGNED * u64::from(levels),
        usage: wgpu::BufferUsages::UNIFORM,
        mapped_at_creation: true,
    });
    // A lost device maps nothing; what follows does nothing then, too.
    if let Ok(mut mapped) = buffer.get_mapped_range_mut(..) {
        for level in 0..levels {
            let frame = Frame {
                size: [size.width as u32, size.height as u32],
                step: 1 << level,
                follows: u32::from(follows),
                origin: affine(|pixel| now.ray_origin(pixel) - eye),
                direction: affine(|pixel| now.ray_direction(pixel)),
                forward_before: four(before.forward().into()),
                eye_moved: four(eye - eye_before),
                atrous: [atrous.colour, atrous.normal, atrous.position, 0.0],
                svgf: [svgf.colour_alpha, svgf.moments_alpha, svgf.sigma_z, svgf.sigma_l],
            };
            let start = ALIGNED as usize * level as usize;
            mapped.slice(start..start + size_of::<Frame>()).copy_from_slice(bytes_of(&frame));
        }
    }
    buffer.unmap();
    buffer
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_level_writes_what_it_reads_or_what_the_next_frame_needs() {
        for levels in 1..=MOST_LEVELS {
            for feedback in 0..levels {
                let ways = ways(levels, feedback);
                assert_eq!((ways.len(), ways[0][0]), (levels as usize, 1));
                assert!(ways.windows(2).all(|w| w[0][1] == w[1][0]), "{ways:?}");
                assert!(ways.iter().all(|[from, to]| from != to), "{ways:?}");
                let kept: Vec<usize> = (0..ways.len()).filter(|&level| ways[level][1] == HISTORY).collect();
                assert_eq!(kept, [feedback as usize]);
            }
        }
    }
}
