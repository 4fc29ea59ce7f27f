//! quell's filter of whole sequences: `quell:sequence` or `quell:sequence-short`, then any number of `+stage.parameter=value`.
//!
//! The filter of `quell denoise`, on the same frames and feature buffers as the others get, with the world positions that
//! follow from depth and camera. It sees the frames after each one, too: its first picture comes when that many frames are in.

use super::{FinishedPicture, Input, Method};
use crate::backend::Backend;
use crate::error::Error;
use quell::sequence::{Filtered, Light, LightKind, SequenceDenoiser, SequenceFrame, SequencePreset, SequenceSettings};
use quell::{Frame, Plane, PlaneRef, Rgb};
use std::sync::Arc;

/// The sequence filter, on the fast back end of the CPU unless another is asked for.
pub struct Sequence {
    variant: String,
    settings: SequenceSettings,
    backend: Backend,
    denoiser: Option<SequenceDenoiser>,
}

impl Sequence {
    /// `variant` is what follows `quell:`; `None` where it names another preset.
    ///
    /// # Errors
    /// [`Error::Quell`] for a parameter that does not exist or has a value out of its range.
    pub fn parse(variant: &str) -> Result<Option<Self>, Error> {
        let mut parts = variant.split('+');
        let Ok(preset) = parts.next().unwrap_or_default().parse::<SequencePreset>() else {
            return Ok(None);
        };
        let mut settings = SequenceSettings::preset(preset);
        for part in parts {
            let (name, value) = part.split_once('=').ok_or_else(|| Error::UnknownMethod {
                name: part.to_owned(),
                nearest: vec!["sequence+stage.parameter=value".to_owned()],
            })?;
            settings.set(name, value)?;
        }
        let backend = Backend::Cpu(quell::Backend::Cpu);
        Ok(Some(Self { variant: variant.to_owned(), settings, backend, denoiser: None }))
    }

    /// The same on another back end.
    #[must_use]
    pub fn on(self, backend: &Backend) -> Self {
        Self { backend: backend.clone(), denoiser: None, ..self }
    }

    fn made(&self) -> Result<SequenceDenoiser, Error> {
        let settings = self.settings.clone();
        Ok(match self.backend.accelerator()? {
            Some(accelerator) => SequenceDenoiser::with_accelerator(settings, accelerator)?,
            None => SequenceDenoiser::with_backend(settings, self.backend.on_this_processor())?,
        })
    }
}

impl Method for Sequence {
    fn name(&self) -> String {
        format!("quell:{}", self.variant)
    }

    fn reset(&mut self) {
        self.denoiser = None;
    }

    fn ran_on(&self) -> Option<(&'static str, String)> {
        let adapter = self.backend.adapter()?;
        Some((self.backend.name(), format!("quell:{} ran on {adapter} and this processor.", self.variant)))
    }

    fn looks_ahead(&self) -> bool {
        true
    }

    /// The frame alone, without any other.
    fn denoise(&mut self, input: &Input<'_>) -> Result<Plane<Rgb>, Error> {
        let mut alone = self.made()?;
        alone.push(sequence_frame(input.frame)?, true)?;
        let filtered = alone.finish()?;
        filtered.first().map(picture).ok_or_else(|| Error::Empty { what: "the filter gave no frame".to_owned() })
    }

    fn push(&mut self, input: &Input<'_>) -> Result<Vec<FinishedPicture>, Error> {
        if self.denoiser.is_none() {
            self.denoiser = Some(self.made()?);
        }
        let Some(denoiser) = &mut self.denoiser else { return Ok(Vec::new()) };
        Ok(finished(denoiser.push(sequence_frame(input.frame)?, true)?))
    }

    fn finish(&mut self) -> Result<Vec<FinishedPicture>, Error> {
        let rest = self.denoiser.take().map(|mut denoiser| denoiser.finish()).transpose()?;
        Ok(finished(rest.unwrap_or_default()))
    }
}

fn finished(filtered: Vec<Filtered>) -> Vec<FinishedPicture> {
    filtered.iter().map(|frame| FinishedPicture { number: frame.number, picture: picture(frame) }).collect()
}

/// The sum of light * weight.
fn picture(filtered: &Filtered) -> Plane<Rgb> {
    let size = filtered.confidence.size();
    Plane::from_fn(size, |x, y| {
        filtered.lights.iter().fold([0.0; 3], |sum, light| {
            let value = light.planes.first().map_or([0.0; 3], |plane| plane.at(x, y));
            let weight = light.weight.as_ref().map_or([1.0; 3], |weight| weight.at(x, y));
            std::array::from_fn(|c| sum[c] + value[c] * weight[c])
        })
    })
}

/// A frame of the real-time contract as one of the sequence filter's.
fn sequence_frame(frame: &Frame<'_>) -> Result<SequenceFrame, Error> {
    fn owned<T: Copy>(plane: PlaneRef<'_, T>) -> Plane<T> {
        Plane::from_fn(plane.size(), |x, y| plane.at(x, y))
    }
    let mut out = SequenceFrame::new(frame.index, frame.size);
    let weights = [frame.matte_weight, frame.glossy_weight].map(|w| w.map(|w| Arc::new(owned(w))));
    for (name, kind, light, weight) in [
        ("matte", LightKind::MatteIndirect, frame.matte, &weights[0]),
        ("glossy", LightKind::GlossyIndirect, frame.glossy, &weights[1]),
        ("direct_matte", LightKind::MatteDirect, frame.direct_matte, &weights[0]),
        ("direct_glossy", LightKind::GlossyDirect, frame.direct_glossy, &weights[1]),
        ("direct", LightKind::NoiseFree, frame.direct, &None),
    ] {
        let Some(light) = light else { continue };
        out.lights.push(Light { weight: weight.clone(), ..Light::new(name, kind, owned(light)) });
    }
    out.depth = frame.view_depth.map(owned);
    out.normal = frame.normal.map(owned);
    out.motion_to_previous = frame.motion.map(owned);
    out.roughness = frame.roughness.map(owned);
    if let Some(depth) = frame.view_depth {
        let view = frame.camera.projection(frame.size).ok_or(quell::Error::Camera { which: "camera" })?;
        let [dx, dy] = frame.camera.jitter;
        out.position = Some(Plane::from_fn(frame.size, |x, y| {
            let pixel = [x as f32 + 0.5 + dx, y as f32 + 0.5 + dy];
            let z = depth.at(x, y);
            if z.is_finite() { view.world(pixel.into(), z).to_array() } else { [0.0; 3] }
        }));
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use quell::{Camera, FrameBuf, Size};

    const SIZE: Size = Size::new(24, 16);

    /// A grey wall under noise, seen by a camera that stands.
    fn frame(t: i64) -> FrameBuf {
        let camera = Camera::perspective([0.0, 0.0, 4.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0], 0.8, 1.5);
        let mut frame = FrameBuf::new(SIZE, camera);
        frame.index = t;
        // Independent: a linear congruence would be a ramp along some diagonal, which is no noise.
        let noise = |x: usize, y: usize| {
            let mut h = x as u64 | (y as u64) << 16 | (t as u64) << 32;
            for _ in 0..3 {
                h = (h ^ (h >> 31)).wrapping_mul(0x9E37_79B9_7F4A_7C15);
            }
            (h >> 40) as f32 / (1u64 << 23) as f32
        };
        frame.matte = Some(Plane::from_fn(SIZE, |x, y| [noise(x, y); 3]));
        frame.matte_weight = Some(Plane::filled(SIZE, [0.5; 3]));
        frame.direct = Some(Plane::filled(SIZE, [0.25; 3]));
        frame.view_depth = Some(Plane::filled(SIZE, 4.0));
        frame.normal = Some(Plane::filled(SIZE, [0.0, 0.0, 1.0]));
        frame.motion = Some(Plane::filled(SIZE, [0.0; 2]));
        frame
    }

    fn error(picture: &Plane<Rgb>) -> f32 {
        picture.data().iter().map(|c| (c[0] - 0.75).powi(2)).sum::<f32>() / SIZE.pixels() as f32
    }

    #[test]
    fn every_frame_comes_out_once_in_order_and_clean() {
        let mut method = Sequence::parse("sequence+gather.frames=2").unwrap().unwrap();
        let frames: Vec<FrameBuf> = (5..12).map(frame).collect();
        let mut out = Vec::new();
        for frame in &frames {
            out.extend(method.push(&Input { frame: &frame.frame(&[]), halves: None }).unwrap());
        }
        // It looks ahead.
        assert!(out.len() < frames.len());
        out.extend(method.finish().unwrap());
        assert_eq!(out.iter().map(|f| f.number).collect::<Vec<_>>(), (5..12).collect::<Vec<_>>());
        for (finished, frame) in out.iter().zip(&frames) {
            let (clean, noisy) = (error(&finished.picture), error(&frame.composite()));
            assert!(clean * 20.0 < noisy, "{clean} of {noisy}");
        }
        let alone: f32 =
            frames.iter().map(|f| error(&method.denoise(&Input { frame: &f.frame(&[]), halves: None }).unwrap())).sum();
        let together: f32 = out.iter().map(|finished| error(&finished.picture)).sum();
        assert!(alone > together, "{alone} alone, {together} with their neighbours");
    }

    #[test]
    fn parameters_are_its_own() {
        assert!(Sequence::parse("paper").unwrap().is_none());
        assert!(Sequence::parse("sequence+firefly.enabled=off").is_err());
        assert!(Sequence::parse("sequence+no-spatial").is_err());
        let method = Sequence::parse("sequence+wavelet.levels=3").unwrap().unwrap();
        assert_eq!((method.name(), method.settings.wavelet.levels), ("quell:sequence+wavelet.levels=3".to_owned(), 3));
    }
}
