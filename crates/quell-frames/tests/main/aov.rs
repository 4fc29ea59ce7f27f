//! Files of other renderers are read as the reference library reads them: `expect.json` holds what it read.

use crate::shared_frames;
use quell_frames::{SampleKind, read_channels, read_headers, read_image};
use serde_json::Value;
use std::path::Path;

fn window(value: &Value) -> [i64; 4] {
    std::array::from_fn(|i| value[i].as_i64().unwrap())
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| match value.as_str() {
        Some("inf") => f64::INFINITY,
        Some("-inf") => f64::NEG_INFINITY,
        _ => f64::NAN,
    })
}

pub fn expectations(frames: &Path) -> serde_json::Map<String, Value> {
    let text = std::fs::read_to_string(frames.join("exr_aov/expect.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

#[test]
fn files_of_other_renderers_read_as_the_reference_library_reads_them() {
    let Some(frames) = shared_frames() else { return };
    let mut channels_seen = 0;
    for (name, parts) in expectations(&frames) {
        let path = frames.join("exr_aov").join(&name);
        let image = read_image(&path).unwrap();
        let parts = parts.as_array().unwrap();
        assert_eq!(image.parts().len(), parts.len(), "{name}");
        for (part, expected) in image.parts().iter().zip(parts) {
            let at = format!("{name} {}", part.name());
            assert_eq!(part.name(), expected["name"].as_str().unwrap(), "{at}");
            assert_eq!(part.view().unwrap_or_default(), expected["view"].as_str().unwrap(), "{at}");
            assert_eq!(part.tiles().is_some(), expected["type"] == "tiledimage", "{at}");
            assert_eq!(
                format!("{}_COMPRESSION", part.compression()).replace("NONE", "NO"),
                expected["compression"],
                "{at}"
            );
            assert_eq!(part.bottom_up(), expected["lineOrder"] == "DECREASING_Y", "{at}");
            for (found, expected) in
                [(part.data_window(), &expected["dataWindow"]), (image.display_window(), &expected["displayWindow"])]
            {
                let [x, y, right, bottom] = window(expected);
                assert_eq!([i64::from(found.x), i64::from(found.y)], [x, y], "{at}");
                let size = [found.size.width as i64, found.size.height as i64];
                assert_eq!(size, [right - x + 1, bottom - y + 1], "{at}");
            }
            let channels = expected["channels"].as_object().unwrap();
            assert_eq!(part.channels().len(), channels.len(), "{at}");
            for channel in part.channels() {
                let at = format!("{at} {}", channel.name());
                let expected = &channels[channel.name()];
                assert_eq!(channel.kind().name(), expected["type"].as_str().unwrap(), "{at}");
                let samples = channel.samples().unwrap();
                let values: Vec<f64> = samples.to_f32().into_iter().map(f64::from).collect();
                // DWA's inverse transform is floating point: libraries differ in the last bits of a half.
                let lossy = part.compression().starts_with("DWA");
                let near = |found: f64, expected: f64, relative: f64| {
                    let slack = if lossy { 2e-3 * expected.abs() + 2e-3 } else { relative * expected.abs() };
                    // (JSON's last digit: what is compared are the floats.)
                    assert!(
                        (found - expected).abs() <= slack || found as f32 == expected as f32,
                        "{at}: {found} is not {expected}"
                    );
                };
                near(values.iter().copied().fold(f64::INFINITY, f64::min), number(&expected["min"]), 0.0);
                near(values.iter().copied().fold(f64::NEG_INFINITY, f64::max), number(&expected["max"]), 0.0);
                let sum: f64 = values.iter().sum();
                near(sum / values.len() as f64, number(&expected["mean"]), 1e-9);
                let origin = part.data_window();
                for pixel in expected["pixels"].as_array().unwrap() {
                    let x = (pixel[0].as_i64().unwrap() - i64::from(origin.x)) as usize;
                    let y = (pixel[1].as_i64().unwrap() - i64::from(origin.y)) as usize;
                    near(f64::from(samples.get(y * origin.size.width + x)), number(&pixel[2]), 0.0);
                }
                channels_seen += 1;
            }
        }
    }
    assert!(channels_seen > 300, "{channels_seen}");
}

#[test]
fn chosen_channels_are_those_of_the_whole_file_and_nothing_else_is_kept() {
    let Some(frames) = shared_frames() else { return };
    for name in expectations(&frames).keys() {
        let path = frames.join("exr_aov").join(name);
        let all = read_image(&path).unwrap();
        let headers = read_headers(&path).unwrap();
        assert!(headers.parts().iter().flat_map(|p| p.channels()).all(|c| c.samples().is_none()));
        let floats = read_channels(&path, |_, channel| channel.kind() == SampleKind::Float).unwrap();
        let mut later = headers.clone();
        later.load(|_, channel| channel.kind() == SampleKind::Float).unwrap();
        for (p, part) in all.parts().iter().enumerate() {
            for (c, channel) in part.channels().iter().enumerate() {
                let expected = (channel.kind() == SampleKind::Float).then(|| channel.samples().unwrap());
                assert!(floats.samples(p, c) == expected, "{name} {}", channel.name());
                assert!(later.samples(p, c) == expected, "{name} {}", channel.name());
            }
        }
    }
}
