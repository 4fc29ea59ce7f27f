//! What temporal anti-aliasing of the picture must do: tend to the mean over the pixel, at rest and in motion, keep energy, follow light.

use super::frames::{Noise, Object, Shape, View, box_before_wall, denoise, jittered, mean, moving, rms, run, sequence};
use quell::{Backend, Denoiser, FrameBuf, Plane, Rgb, Settings, Size};

const SIZE: Size = Size::new(72, 44);

fn settings() -> Settings {
    let mut settings = Settings::default().without_denoising();
    settings.antialiasing.enabled = true;
    settings
}

fn sum(frame: &FrameBuf) -> Plane<Rgb> {
    frame.frame(&[]).composite()
}

/// The camera moves; the samples of all frames lie at the place of frame `K`.
fn moving_at<const K: i64>(t: f64) -> View {
    View { jitter: jittered(K as f64).jitter, ..moving(t) }
}

fn moving_jittered(t: f64) -> View {
    View { jitter: jittered(t).jitter, ..moving(t) }
}

fn mean_of(pictures: &[Plane<Rgb>]) -> Plane<Rgb> {
    let share = 1.0 / pictures.len() as f32;
    Plane::from_fn(SIZE, |x, y| {
        [0, 1, 2].map(|c| pictures.iter().map(|picture| picture.at(x, y)[c]).sum::<f32>() * share)
    })
}

#[test]
fn at_rest_it_tends_to_the_mean_over_the_pixel() {
    let mut scene = box_before_wall(jittered, Noise::None);
    scene.objects[2].pose = Box::new(|_| {
        glam::DAffine3::from_translation(glam::DVec3::new(-0.1, 0.2, 0.6)) * glam::DAffine3::from_rotation_z(0.4)
    });
    let frames = sequence(&scene, SIZE, 40);
    // One period of the places.
    let expected = mean_of(&frames[32..].iter().map(sum).collect::<Vec<_>>());
    let all = |_, _| true;
    let aliased = rms(&sum(&frames[39]), &expected, all);
    for backend in [Backend::Cpu, Backend::Reference] {
        let found = run(backend, &settings(), &frames).composite;
        let apart = rms(&found, &expected, all);
        println!("{backend:?}: {apart} for {aliased}");
        assert!(apart < 0.25 * aliased, "{backend:?}: {apart} for {aliased}");
        let energy = mean(&found) / mean(&expected);
        assert!((energy - 1.0).abs() < 2e-3, "{backend:?}: energy {energy}");
    }
}

#[test]
fn in_motion_it_is_nearer_to_the_mean_over_the_pixel() {
    let frames = sequence(&box_before_wall(moving_jittered, Noise::None), SIZE, 24);
    let places: [fn(f64) -> View; 8] = [
        moving_at::<0>,
        moving_at::<1>,
        moving_at::<2>,
        moving_at::<3>,
        moving_at::<4>,
        moving_at::<5>,
        moving_at::<6>,
        moving_at::<7>,
    ];
    let last = places.map(|view| sum(&box_before_wall(view, Noise::None).frame(SIZE, 23)));
    let expected = mean_of(&last);
    let all = |_, _| true;
    let aliased = rms(&sum(&frames[23]), &expected, all);
    let found = run(Backend::Cpu, &settings(), &frames).composite;
    let apart = rms(&found, &expected, all);
    println!("{apart} for {aliased}");
    assert!(apart < 0.8 * aliased, "{apart} for {aliased}");
    let energy = mean(&found) / mean(&expected);
    assert!((energy - 1.0).abs() < 5e-3, "energy {energy}");
}

#[test]
fn without_jitter_and_after_a_cut_the_picture_is_the_sum() {
    let mut frames = sequence(&box_before_wall(jittered, Noise::None), SIZE, 4);
    for backend in [Backend::Cpu, Backend::Reference] {
        let mut denoiser = Denoiser::with_backend(SIZE, &settings(), backend).unwrap();
        let plain = &Settings::default().without_denoising();
        let mut without = Denoiser::with_backend(SIZE, plain, backend).unwrap();
        for frame in &frames[..3] {
            denoise(&mut denoiser, frame);
        }
        let last = &mut frames[3];
        assert!(denoise(&mut denoiser.clone(), last).composite != denoise(&mut without, last).composite);
        // History is forgotten; a frame without jitter forgets it, too.
        last.index = 9;
        assert!(denoise(&mut denoiser.clone(), last).composite == denoise(&mut without, last).composite);
        let (index, jitter, jitter_before) = (3, last.camera.jitter, last.previous_camera.jitter);
        last.index = index;
        // A pattern may hold the centre itself: the frame before was jittered.
        last.camera.jitter = [0.0; 2];
        assert!(denoise(&mut denoiser.clone(), last).composite != denoise(&mut without, last).composite);
        last.previous_camera.jitter = [0.0; 2];
        assert!(denoise(&mut denoiser, last).composite == denoise(&mut without, last).composite);
        (last.index, last.camera.jitter) = (index + 1, jitter);
        assert!(denoise(&mut denoiser, last).composite == denoise(&mut without, last).composite);
        (last.index, last.previous_camera.jitter) = (index, jitter_before);
    }
}

#[test]
fn a_stage_that_was_off_begins_anew() {
    let frames = sequence(&box_before_wall(jittered, Noise::None), SIZE, 7);
    let (on, off) = (settings(), Settings::default().without_denoising());
    for backend in [Backend::Cpu, Backend::Reference] {
        let mut denoiser = Denoiser::with_backend(SIZE, &settings(), backend).unwrap();
        let mut fresh = Denoiser::with_backend(SIZE, &settings(), backend).unwrap();
        for (i, frame) in frames.iter().enumerate() {
            denoiser.set_settings(if (3..5).contains(&i) { &off } else { &on }).unwrap();
            let found = denoise(&mut denoiser, frame).composite;
            match i {
                3 | 4 => assert!(found == sum(frame), "{backend:?} {i}"),
                5 | 6 => assert!(found == denoise(&mut fresh, frame).composite, "{backend:?} {i}"),
                _ => {}
            }
        }
    }
}

/// Bars half a pixel wide across the wall, which move by so much a frame.
fn wires(speed: f64) -> Vec<FrameBuf> {
    let mut scene = box_before_wall(jittered, Noise::None);
    let wall = scene.objects.swap_remove(0);
    scene.objects.clear();
    scene.objects.push(wall);
    for i in 0..5 {
        scene.objects.push(Object {
            shape: Shape::Box(glam::DVec3::new(0.009, 1.5, 0.009)),
            id: 10 + i,
            roughness: 0.5,
            pose: Box::new(move |t| {
                let turn = glam::DAffine3::from_rotation_z(0.1 * f64::from(i) + 0.1);
                glam::DAffine3::from_translation(glam::DVec3::new(0.3 * f64::from(i) - 0.6 + speed * t, 0.0, 1.2))
                    * turn
            }),
            light: |_, _| [4.0; 3],
        });
    }
    sequence(&scene, SIZE, 40)
}

/// The clamp keeps the wires that no sample of 3x3 pixels hit.
#[test]
fn wires_that_samples_miss_stay_whole() {
    let frames = wires(0.0);
    let expected = mean_of(&frames[32..].iter().map(sum).collect::<Vec<_>>());
    let mut clamped = settings();
    clamped.antialiasing.thin_radius = 0;
    let all = |_, _| true;
    for backend in [Backend::Cpu, Backend::Reference] {
        let found = run(backend, &settings(), &frames).composite;
        let dotted = rms(&run(backend, &clamped, &frames).composite, &expected, all);
        let apart = rms(&found, &expected, all);
        println!("{backend:?}: {apart} for {dotted}, energy {}", mean(&found) / mean(&expected));
        assert!(apart < 0.6 * dotted, "{backend:?}: {apart} for {dotted}");
    }
}

/// What moves is kept where it is now, not where it was.
#[test]
fn wires_that_move_leave_no_copies() {
    let frames = wires(0.045);
    let brighter = |picture: &Plane<Rgb>| {
        // Light beyond that of the frame's own samples, one pixel to either side.
        let now = sum(&frames[39]);
        Plane::from_fn(SIZE, |x, y| {
            let beside = x.saturating_sub(1)..(x + 2).min(SIZE.width);
            let most = beside.map(|x| now.at(x, y)[0]).fold(0.0, f32::max);
            [(picture.at(x, y)[0] - 1.05 * most).max(0.0); 3]
        })
    };
    let mut clamped = settings();
    clamped.antialiasing.thin_radius = 0;
    let mut copied = settings();
    copied.antialiasing.thin_motion = 16.0;
    let [held, kept, copies] =
        [clamped, settings(), copied].map(|s| mean(&brighter(&run(Backend::Cpu, &s, &frames).composite)));
    println!("{kept}; with 3x3 pixels alone {held}, with whatever moves {copies}");
    assert!(kept < 1.2 * held + 1e-3, "{kept} for {held}");
    assert!(copies > 2.0 * kept, "{copies} for {kept}: the case shows nothing");
}

/// Lamps that switch leave no trail: the clamp holds history to what the new frame shows, and it counts fewer frames.
#[test]
fn light_that_switches_is_followed_at_once() {
    let mut frames = sequence(&box_before_wall(jittered, Noise::None), SIZE, 24);
    for frame in &mut frames[20..] {
        let scaled = |plane: &mut Option<Plane<Rgb>>| {
            for colour in plane.iter_mut().flat_map(|plane| plane.data_mut()) {
                *colour = colour.map(|v| 0.2 * v);
            }
        };
        scaled(&mut frame.matte);
        scaled(&mut frame.glossy);
        scaled(&mut frame.direct);
    }
    let expected = mean(&mean_of(&frames[20..].iter().map(sum).collect::<Vec<_>>()));
    let found = mean(&run(Backend::Cpu, &settings(), &frames[..21]).composite);
    assert!((found / expected - 1.0).abs() < 0.1, "{found} for {expected}");
    let found = mean(&run(Backend::Cpu, &settings(), &frames).composite);
    assert!((found / expected - 1.0).abs() < 0.02, "{found} for {expected}");
}

/// Where motion is unknown the new frame counts alone.
#[test]
fn unknown_motion_takes_the_new_frame() {
    let mut frames = sequence(&box_before_wall(jittered, Noise::None), SIZE, 6);
    frames[5].motion.as_mut().unwrap().data_mut().fill([f32::NAN; 2]);
    for backend in [Backend::Cpu, Backend::Reference] {
        let found = run(backend, &settings(), &frames).composite;
        assert!(found == sum(&frames[5]), "{backend:?}");
    }
}
