//! Names become roles as the frames README says; what is ambiguous or unknown is an error that lists names.

use crate::{Folder, shared_frames};
use quell_frames::{ExrImage, MapOptions, Mapping, Role, map_roles, read_headers, read_image_from};
use std::path::Path;

fn map(path: &Path, options: &MapOptions) -> Result<Vec<Mapping>, quell_frames::Error> {
    let image = read_headers(path).unwrap();
    map_roles(&[(String::new(), &image)], options)
}

fn lines(mapping: &Mapping) -> Vec<String> {
    mapping.passes.iter().map(|p| format!("{}={}/{}", p.role, p.name, p.channels.len())).collect()
}

#[test]
fn every_layout_of_the_shared_frames_maps_as_its_readme_says() {
    let Some(frames) = shared_frames() else { return };
    let folder = frames.join("exr_aov");
    let blender = [
        "beauty=ViewLayer.Combined/3",
        "matte_direct=ViewLayer.Diffuse Direct/3",
        "matte_indirect=ViewLayer.Diffuse Indirect/3",
        "matte_colour=ViewLayer.Diffuse Color/3",
        "glossy_direct=ViewLayer.Glossy Direct/3",
        "glossy_indirect=ViewLayer.Glossy Indirect/3",
        "glossy_colour=ViewLayer.Glossy Color/3",
        "transmission_direct=ViewLayer.Transmission Direct/3",
        "transmission_indirect=ViewLayer.Transmission Indirect/3",
        "transmission_colour=ViewLayer.Transmission Color/3",
        "volume_direct=ViewLayer.Volume Direct/3",
        "volume_indirect=ViewLayer.Volume Indirect/3",
        "emission=ViewLayer.Emission/3",
        "environment=ViewLayer.Environment/3",
        "normal=ViewLayer.Normal/3",
        "seen_albedo=ViewLayer.Denoising Albedo/3",
        "seen_normal=ViewLayer.Denoising Normal/3",
        "seen_depth=ViewLayer.Denoising Depth/1",
        "depth=ViewLayer.Depth/1",
        "position=ViewLayer.Position/3",
        "motion=ViewLayer.Vector/4",
    ];
    for (file, renderer, expected) in [
        ("blender50_multipart_float_zip.exr", "blender", &blender[..]),
        ("blender50_multipart_dwaa.exr", "blender", &blender[..]),
        ("blender50_interleaved_half_piz.exr", "blender", &blender[..]),
        (
            "arnold_names_tiled_autocrop_zip.exr",
            "arnold",
            &[
                "beauty=/3",
                "matte_direct=diffuse_direct/3",
                "matte_indirect=diffuse_indirect/3",
                "matte_colour=diffuse_albedo/3",
                "glossy_direct=specular_direct/3",
                "glossy_indirect=specular_indirect/3",
                "glossy_colour=specular_albedo/3",
                "transmission=transmission/3",
                "emission=emission/3",
                "environment=background/3",
                "albedo=denoise_albedo/3",
                "normal=N/3",
                "depth=Z/1",
                "position=P/3",
                "motion=motionvector/3",
            ],
        ),
        (
            "renderman_names_pxr24.exr",
            "renderman",
            &[
                "beauty=Ci/3",
                "matte=diffuse/3",
                "glossy=specular/3",
                "albedo=albedo/3",
                "normal=normal/3",
                "depth=z/1",
                "motion_previous=backward/2",
                "motion_next=forward/2",
                "variance=mse/3",
            ],
        ),
        (
            "vray_names_b44.exr",
            "vray",
            &[
                "beauty=/3",
                "matte_direct=lighting/3",
                "matte_indirect=gi/3",
                "matte_colour=diffuse/3",
                "glossy_direct=specular/3",
                "glossy_indirect=reflection/3",
                "glossy_colour=reflection_filter/3",
                "transmission=refraction/3",
                "emission=self_illumination/3",
                "environment=background/3",
                "normal=normals/3",
                "depth=z_depth/1",
                "motion=velocity/3",
            ],
        ),
        (
            "pbrt4_gbuffer_names_crop_zip.exr",
            "pbrt",
            &["beauty=/3", "albedo=Albedo/3", "normal=Ns/3", "position=P/3", "variance=Variance/3"],
        ),
        (
            "nuke_names_overscan_rle.exr",
            "nuke",
            &["beauty=/3", "albedo=albedo/3", "depth=depth/1", "motion_previous=backward/2", "motion_next=forward/2"],
        ),
        (
            "mitsuba3_aov_half_piz.exr",
            "mitsuba",
            &["beauty=/3", "albedo=albedo/3", "normal=nn/3", "depth=dd/1", "position=pos/3", "id=prim/1"],
        ),
        ("parts_mixed_half_float_uint.exr", "any", &["beauty=beauty/3", "normal=N/3", "depth=Z/1", "id=id/1"]),
    ] {
        let mappings = map(&folder.join(file), &MapOptions::default()).unwrap();
        assert_eq!(mappings.len(), 1, "{file}");
        assert_eq!(mappings[0].renderer.name, renderer, "{file}: {}", mappings[0].renderer_why);
        assert_eq!(lines(&mappings[0]), expected, "{file}");
    }
}

#[test]
fn stereo_views_map_one_by_one_and_can_be_chosen() {
    let Some(frames) = shared_frames() else { return };
    for file in ["blender50_stereo_multipart_zips.exr", "blender50_stereo_interleaved_rle.exr"] {
        let path = frames.join("exr_aov").join(file);
        let both = map(&path, &MapOptions::default()).unwrap();
        let views: Vec<&str> = both.iter().map(|m| m.view.as_str()).collect();
        assert_eq!(views, ["left", "right"], "{file}");
        for mapping in &both {
            assert_eq!(mapping.passes.len(), 10, "{file} {:?}", lines(mapping));
            assert_eq!(mapping.layer, "ViewLayer");
        }
        let shared = both[0].channels().intersection(&both[1].channels()).count();
        assert_eq!(shared, 0, "{file}");
        let right = map(&path, &MapOptions { view: Some("right".into()), ..MapOptions::default() }).unwrap();
        assert_eq!(right, both[1..], "{file}");
        let error =
            map(&path, &MapOptions { view: Some("top".into()), ..MapOptions::default() }).unwrap_err().to_string();
        assert!(error.contains("`left`") && error.contains("`right`") && error.contains("top"), "{error}");
    }
}

#[test]
fn one_quantity_a_file_maps_by_the_names_of_files() {
    let Some(frames) = shared_frames() else { return };
    let read = |name: &str| read_headers(&frames.join("exr_aov/separate").join(format!("hall.{name}.exr"))).unwrap();
    let images: Vec<(String, ExrImage)> = ["hdr", "alb", "nrm", "depth"].map(|n| (n.to_owned(), read(n))).into();
    let files: Vec<(String, &ExrImage)> = images.iter().map(|(n, i)| (n.clone(), i)).collect();
    let mapping = &map_roles(&files, &MapOptions::default()).unwrap()[0];
    assert_eq!(lines(mapping), ["beauty=hdr/3", "albedo=alb/3", "normal=nrm/3", "depth=depth/1"]);
    assert_eq!(mapping.get(Role::Depth).unwrap().channels[0].file, 3);
}

/// A header with these channels, half floats.
fn with_channels(folder: &Folder, names: &[&str]) -> ExrImage {
    use exr::prelude::*;
    let channels: Vec<AnyChannel<FlatSamples>> =
        names.iter().map(|n| AnyChannel::new(*n, FlatSamples::F32(vec![0.5; 6]))).collect();
    let encoding = Encoding::FAST_LOSSLESS;
    let layer = Layer::new((3, 2), LayerAttributes::default(), encoding, AnyChannels::sort(channels.into()));
    let path = folder.file("names.exr");
    Image::from_layer(layer).write().non_parallel().to_file(&path).unwrap();
    read_image_from(std::io::Cursor::new(std::fs::read(&path).unwrap()), &path).unwrap()
}

fn rgb(layers: &[&str]) -> Vec<String> {
    layers
        .iter()
        .flat_map(|l| ["R", "G", "B"].map(|c| if l.is_empty() { c.into() } else { format!("{l}.{c}") }))
        .collect()
}

fn mapped(layers: &[&str], options: &MapOptions) -> Result<Vec<Mapping>, quell_frames::Error> {
    let folder = Folder::new(&format!("names-{}", layers.join("-").len()));
    let names = rgb(layers);
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    map_roles(&[(String::new(), &with_channels(&folder, &names))], options)
}

#[test]
fn names_match_from_the_right_without_case_and_groups_keep_their_names() {
    let default = MapOptions::default();
    let m = &mapped(&["", "shot.x.DIFFUSE_INDIRECT", "Anything.SpecularDirect", "q.Roughness"], &default).unwrap()[0];
    assert_eq!(m.get(Role::MatteIndirect).unwrap().name, "shot.x.DIFFUSE_INDIRECT");
    assert_eq!(m.get(Role::GlossyDirect).unwrap().name, "Anything.SpecularDirect");
    assert_eq!(m.get(Role::Roughness).unwrap().channels.len(), 1);
    assert_eq!(m.layer, "");

    let layers = ["View A.Combined", "View A.Combined_key light", "View A.CryptoObject00", "View A.DiffCol"];
    let m = &mapped(&layers, &default).unwrap()[0];
    assert_eq!(m.layer, "View A");
    assert_eq!(m.get(Role::Beauty).unwrap().name, "View A.Combined");
    assert_eq!(m.get(Role::LightGroup).unwrap().name, "View A.Combined_key light");
    assert_eq!(m.get(Role::Cryptomatte).unwrap().name, "View A.CryptoObject00");

    // Two layers, each with its own picture; the compositor's result stays out.
    let layers = ["A.Combined", "A.DiffCol", "B.Combined", "B.DiffCol", "Composite.Combined"];
    let two = mapped(&layers, &default).unwrap();
    assert_eq!(two.iter().map(|m| m.layer.as_str()).collect::<Vec<_>>(), ["A", "B"]);
    let one = mapped(&layers, &MapOptions { layer: Some("B".into()), ..default.clone() }).unwrap();
    assert_eq!(one, two[1..]);
    let error = mapped(&layers, &MapOptions { layer: Some("C".into()), ..default.clone() }).unwrap_err().to_string();
    assert!(error.contains("`A`") && error.contains("`B`"), "{error}");

    // What Blender 5.2 adds to its denoising data is known, and is neither the picture nor light.
    let data =
        ["Denoising Albedo", "Denoising Normal", "Denoising Specular Albedo", "Denoising Roughness", "Denoising Depth"];
    let layers: Vec<String> = ["Noisy Image"].iter().chain(&data).map(|name| format!("ViewLayer.{name}")).collect();
    let m = &mapped(&layers.iter().map(String::as_str).collect::<Vec<_>>(), &default).unwrap()[0];
    let expected = [
        "beauty=ViewLayer.Noisy Image/3",
        "seen_albedo=ViewLayer.Denoising Albedo/3",
        "seen_normal=ViewLayer.Denoising Normal/3",
        "seen_depth=ViewLayer.Denoising Depth/1",
        "roughness=ViewLayer.Denoising Roughness/1",
        "steady_part=ViewLayer.Denoising Specular Albedo/3",
    ];
    assert_eq!((m.renderer.name.as_str(), lines(m)), ("blender", expected.map(String::from).to_vec()));
    assert_eq!(m.others, Vec::<String>::new());

    // A picture under a name of the user's own.
    let m = &mapped(&["my render", "albedo"], &default).unwrap()[0];
    assert_eq!(m.get(Role::Beauty).unwrap().name, "my render");
}

#[test]
fn the_users_word_comes_first_and_what_is_ambiguous_or_unknown_is_an_error() {
    let asks =
        |wishes: &[&str]| MapOptions { map: wishes.iter().map(|w| (*w).to_owned()).collect(), ..Default::default() };
    let error = mapped(&["", "x.albedo", "y.albedo"], &asks(&[])).unwrap_err().to_string();
    assert!(error.contains("`x.albedo`") && error.contains("`y.albedo`") && error.contains("--map albedo="), "{error}");
    let m = &mapped(&["", "x.albedo", "y.albedo"], &asks(&["albedo=y.albedo"])).unwrap()[0];
    assert_eq!(m.get(Role::Albedo).unwrap().name, "y.albedo");
    let m = &mapped(&["", "odd", "albedo"], &asks(&["glossy-color=odd.R,odd.G,odd.B", "albedo=none"])).unwrap()[0];
    assert_eq!(m.get(Role::GlossyColour).unwrap().channels.len(), 3);
    assert!(m.get(Role::Albedo).is_none());
    for (wish, words) in [
        ("sparkle=odd", &["`sparkle`", "beauty", "roughness"][..]),
        ("albedo=nothing", &["`nothing`", "`odd`"]),
        ("normal=odd.R", &["normal", "3"]),
        ("albedo", &["ROLE=CHANNEL"]),
    ] {
        let error = mapped(&["", "odd"], &asks(&[wish])).unwrap_err().to_string();
        assert!(words.iter().all(|w| error.contains(w)) && error.contains("names.exr"), "{error}");
    }
    let error = mapped(&["albedo", "normal"], &asks(&[])).unwrap_err().to_string();
    assert!(error.contains("no beauty") && error.contains("`albedo`"), "{error}");
}
