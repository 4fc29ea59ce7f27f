//! The shaders without a GPU: they validate, bind what Rust binds, lie within WebGPU's default limits, and their structs
//! are laid out as Rust writes them.

use quell::gpu::wgpu::{Limits, naga};
use quell::gpu::{BindingKind, Pass, Storage, layouts};

/// Every pass as every device may be given it.
fn sources() -> Vec<(Pass, Storage, String)> {
    let storages = [Storage::Half, Storage::Float];
    let of =
        |pass: Pass| storages.into_iter().flat_map(move |s| [false, true].map(|host| (pass, s, pass.source(s, host))));
    Pass::all().flat_map(of).collect()
}

fn parsed(name: &str, source: &str) -> naga::Module {
    naga::front::wgsl::parse_str(source).unwrap_or_else(|e| panic!("{name}: {}", e.emit_to_string(source)))
}

#[test]
fn every_shader_validates_with_what_core_webgpu_has() {
    for (pass, _, source) in sources() {
        let module = parsed(pass.name, &source);
        // `unpack2x16float` is core WGSL; the sequence filter's passes do without.
        let capabilities = if pass.per_frame {
            naga::valid::Capabilities::SHADER_FLOAT16_IN_FLOAT32
        } else {
            naga::valid::Capabilities::empty()
        };
        let mut validator = naga::valid::Validator::new(naga::valid::ValidationFlags::all(), capabilities);
        if let Err(e) = validator.validate(&module) {
            panic!("{}: {}", pass.name, e.emit_to_string(&source));
        }
        let entries: Vec<&str> = module.entry_points.iter().map(|e| e.name.as_str()).collect();
        assert!(entries.contains(&pass.entry), "{}: no `{}`", pass.name, pass.entry);
        let bound = module.global_variables.iter().filter(|(_, v)| v.binding.is_some()).count();
        assert_eq!(bound, pass.bindings.len() + pass.first_binding() as usize, "{}", pass.name);
    }
}

#[test]
fn passes_are_within_the_default_limits() {
    let limits = Limits::default();
    for (pass, _, source) in sources() {
        let module = parsed(pass.name, &source);
        let count = |is: fn(&BindingKind) -> bool| pass.bindings.iter().filter(|b| is(&b.kind)).count() as u32;
        let sampled = count(|k| matches!(k, BindingKind::Sampled(_) | BindingKind::Host(_) | BindingKind::Frames));
        assert!(sampled <= limits.max_sampled_textures_per_shader_stage, "{}", pass.name);
        let stored = count(|k| matches!(k, BindingKind::Stored(_) | BindingKind::Picture(_) | BindingKind::Layers(_)));
        assert!(stored <= limits.max_storage_textures_per_shader_stage, "{}", pass.name);
        let is_buffer = |k: &BindingKind| {
            matches!(k, BindingKind::Taps | BindingKind::Counts(_) | BindingKind::Read(_) | BindingKind::Write(_))
        };
        let buffers = count(is_buffer);
        assert!(buffers <= limits.max_storage_buffers_per_shader_stage, "{}", pass.name);
        let uniforms = pass.first_binding() + count(|k| matches!(k, BindingKind::Uniform(_)));
        assert!(uniforms <= limits.max_uniform_buffers_per_shader_stage, "{}", pass.name);
        let shared: u32 = module
            .global_variables
            .iter()
            .filter(|(_, v)| v.space == naga::AddressSpace::WorkGroup)
            .map(|(_, v)| module.types[v.ty].inner.size(module.to_ctx()))
            .sum();
        assert!(shared <= limits.max_compute_workgroup_storage_size, "{}: {shared}", pass.name);
        for entry in &module.entry_points {
            let [x, y, z] = entry.workgroup_size;
            assert!(x * y * z <= limits.max_compute_invocations_per_workgroup);
            // What the number of workgroups is counted with.
            assert_eq!([x, y, z], [pass.workgroup(), pass.workgroup(), 1], "{}", pass.name);
        }
    }
    assert_eq!(limits.max_sampled_textures_per_shader_stage, 16);
    assert_eq!(limits.max_storage_textures_per_shader_stage, 4);
    assert_eq!(limits.max_compute_workgroup_storage_size, 16384);
    assert_eq!(limits.max_compute_invocations_per_workgroup, 256);
}

/// Where a struct of the shaders differs from what Rust writes.
fn difference(module: &naga::Module, expected: &quell::gpu::Uniform) -> Option<Result<(), String>> {
    let (_, ty) = module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some(expected.name))?;
    let naga::TypeInner::Struct { members, span } = &ty.inner else { return Some(Err("is no struct".to_owned())) };
    let found: Vec<(&str, usize)> =
        members.iter().map(|m| (m.name.as_deref().unwrap_or_default(), m.offset as usize)).collect();
    let wanted: Vec<(&str, usize)> = expected.members.iter().map(|m| (m.name, m.offset)).collect();
    Some(if found != wanted {
        Err(format!("{found:?} in WGSL, {wanted:?} in Rust"))
    } else if expected.size != *span as usize {
        Err(format!("{span} bytes in WGSL, {} in Rust", expected.size))
    } else {
        Ok(())
    })
}

#[test]
fn structs_are_laid_out_as_rust_writes_them() {
    let modules: Vec<naga::Module> = sources().iter().map(|(pass, _, source)| parsed(pass.name, source)).collect();
    for layout in layouts() {
        let results: Vec<_> = modules.iter().filter_map(|m| difference(m, &layout)).collect();
        assert!(!results.is_empty(), "no shader has a struct `{}`", layout.name);
        for result in results {
            assert_eq!(result, Ok(()), "{}", layout.name);
        }
        // A member moved, renamed or lost is seen.
        let mut moved = layout.clone();
        moved.members.last_mut().unwrap().offset += 4;
        let mut longer = layout.clone();
        longer.size += 16;
        let mut lost = layout.clone();
        lost.members.pop();
        for planted in [moved, longer, lost] {
            let seen = modules.iter().filter_map(|m| difference(m, &planted)).all(|r| r.is_err());
            assert!(seen, "{}", layout.name);
        }
    }
}
