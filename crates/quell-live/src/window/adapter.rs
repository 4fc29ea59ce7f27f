//! What is asked of a device and of a user, in a window as in a page.

use quell::Size;
use quell::gpu::wgpu;

/// WebGPU's default limits, but buffers and textures as large as the adapter has them; timestamps where there are any.
pub(super) fn device_descriptor(adapter: &wgpu::Adapter) -> wgpu::DeviceDescriptor<'static> {
    let most = adapter.limits();
    wgpu::DeviceDescriptor {
        label: Some("quell live"),
        required_features: adapter.features() & wgpu::Features::TIMESTAMP_QUERY,
        required_limits: wgpu::Limits {
            max_buffer_size: most.max_buffer_size,
            max_texture_dimension_2d: most.max_texture_dimension_2d,
            max_storage_buffer_binding_size: most.max_storage_buffer_binding_size,
            ..wgpu::Limits::default()
        },
        ..Default::default()
    }
}

/// An extent such as `640x360`.
pub(super) fn size(text: &str) -> Option<Size> {
    let (width, height) = text.split_once('x')?;
    let (width, height) = (width.parse().ok()?, height.parse().ok()?);
    (width > 0 && height > 0 && width <= 16384 && height <= 16384).then(|| Size::new(width, height))
}

/// An angle.
pub(super) fn degrees(text: &str) -> Result<f32, String> {
    let angle = text.trim().parse().ok().filter(|v: &f32| v.is_finite());
    angle.ok_or_else(|| format!("{text} is no angle in degrees"))
}

/// A factor.
pub(super) fn strength(text: &str) -> Result<f32, String> {
    let factor = text.trim().parse().ok().filter(|v: &f32| v.is_finite() && *v > 0.0);
    factor.ok_or_else(|| format!("`{text}` is no positive number"))
}
