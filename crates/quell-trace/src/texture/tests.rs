//! Decoding, levels of detail, wrapping and transforms.

use super::*;
use std::io::Cursor;

fn checker(width: usize, height: usize) -> Image {
    let texel =
        |i: usize| if (i % width + i / width).is_multiple_of(2) { [255, 255, 255, 255] } else { [0, 0, 0, 255] };
    Image::new(width, height, (0..width * height).map(texel).collect()).unwrap()
}

fn encoded(format: image::ImageFormat, width: u32, height: u32) -> Vec<u8> {
    let picture =
        image::RgbaImage::from_fn(width, height, |x, y| image::Rgba([(x * 16) as u8, (y * 16) as u8, 7, 128]));
    let mut bytes = Cursor::new(Vec::new());
    let picture = image::DynamicImage::ImageRgba8(picture);
    let written = match format {
        image::ImageFormat::Jpeg => image::DynamicImage::ImageRgb8(picture.to_rgb8()).write_to(&mut bytes, format),
        _ => picture.write_to(&mut bytes, format),
    };
    written.unwrap();
    bytes.into_inner()
}

#[test]
fn png_jpeg_and_webp_are_read() {
    for format in [image::ImageFormat::Png, image::ImageFormat::Jpeg, image::ImageFormat::WebP] {
        let image = decode(&encoded(format, 12, 7), Limits::default()).unwrap();
        assert_eq!((image.width(), image.height()), (12, 7));
        let jpeg = format == image::ImageFormat::Jpeg;
        assert_eq!(image.is_opaque(), jpeg, "{format:?}");
        let at = image.sample(Vec2::new(10.5 / 12.0, 2.5 / 7.0), 0.0, &Sampler::default(), Encoding::Linear) * 255.0;
        let slack = if jpeg { 12.0 } else { 0.01 };
        assert!((at.x - 160.0).abs() < slack && (at.y - 32.0).abs() < slack, "{format:?}: {at}");
    }
}

#[test]
fn bad_files_are_errors_with_what_to_do() {
    let png = encoded(image::ImageFormat::Png, 12, 7);
    assert!(matches!(decode(b"not an image", Limits::default()), Err(TextureError::Format)));
    assert!(matches!(decode(&[], Limits::default()), Err(TextureError::Format)));
    for format in [image::ImageFormat::Png, image::ImageFormat::Jpeg, image::ImageFormat::WebP] {
        let whole = encoded(format, 12, 7);
        for cut in 0..whole.len() {
            // Some decoders forgive a missing tail; none may panic.
            let _ = decode(&whole[..cut], Limits::default());
        }
    }
    for limits in [
        Limits { extent: 11, ..Limits::default() },
        Limits { pixels: 83, ..Limits::default() },
        Limits { bytes: 600, ..Limits::default() },
    ] {
        let error = decode(&png, limits).unwrap_err();
        assert!(matches!(error, TextureError::TooLarge { width: 12, height: 7, .. }), "{limits:?}: {error}");
        assert!(error.to_string().contains("scale it down"));
    }
    // A header that promises 60000 x 60000 is refused before anything is allocated.
    let mut lying = png.clone();
    lying[16..24].copy_from_slice(&[0, 0, 0xea, 0x60, 0, 0, 0xea, 0x60]);
    assert!(decode(&lying, Limits::default()).is_err());
    assert!(matches!(Image::new(2, 2, vec![[0; 4]; 3]), Err(TextureError::Extent { texels: 3, .. })));
}

#[test]
fn levels_keep_the_mean_in_linear_light() {
    for (width, height) in [(64, 64), (37, 19), (1, 5), (3, 1), (1, 1), (100, 7)] {
        let image = checker(width, height);
        let white = (0..width * height).filter(|i| (i % width + i / width).is_multiple_of(2)).count();
        let mean = white as f32 / (width * height) as f32;
        for encoding in [Encoding::Srgb, Encoding::Linear] {
            let coarse = image.sample(Vec2::new(0.3, 0.8), 99.0, &Sampler::default(), encoding).x;
            assert!((coarse - mean).abs() < 6e-3, "{width} x {height}, {encoding:?}: {coarse} against {mean}");
        }
    }
    // Canary: averaged codes of sRGB would have been 0.21.
    let wrong = LevelMean::of_codes(&checker(8, 8));
    assert!((wrong - 0.5).abs() > 0.2);
}

/// What levels would be if they averaged the stored codes.
struct LevelMean;

impl LevelMean {
    fn of_codes(image: &Image) -> f32 {
        let mean = image.sample(Vec2::ZERO, 99.0, &Sampler::default(), Encoding::Linear).x;
        ((mean + 0.055) / 1.055).powf(2.4)
    }
}

#[test]
fn a_footprint_of_two_texels_sees_no_checker() {
    let image = checker(64, 64);
    for i in 0..100 {
        let uv = Vec2::new(0.123 * i as f32, 0.0791 * i as f32);
        let seen = image.sample(uv, 1.0, &Sampler::default(), Encoding::Srgb).x;
        assert!((seen - 0.5).abs() < 5e-3, "{uv}: {seen}");
    }
    let (dark, bright) = (Vec2::new(1.5, 0.5) / 64.0, Vec2::new(0.5, 0.5) / 64.0);
    assert_eq!(image.sample(dark, 0.0, &Sampler::default(), Encoding::Srgb).x, 0.0);
    assert!((image.sample(bright, 0.0, &Sampler::default(), Encoding::Srgb).x - 1.0).abs() < 1e-6);
}

#[test]
fn edges_repeat_mirror_and_clamp() {
    let ramp = Image::new(4, 1, [0, 85, 170, 255].map(|v| [v, v, v, 255]).to_vec()).unwrap();
    let at = |wrap, texel: f32| {
        let sampler = Sampler { wrap_s: wrap, mag: Filter::Nearest, ..Sampler::default() };
        (ramp.sample(Vec2::new((texel + 0.5) / 4.0, 0.5), 0.0, &sampler, Encoding::Linear).x * 3.0).round()
    };
    for (texel, repeated, mirrored, clamped) in [
        (0.0, 0.0, 0.0, 0.0),
        (3.0, 3.0, 3.0, 3.0),
        (4.0, 0.0, 3.0, 3.0),
        (5.0, 1.0, 2.0, 3.0),
        (-1.0, 3.0, 0.0, 0.0),
        (-2.0, 2.0, 1.0, 0.0),
    ] {
        assert_eq!(at(Wrap::Repeat, texel), repeated, "{texel}");
        assert_eq!(at(Wrap::Mirror, texel), mirrored, "{texel}");
        assert_eq!(at(Wrap::Clamp, texel), clamped, "{texel}");
    }
    for uv in [Vec2::NAN, Vec2::INFINITY, Vec2::splat(1e30), Vec2::splat(-1e30)] {
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            let sampler = Sampler { wrap_s: wrap, wrap_t: wrap, ..Sampler::default() };
            assert!(ramp.sample(uv, f32::NAN, &sampler, Encoding::Srgb).is_finite());
        }
    }
}

#[test]
fn transforms_follow_the_examples_of_the_extension() {
    // "utilizes only the lower left quadrant of the source image, rotated clockwise 90 degrees"
    let quadrant =
        Transform { offset: Vec2::new(0.0, 1.0), rotation: std::f32::consts::FRAC_PI_2, scale: Vec2::splat(0.5) };
    for (uv, expected) in [
        (Vec2::ZERO, Vec2::new(0.0, 1.0)),
        (Vec2::X, Vec2::new(0.0, 0.5)),
        (Vec2::Y, Vec2::new(0.5, 1.0)),
        (Vec2::ONE, Vec2::new(0.5, 0.5)),
    ] {
        assert!((quadrant.apply(uv) - expected).length() < 1e-6, "{uv} becomes {}", quadrant.apply(uv));
    }
    // "inverts the T axis"
    let flipped = Transform { offset: Vec2::Y, rotation: 0.0, scale: Vec2::new(1.0, -1.0) };
    assert_eq!(flipped.apply(Vec2::new(0.3, 0.2)), Vec2::new(0.3, 0.8));
    assert_eq!(Transform::default().apply(Vec2::new(0.3, 0.2)), Vec2::new(0.3, 0.2));
}
