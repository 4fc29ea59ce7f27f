//! Writes one frame with every plane and reads it back: `cargo run -p quell-frames --example 01_write_and_read FILE`.
//!
//! `tests/scripts/check_with_openexr.py FILE` checks the same file against the reference library.

use quell::{Camera, FrameBuf, PassBuf, Plane, Signal, Size};
use quell_frames::{Content, FrameToWrite, Half, Metadata, WriteOptions, read_frame, write_frame};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args_os().nth(1).ok_or("give the path of the file to write")?;
    let path = std::path::Path::new(&path);

    let size = Size::new(40, 22);
    let mut camera = Camera::perspective([1.0, 2.0, 3.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0], 0.8, 40.0 / 22.0);
    camera.jitter = [0.25, -0.125];
    let mut frame = FrameBuf::new(size, camera);
    frame.index = 12;
    let colour = |k: f32| Some(Plane::from_fn(size, |x, y| [x as f32 * k, y as f32 * k, (x + y) as f32 * k]));
    let float = |k: f32| Some(Plane::from_fn(size, |x, y| (x + 100 * y) as f32 * k));
    frame.direct = colour(0.5);
    frame.matte = colour(0.25);
    frame.glossy = colour(0.125);
    frame.matte_weight = colour(0.0625);
    frame.view_depth = Some(Plane::from_fn(size, |x, y| if y == 0 { f32::INFINITY } else { 1.0 + x as f32 }));
    frame.normal = Some(Plane::from_fn(size, |_, y| if y == 0 { [0.0; 3] } else { [0.0, 0.6, 0.8] }));
    frame.motion = Some(Plane::from_fn(size, |x, y| [x as f32 * 0.5, y as f32 * 0.25]));
    frame.roughness = float(0.001);
    frame.glossy_hit_distance = float(2.0);
    frame.matte_hit_distance = float(4.0);
    frame.surface_id = Some(Plane::from_fn(size, |x, y| (x * 70_000 + y) as u32));
    frame.matte_variance = float(0.5);
    frame.passes =
        vec![PassBuf { name: "key light".to_owned(), signal: Signal::Matte, plane: Plane::filled(size, [0.5; 3]) }];
    let confidence = Plane::filled(size, 0.75);
    let half = Plane::filled(size, [0.125; 3]);

    let passes = frame.pass_views();
    let file = FrameToWrite {
        confidence: Some(confidence.view()),
        halves: [Half { matte: Some(half.view()), ..Half::default() }, Half::default()],
        metadata: Metadata {
            content: Content::Noisy,
            scene: "example".to_owned(),
            sampling: "estimator exact, 1 sample a pixel".to_owned(),
            exposure: 1.5,
            ..Metadata::default()
        },
        ..FrameToWrite::new(frame.frame(&passes))
    };
    let written = write_frame(path, &file, &WriteOptions::default())?;
    println!("{} bytes", written.bytes);

    let back = read_frame(path)?;
    assert_eq!(back.frame, frame);
    Ok(())
}
