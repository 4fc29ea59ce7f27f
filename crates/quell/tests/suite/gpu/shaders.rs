//! The shaders without a GPU: they validate, bind what Rust binds, lie within WebGPU's default limits, and their structs
//! are laid out as Rust writes them.

use quell::gpu::wgpu::{Limits, naga};
use quell::gpu::{Access, Pass, count_source, layouts, prepare_source};

fn parsed(pass: &Pass) -> naga::Module {
    let source = pass.source();
    naga::front::wgsl::parse_str(&source).unwrap_or_else(|e| panic!("{}: {}", pass.name, e.emit_to_string(&source)))
}

#[test]
fn every_shader_validates_without_any_capability() {
    for pass in Pass::ALL {
        let module = parsed(&pass);
        let mut validator =
            naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::empty());
        if let Err(e) = validator.validate(&module) {
            panic!("{}: {}", pass.name, e.emit_to_string(&pass.source()));
        }
        for entry in pass.entries {
            assert!(module.entry_points.iter().any(|e| e.name == *entry), "{}: no `{entry}`", pass.name);
        }
    }
}

#[test]
fn bindings_are_those_that_rust_binds_within_the_default_limits() {
    let limits = Limits::default();
    for pass in Pass::ALL {
        let module = parsed(&pass);
        let mut found = 0;
        for (_, variable) in module.global_variables.iter() {
            let Some(binding) = &variable.binding else { continue };
            let name = variable.name.as_deref().unwrap();
            found += 1;
            assert_eq!(binding.group, 0, "{name}");
            match variable.space {
                naga::AddressSpace::Uniform => assert_eq!((name == "settings") as u32, binding.binding),
                naga::AddressSpace::Storage { access } => {
                    let listed = &pass.bindings[binding.binding as usize - 2];
                    assert_eq!(listed.name, name, "{}", pass.name);
                    let writes = access.contains(naga::StorageAccess::STORE);
                    assert_eq!(listed.access == Access::Write, writes, "{}: {name}", pass.name);
                    let naga::TypeInner::Array { stride, .. } = module.types[variable.ty].inner else {
                        panic!("{name} is no array")
                    };
                    assert_eq!(u64::from(stride), listed.stride, "{}: {name}", pass.name);
                }
                other => panic!("{name}: {other:?}"),
            }
        }
        assert_eq!(found, pass.bindings.len() + 2, "{}", pass.name);
        assert!(pass.bindings.len() <= limits.max_storage_buffers_per_shader_stage as usize);
        for entry in &module.entry_points {
            let [x, y, z] = entry.workgroup_size;
            assert!(x * y * z <= limits.max_compute_invocations_per_workgroup);
            // What the number of workgroups is counted with.
            assert_eq!([x, y, z], [8, 8, 1], "{}", pass.name);
        }
    }
    assert_eq!(limits.max_storage_buffers_per_shader_stage, 8);
    assert_eq!(limits.max_compute_invocations_per_workgroup, 256);
}

#[test]
fn the_border_validates_within_the_default_limits() {
    let limits = Limits::default();
    for source in [prepare_source(), count_source()] {
        let module = naga::front::wgsl::parse_str(&source).unwrap_or_else(|e| panic!("{}", e.emit_to_string(&source)));
        let mut validator =
            naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::empty());
        validator.validate(&module).unwrap_or_else(|e| panic!("{}", e.emit_to_string(&source)));
        let bound = |space: fn(&naga::AddressSpace) -> bool| {
            module.global_variables.iter().filter(|(_, v)| v.binding.is_some() && space(&v.space)).count() as u32
        };
        let textures = bound(|s| matches!(s, naga::AddressSpace::Handle));
        assert!((7..=limits.max_sampled_textures_per_shader_stage).contains(&textures), "{textures}");
        let buffers = bound(|s| matches!(s, naga::AddressSpace::Storage { .. }));
        assert!((1..=limits.max_storage_buffers_per_shader_stage).contains(&buffers), "{buffers}");
    }
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
    let border = [prepare_source(), count_source()].map(|s| naga::front::wgsl::parse_str(&s).unwrap());
    let modules: Vec<naga::Module> = Pass::ALL.iter().map(parsed).chain(border).collect();
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
