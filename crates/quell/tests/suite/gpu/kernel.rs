//! What a kernel refuses before the device sees it.

use super::device::gpu;
use quell::Size;
use quell::gpu::wgpu::BufferUsages;
use quell::gpu::{Error, Kernel, Pass};

#[test]
fn wrong_buffers_and_sizes_are_errors_that_name_them() {
    let Some(gpu) = gpu() else { return };
    let kernel = Kernel::new(&gpu.device, Pass::FIREFLY);
    let size = Size::new(8, 4);
    let uniform = gpu.buffer("uniform", &[0; 2048], BufferUsages::UNIFORM);
    let storage = |bytes| gpu.buffer("storage", &vec![0; bytes], BufferUsages::STORAGE);
    let (guides, input, output) = (storage(48 * 32), storage(16 * 32), storage(16 * 32));
    let (short, wrong) = (storage(16 * 31 + 12), gpu.buffer("wrong", &[0; 16 * 32], BufferUsages::VERTEX));
    let encode = |uniforms: [&_; 2], buffers: &[&_], size| {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        kernel.encode(&gpu.device, &mut encoder, uniforms[0], uniforms[1], buffers, size)
    };
    let uniforms = [&uniform, &uniform];
    assert_eq!(encode(uniforms, &[&guides, &input, &output], size), Ok(()));
    assert_eq!(
        encode(uniforms, &[&guides, &input], size),
        Err(Error::BufferCount { pass: "firefly", expected: 3, found: 2 })
    );
    assert_eq!(
        encode(uniforms, &[&guides, &input, &short], size),
        Err(Error::BufferSize { pass: "firefly", binding: "output", size, needed: 512, found: 508 })
    );
    assert_eq!(
        encode(uniforms, &[&guides, &wrong, &output], size),
        Err(Error::BufferUsage { pass: "firefly", binding: "input", usage: "STORAGE" })
    );
    assert_eq!(
        encode([&uniform, &input], &[&guides, &input, &output], size),
        Err(Error::BufferUsage { pass: "firefly", binding: "settings", usage: "UNIFORM" })
    );
    for bad in [Size::new(0, 4), Size::new(1 << 20, 1)] {
        assert!(matches!(encode(uniforms, &[&guides, &input, &output], bad), Err(Error::Size { .. })), "{bad}");
    }
}
