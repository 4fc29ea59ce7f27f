//! A frame in memory as an image: named passes instead of a file's channels, so that arrays take the way of files. And planes of the
//! real-time filter's frames by their names.

use crate::error::Error;
use crate::image::{AttributeValue, ExrImage, Samples};
use crate::roles::{Aliases, Role};
use quell::{FrameBuf, Plane, Size};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// A pass of a frame in memory.
#[derive(Clone, Debug)]
pub struct ArrayPass {
    /// What messages and results call it; without a role also what tells what it is, as in a file (`DiffDir`).
    pub name: String,
    /// What it is; absent: by its name, one of quell's own words first ([`Role::name`]).
    pub role: Option<Role>,
    /// Its components in their usual order (red, green, blue, alpha; x, y, z, w), one to four.
    pub components: Vec<Samples>,
}

/// Names of components, by their number.
const COMPONENTS: [&[&str]; 4] = [&["Y"], &["X", "Y"], &["R", "G", "B"], &["R", "G", "B", "A"]];
/// Motion with a second pair of components for the other direction of time.
const FOUR_NUMBERS: &[&str] = &["X", "Y", "Z", "W"];

/// The image of a frame; `label` stands for the file in messages. `clip_from_world` is the camera, as
/// [`quell::Camera::clip_from_world`].
///
/// With it come the wishes ([`crate::MapOptions::map`]) that give passes with a role that role.
///
/// # Errors
/// [`Error::Invalid`] where a name is empty, given twice or known to no renderer, where a role does not have so many
/// components, or where samples are not as many as pixels.
pub fn image_of(
    label: &Path,
    size: Size,
    passes: Vec<ArrayPass>,
    clip_from_world: Option<[f32; 16]>,
) -> Result<(ExrImage, Vec<String>), Error> {
    let aliases = Aliases::built_in()?;
    let mut channels = BTreeMap::new();
    let mut names = BTreeSet::new();
    let mut wishes = Vec::new();
    for pass in passes {
        let ArrayPass { name, role, components } = pass;
        let role = role.or_else(|| Role::from_name(&name));
        let invalid = |reason: String| Error::invalid(label, format!("`{name}`: {reason}"));
        if name.is_empty() {
            return Err(invalid("a pass without a name".to_owned()));
        }
        if !names.insert(name.clone()) {
            return Err(invalid("two passes of this name".to_owned()));
        }
        if role.is_none() && !aliases.knows(&name) {
            let roles = Role::ALL.iter().map(|role| role.name()).collect::<Vec<_>>().join(", ");
            return Err(invalid(format!("no renderer calls a pass like this; name what it is: {roles}")));
        }
        let count = components.len();
        if let Some(role) = role {
            let [least, most] = role.channels();
            // A colour may have its alpha beside it.
            let most = if most == 3 && (role.light().is_some() || role == Role::Beauty) { 4 } else { most };
            if count < least || count > most {
                let wanted = if least == most { least.to_string() } else { format!("{least} to {most}") };
                return Err(invalid(format!("{count} channels, and {role} has {wanted}")));
            }
            wishes.push(format!("{role}={name}"));
        }
        let is_motion = role.map_or_else(|| aliases.is_motion(&name), |role| role == Role::Motion);
        let letters = if is_motion && count == 4 { Some(&FOUR_NUMBERS) } else { COMPONENTS.get(count.wrapping_sub(1)) };
        let Some(letters) = letters else { return Err(invalid(format!("{count} channels; passes have one to four"))) };
        for (letter, samples) in letters.iter().zip(components) {
            if samples.len() != size.pixels() {
                return Err(invalid(format!("{} samples a channel, not {}", samples.len(), size.pixels())));
            }
            channels.insert(format!("{name}.{letter}"), samples);
        }
    }
    let mut image = ExrImage::from_channels(label, size, channels)?;
    if let Some(matrix) = clip_from_world {
        image.set_attribute("worldToNDC", AttributeValue::Matrix4x4(matrix))?;
    }
    Ok((image, wishes))
}

/// The replaced samples of a pass that had so many components, in their order; `None` where it was not filtered. Of a light
/// pass with an alpha only the colour is filtered.
pub fn filtered<'i>(image: &'i ExrImage, name: &str, components: usize) -> Option<Vec<&'i Samples>> {
    let part = image.parts().first()?;
    let letters = COMPONENTS.get(components.wrapping_sub(1))?;
    let replaced = |letter: &&str| {
        let channel = part.channels().get(part.find(&format!("{name}.{letter}"))?)?;
        channel.samples().filter(|_| channel.is_replaced())
    };
    let found: Vec<&Samples> = letters.iter().map_while(replaced).collect();
    (found.len() >= components.min(3)).then_some(found)
}

/// Puts a plane into a frame of the real-time filter by its name: `direct`, `matte`, `glossy`, `direct_matte`, `direct_glossy`,
/// `matte_weight`, `glossy_weight`, `depth` (view depth), `normal`, `roughness`, `motion`, `glossy_hit_distance`, `surface_id` (whole numbers),
/// `confidence`; what each holds: [`quell::Frame`]. `values` lie pixel by pixel, rows from the top.
///
/// # Errors
/// [`Error::Invalid`] for another name, another number of channels, or other than as many values as pixels times channels.
pub fn set_plane(frame: &mut FrameBuf, name: &str, values: Vec<f32>, channels: usize) -> Result<(), Error> {
    let size = frame.size;
    let invalid = |reason: String| Error::invalid(Path::new(name), reason);
    if values.len() != size.pixels() * channels {
        return Err(invalid(format!("{} numbers, not {channels} for each of {size} pixels", values.len())));
    }
    fn pixels<const N: usize>(values: Vec<f32>, channels: usize, size: Size) -> Result<Plane<[f32; N]>, String> {
        if channels != N {
            return Err(format!("{channels} channels, expected {N}"));
        }
        let (pixels, _) = values.as_chunks::<N>();
        Plane::from_vec(size, pixels.to_vec()).map_err(|error| error.to_string())
    }
    let number = |values| match channels {
        1 => Plane::from_vec(size, values).map_err(|error| error.to_string()),
        _ => Err(format!("{channels} channels, expected 1")),
    };
    let set = || -> Result<(), String> {
        match name {
            "direct" => frame.direct = Some(pixels(values, channels, size)?),
            "matte" => frame.matte = Some(pixels(values, channels, size)?),
            "glossy" => frame.glossy = Some(pixels(values, channels, size)?),
            "direct_matte" => frame.direct_matte = Some(pixels(values, channels, size)?),
            "direct_glossy" => frame.direct_glossy = Some(pixels(values, channels, size)?),
            "matte_weight" => frame.matte_weight = Some(pixels(values, channels, size)?),
            "glossy_weight" => frame.glossy_weight = Some(pixels(values, channels, size)?),
            "depth" => frame.view_depth = Some(number(values)?),
            "normal" => frame.normal = Some(pixels(values, channels, size)?),
            "roughness" => frame.roughness = Some(number(values)?),
            "motion" => frame.motion = Some(pixels(values, channels, size)?),
            "glossy_hit_distance" => frame.glossy_hit_distance = Some(number(values)?),
            "confidence" => frame.confidence_in = Some(number(values)?),
            "surface_id" => {
                let ids = number(values)?.into_vec().into_iter().map(|id| id as u32).collect();
                frame.surface_id = Plane::from_vec(size, ids).ok();
            }
            _ => return Err("the real-time filter has no such plane".to_owned()),
        }
        Ok(())
    };
    set().map_err(invalid)
}
