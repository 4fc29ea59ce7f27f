//! Files become frames of the filter as the frames README says of their conventions, and filtered light comes back as
//! passes that add up.

use crate::{Folder, shared_frames};
use quell::sequence::{LightKind, SequenceFrame};
use quell::{Plane, Rgb};
use quell_frames::motion::MotionConvention;
use quell_frames::{
    AdaptOptions, Adapter, ExrImage, ImageWriteOptions, Links, MapOptions, MotionChoice, Role, adapt, map_roles,
    read_channels, read_image,
};
use std::path::{Path, PathBuf};

/// Reads what the adapter of the first mapping needs.
fn open(path: &Path) -> (Vec<ExrImage>, quell_frames::Mapping) {
    let headers = quell_frames::read_headers(path).unwrap();
    let mapping = map_roles(&[(String::new(), &headers)], &MapOptions::default()).unwrap().swap_remove(0);
    let image = read_channels(path, adapt::reads(&mapping, 0)).unwrap();
    (vec![image], mapping)
}

fn adapter(path: &Path) -> (Adapter, Vec<ExrImage>) {
    let (images, mapping) = open(path);
    let canvas = images[0].full_window();
    (Adapter::new(mapping, canvas, &images, None, &AdaptOptions::default()).unwrap(), images)
}

fn one(path: &Path) -> (Adapter, Vec<ExrImage>, SequenceFrame) {
    let (adapter, images) = adapter(path);
    let frame = adapter.frame(5, &images, &mut Links::default()).unwrap().frame;
    (adapter, images, frame)
}

fn hall(frames: &Path, number: u32) -> PathBuf {
    frames.join(format!("hall/noisy/hall.{number:04}.exr"))
}

/// Something that a filter could have done: each light mixed with its mean.
fn filtered(frame: &SequenceFrame) -> Vec<Plane<Rgb>> {
    let one = |plane: &Plane<Rgb>| {
        let count = plane.data().len() as f32;
        let mut mean = [0.0; 3];
        for value in plane.data() {
            for c in 0..3 {
                mean[c] += value[c] / count;
            }
        }
        Plane::from_vec(
            plane.size(),
            plane.data().iter().map(|v| std::array::from_fn(|c| 0.75 * v[c] + 0.25 * mean[c])).collect(),
        )
        .unwrap()
    };
    frame.lights.iter().map(|light| one(&light.light)).collect()
}

/// Largest difference of beauty and sum of passes in a file, in units of half rounding of the beauty.
pub fn off(adapter: &Adapter, images: &[ExrImage]) -> f32 {
    let sum = adapter.sum_of_passes(images).unwrap();
    let beauty = &adapter.mapping().get(Role::Beauty).unwrap().channels;
    let mut worst = 0.0f32;
    for (c, id) in beauty.iter().enumerate() {
        let window = images[id.file].parts()[id.part].data_window();
        let samples = images[id.file].samples(id.part, id.channel).unwrap();
        let canvas = adapter.canvas();
        for y in 0..window.size.height {
            for x in 0..window.size.width {
                let at = ((x as i32 + window.x - canvas.x) as usize, (y as i32 + window.y - canvas.y) as usize);
                let (sum, beauty) = (sum.at(at.0, at.1)[c], samples.get(y * window.size.width + x));
                worst = worst.max((sum - beauty).abs() / (sum.abs() * 2f32.powi(-11) + 6e-8));
            }
        }
    }
    worst
}

#[test]
fn blender_passes_become_lights_with_their_colours_and_all_layouts_agree() {
    let Some(frames) = shared_frames() else { return };
    let folder = frames.join("exr_aov");
    let mut seen = Vec::new();
    for file in
        ["blender50_multipart_float_zip.exr", "blender50_interleaved_half_piz.exr", "blender50_multipart_dwaa.exr"]
    {
        let (adapter, _, frame) = one(&folder.join(file));
        assert!(!adapter.rule().colour_inside && adapter.rule().complete, "{file}: {}", adapter.rule().describe());
        let kinds: Vec<LightKind> = frame.lights.iter().map(|l| l.kind).collect();
        use LightKind as K;
        let expected = [
            K::MatteDirect,
            K::MatteIndirect,
            K::GlossyDirect,
            K::GlossyIndirect,
            K::Transmission,
            K::Transmission,
            K::Volume,
            K::Volume,
            K::NoiseFree,
            K::NoiseFree,
        ];
        assert_eq!(kinds, expected, "{file}");
        assert!(
            frame.lights[..6].iter().all(|l| l.weight.is_some())
                && frame.lights[6..].iter().all(|l| l.weight.is_none())
        );
        assert!(frame.normal.is_some() && frame.seen_normal.is_some() && frame.albedo.is_some());
        assert!(frame.motion_to_previous.is_some() && frame.motion_to_next.is_some() && !frame.camera_motion);
        seen.push((frame.beauty(), frame.depth.unwrap()));
    }
    // Each file has noise of its own: means agree, and depth, which has none.
    let mean = |plane: &Plane<Rgb>| plane.data().iter().map(|v| v[1]).sum::<f32>() / plane.data().len() as f32;
    for (beauty, depth) in &seen {
        assert!((mean(beauty) / mean(&seen[0].0) - 1.0).abs() < 0.15, "{} {}", mean(beauty), mean(&seen[0].0));
        let near = |(a, b): (&f32, &f32)| a == b || (a - b).abs() < 1e-3 * b;
        assert!(depth.data().iter().zip(seen[0].1.data()).all(near));
    }
}

#[test]
fn filtered_passes_add_up_to_the_written_beauty_in_every_layout() {
    let Some(frames) = shared_frames() else { return };
    let folder = Folder::new("adds-up");
    let mut inputs: Vec<PathBuf> = [
        "blender50_multipart_float_zip.exr",
        "blender50_interleaved_half_piz.exr",
        "blender50_multipart_dwaa.exr",
        "blender50_stereo_multipart_zips.exr",
        "arnold_names_tiled_autocrop_zip.exr",
        "renderman_names_pxr24.exr",
        "vray_names_b44.exr",
    ]
    .map(|name| frames.join("exr_aov").join(name))
    .into();
    inputs.push(hall(&frames, 3));
    for path in inputs {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let (adapter, mut images, frame) = one(&path);
        let lights = filtered(&frame);
        let report = adapter.write_back(&mut images, &frame, &lights, None).unwrap();
        assert!(report.filtered.len() >= 3 && report.clamped_to_half == 0, "{name} {report:?}");
        adapter.sign(&mut images, "[sequence]\n").unwrap();
        let out = folder.file(&name);
        images[0].write(&out, &ImageWriteOptions::default()).unwrap();
        let after = read_image(&out).unwrap();
        let before = read_image(&path).unwrap();
        assert!(after.text("quell.mapping").unwrap().contains("beauty = "), "{name}");
        // With everything in the file, the sum of what is written is what is written as beauty.
        if adapter.rule().complete {
            let worst = off(&adapter, std::slice::from_ref(&after));
            assert!(worst <= 1.01, "{name}: {worst} half roundings");
        }
        // What is no light and no beauty is as it was, and lights are not.
        let lit: Vec<_> =
            adapter.mapping().passes.iter().filter(|p| p.role.light().is_some() || p.role == Role::Beauty).collect();
        for (p, part) in after.parts().iter().enumerate() {
            for (c, channel) in part.channels().iter().enumerate() {
                let is_light = lit.iter().any(|pass| pass.channels.iter().any(|id| (id.part, id.channel) == (p, c)));
                let same = channel.samples() == before.samples(p, c)
                    || matches!((channel.samples(), before.samples(p, c)), (Some(a), Some(b)) if a.to_f32().iter().map(|v| v.to_bits()).eq(b.to_f32().iter().map(|v| v.to_bits())));
                if !is_light {
                    assert!(same, "{name} {} changed", channel.name());
                } else if channel.name().contains("irect") {
                    assert!(!same || !channel.name().contains("Diffuse"), "{name} {} did not change", channel.name());
                }
            }
        }
    }
}

/// Lists of `--passes` for a file: all lights but emission, one light alone, emission alone, with the beauty and without.
fn lists(mapping: &quell_frames::Mapping) -> Vec<Vec<String>> {
    let lights: Vec<(Role, String)> =
        (mapping.passes.iter()).filter(|p| p.role.light().is_some()).map(|p| (p.role, p.name.clone())).collect();
    let some = |wanted: &dyn Fn(Role) -> bool| -> Vec<String> {
        lights.iter().filter(|(role, _)| wanted(*role)).map(|(_, name)| name.clone()).collect()
    };
    let without_emission = some(&|role| role != Role::Emission);
    let with_beauty = [vec!["beauty".to_owned()], without_emission.clone()].concat();
    vec![without_emission, with_beauty, vec![lights[0].1.clone()], some(&|role| role == Role::Emission)]
}

#[test]
fn chosen_passes_and_those_that_stay_add_up_to_the_written_beauty() {
    let Some(frames) = shared_frames() else { return };
    let folder = Folder::new("chosen");
    let (mut tried, mut seen) = (0, 0);
    for path in [
        frames.join("exr_aov/blender50_interleaved_half_piz.exr"),
        frames.join("exr_aov/blender50_multipart_float_zip.exr"),
        frames.join("exr_aov/arnold_names_tiled_autocrop_zip.exr"),
        hall(&frames, 3),
    ] {
        let file = path.file_name().unwrap().to_string_lossy().into_owned();
        let write = |passes: Option<Vec<String>>| {
            let (mut images, mapping) = open(&path);
            let options = AdaptOptions { passes, ..AdaptOptions::default() };
            let adapter = Adapter::new(mapping, images[0].full_window(), &images, None, &options).unwrap();
            let frame = adapter.frame(5, &images, &mut Links::default()).unwrap().frame;
            // As frames wait in a job.
            images.iter_mut().for_each(ExrImage::forget);
            let report = adapter.write_back(&mut images, &frame, &filtered(&frame), None).unwrap();
            let out = folder.file(&file);
            let overwrite = ImageWriteOptions { overwrite: true };
            images[0].write(&out, &overwrite).unwrap();
            (adapter, read_image(&out).unwrap(), report)
        };
        let (whole, all, _) = write(None);
        if !whole.rule().complete {
            continue;
        }
        let before = read_image(&path).unwrap();
        for list in lists(whole.mapping()).into_iter().filter(|list| !list.is_empty()) {
            tried += 1;
            let (adapter, after, report) = write(Some(list.clone()));
            let worst = off(&adapter, std::slice::from_ref(&after));
            assert!(worst <= 1.01, "{file} {list:?}: {worst} half roundings");
            for pass in adapter.mapping().passes.iter().filter(|p| p.role.light().is_some()) {
                let chosen = list.contains(&pass.name);
                assert_eq!(report.filtered.contains(&pass.name), chosen, "{file} {list:?} {}", pass.name);
                let same = |id: &quell_frames::roles::ChannelId| {
                    after.samples(id.part, id.channel) == before.samples(id.part, id.channel)
                };
                assert!(chosen || pass.channels.iter().all(same), "{file} {list:?}: {} changed", pass.name);
            }
            let warned = adapter.warnings().iter().any(|w| w.contains("keeps the noise of"));
            assert!(warned, "{file} {list:?} {:?}", adapter.warnings());
            // Canary: the beauty of all passes filtered is not the sum of these.
            let mut wrong = after.clone();
            for id in &adapter.mapping().get(Role::Beauty).unwrap().channels {
                wrong.replace(id.part, id.channel, all.samples(id.part, id.channel).unwrap().clone()).unwrap();
            }
            let worst = off(&adapter, std::slice::from_ref(&wrong));
            let stays = adapter.mapping().passes.iter().filter(|p| p.role.light().is_some() && !list.contains(&p.name));
            let black = stays
                .flat_map(|p| &p.channels)
                .all(|id| all.samples(id.part, id.channel) == before.samples(id.part, id.channel));
            assert!(worst > 5.0 || black, "{file} {list:?}: a wrong beauty went unseen: {worst}");
            seen += usize::from(!black);
        }
    }
    assert!(tried >= 8 && seen >= 6, "{tried} lists, {seen} canaries");
}

#[test]
fn light_that_goes_through_unfiltered_comes_back_to_the_bit_or_within_half_rounding() {
    let Some(frames) = shared_frames() else { return };
    for (file, exact) in [("blender50_interleaved_half_piz.exr", true), ("arnold_names_tiled_autocrop_zip.exr", false)]
    {
        let path = frames.join("exr_aov").join(file);
        let (adapter, mut images, frame) = one(&path);
        let before = images.clone();
        let lights: Vec<_> = frame.lights.iter().map(|l| l.light.clone()).collect();
        adapter.write_back(&mut images, &frame, &lights, None).unwrap();
        for pass in adapter.mapping().passes.iter().filter(|p| p.role.light().is_some()) {
            for id in &pass.channels {
                let (a, b) = (before[0].samples(id.part, id.channel), images[0].samples(id.part, id.channel));
                let (a, b) = (a.unwrap().to_f32(), b.unwrap().to_f32());
                if exact {
                    assert_eq!(a, b, "{file} {}", pass.name);
                }
                for (a, b) in a.iter().zip(&b) {
                    assert!((a - b).abs() <= a.abs() * 2f32.powi(-10) + 6e-8, "{file} {}: {a} {b}", pass.name);
                }
            }
        }
    }
}

#[test]
fn rules_of_other_renderers_are_told_from_the_beauty() {
    let Some(frames) = shared_frames() else { return };
    let folder = frames.join("exr_aov");
    for (file, inside) in [
        ("arnold_names_tiled_autocrop_zip.exr", true),
        ("vray_names_b44.exr", true),
        ("renderman_names_pxr24.exr", true),
    ] {
        let (adapter, _, frame) = one(&folder.join(file));
        println!("{file}: {} complete {}", adapter.rule().describe(), adapter.rule().complete);
        assert_eq!(adapter.rule().colour_inside, inside, "{file}");
        // With or without a rest, the lights are the beauty.
        let (images, mapping) = open(&folder.join(file));
        let id = &mapping.get(Role::Beauty).unwrap().channels[1];
        let samples = images[0].samples(id.part, id.channel).unwrap();
        let window = images[0].parts()[id.part].data_window();
        let sum = frame.beauty();
        let (mut error, mut all) = (0.0, 0.0);
        for y in 0..window.size.height {
            for x in 0..window.size.width {
                let beauty = samples.get(y * window.size.width + x);
                error += (sum.at(x + window.x as usize, y + window.y as usize)[1] - beauty).abs();
                all += beauty;
            }
        }
        assert!(error / all < 0.021, "{file} {}", error / all);
    }
    // Beauty and albedo alone: one light, divided by the albedo. Mitsuba's is a sampled weight on metals, which count as white.
    for file in ["pbrt4_gbuffer_names_crop_zip.exr", "mitsuba3_aov_half_piz.exr", "nuke_names_overscan_rle.exr"] {
        let (adapter, _, frame) = one(&folder.join(file));
        assert_eq!(frame.lights.len(), 1, "{file}");
        assert_eq!(frame.lights[0].kind, LightKind::Beauty);
        let weight = frame.lights[0].weight.as_ref();
        assert!(
            weight.is_some_and(|weight| weight.data().iter().flatten().all(|w| (0.02..=1.0).contains(w))),
            "{file}"
        );
        assert!(!adapter.warnings().iter().any(|w| w.contains("albedo is above 1")), "{file}");
        assert!(frame.depth.is_some(), "{file}");
    }
}

#[test]
fn depth_is_planar_and_normals_face_the_viewer_whatever_the_file_holds() {
    let Some(frames) = shared_frames() else { return };
    let folder = frames.join("exr_aov");
    let truth = one(&folder.join("blender50_multipart_float_zip.exr")).2;
    // Nuke's is 1 / z and has a frame of 8 pixels around the picture.
    let (around, _, nuke) = one(&folder.join("nuke_names_overscan_rle.exr"));
    assert_eq!((around.canvas().x, around.canvas().size.width), (-8, 112));
    for (x, y) in [(10, 10), (50, 40), (80, 20)] {
        let (a, b) = (truth.depth.as_ref().unwrap().at(x, y), nuke.depth.as_ref().unwrap().at(x + 8, y + 8));
        assert!((a.is_infinite() && b.is_infinite()) || (a - b).abs() < 0.02 * a, "{a} {b}");
    }
    // Arnold's is cut to part of the picture; the rest is background.
    let arnold = one(&folder.join("arnold_names_tiled_autocrop_zip.exr")).2;
    assert_eq!(arnold.size, truth.size);
    assert!(arnold.depth.as_ref().unwrap().at(0, 0).is_infinite());
    assert_eq!(arnold.depth.as_ref().unwrap().at(40, 30), truth.depth.as_ref().unwrap().at(40, 30));

    // Mitsuba's is along the ray. Its camera comes from positions; cameras.json says where it stands.
    let (made_by, images) = adapter(&frames.join("mitsuba_box/noisy/box.0003.exr"));
    let made = made_by.frame(3, &images, &mut Links::default()).unwrap();
    let camera = made.camera.unwrap();
    assert!(camera.residual_px < 0.2, "{}", camera.residual_px);
    let json: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(frames.join("mitsuba_box/cameras.json")).unwrap()).unwrap();
    let entry = find_camera(&json, 3).expect("cameras.json has frame 3");
    for c in 0..3 {
        let eye = entry["camera_to_world"][c][3].as_f64().unwrap() as f32;
        assert!((camera.eye[c] - eye).abs() < 0.02, "{:?} {eye}", camera.eye);
    }
    // The planar depth of a pixel is its position's distance along the axis.
    let (depth, position) = (made.frame.depth.unwrap(), made.frame.position.unwrap());
    // (Its rays begin at the near plane, 0.01 before the camera: 0.25 % here.)
    let mut worst: Vec<f32> = (0..240 * 240)
        .map(|i| (i % 240, i / 240))
        .filter(|(x, y)| depth.at(*x, *y).is_finite() && position.at(*x, *y) != [0.0; 3])
        .map(|(x, y)| (camera.depth(position.at(x, y)) / depth.at(x, y) - 1.0).abs())
        .collect();
    worst.sort_by(f32::total_cmp);
    assert!(
        worst[worst.len() / 2] < 4e-3 && worst[worst.len() * 9 / 10] < 0.02,
        "{} {}",
        worst[worst.len() / 2],
        worst[worst.len() * 9 / 10]
    );

    // Denoising Normal is camera space; where it is Normal (91 % of pixels) it agrees after the turn.
    let (seen, normal) = (truth.seen_normal.unwrap(), truth.normal.unwrap());
    let agree =
        seen.data().iter().zip(normal.data()).filter(|(a, b)| (0..3).all(|c| (a[c] - b[c]).abs() < 0.1)).count();
    assert!(agree * 100 > 75 * seen.data().len(), "{agree} of {}", seen.data().len());
}

#[test]
fn the_kind_of_depth_is_measured_where_positions_tell_the_camera() {
    use quell_frames::roles::DepthKind;
    let Some(frames) = shared_frames() else { return };
    let open_as = |path: PathBuf, wrong: DepthKind| {
        let (images, mut mapping) = open(&path);
        mapping.renderer.depth = wrong;
        let canvas = images[0].full_window();
        let adapter = Adapter::new(mapping, canvas, &images, None, &AdaptOptions::default()).unwrap();
        adapter.mapping().renderer.depth
    };
    let kinds = [DepthKind::Planar, DepthKind::Ray, DepthKind::Inverse];
    for wrong in kinds {
        assert_eq!(open_as(frames.join("mitsuba_box/noisy/box.0003.exr"), wrong), DepthKind::Ray);
        assert_eq!(open_as(hall(&frames, 3), wrong), DepthKind::Planar);
    }
    // Without positions nothing is known, and nothing moves.
    let (adapter, _) = adapter(&frames.join("exr_aov/parts_mixed_half_float_uint.exr"));
    assert!(adapter.warnings().iter().any(|w| w.contains("by itself")), "{:?}", adapter.warnings());
}

fn find_camera(json: &serde_json::Value, frame: i64) -> Option<serde_json::Value> {
    match json {
        serde_json::Value::Array(all) => all.iter().find_map(|v| find_camera(v, frame)),
        serde_json::Value::Object(all) => {
            if all.contains_key("camera_to_world") && all.get("frame").and_then(|f| f.as_i64()) == Some(frame) {
                return Some(json.clone());
            }
            all.get(&frame.to_string())
                .filter(|v| v.get("camera_to_world").is_some())
                .cloned()
                .or_else(|| all.values().find_map(|v| find_camera(v, frame)))
        }
        _ => None,
    }
}

#[test]
fn motion_follows_the_surface_and_the_sky_turns_with_the_camera() {
    let Some(frames) = shared_frames() else { return };
    let mut links = Links::default();
    let (adapter, first) = adapter(&hall(&frames, 5));
    adapter.frame(5, &first, &mut links).unwrap();
    let (second, _) = open(&hall(&frames, 6));
    let made = adapter.frame(6, &second, &mut links).unwrap();
    assert!(made.camera.unwrap().residual_px < 0.1, "{}", made.camera.unwrap().residual_px);
    assert!(!made.frame.repeats_noise && made.notes.is_empty(), "{:?}", made.notes);
    let before = adapter.frame(5, &first, &mut Links::default()).unwrap().frame;
    let (now, motion) = (&made.frame, made.frame.motion_to_previous.as_ref().unwrap());
    let (position, earlier) = (now.position.as_ref().unwrap(), before.position.as_ref().unwrap());
    let depth = now.depth.as_ref().unwrap();
    let (mut hit, mut count, mut sky) = (0, 0, 0);
    for y in 0..225 {
        for x in 0..400 {
            let v = motion.at(x, y);
            if depth.at(x, y).is_infinite() {
                assert!(v[0].is_finite() && v[0].hypot(v[1]) > 0.5, "{v:?}");
                sky += 1;
                continue;
            }
            let (tx, ty) = ((x as f32 + 0.5 + v[0]).floor(), (y as f32 + 0.5 + v[1]).floor());
            if tx >= 0.0 && ty >= 0.0 && tx < 400.0 && ty < 225.0 {
                let (a, b) = (position.at(x, y), earlier.at(tx as usize, ty as usize));
                let distance = (0..3).map(|c| (a[c] - b[c]).powi(2)).sum::<f32>().sqrt();
                count += 1;
                hit += usize::from(distance < 0.006 * depth.at(x, y).max(1.0) * 2.0);
            }
        }
    }
    assert!(sky > 500 && hit * 100 > 85 * count, "{sky} {hit} of {count}");
    // Without a neighbour the sky's motion is unknown (where the pixel is all sky: at edges vectors are means).
    let (alone, depth) = (before.motion_to_previous.as_ref().unwrap(), before.depth.as_ref().unwrap());
    let skies = alone.data().iter().zip(depth.data()).filter(|(_, d)| d.is_infinite());
    let (known, unknown): (Vec<_>, Vec<_>) = skies.partition(|(v, _)| v[0].is_finite());
    assert!(unknown.len() > 4 * known.len(), "{} {}", known.len(), unknown.len());
}

#[test]
fn a_file_without_vectors_gets_motion_from_two_cameras() {
    let Some(frames) = shared_frames() else { return };
    let path = |n: u32| frames.join(format!("mitsuba_box/noisy/box.{n:04}.exr"));
    let mut links = Links::default();
    let (adapter, first) = adapter(&path(1));
    let before = adapter.frame(1, &first, &mut links).unwrap().frame;
    assert!(before.motion_to_previous.is_none());
    let (second, _) = open(&path(2));
    let now = adapter.frame(2, &second, &mut links).unwrap().frame;
    assert!(now.camera_motion && !before.camera_motion);
    let motion = now.motion_to_previous.unwrap();
    let (position, earlier) = (now.position.unwrap(), before.position.unwrap());
    let mut distances = Vec::new();
    for y in 20..220 {
        for x in 20..220 {
            let v = motion.at(x, y);
            let (tx, ty) = ((x as f32 + 0.5 + v[0]).floor(), (y as f32 + 0.5 + v[1]).floor());
            if v[0].is_finite() && (0.0..240.0).contains(&tx) && (0.0..240.0).contains(&ty) {
                let (a, b) = (position.at(x, y), earlier.at(tx as usize, ty as usize));
                distances.push((0..3).map(|c| (a[c] - b[c]).powi(2)).sum::<f32>().sqrt());
            }
        }
    }
    distances.sort_by(f32::total_cmp);
    // A pixel is about 0.01 wide here.
    assert!(distances[distances.len() / 2] < 0.012, "{}", distances[distances.len() / 2]);
    assert!(motion.data().iter().filter(|v| v[0].hypot(v[1]) > 1.0).count() > 10_000);
}

#[test]
fn motion_auto_finds_the_convention_of_hall_and_of_every_variant_made_from_it() {
    let Some(frames) = shared_frames() else { return };
    let (_, mapping) = open(&hall(&frames, 6));
    let vector = mapping.get(Role::Motion).unwrap().channels.clone();
    let files: Vec<Vec<ExrImage>> = [6, 7].map(|n| open(&hall(&frames, n)).0).into();
    let canvas = files[0][0].full_window();
    let auto = AdaptOptions { motion: MotionChoice::Auto, ..AdaptOptions::default() };
    let truth = Adapter::new(mapping.clone(), canvas, &files[0], Some(&files[1]), &AdaptOptions::default()).unwrap();
    let mut links = Links::default();
    truth.frame(6, &files[0], &mut links).unwrap();
    let truth = truth.frame(7, &files[1], &mut links).unwrap().frame;
    let [xy, zw] = MotionConvention::preset("blender").unwrap();
    let found = Adapter::new(mapping.clone(), canvas, &files[0], Some(&files[1]), &auto).unwrap();
    println!("{:?} {:?}", found.notes(), found.warnings());
    assert!(found.warnings().is_empty());
    for wanted in MotionConvention::all() {
        // The file's own vectors, spelled in the wanted convention, in the first two channels.
        let from = if wanted.direction == xy.direction { (xy, 0) } else { (zw, 2) };
        let mut variant = files.clone();
        for images in &mut variant {
            let numbers: Vec<Vec<f32>> = (0..2)
                .map(|k| {
                    let id = vector[from.1 + k];
                    images[0].samples(id.part, id.channel).unwrap().to_f32()
                })
                .collect();
            let spelled: Vec<[f32; 2]> = numbers[0]
                .iter()
                .zip(&numbers[1])
                .map(|(x, y)| wanted.value(from.0.offset([*x, *y], canvas.size), canvas.size))
                .collect();
            for k in 0..4 {
                let id = vector[k];
                let values = spelled.iter().map(|v| if k < 2 { v[k] } else { 0.0 }).collect();
                let kind = images[0].parts()[id.part].channels()[id.channel].kind();
                images[0].replace(id.part, id.channel, quell_frames::Samples::from_f32(values, kind).0).unwrap();
            }
        }
        let mut mapping = mapping.clone();
        for pass in mapping.passes.iter_mut().filter(|p| p.role == Role::Motion) {
            pass.channels.truncate(2);
        }
        let adapter = Adapter::new(mapping, canvas, &variant[0], Some(&variant[1]), &auto).unwrap();
        assert!(adapter.warnings().is_empty(), "{wanted}: {:?}", adapter.warnings());
        let mut links = Links::default();
        adapter.frame(6, &variant[0], &mut links).unwrap();
        let made = adapter.frame(7, &variant[1], &mut links).unwrap().frame;
        // The convention, or one that warps equally well: vectors agree with the truth within a quarter of a pixel.
        let pairs =
            [(&made.motion_to_previous, &truth.motion_to_previous), (&made.motion_to_next, &truth.motion_to_next)];
        for (made, truth) in pairs.into_iter().filter_map(|(a, b)| Some((a.as_ref()?, b.as_ref()?))) {
            let mut misses: Vec<f32> = made
                .data()
                .iter()
                .zip(truth.data())
                .map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1]))
                .filter(|d| d.is_finite())
                .collect();
            misses.sort_by(f32::total_cmp);
            assert!(misses[misses.len() / 2] < 0.25, "{wanted}: {} {:?}", misses[misses.len() / 2], adapter.notes());
        }
        assert!(made.motion_to_previous.is_some() || made.motion_to_next.is_some());
    }
    // Vectors that mean nothing are not used.
    let mut nonsense = files.clone();
    for images in &mut nonsense {
        for (k, id) in vector.iter().enumerate() {
            let count = images[0].samples(id.part, id.channel).unwrap().len();
            let values = (0..count).map(|i| ((i * 7919 + k * 104_729) % 61) as f32 - 30.0).collect();
            let kind = images[0].parts()[id.part].channels()[id.channel].kind();
            images[0].replace(id.part, id.channel, quell_frames::Samples::from_f32(values, kind).0).unwrap();
        }
    }
    let adapter = Adapter::new(mapping.clone(), canvas, &nonsense[0], Some(&nonsense[1]), &auto).unwrap();
    assert!(adapter.warnings().iter().any(|w| w.contains("--motion")), "{:?}", adapter.warnings());
    let error = Adapter::new(
        mapping,
        canvas,
        &files[0],
        None,
        &AdaptOptions { motion: MotionChoice::Preset("sideways".into()), ..AdaptOptions::default() },
    )
    .unwrap_err()
    .to_string();
    assert!(error.contains("sideways") && error.contains("blender"), "{error}");
}

#[test]
fn vectors_that_are_zero_while_the_picture_moves_count_as_missing_and_repeated_noise_is_noticed() {
    let Some(frames) = shared_frames() else { return };
    let (_, mapping) = open(&hall(&frames, 6));
    let mut files: Vec<Vec<ExrImage>> = [6, 7].map(|n| open(&hall(&frames, n)).0).into();
    for images in &mut files {
        for id in mapping.get(Role::Motion).unwrap().channels.clone() {
            let count = images[0].samples(id.part, id.channel).unwrap().len();
            let kind = images[0].parts()[id.part].channels()[id.channel].kind();
            images[0].replace(id.part, id.channel, quell_frames::Samples::from_f32(vec![0.0; count], kind).0).unwrap();
        }
    }
    let adapter = Adapter::new(mapping, files[0][0].full_window(), &files[0], None, &AdaptOptions::default()).unwrap();
    let mut links = Links::default();
    adapter.frame(6, &files[0], &mut links).unwrap();
    let made = adapter.frame(7, &files[1], &mut links).unwrap();
    assert!(made.notes.iter().any(|n| n.contains("zero everywhere")), "{:?}", made.notes);
    // Positions give both cameras: most of the picture stands still.
    let moved = made.frame.motion_to_previous.unwrap().data().iter().filter(|v| v[0].hypot(v[1]) > 0.5).count();
    assert!(moved > 60_000, "{moved}");

    // The same frame again is the same noise (and the same picture).
    let mut links = Links::default();
    adapter.frame(6, &files[0], &mut links).unwrap();
    let twice = adapter.frame(7, &files[0], &mut links).unwrap();
    assert!(twice.frame.repeats_noise && twice.notes.iter().any(|n| n.contains("Seed")), "{:?}", twice.notes);
}
