//! Buffers and textures of a scene, made and filled.

use super::error::GpuError;
use super::pack::images::HEAP_WIDTH;
use bytemuck::cast_slice;

/// Makes buffers and textures that hold something.
pub(super) struct Upload<'a> {
    pub(super) device: &'a wgpu::Device,
    pub(super) queue: &'a wgpu::Queue,
}

impl Upload<'_> {
    pub(super) fn uniform(&self, label: &str, bytes: usize) -> wgpu::Buffer {
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: bytes as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    }

    /// Whether a part of a scene fits into a binding.
    pub(super) fn check(&self, what: &'static str, bytes: &[u8]) -> Result<(), GpuError> {
        let limits = self.device.limits();
        let limit = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        let needed = bytes.len() as u64;
        if needed > limit { Err(GpuError::TooLarge { what, needed, limit }) } else { Ok(()) }
    }

    pub(super) fn storage(&self, what: &'static str, bytes: &[u8]) -> wgpu::Buffer {
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(what),
            size: bytes.len() as u64,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        self.queue.write_buffer(&buffer, 0, bytes);
        buffer
    }

    pub(super) fn texels(&self, texels: &[[u8; 4]], layers: u32) -> Result<wgpu::TextureView, GpuError> {
        let layer_texels = (HEAP_WIDTH * HEAP_WIDTH) as usize;
        let most = self.device.limits().max_texture_array_layers;
        if layers > most {
            let bytes = |layers: u32| u64::from(layers) * layer_texels as u64 * 4;
            return Err(GpuError::TooLarge { what: "textures", needed: bytes(layers), limit: bytes(most) });
        }
        // A scene without textures has one texel.
        let height = if texels.is_empty() { 1 } else { HEAP_WIDTH };
        let width = if texels.is_empty() { 1 } else { HEAP_WIDTH };
        let texture = self.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("quell texels"),
            size: wgpu::Extent3d { width, height, depth_or_array_layers: layers },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba8Uint,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        for (layer, texels) in (0..).zip(texels.chunks(layer_texels)) {
            let mut texels = texels.to_vec();
            let rows = texels.len().div_ceil(HEAP_WIDTH as usize);
            texels.resize(rows * HEAP_WIDTH as usize, [0; 4]);
            let to = wgpu::TexelCopyTextureInfo {
                origin: wgpu::Origin3d { x: 0, y: 0, z: layer },
                ..texture.as_image_copy()
            };
            let layout =
                wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(HEAP_WIDTH * 4), rows_per_image: None };
            let extent = wgpu::Extent3d { width: HEAP_WIDTH, height: rows as u32, depth_or_array_layers: 1 };
            self.queue.write_texture(to, cast_slice(&texels), layout, extent);
        }
        let dimension = Some(wgpu::TextureViewDimension::D2Array);
        Ok(texture.create_view(&wgpu::TextureViewDescriptor { dimension, ..Default::default() }))
    }
}
