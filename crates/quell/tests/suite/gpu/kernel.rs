//! What a kernel refuses before the device sees it.

use super::device::gpu;
use quell::Size;
use quell::gpu::wgpu::{BufferUsages, TextureFormat, TextureUsages};
use quell::gpu::{Bindable, Error, Kernel, Pass, PerFrameUniforms, Storage};

#[test]
fn wrong_resources_and_sizes_are_errors_that_name_them() {
    let Some(gpu) = gpu() else { return };
    let kernel = Kernel::new(&gpu.device, Pass::FIREFLY, Storage::Half, false);
    let size = Size::new(8, 4);
    let uniform = gpu.buffer("uniform", &[0; 2048], BufferUsages::UNIFORM);
    let storage = gpu.buffer("storage", &[0; 16], BufferUsages::STORAGE);
    let texture = |format: TextureFormat, size: Size, usage| {
        let bytes = vec![0; format.block_copy_size(None).unwrap() as usize * size.pixels()];
        gpu.texture_with("texture", format, size, &bytes, usage)
    };
    let (sampled, stored) = (TextureUsages::TEXTURE_BINDING, TextureUsages::STORAGE_BINDING);
    let geometry = texture(TextureFormat::Rg32Uint, size, sampled);
    let input = texture(TextureFormat::Rgba16Float, size, sampled);
    let output = texture(TextureFormat::Rgba16Float, size, stored);
    let short = texture(TextureFormat::Rgba16Float, Size::new(8, 3), stored);
    let exact = texture(TextureFormat::Rgba32Float, size, stored);
    let [geometry, input, output, short, exact] = [&geometry, &input, &output, &short, &exact].map(Bindable::Plane);
    let encode = |[frame, settings]: [&_; 2], bound: &[Bindable<'_>], size| {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        kernel.encode(&gpu.device, &mut encoder, PerFrameUniforms { frame, settings }, bound, size)
    };
    let uniforms = [&uniform, &uniform];
    let (pass, binding) = ("firefly", "output");
    assert_eq!(encode(uniforms, &[geometry, input, output], size), Ok(()));
    assert_eq!(encode(uniforms, &[geometry, input], size), Err(Error::Count { pass, expected: 3, found: 2 }));
    assert_eq!(
        encode(uniforms, &[geometry, input, short], size),
        Err(Error::TextureSize { pass, binding, needed: size, found: Size::new(8, 3) })
    );
    assert_eq!(
        encode(uniforms, &[geometry, input, exact], size),
        Err(Error::Format { pass, binding, expected: "rgba16float", found: TextureFormat::Rgba32Float })
    );
    assert_eq!(
        encode(uniforms, &[geometry, input, input], size),
        Err(Error::Usage { pass, binding, usage: "STORAGE_BINDING" })
    );
    assert_eq!(
        encode(uniforms, &[geometry, output, output], size),
        Err(Error::Usage { pass, binding: "input", usage: "TEXTURE_BINDING" })
    );
    assert!(matches!(encode(uniforms, &[input, input, output], size), Err(Error::Format { binding: "geometry", .. })));
    assert!(matches!(
        encode(uniforms, &[geometry, Bindable::Taps(&storage), output], size),
        Err(Error::Kind { binding: "input", .. })
    ));
    assert_eq!(
        encode([&uniform, &storage], &[geometry, input, output], size),
        Err(Error::Usage { pass, binding: "settings", usage: "UNIFORM" })
    );
    for bad in [Size::new(0, 4), Size::new(1 << 20, 1)] {
        assert!(matches!(encode(uniforms, &[geometry, input, output], bad), Err(Error::Size { .. })), "{bad}");
    }
}
