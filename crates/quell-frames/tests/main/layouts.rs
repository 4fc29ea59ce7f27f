//! `hall` as different versions of Blender lay it out: long names in many parts, short names in one part, a file a pass.
//! Whole jobs, whose passes add up.

use crate::adapt::off;
use crate::made::{Value, write};
use crate::{Folder, shared_frames};
use quell_frames::driver::{Destination, Existing, Fate, Job, JobOptions};
use quell_frames::{AdaptOptions, Adapter, ExrImage, MapOptions, Samples, find_sequence, map_roles, read_image};
use std::fs;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// Of the frames of hall, as wide and high as is kept.
const SIZE: (usize, usize) = (80, 45);
const FRAMES: u32 = 3;

/// Long names (Blender 5) and short ones (4.5 and before).
const NAMES: [(&str, &str); 15] = [
    ("Combined", "Combined"),
    ("Diffuse Direct", "DiffDir"),
    ("Diffuse Indirect", "DiffInd"),
    ("Diffuse Color", "DiffCol"),
    ("Glossy Direct", "GlossDir"),
    ("Glossy Indirect", "GlossInd"),
    ("Glossy Color", "GlossCol"),
    ("Transmission Direct", "TransDir"),
    ("Transmission Indirect", "TransInd"),
    ("Transmission Color", "TransCol"),
    ("Emission", "Emit"),
    ("Environment", "Env"),
    ("Normal", "Normal"),
    ("Depth", "Depth"),
    ("Vector", "Vector"),
];

/// Short name, component, samples.
type Channels = Vec<(&'static str, String, Samples)>;

fn channels(image: &ExrImage) -> Channels {
    let parts = image.parts().iter().flat_map(|part| {
        let short = part.name().rsplit('.').next().and_then(|long| NAMES.iter().find(|n| n.0 == long)).map(|n| n.1);
        part.channels()
            .iter()
            .filter_map(move |c| Some((short?, c.name().rsplit('.').next()?.to_owned(), c.samples()?.clone())))
    });
    parts.collect()
}

fn made(folder: &Folder, name: &str, width: usize, channels: &[(String, &Samples)]) {
    // The middle of the picture, where there is some of everything.
    let at = |samples: &Samples, x: usize, y: usize| samples.get((y + 100) * width + x + 150);
    let values: Vec<_> =
        channels.iter().map(|(_, samples)| move |x: usize, y: usize| at(samples, x, y).min(65504.0)).collect();
    let names = channels.iter().map(|(name, _)| name.as_str());
    let list: Vec<(&str, Value<'_>)> = names.zip(values.iter().map(|value| value as Value<'_>)).collect();
    write(folder, name, SIZE, &list);
}

#[test]
fn passes_of_hall_add_up_in_every_layout() {
    let Some(frames) = shared_frames() else { return };
    let folder = Folder::new("layouts");
    for layout in ["single", "files", "parts"] {
        fs::create_dir_all(folder.file(layout)).unwrap();
    }
    for number in 1..=FRAMES {
        let path = frames.join(format!("hall/noisy/hall.{number:04}.exr"));
        let image = read_image(&path).unwrap();
        let (width, channels) = (image.display_window().size.width, channels(&image));
        assert_eq!(channels.len(), 13 * 3 + 1 + 1 + 4, "{channels:?}");
        let all: Vec<(String, &Samples)> =
            channels.iter().map(|(short, c, samples)| (format!("ViewLayer.{short}.{c}"), samples)).collect();
        made(&folder, &format!("single/hall.{number:04}.exr"), width, &all);
        for short in NAMES.map(|n| n.1) {
            let of_pass = channels.iter().filter(|c| c.0 == short);
            let of_pass: Vec<(String, &Samples)> = of_pass.map(|(_, c, samples)| (c.clone(), samples)).collect();
            made(&folder, &format!("files/hall.{short}.{number:04}.exr"), width, &of_pass);
        }
        if number < FRAMES {
            fs::copy(&path, folder.file(&format!("parts/hall.{number:04}.exr"))).unwrap();
        }
    }
    let mut beauties = Vec::new();
    for (layout, count) in [("single", FRAMES), ("files", FRAMES), ("parts", FRAMES - 1)] {
        let to = format!("{layout}-clean");
        let job = Job::open(JobOptions {
            inputs: vec![folder.file(layout)],
            destination: Destination::parse(&folder.file(&to)).unwrap(),
            existing: Existing::Ours,
            frames: None,
            shot: None,
            cuts: None,
            map: MapOptions::default(),
            adapt: AdaptOptions::default(),
            settings: quell::sequence::SequenceSettings::default(),
            max_memory: None,
            bands: None,
            backend: quell::Backend::default(),
            accelerator: None,
            measure_noise: false,
        })
        .unwrap();
        assert!(!job.notes().iter().any(|note| note.contains("add up")), "{layout}: {:?}", job.notes());
        let outcome = job.run(&AtomicBool::new(false), &|_| {}).unwrap();
        assert!(outcome.frames.iter().all(|(_, fate)| *fate == Fate::Written), "{layout}: {outcome:?}");
        assert_eq!(outcome.written(), count as usize);
        let worst = |from: &Path| {
            let sequence = find_sequence(&[from.to_owned()]).unwrap();
            let files = &sequence.frames[1].files;
            let images: Vec<ExrImage> = files.iter().map(|file| read_image(&file.path).unwrap()).collect();
            let named: Vec<_> = files.iter().map(|file| file.pass.clone()).zip(&images).collect();
            let mapping = map_roles(&named, &MapOptions::default()).unwrap().swap_remove(0);
            let canvas = images[0].full_window();
            let adapter = Adapter::new(mapping, canvas, &images, None, &AdaptOptions::default()).unwrap();
            (off(&adapter, &images), adapter.sum_of_passes(&images).unwrap())
        };
        let (half_roundings, sum) = worst(&folder.file(&to));
        assert!(half_roundings <= 1.01, "{layout}: {half_roundings} half roundings");
        // And something was filtered.
        assert_ne!(worst(&folder.file(layout)).1, sum, "{layout}");
        beauties.push(sum);
    }
    // Names and files change nothing.
    assert_eq!(beauties[0], beauties[1]);
}
