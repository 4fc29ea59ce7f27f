//! What moves: node animation, clips, skins, morph targets; compared with closed forms.

use crate::gltf::file::{File, warnings};
use crate::gltf::static_scenes::world;
use glam::{Quat, Vec3};
use quell::Size;
use quell_trace::gltf::{Options, Plays};
use serde_json::json;

fn options(clip: &str) -> Options {
    Options { clip: Some(clip.to_owned()), ..Options::default() }
}

#[test]
fn parents_and_children_move_together_and_frames_follow_the_clip() {
    let mut file = File::triangle();
    // Node 0 shows the triangle; its parent turns a quarter in one second while it climbs itself.
    file.json["scenes"][0]["nodes"] = json!([]);
    let parent = file.shown(json!({"children": [0]}));
    let half = std::f32::consts::FRAC_1_SQRT_2;
    file.clip("turn", parent, "rotation", "LINEAR", &[0.0, 1.0], &[0.0, 0.0, 0.0, 1.0, 0.0, half, 0.0, half]);
    file.clip("climb", 0, "translation", "LINEAR", &[0.0, 2.0], &[1.0, 0.0, 0.0, 1.0, 2.0, 0.0]);
    let loaded = file.load();
    assert_eq!(loaded.scene.frames, 49);
    assert!(loaded.report.clips.iter().all(|c| c.plays == Plays::Yes));
    for frame in [-3.0, 0.0, 6.0, 12.5, 24.0, 36.0, 48.0, 100.0] {
        let seconds = (frame / 24.0_f64).max(0.0) as f32;
        let turn = Quat::from_rotation_y(std::f32::consts::FRAC_PI_2 * seconds.min(1.0));
        let climb = Vec3::new(1.0, seconds.min(2.0), 0.0);
        let expected = [Vec3::ZERO, Vec3::X, Vec3::Y].map(|p| turn * (p + climb));
        for (found, expected) in world(&loaded.scene, 0, frame).iter().zip(expected) {
            assert!(found.abs_diff_eq(expected, 1e-5), "{frame}: {found} {expected}");
        }
    }
    // One clip alone, and none.
    let climb = file.try_load_with(&options("climb")).unwrap();
    assert!(world(&climb.scene, 0, 24.0)[0].abs_diff_eq(Vec3::new(1.0, 1.0, 0.0), 1e-6));
    let still = file.try_load_with(&options("none")).unwrap();
    assert_eq!(still.scene.frames, 64);
    assert!(still.scene.instances[0].transform.is_constant());
    assert!(file.try_load_with(&options("1")).is_ok());
    let error = file.try_load_with(&options("run")).unwrap_err().to_string();
    assert_eq!(error, "test.glb: there is no clip `run`; there are: turn, climb");
    let other = Options { frames_per_second: 30.0, ..Options::default() };
    assert_eq!(file.try_load_with(&other).unwrap().scene.frames, 61);
    assert!(file.try_load_with(&Options { frames_per_second: 0.0, ..Options::default() }).is_err());
}

#[test]
fn of_clips_that_share_a_channel_the_first_plays() {
    let mut file = File::triangle();
    for (name, x) in [("a", 1.0), ("b", 2.0)] {
        file.clip(name, 0, "translation", "STEP", &[0.0, 1.0], &[x, 0.0, 0.0, x, 0.0, 0.0]);
    }
    file.clip("c", 0, "scale", "STEP", &[0.0], &[3.0, 3.0, 3.0]);
    let loaded = file.load();
    let plays: Vec<_> = loaded.report.clips.iter().map(|c| c.plays.clone()).collect();
    assert_eq!(plays, [Plays::Yes, Plays::SharesChannels("a".to_owned()), Plays::Yes]);
    assert!(world(&loaded.scene, 0, 0.0)[1].abs_diff_eq(Vec3::new(4.0, 0.0, 0.0), 1e-6));
}

#[test]
fn a_camera_that_rolls_is_rolled() {
    let mut file = File::triangle();
    file.json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}}]);
    let camera = file.shown(json!({"camera": 0}));
    let half = std::f32::consts::FRAC_1_SQRT_2;
    file.clip("roll", camera, "rotation", "LINEAR", &[0.0, 1.0], &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, half, half]);
    let loaded = file.load();
    assert!(loaded.report.cameras[0].moves);
    let size = Size::new(32, 32);
    for (frame, angle) in [(0.0, 0.0), (12.0, std::f32::consts::FRAC_PI_4), (24.0, std::f32::consts::FRAC_PI_2)] {
        let projection = loaded.scene.cameras[0].at(frame, size).unwrap().projection(size).unwrap();
        // A point right of the axis in the world appears turned the other way.
        let pixel = projection.pixel(Vec3::new(0.1, 0.0, -1.0)).unwrap() - 16.0;
        let expected = glam::Vec2::from_angle(angle) * pixel.length();
        assert!((pixel - expected).length() < 1e-2, "{frame}: {pixel} {expected}");
    }
}

#[test]
fn morph_targets_add_their_offsets() {
    let mut file = File::triangle();
    let normals = file.floats("VEC3", &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    let up = file.floats("VEC3", &[0.0, 0.0, 1.0, 0.0, 0.0, 2.0, 0.0, 0.0, 3.0]);
    let side = file.floats("VEC3", &[1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
    let primitive = &mut file.json["meshes"][0]["primitives"][0];
    primitive["attributes"]["NORMAL"] = normals.into();
    primitive["targets"] = json!([{"POSITION": up, "NORMAL": side}, {"POSITION": side}]);
    file.json["meshes"][0]["weights"] = json!([0.5, 0.0]);
    // At rest, by the mesh's own weights.
    let rest = file.load();
    assert!(rest.scene.meshes[0].deform.is_none(), "nothing moves");
    assert_eq!(
        world(&rest.scene, 0, 0.0),
        [Vec3::new(0.0, 0.0, 0.5), Vec3::new(1.0, 0.0, 1.0), Vec3::new(0.0, 1.0, 1.5)]
    );
    // Driven: the first from 0 to 1, the second from 1 to 0.
    file.clip("morph", 0, "weights", "LINEAR", &[0.0, 1.0], &[0.0, 1.0, 1.0, 0.0]);
    let loaded = file.load();
    assert_eq!(loaded.report.deforming_meshes, 1);
    let mesh = &loaded.scene.meshes[0];
    for frame in [0.0, 6.0, 24.0] {
        let s = (frame / 24.0) as f32;
        let expected = [Vec3::ZERO, Vec3::X, Vec3::Y]
            .iter()
            .enumerate()
            .map(|(i, p)| *p + Vec3::Z * (s * (i + 1) as f32) + Vec3::X * (1.0 - s))
            .collect::<Vec<_>>();
        for (found, expected) in world(&loaded.scene, 0, frame).iter().zip(&expected) {
            assert!(found.abs_diff_eq(*expected, 1e-5), "{frame}: {found} {expected}");
        }
        let normals = mesh.deform.as_ref().unwrap()(frame, mesh).1;
        assert!(normals.iter().all(|n| n.abs_diff_eq(Vec3::new(s, 0.0, 1.0), 1e-5)), "{frame}: {normals:?}");
    }
}

#[test]
fn skins_follow_their_joints_and_not_their_node() {
    let mut file = File::triangle();
    let joints = file.accessor("VEC4", 5121, 3, &[0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0]);
    let weights = file.floats("VEC4", &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0]);
    let attributes = &mut file.json["meshes"][0]["primitives"][0]["attributes"];
    attributes["JOINTS_0"] = joints.into();
    attributes["WEIGHTS_0"] = weights.into();
    // Joint 1 is bound at (1, 0, 0).
    let mut matrices = [0.0; 32];
    for i in [0, 5, 10, 15, 16, 21, 26, 31] {
        matrices[i] = 1.0;
    }
    matrices[16 + 12] = -1.0;
    let bind = file.floats("MAT4", &matrices);
    let tip = file.push("nodes", json!({"translation": [1.0, 0.0, 0.0]}));
    let root = file.push("nodes", json!({"children": [tip]}));
    file.push("skins", json!({"joints": [root, tip], "inverseBindMatrices": bind}));
    file.json["nodes"][0] = json!({"mesh": 0, "skin": 0, "translation": [100.0, 0.0, 0.0], "scale": [9.0, 9.0, 9.0]});
    file.json["scenes"][0]["nodes"] = json!([0, root]);
    // Nothing moves: bound where it stands, baked.
    let rest = file.load();
    assert!(rest.scene.meshes[0].deform.is_none());
    for (found, expected) in world(&rest.scene, 0, 0.0).iter().zip([Vec3::ZERO, Vec3::X, Vec3::Y]) {
        assert!(found.abs_diff_eq(expected, 1e-6), "{found}");
    }
    file.clip("lift", tip, "translation", "LINEAR", &[0.0, 1.0], &[1.0, 0.0, 0.0, 1.0, 0.0, 4.0]);
    let half = std::f32::consts::FRAC_1_SQRT_2;
    file.clip("turn", root, "rotation", "LINEAR", &[0.0, 1.0], &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, half, half]);
    let loaded = file.load();
    for frame in [0.0, 12.0, 24.0] {
        let s = (frame / 24.0) as f32;
        let turn = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2 * s);
        let lift = Vec3::Z * (4.0 * s);
        let expected = [Vec3::ZERO, turn * (Vec3::X + lift), turn * (Vec3::Y + lift * 0.5)];
        for (found, expected) in world(&loaded.scene, 0, frame).iter().zip(expected) {
            assert!(found.abs_diff_eq(expected, 1e-5), "{frame}: {found} {expected}");
        }
    }
    // Joints beyond the skin are an error, not a guess.
    file.json["skins"][0]["joints"] = json!([root]);
    assert_eq!(
        file.refusal(),
        "test.glb: nodes[0].skin: names joint 1, but there are 1 (counted from 0); export the file again"
    );
}

#[test]
fn channels_that_cannot_be_played_are_left_out_with_a_warning() {
    let mut file = File::triangle();
    file.clip("back", 0, "translation", "LINEAR", &[1.0, 0.0], &[0.0; 6]);
    file.clip("nan", 0, "translation", "LINEAR", &[0.0, 1.0], &[f32::NAN, 0.0, 0.0, 0.0, 0.0, 0.0]);
    file.clip("pointer", 0, "translation", "LINEAR", &[0.0], &[0.0; 3]);
    file.json["animations"][2]["channels"][0]["target"] = json!({"path": "pointer"});
    file.clip("no morph", 0, "weights", "LINEAR", &[0.0], &[1.0]);
    let loaded = file.load();
    assert_eq!(loaded.scene.frames, 64);
    let told = warnings(&loaded);
    for expected in [
        "animations[0].samplers[0].input: times must be finite and ascend",
        "animations[1].samplers[0].output: holds values that are not finite",
        "animations[2].channels[0].target: drives no node",
        "animations[3].channels[0].target: the node's mesh has no morph targets",
    ] {
        assert!(told.contains(expected), "{expected} is missing in:\n{told}");
    }
}
