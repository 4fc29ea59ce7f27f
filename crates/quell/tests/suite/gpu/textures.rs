//! Planes as a host's textures: written in the format that the host would have.

use super::device::Gpu;
use glam::Vec3;
use quell::border::Sanitised;
use quell::gpu::{self, Channel, GuideTextures, Repairs, Scalar, wgpu};
use quell::{FrameBuf, Plane, Rgb, Size};
use wgpu::{TextureFormat as F, TextureUsages, TextureView};

/// A half float, rounded to nearest even.
pub fn half(v: f32) -> u16 {
    let bits = v.to_bits();
    let sign = (bits >> 16 & 0x8000) as u16;
    let magnitude = bits & 0x7fff_ffff;
    if magnitude > 0x7f80_0000 {
        return sign | 0x7e00;
    }
    // 65520 and more is infinite.
    if magnitude >= 0x477f_f000 {
        return sign | 0x7c00;
    }
    if magnitude < 0x3880_0000 {
        // Below 2^-14: multiples of 2^-24.
        return sign | (f32::from_bits(magnitude) * 16_777_216.0).round_ties_even() as u16;
    }
    let rounded = magnitude + 0xfff + (magnitude >> 13 & 1);
    sign | ((rounded - 0x3800_0000) >> 13) as u16
}

fn unorm(v: f32, most: f32) -> u32 {
    (v.clamp(0.0, 1.0) * most).round() as u32
}

/// The bytes of a texel of a colour format.
fn texel(format: F, v: [f32; 4]) -> Vec<u8> {
    let floats = |n: usize| v[..n].iter().flat_map(|v| v.to_le_bytes()).collect();
    let halves = |n: usize| v[..n].iter().flat_map(|v| half(*v).to_le_bytes()).collect();
    match format {
        F::R32Float => floats(1),
        F::Rg32Float => floats(2),
        F::Rgba32Float => floats(4),
        F::R16Float => halves(1),
        F::Rg16Float => halves(2),
        F::Rgba16Float => halves(4),
        F::Rgba8Unorm => v.iter().map(|v| unorm(*v, 255.0) as u8).collect(),
        F::Rgb10a2Unorm => {
            let rgb = (0..3).fold(0, |bits, c| bits | unorm(v[c], 1023.0) << (10 * c));
            (rgb | unorm(v[3], 3.0) << 30).to_le_bytes().to_vec()
        }
        F::R32Uint => (v[0] as u32).to_le_bytes().to_vec(),
        F::R16Uint => (v[0] as u16).to_le_bytes().to_vec(),
        other => panic!("{other:?}"),
    }
}

/// A texture of a format that holds `at`; larger than the frame by `margin`, in which there is nonsense.
pub fn texture(gpu: &Gpu, format: F, size: Size, margin: u32, at: impl Fn(usize, usize) -> [f32; 4]) -> TextureView {
    let (width, height) = (size.width as u32 + margin, size.height as u32 + margin);
    let extent = wgpu::Extent3d { width, height, depth_or_array_layers: 1 };
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("a host's plane"),
        size: extent,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        // COPY_SRC: what no stage filters comes out as it went in, and is read back.
        usage: TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST | TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    let nonsense = [0.3, f32::NAN, -7.0, 0.1];
    let mut bytes = Vec::new();
    for y in 0..height as usize {
        for x in 0..width as usize {
            let inside = x < size.width && y < size.height;
            bytes.extend(texel(format, if inside { at(x, y) } else { nonsense }));
        }
    }
    let layout = wgpu::TexelCopyBufferLayout {
        offset: 0,
        bytes_per_row: Some(bytes.len() as u32 / height),
        rows_per_image: None,
    };
    gpu.queue.write_texture(texture.as_image_copy(), &bytes, layout, extent);
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

/// A depth texture, which only a render pass can fill.
pub fn depth_texture(gpu: &Gpu, size: Size, at: impl Fn(usize, usize) -> f32) -> TextureView {
    const SOURCE: &str = "
        @group(0) @binding(0) var given: texture_2d<f32>;
        @vertex fn corner(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
            return vec4f(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0, 0.0, 1.0);
        }
        @fragment fn depth(@builtin(position) p: vec4f) -> @builtin(frag_depth) f32 {
            return textureLoad(given, vec2i(p.xy), 0).x;
        }";
    let device = &gpu.device;
    let given = texture(gpu, F::R32Float, size, 0, |x, y| [at(x, y); 4]);
    let target = device.create_texture(&wgpu::TextureDescriptor {
        label: Some("a host's depth"),
        size: wgpu::Extent3d { width: size.width as u32, height: size.height as u32, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: F::Depth32Float,
        usage: TextureUsages::TEXTURE_BINDING | TextureUsages::RENDER_ATTACHMENT,
        view_formats: &[],
    });
    let target = target.create_view(&wgpu::TextureViewDescriptor::default());
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("fill depth"),
        source: wgpu::ShaderSource::Wgsl(SOURCE.into()),
    });
    let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("fill depth"),
        layout: None,
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: None,
            compilation_options: Default::default(),
            buffers: &[],
        },
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: None,
            compilation_options: Default::default(),
            targets: &[],
        }),
        primitive: Default::default(),
        depth_stencil: Some(wgpu::DepthStencilState {
            format: F::Depth32Float,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Always),
            stencil: Default::default(),
            bias: Default::default(),
        }),
        multisample: Default::default(),
        multiview_mask: None,
        cache: None,
    });
    let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("fill depth"),
        layout: &pipeline.get_bind_group_layout(0),
        entries: &[wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(&given) }],
    });
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("fill depth") });
    {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("fill depth"),
            color_attachments: &[],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &target,
                depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(0.5), store: wgpu::StoreOp::Store }),
                stencil_ops: None,
            }),
            timestamp_writes: None,
            occlusion_query_set: None,
            multiview_mask: None,
        });
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.draw(0..3, 0..1);
    }
    gpu.queue.submit([encoder.finish()]);
    target
}

/// The counts of repairs once everything submitted has run.
pub fn read_counts(gpu: &Gpu, repairs: &Repairs) -> Sanitised {
    let numbers = &gpu.read_buffers(&[repairs.buffer()])[0];
    Repairs::read(&numbers.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<_>>()).unwrap()
}

/// A whole frame as a host's textures, in quell's own convention and 32-bit floats.
pub struct HostFrame {
    frame: FrameBuf,
    /// Depth, normal, motion, roughness and trust, hit distance, id.
    guides: [Option<TextureView>; 6],
    /// Direct, matte, glossy, direct_matte, direct_glossy, matte_weight, glossy_weight.
    colours: [Option<TextureView>; 7],
    joint: Vec<(String, quell::Signal, TextureView)>,
}

impl HostFrame {
    pub fn new(gpu: &Gpu, frame: &FrameBuf) -> Self {
        let size = frame.size;
        let scalar =
            |p: &Option<Plane<f32>>| p.as_ref().map(|p| texture(gpu, F::R32Float, size, 1, |x, y| [p.at(x, y); 4]));
        let colour = |p: &Plane<Rgb>| {
            texture(gpu, F::Rgba32Float, size, 1, |x, y| Vec3::from(p.at(x, y)).extend(f32::NAN).to_array())
        };
        let colours = [
            &frame.direct,
            &frame.matte,
            &frame.glossy,
            &frame.direct_matte,
            &frame.direct_glossy,
            &frame.matte_weight,
            &frame.glossy_weight,
        ];
        let shares = |x, y| {
            let at = |p: &Option<Plane<f32>>| p.as_ref().map_or(1.0, |p| p.at(x, y));
            [at(&frame.roughness), at(&frame.confidence_in), 0.0, 0.0]
        };
        let id = frame.surface_id.as_ref();
        let motion = frame.motion.as_ref();
        Self {
            guides: [
                scalar(&frame.view_depth),
                frame.normal.as_ref().map(colour),
                motion.map(|p| texture(gpu, F::Rg32Float, size, 1, |x, y| [p.at(x, y)[0], p.at(x, y)[1], 0.0, 0.0])),
                Some(texture(gpu, F::Rgba32Float, size, 1, shares)),
                scalar(&frame.glossy_hit_distance),
                id.map(|p| texture(gpu, F::R32Uint, size, 0, |x, y| [p.at(x, y) as f32; 4])),
            ],
            colours: colours.map(|p| p.as_ref().map(colour)),
            joint: frame.passes.iter().map(|p| (p.name.clone(), p.signal, colour(&p.plane))).collect(),
            frame: frame.clone(),
        }
    }

    pub fn joint(&self) -> Vec<gpu::JointPlane<'_>> {
        self.joint.iter().map(|(name, signal, light)| gpu::JointPlane { name, signal: *signal, light }).collect()
    }

    /// `joint`: of [`HostFrame::joint`].
    pub fn frame<'a>(&'a self, joint: &'a [gpu::JointPlane<'a>]) -> gpu::Frame<'a> {
        let f = &self.frame;
        let [depth, normal, motion, shares, hit, id] = self.guides.each_ref().map(Option::as_ref);
        let share = |channel, there: bool| shares.filter(|_| there).map(|view| Scalar { view, channel });
        let guides = GuideTextures {
            view_depth: depth,
            normal,
            motion,
            roughness: share(Channel::R, f.roughness.is_some()),
            glossy_hit_distance: hit.map(Scalar::from),
            surface_id: id,
            confidence_in: share(Channel::G, f.confidence_in.is_some()),
            ..GuideTextures::default()
        };
        let [direct, matte, glossy, direct_matte, direct_glossy, matte_weight, glossy_weight] =
            self.colours.each_ref().map(Option::as_ref);
        let signal =
            |light: Option<&'a TextureView>, weight, direct| light.map(|light| gpu::Signal { light, weight, direct });
        gpu::Frame {
            direct,
            matte: signal(matte, matte_weight, direct_matte),
            glossy: signal(glossy, glossy_weight, direct_glossy),
            joint,
            ..gpu::Frame::new(f.size, f.camera, f.previous_camera, f.index, guides)
        }
    }
}
