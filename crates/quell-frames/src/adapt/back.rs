//! Filtered light back into the file's passes, by the renderer's own rule, so that they add up.

use super::lights::{NO_GROUP, REST};
use super::planes::{colour, one, scatter};
use super::{Adapter, Error};
use crate::image::ExrImage;
use crate::roles::{ChannelId, Mapped, Mapping, Role};
use quell::sequence::{Light, SequenceFrame};
use quell::{Plane, Rgb};
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::path::Path;

/// What was put into the images.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
pub struct WriteBack {
    /// Passes that were filtered.
    pub filtered: Vec<String>,
    /// Light groups that were filtered and scaled to the filtered beauty.
    pub normalised: Vec<String>,
    /// Values beyond the largest half float, stored as that.
    pub clamped_to_half: usize,
}

impl Adapter {
    /// Replaces every filtered pass in `images`, and the beauty by their sum *as stored*: what is written adds up
    /// within the rounding of the beauty alone. Everything else stays as it is.
    ///
    /// Where passes were chosen, the beauty holds the others as the file has them, so that it is still the sum; without
    /// a light pass among the chosen ones it is filtered whole.
    ///
    /// `lights` are the filtered planes without weight, in the order of `frame.lights`; `alpha` the filtered coverage,
    /// where it is to be written. The images need no samples.
    ///
    /// # Errors
    /// [`Error::Invalid`] where planes and frame do not belong together or a file has changed meanwhile.
    pub fn write_back(
        &self,
        images: &mut [ExrImage],
        frame: &SequenceFrame,
        lights: &[Plane<Rgb>],
        alpha: Option<&Plane<f32>>,
    ) -> Result<WriteBack, Error> {
        let size = self.canvas.size;
        let path = images.first().map_or_else(std::path::PathBuf::new, |image| image.path().to_owned());
        if lights.len() != frame.lights.len() || lights.iter().any(|plane| plane.size() != size) || frame.size != size {
            let reason = format!("{} filtered planes do not belong to {} lights", lights.len(), frame.lights.len());
            return Err(Error::invalid(&path, reason));
        }
        for (file, image) in images.iter_mut().enumerate() {
            if image.full_window().union(self.canvas) != self.canvas {
                image.load(self.reads(file))?;
            }
        }
        let mut report = WriteBack::default();
        let mut beauty = Plane::filled(size, [0.0; 3]);
        let summed = self.sums_what_is_written();
        for (light, plane) in frame.lights.iter().zip(lights).filter(|(light, _)| light.in_beauty) {
            let pass = self.mapping.passes.iter().find(|p| p.role.light().is_some() && p.name == light.name);
            match pass.filter(|_| self.rule.factored && light.name != REST) {
                // The rest, or a beauty that could not be divided into lights.
                None => add(&mut beauty, plane, light.weight.as_deref()),
                Some(pass) if !self.writes(pass) && !summed => add(&mut beauty, plane, light.weight.as_deref()),
                Some(pass) if !self.writes(pass) => {
                    let kept = self.as_it_came(images, pass)?;
                    add(&mut beauty, &kept, light.weight.as_deref().filter(|_| !self.rule.colour_inside));
                }
                Some(pass) if self.rule.colour_inside => {
                    let mut stored = product(plane, light);
                    report.clamped_to_half += scatter(images, pass, self.canvas, &mut stored)?;
                    report.filtered.push(pass.name.clone());
                    add(&mut beauty, &stored, None);
                }
                Some(pass) => {
                    let mut stored = plane.clone();
                    report.clamped_to_half += scatter(images, pass, self.canvas, &mut stored)?;
                    report.filtered.push(pass.name.clone());
                    add(&mut beauty, &stored, light.weight.as_deref());
                }
            }
        }
        self.groups(images, frame, lights, &beauty, &mut report)?;
        for pass in self.mapping.all(Role::Beauty).filter(|pass| summed || self.writes(pass)) {
            let mut stored = beauty.clone();
            report.clamped_to_half += scatter(images, pass, self.canvas, &mut stored)?;
            report.filtered.push(pass.name.clone());
            if let (Some(id), Some(alpha)) = (pass.alpha, alpha.filter(|alpha| alpha.size() == size)) {
                let values = alpha.data().iter().map(|a| [*a]).collect();
                let mut plane =
                    Plane::from_vec(size, values).map_err(|source| Error::Frame { path: path.clone(), source })?;
                report.clamped_to_half += one(images, id, self.canvas, &mut plane, 0)?;
            }
        }
        Ok(report)
    }

    /// True for a pass that is written filtered.
    fn writes(&self, pass: &Mapped) -> bool {
        self.written.as_ref().is_none_or(|names| names.contains(&pass.name))
    }

    /// True where light passes are written filtered: then the beauty is the sum of what is written.
    fn sums_what_is_written(&self) -> bool {
        self.rule.factored && self.mapping.passes.iter().any(|pass| pass.role.light().is_some() && self.writes(pass))
    }

    /// A pass as the file holds it, read again where that is needed: frames wait without their samples.
    pub(super) fn as_it_came(&self, images: &mut [ExrImage], pass: &Mapped) -> Result<Plane<Rgb>, Error> {
        for (file, image) in images.iter_mut().enumerate() {
            let holds = |id: &&ChannelId| id.file == file;
            image.load(|part, channel| {
                let at = part.channels().iter().position(|c| std::ptr::eq(c, channel));
                let mut ids = pass.channels.iter().filter(holds);
                ids.any(|id| id.part == part.index() && Some(id.channel) == at)
            })?;
        }
        let mut plane = colour(images, pass, self.canvas)?;
        // As everywhere, what is no number counts as black.
        plane.data_mut().iter_mut().flatten().filter(|v| !v.is_finite()).for_each(|v| *v = 0.0);
        Ok(plane)
    }

    /// What a choice of passes does to those that are not chosen, for the user; nothing where all are.
    pub(super) fn says_of_chosen(&self) -> Vec<String> {
        let Some(names) = &self.written else { return Vec::new() };
        let listed = |passes: Vec<&Mapped>| {
            let names = passes.iter().map(|p| if p.name.is_empty() { "R, G, B" } else { p.name.as_str() });
            names.collect::<Vec<_>>().join(", ")
        };
        let stay = |light: &dyn Fn(&Mapped) -> bool| -> Vec<&Mapped> {
            self.mapping.passes.iter().filter(|pass| light(pass) && !self.writes(pass)).collect()
        };
        let lights = stay(&|pass| pass.role.light().is_some());
        let mut said = Vec::new();
        let chosen = names.iter().map(String::as_str).collect::<Vec<_>>().join(", ");
        if self.sums_what_is_written() {
            if !lights.is_empty() {
                said.push(format!(
                    "only these passes are filtered: {chosen}; the beauty is the sum of what is written and keeps the noise \
                     of {}",
                    listed(lights)
                ));
            }
        } else if !lights.is_empty() {
            said.push(format!(
                "no light pass is filtered, only: {chosen}; the others stay as they came, so that they do not add up to \
                 the filtered beauty"
            ));
        }
        let groups = stay(&|pass| pass.role == Role::LightGroup);
        if !groups.is_empty() {
            said.push(format!(
                "these light groups stay as they came and do not add up to the beauty: {}",
                listed(groups)
            ));
        }
        said
    }

    /// Groups mix lobes: each is filtered, and all are scaled in each pixel to the filtered beauty.
    fn groups(
        &self,
        images: &mut [ExrImage],
        frame: &SequenceFrame,
        lights: &[Plane<Rgb>],
        beauty: &Plane<Rgb>,
        report: &mut WriteBack,
    ) -> Result<(), Error> {
        let groups: Vec<(&Light, Plane<Rgb>)> = frame
            .lights
            .iter()
            .zip(lights)
            .filter(|(light, _)| !light.in_beauty)
            .map(|(light, plane)| (light, product(plane, light)))
            .collect();
        let mut sum = Plane::filled(self.canvas.size, [0.0; 3]);
        for (_, plane) in &groups {
            add(&mut sum, plane, None);
        }
        let passes: Vec<&Mapped> = self.mapping.all(Role::LightGroup).collect();
        for (light, mut plane) in groups {
            let kept = |pass: &&&Mapped| self.writes(pass);
            let Some(pass) = passes.iter().filter(kept).find(|pass| pass.name == light.name && light.name != NO_GROUP)
            else {
                continue;
            };
            for (i, value) in plane.data_mut().iter_mut().enumerate() {
                let (Some(sum), Some(beauty)) = (sum.data().get(i), beauty.data().get(i)) else { continue };
                for c in 0..3 {
                    // No light in any group: none to scale.
                    let scale = if sum[c].abs() > 1e-12 { beauty[c] / sum[c] } else { 1.0 };
                    value[c] *= scale;
                }
            }
            report.clamped_to_half += scatter(images, pass, self.canvas, &mut plane)?;
            report.normalised.push(pass.name.clone());
        }
        Ok(())
    }

    /// Puts `quell.version`, `quell.settings` and `quell.mapping` into the first file's header and version into all.
    ///
    /// # Errors
    /// [`Error::NotSupported`] for texts with a zero character.
    pub fn sign(&self, images: &mut [ExrImage], settings: &str) -> Result<(), Error> {
        for image in images {
            image.set_text("quell.version", env!("CARGO_PKG_VERSION"))?;
            image.set_text("quell.content", "denoised")?;
            image.set_text("quell.settings", settings)?;
            image.set_text("quell.mapping", &self.describe())?;
        }
        Ok(())
    }

    /// The sum of the passes as the files hold them, by the renderer's own rule: what [`Adapter::write_back`] makes
    /// the beauty of. For tests and for `doctor`.
    ///
    /// # Errors
    /// [`Error::Invalid`] where a channel was not read.
    pub fn sum_of_passes(&self, images: &[ExrImage]) -> Result<Plane<Rgb>, Error> {
        let mut sum = Plane::filled(self.canvas.size, [0.0; 3]);
        for light in super::lights::make(&self.mapping, &self.rule, self.canvas, images)? {
            let pass = self.mapping.passes.iter().find(|p| p.role.light().is_some() && p.name == light.name);
            let Some(pass) = pass.filter(|_| light.in_beauty) else { continue };
            let weight = if self.rule.colour_inside { None } else { light.weight.as_deref() };
            add(&mut sum, &colour(images, pass, self.canvas)?, weight);
        }
        Ok(sum)
    }
}

/// The names of the passes that a user's list means: by role, by name, or by the last part of the name.
///
/// # Errors
/// [`Error::Invalid`] where an entry means none; those that there are are listed.
pub(super) fn chosen(
    path: &Path,
    mapping: &Mapping,
    list: Option<&[String]>,
) -> Result<Option<BTreeSet<String>>, Error> {
    let Some(list) = list else { return Ok(None) };
    let filtered = |pass: &&Mapped| pass.role.light().is_some() || matches!(pass.role, Role::Beauty | Role::LightGroup);
    let mut names = BTreeSet::new();
    for entry in list {
        let plain = |text: &str| text.to_lowercase().replace([' ', '_', '-'], "");
        let meant = |pass: &&Mapped| {
            let last = pass.name.rsplit('.').next().unwrap_or_default();
            [pass.role.to_string().as_str(), &pass.name, last].iter().any(|name| plain(name) == plain(entry))
        };
        let before = names.len();
        names.extend(mapping.passes.iter().filter(filtered).filter(meant).map(|pass| pass.name.clone()));
        if names.len() == before && !mapping.passes.iter().filter(filtered).any(|pass| meant(&pass)) {
            let known = |pass: &Mapped| {
                if pass.name.is_empty() { pass.role.to_string() } else { format!("{} ({})", pass.role, pass.name) }
            };
            let known: Vec<String> = mapping.passes.iter().filter(filtered).map(known).collect();
            let reason = format!("there is no light pass `{entry}` to filter; there are {}", known.join(", "));
            return Err(Error::invalid(path, reason));
        }
    }
    Ok(Some(names))
}

fn product(plane: &Plane<Rgb>, light: &Light) -> Plane<Rgb> {
    let mut product = plane.clone();
    if let Some(weight) = &light.weight {
        product.data_mut().par_iter_mut().zip(weight.data().par_iter()).for_each(|(value, weight)| {
            for c in 0..3 {
                value[c] *= weight[c];
            }
        });
    }
    product
}

fn add(sum: &mut Plane<Rgb>, plane: &Plane<Rgb>, weight: Option<&Plane<Rgb>>) {
    let values = sum.data_mut().par_iter_mut().zip(plane.data().par_iter()).enumerate();
    values.for_each(|(i, (sum, value))| {
        let weight = weight.and_then(|w| w.data().get(i)).copied().unwrap_or([1.0; 3]);
        for c in 0..3 {
            sum[c] += value[c] * weight[c];
        }
    });
}
