//! What a frame does, counted and checked without a device.

use quell::gpu::wgpu::Limits;
use quell::gpu::{BindingKind, Contents, Dispatch, Holds, Program, Role, SignalContents, Slot, Storage, Texel};
use quell::pipeline::{Plan, Stage};
use quell::{Preset, Settings};

fn program(settings: &Settings, contents: Contents, storage: Storage, fuse: bool) -> Program {
    Program::new(&Plan::new(settings, contents.inputs()), contents, storage, fuse)
}

/// Stages 3 to 10.
const FILTERS: [Stage; 8] = [
    Stage::MatteTemporal,
    Stage::MattePrefilter,
    Stage::Disocclusion,
    Stage::Firefly,
    Stage::MatteBilateral,
    Stage::GlossyTemporal,
    Stage::GlossyHorizontal,
    Stage::GlossyVertical,
];

#[test]
fn stages_3_to_10_move_at_most_260_bytes_a_pixel() {
    let settings = Settings::default();
    let bytes = |storage, fuse| {
        let program = program(&settings, Contents::USUAL, storage, fuse);
        for dispatch in &program.dispatches {
            println!("{storage:?} {:<32} {:>3} bytes a pixel", dispatch.pass.name, program.bytes_of(dispatch));
        }
        let memory = program.memory(1);
        println!("{storage:?}: {} bytes a pixel persistent, {} transient", memory.persistent, memory.transient);
        FILTERS.iter().map(|stage| program.bytes_per_pixel(*stage).unwrap()).sum::<u32>()
    };
    // Guides now 20 and before 12; of each signal input, history, result 8 each, length read and written 4 each; then
    // stage 4, stages 5 and 6, stage 7, stages 9 and 10.
    assert_eq!(bytes(Storage::Half, true), (32 + 2 * 32) + 28 + 32 + 28 + 2 * 36);
    assert!(bytes(Storage::Half, true) <= 260);
    // Alone, stages 3 and 8 read the guides each, 5 writes what 6 reads, and 6 the depths.
    assert_eq!(bytes(Storage::Half, false), 256 + 32 + 8 + 8 + 8);
    assert!(bytes(Storage::Float, true) > 260);
}

#[test]
fn quality_moves_at_most_420_bytes_a_pixel_and_holds_at_most_200() {
    let program = program(&Settings::preset(Preset::Quality), Contents::USUAL, Storage::Half, true);
    for dispatch in &program.dispatches {
        println!("{:<32} {:>3} bytes a pixel", dispatch.pass.name, program.bytes_of(dispatch));
    }
    let bytes: u32 = Stage::ALL
        .iter()
        .filter(|stage| !matches!(stage, Stage::DirectTaa | Stage::Composite | Stage::Antialiasing))
        .filter_map(|stage| program.bytes_per_pixel(*stage))
        .sum();
    let memory = program.memory(1);
    println!("{bytes} bytes a pixel; {} persistent, {} transient", memory.persistent, memory.transient);
    assert!(bytes <= 420, "{bytes}");
    assert!(memory.persistent + memory.transient <= 200, "{}", memory.persistent + memory.transient);
}

#[test]
fn five_thousand_pixels_fit_the_default_limits() {
    let (limits, width, height) = (Limits::default(), 5120, 2880);
    let program = program(&Settings::default(), Contents::USUAL, Storage::Half, true);
    assert!(width <= limits.max_texture_dimension_2d && height <= limits.max_texture_dimension_2d);
    assert!(width.div_ceil(8) <= limits.max_compute_workgroups_per_dimension);
    for resource in &program.resources {
        // No plane is a buffer, and none would be too large for one binding.
        let bytes = resource.texel().map_or(0, |texel| u64::from(texel.bytes(Storage::Half)));
        assert!(bytes * u64::from(width * height) <= limits.max_storage_buffer_binding_size, "{:?}", resource.slot);
    }
    let memory = program.memory((width * height) as usize);
    assert_eq!(memory.persistent + memory.transient, {
        let one = program.memory(1);
        (one.persistent + one.transient) * u64::from(width * height)
    });
}

/// Every combination of switches, feedback and contents.
fn every_program(mut check: impl FnMut(&Program, &str)) {
    let switches = [
        "matte_temporal.enabled",
        "young_filter.matte",
        "young_filter.glossy",
        "matte_prefilter.enabled",
        "disocclusion.enabled",
        "firefly.enabled",
        "matte_bilateral.enabled",
        "glossy_temporal.enabled",
        "glossy_bilateral.enabled",
        "direct_taa.enabled",
        "antialiasing.enabled",
    ];
    let some = Some(SignalContents { weight: true, direct: true });
    let none = Some(SignalContents::default());
    let contents = [
        Contents::USUAL,
        Contents { matte: some, glossy: None, joint: [2, 0], ..Contents::USUAL },
        Contents { matte: None, glossy: none, joint: [0, 1], textures: true, counts: true, ..Contents::default() },
        Contents { textures: true, ..Contents::USUAL },
        Contents { counts: true, ..Contents::default() },
        Contents { direct: false, ..Contents::USUAL },
    ];
    for feedback in ["temporal", "prefilter", "blend", "firefly", "bilateral"] {
        for mask in 0..1u32 << switches.len() {
            let mut settings = Settings::default();
            settings.set("pipeline.feedback", feedback).unwrap();
            for (i, switch) in switches.iter().enumerate() {
                settings.set(switch, if mask >> i & 1 == 1 { "on" } else { "off" }).unwrap();
            }
            for contents in contents {
                for fuse in [false, true] {
                    let program = program(&settings, contents, Storage::Half, fuse);
                    check(&program, &format!("{feedback}, switches {mask:b}, {contents:?}, fused {fuse}"));
                }
            }
        }
    }
}

#[test]
fn every_plane_is_written_before_it_is_read_and_never_while() {
    every_program(|program, what| {
        let mut written = Vec::new();
        for dispatch in &program.dispatches {
            let name = dispatch.pass.name;
            assert_eq!(dispatch.bound.len(), dispatch.pass.bindings.len(), "{what}: {name}");
            let bindings: Vec<_> = program.bindings(dispatch).collect();
            let stored: Vec<_> = bindings.iter().filter(|(b, ..)| matches!(b.kind, BindingKind::Stored(_))).collect();
            for (binding, resource, before) in &bindings {
                let slot = resource.slot;
                match binding.kind {
                    BindingKind::Sampled(texel) => {
                        let is_absent = resource.role == Role::Absent;
                        assert!(is_absent || resource.texel() == Some(texel), "{what}: {name}, {}", binding.name);
                        let given = is_absent || matches!(resource.role, Role::Input | Role::Guides);
                        assert!(given || *before || written.contains(&slot), "{what}: {name} reads {slot:?}");
                        assert!(!*before || resource.alternates, "{what}: {name} reads {slot:?} of the frame before");
                        assert!(
                            !stored.iter().any(|(_, r, b)| r.slot == slot && b == before),
                            "{what}: {name} reads {slot:?} while it writes it"
                        );
                    }
                    BindingKind::Stored(texel) => {
                        assert_eq!(resource.texel(), Some(texel), "{what}: {name}, {}", binding.name);
                        assert!(!*before && resource.role != Role::Input, "{what}: {name} writes {slot:?}");
                        assert!(!written.contains(&slot), "{what}: {slot:?} is written twice");
                    }
                    BindingKind::Host(sample) => {
                        assert_eq!((resource.role, resource.holds), (Role::Input, Holds::Host(sample)), "{what}");
                        let stand_in = resource.absent.map(|index| &program.resources[index]).unwrap();
                        assert_eq!((stand_in.role, stand_in.holds), (Role::Absent, resource.holds), "{what}");
                    }
                    BindingKind::Frames
                    | BindingKind::Read(_)
                    | BindingKind::Write(_)
                    | BindingKind::Picture(_)
                    | BindingKind::Layers(_) => {
                        panic!("{}: no program has one", binding.name)
                    }
                    BindingKind::Taps => assert_eq!(resource.role, Role::Taps),
                    BindingKind::Counts(_) => assert_eq!(resource.role, Role::Counts),
                    BindingKind::Uniform(name) => {
                        assert_eq!((resource.role, resource.holds), (Role::Uniform, Holds::Uniform(name)));
                    }
                }
            }
            written.extend(stored.iter().map(|(_, r, _)| r.slot));
        }
        let shown = program.shown;
        let shown = [shown.composite, shown.direct, shown.matte, shown.glossy];
        for index in shown.into_iter().flatten() {
            let resource = &program.resources[index];
            assert!(resource.role == Role::Input || written.contains(&resource.slot), "{what}: {:?}", resource.slot);
        }
    });
}

/// Runs a program in thought, and asks at every reading whether the texture still holds what is read.
fn overwritten(program: &Program) -> Option<String> {
    let mut holds: Vec<usize> = (0..program.resources.len()).collect();
    let home = |index: usize| program.resources[index].shares.unwrap_or(index);
    for dispatch in &program.dispatches {
        let bound = || program.bindings(dispatch).zip(&dispatch.bound);
        let stored: Vec<usize> = bound()
            .filter(|((binding, ..), _)| matches!(binding.kind, BindingKind::Stored(_)))
            .map(|(_, bound)| bound.resource)
            .collect();
        for ((binding, resource, _), bound) in bound() {
            let is_read = !matches!(binding.kind, BindingKind::Stored(_));
            if is_read && holds[home(bound.resource)] != bound.resource && resource.shares.is_some() {
                return Some(format!("{} reads {:?}, which is gone", dispatch.pass.name, resource.slot));
            }
            if is_read && stored.iter().any(|index| home(*index) == home(bound.resource) && !bound.before) {
                return Some(format!("{} writes over {:?}, which it reads", dispatch.pass.name, resource.slot));
            }
        }
        for index in stored {
            holds[home(index)] = index;
        }
    }
    let shown = &program.shown;
    let shown = [shown.composite, shown.direct, shown.matte, shown.glossy, shown.confidence, shown.length];
    let shown = shown.into_iter().flatten().chain(program.joint.iter().flatten().copied());
    let lost = |index: &usize| program.resources[*index].role != Role::Input && holds[home(*index)] != *index;
    if let Some(index) = shown.into_iter().find(lost) {
        return Some(format!("{:?} is shown, and gone", program.resources[index].slot));
    }
    (0..program.resources.len()).find_map(|index| {
        let resource = &program.resources[index];
        let is_written = resource.shares.is_some() || holds[index] != index;
        let lasts = holds[home(index)] == index;
        (is_written && lasts != resource.lasts).then(|| format!("{:?} lasts: {lasts}", resource.slot))
    })
}

#[test]
fn planes_that_share_a_texture_are_never_needed_at_once() {
    let (mut shared, mut tried, mut unseen) = (0, 0, 0);
    every_program(|program, what| {
        let found = program.clone().with_shared_planes();
        assert_eq!(overwritten(&found), None, "{what}");
        assert!(found.memory(1).transient <= program.memory(1).transient);
        for (index, resource) in found.resources.iter().enumerate() {
            let Some(home) = resource.shares else { continue };
            shared += 1;
            let other = &found.resources[home];
            assert_eq!((resource.holds, other.shares), (other.holds, None), "{what}");
            assert!(!resource.alternates && !other.alternates && other.role != Role::Guides, "{what}: {index}");
        }
        // What a pass reads in the texture that it writes is seen; and so is what is shown, with a later image in its texture.
        let of_frame = |index: usize| {
            let resource = &program.resources[index];
            matches!(resource.role, Role::Transient | Role::Output) && resource.texel() == Some(Texel::Colour)
        };
        let of = |dispatch: &Dispatch, stored: bool| -> Vec<usize> {
            let bound = dispatch.pass.bindings.iter().zip(&dispatch.bound);
            bound
                .filter(|(b, bound)| matches!(b.kind, BindingKind::Stored(_)) == stored && of_frame(bound.resource))
                .map(|(_, bound)| bound.resource)
                .collect()
        };
        let mut pairs = Vec::new();
        for (k, dispatch) in program.dispatches.iter().enumerate() {
            for written in of(dispatch, true) {
                pairs.extend(of(dispatch, false).into_iter().map(|read| (read, written)));
                let later = program.dispatches.iter().skip(k + 1).flat_map(|d| of(d, true));
                if program.resources[written].role == Role::Output {
                    pairs.extend(later.map(|later| (written, later)));
                }
            }
        }
        for (a, b) in pairs {
            let mut planted = program.clone();
            planted.resources[b].shares = Some(a);
            tried += 1;
            unseen += u32::from(overwritten(&planted).is_none());
        }
    });
    println!("{shared} planes share; of {tried} planted pairs {unseen} went unseen");
    assert!(shared > 1000 && tried > 1000 && unseen == 0);
}

#[test]
fn what_sharing_saves() {
    let (settings, usual) = (Settings::default(), Contents::USUAL);
    let bytes = |program: &Program| {
        let memory = program.memory(1);
        [memory.persistent, memory.transient]
    };
    let plain = program(&settings, usual, Storage::Half, true);
    let shared = plain.clone().with_shared_planes();
    // Motion, and of colours four textures for seven: what stage 3 wrote stays, as the confidence lies in it; both
    // signals and the sum are shown.
    assert_eq!([bytes(&plain), bytes(&shared)], [[88, 8 + 7 * 8], [88, 8 + 4 * 8]]);
    // One stage a pass.
    let unfused = program(&settings, usual, Storage::Half, false);
    println!("{:?} {:?}", bytes(&unfused), bytes(&unfused.clone().with_shared_planes()));
}

#[test]
fn guides_from_textures_are_a_dispatch_with_bytes_of_its_own() {
    let settings = Settings::default();
    let of = |textures, counts| {
        let contents = Contents { textures, counts, ..Contents::USUAL };
        program(&settings, contents, Storage::Half, true)
    };
    let (packed, textures, counted) = (of(false, false), of(true, false), of(true, true));
    // Depth 4, normal 8, motion 4, roughness 4, hit 2, id 4, trust 1; guides 20. Then five colours.
    let border = [&packed, &textures, &counted].map(Program::border_bytes_per_pixel);
    assert_eq!(border, [0, 27 + 20, 27 + 20 + 5 * 8]);
    println!("prepare moves {} bytes a pixel", border[1]);
    let names = |program: &Program| program.dispatches.iter().map(|d| d.pass.name).collect::<Vec<_>>();
    assert_eq!(names(&textures), [&["prepare"][..], &names(&packed)].concat());
    assert_eq!(names(&counted)[..2], ["prepare", "count_repairs"]);
    // What the stages move, and what is allocated, is the same.
    for stage in FILTERS {
        assert_eq!(packed.bytes_per_pixel(stage), counted.bytes_per_pixel(stage));
    }
    assert_eq!(packed.memory(1), counted.memory(1));
    // The host fills what it packs, and nothing where it hands over its textures.
    let role = |program: &Program, slot| program.resources.iter().find(|r| r.slot == slot).unwrap().role;
    assert_eq!(role(&packed, Slot::Moving), Role::Guides);
    assert_eq!([Slot::Geometry, Slot::Moving].map(|s| role(&textures, s)), [Role::Persistent, Role::Transient]);
}

#[test]
fn floors_follow_from_bytes_and_bandwidth() {
    let program = program(&Settings::default(), Contents::USUAL, Storage::Half, true);
    let stage = Stage::MattePrefilter;
    let bytes = f64::from(program.bytes_per_pixel(stage).unwrap());
    let floor = program.floor_ms(stage, 1_000_000, 1e12).unwrap();
    assert!((floor - bytes * 1e-3).abs() < 1e-12, "{floor}");
}
