//! Pictures for a screen, and the mean of all frames since something last moved.

use crate::baselines::Filtered;
use crate::choice::{Choice, Pane};
use bytemuck::{Pod, Zeroable, bytes_of};
use quell::Size;
use quell::gpu::wgpu;
use quell_trace::gpu::Planes;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Uniform {
    size: [u32; 2],
    frames: u32,
    panes: u32,
    kinds: [u32; 8],
    edges: [f32; 8],
    exposure: f32,
    pad: [f32; 3],
}

/// Pipelines of `display.wgsl`.
pub(crate) struct Display {
    accumulate: wgpu::ComputePipeline,
    show: wgpu::ComputePipeline,
}

/// Textures of one extent.
pub(crate) struct Pictures {
    size: Size,
    /// Written in turn.
    means: [wgpu::TextureView; 2],
    turn: usize,
    pub(crate) debug: wgpu::TextureView,
    pub(crate) picture: wgpu::TextureView,
    /// Frames in the mean.
    pub(crate) frames: u32,
}

/// Where a pass writes its timestamps: the set, and the first of two places.
pub(crate) type Stamp = Option<(wgpu::QuerySet, u32)>;

pub(crate) fn writes(stamp: &Stamp) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
    stamp.as_ref().map(|(query_set, index)| wgpu::ComputePassTimestampWrites {
        query_set,
        beginning_of_pass_write_index: Some(*index),
        end_of_pass_write_index: Some(index + 1),
    })
}

impl Pictures {
    pub(crate) fn new(device: &wgpu::Device, size: Size) -> Self {
        use wgpu::TextureFormat::{Rgba8Unorm, Rgba32Float};
        let make = |label, format| {
            let texture = device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d { width: size.width as u32, height: size.height as u32, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::STORAGE_BINDING
                    | wgpu::TextureUsages::TEXTURE_BINDING
                    | wgpu::TextureUsages::COPY_SRC,
                view_formats: &[],
            });
            texture.create_view(&wgpu::TextureViewDescriptor::default())
        };
        Self {
            size,
            means: [make("mean", Rgba32Float), make("mean", Rgba32Float)],
            turn: 0,
            debug: make("debug view", Rgba8Unorm),
            picture: make("picture", Rgba8Unorm),
            frames: 0,
        }
    }

    /// The mean of the frames so far; rgba32float.
    pub(crate) fn mean(&self) -> &wgpu::TextureView {
        &self.means[self.turn]
    }
}

impl Display {
    pub(crate) fn new(device: &wgpu::Device) -> Self {
        let module = device.create_shader_module(wgpu::include_wgsl!("display.wgsl"));
        let pipeline = |entry| {
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(entry),
                layout: None,
                module: &module,
                entry_point: Some(entry),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                cache: None,
            })
        };
        Self { accumulate: pipeline("accumulate"), show: pipeline("show") }
    }

    /// Adds the frame to the mean, and makes the picture. `begins_anew`: the mean is this frame alone. `denoised`: the sum, and
    /// its direct light.
    #[expect(clippy::too_many_arguments, reason = "all of a frame")]
    pub(crate) fn encode(
        &self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        planes: &Planes,
        denoised: [&wgpu::TextureView; 2],
        baselines: &Filtered<'_>,
        pictures: &mut Pictures,
        choice: &Choice,
        exposure: f32,
        begins_anew: bool,
        stamp: &Stamp,
    ) {
        let size = pictures.size;
        pictures.frames = if begins_anew { 1 } else { pictures.frames.saturating_add(1) };
        let mut uniform = Uniform {
            size: [size.width as u32, size.height as u32],
            frames: pictures.frames,
            panes: choice.panes.len().clamp(1, Pane::ALL.len()) as u32,
            exposure,
            ..Uniform::zeroed()
        };
        for (kind, pane) in uniform.kinds.iter_mut().zip(choice.panes.iter().chain(std::iter::repeat(&Pane::Quell))) {
            *kind = pane.number();
        }
        for (edge, split) in uniform.edges.iter_mut().zip(&choice.splits) {
            *edge = split * size.width as f32;
        }
        let buffer = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("display"),
            size: size_of::<Uniform>() as u64,
            usage: wgpu::BufferUsages::UNIFORM,
            mapped_at_creation: true,
        });
        // A lost device maps nothing; what follows does nothing then, too.
        if let Ok(mut mapped) = buffer.get_mapped_range_mut(..) {
            mapped.copy_from_slice(bytes_of(&uniform));
        }
        buffer.unmap();
        let before = &pictures.means[pictures.turn];
        let after = &pictures.means[1 - pictures.turn];
        let sums = [
            (1, &planes.direct),
            (2, &planes.matte),
            (3, &planes.glossy),
            (4, &planes.matte_weight),
            (5, &planes.glossy_weight),
        ];
        // What no pane shows is bound all the same, in the place of a baseline that did not run.
        let [atrous_matte, atrous_glossy] = filtered(baselines.atrous, planes);
        let [svgf_matte, svgf_glossy] = filtered(baselines.svgf, planes);
        let shown = [
            (8, after),
            (9, denoised[0]),
            (10, &pictures.debug),
            (11, &pictures.picture),
            (12, denoised[1]),
            (13, atrous_matte),
            (14, atrous_glossy),
            (15, svgf_matte),
            (16, svgf_glossy),
        ];
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("display"),
            timestamp_writes: writes(stamp),
        });
        let passes = [(&self.accumulate, &[(6, before), (7, after)][..]), (&self.show, &shown[..])];
        for (pipeline, further) in passes {
            let mut entries = vec![wgpu::BindGroupEntry { binding: 0, resource: buffer.as_entire_binding() }];
            entries.extend(sums.iter().chain(further).map(|(binding, view)| wgpu::BindGroupEntry {
                binding: *binding,
                resource: wgpu::BindingResource::TextureView(view),
            }));
            let layout = pipeline.get_bind_group_layout(0);
            let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("display"),
                layout: &layout,
                entries: &entries,
            });
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.dispatch_workgroups((size.width as u32).div_ceil(8), (size.height as u32).div_ceil(8), 1);
        }
        drop(pass);
        pictures.turn = 1 - pictures.turn;
    }
}

/// Light that a baseline filtered; as traced where it did not run.
fn filtered<'a>(pair: Option<&'a [wgpu::TextureView; 2]>, planes: &'a Planes) -> [&'a wgpu::TextureView; 2] {
    pair.map_or([&planes.matte, &planes.glossy], |[matte, glossy]| [matte, glossy])
}
