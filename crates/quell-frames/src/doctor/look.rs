//! Which frames are looked at closely, and what is kept of one while it is looked at.

use super::files::Header;
use crate::adapt::noise::Trace;
use crate::adapt::planes::{colour, gather, single};
use crate::adapt::{Adapter, Links, PixelCamera};
use crate::error::Error;
use crate::image::{ExrImage, SampleKind, Window};
use crate::roles::{Mapped, Mapping, Role};
use crate::sequence::FrameSources;
use quell::sequence::SequenceFrame;
use quell::{Plane, Rgb};

/// Frames in a row from the first: four pairs show whether an animation is on twos.
const ROW: usize = 5;
/// Further pairs spread over the rest.
const PAIRS: usize = 3;

/// Numbers of the frames whose pixels are read, ascending: a row at the first pair of neighbours, then some pairs.
pub(super) fn chosen(headers: &[Header], first: &Header) -> Vec<i64> {
    let numbers: Vec<i64> = headers.iter().filter(|h| h.fits(first)).map(|h| h.number).collect();
    let follows = |a: i64, b: i64| a.checked_add(1) == Some(b);
    let pairs: Vec<(i64, i64)> = numbers.windows(2).filter(|w| follows(w[0], w[1])).map(|w| (w[0], w[1])).collect();
    let Some(first) = pairs.first() else {
        // No neighbours: a few frames by themselves.
        let step = (numbers.len() / 2).max(1);
        return numbers.iter().step_by(step).take(3).copied().collect();
    };
    let mut chosen = vec![first.0];
    for (a, b) in &pairs {
        if chosen.len() < ROW && chosen.last() == Some(a) {
            chosen.push(*b);
        }
    }
    for i in 1..=PAIRS {
        if let Some((a, b)) = pairs.get(i * (pairs.len() - 1) / PAIRS) {
            chosen.extend([*a, *b]);
        }
    }
    chosen.sort_unstable();
    chosen.dedup();
    chosen
}

/// One frame of one layer.
pub(super) struct Look {
    pub number: i64,
    /// As the filter would get it.
    pub frame: SequenceFrame,
    /// The picture.
    pub beauty: Plane<Rgb>,
    /// The file's own numbers.
    pub raw: Raw,
    pub camera: Option<PixelCamera>,
    pub trace: Trace,
}

/// Passes as the file has them, before any convention.
pub(super) struct Raw {
    /// Of each pair of numbers of the vectors: role and plane.
    pub vectors: Vec<(Role, usize, Plane<[f32; 2]>)>,
    pub normal: Option<Plane<[f32; 3]>>,
    pub depth: Option<Plane<f32>>,
    /// Depth is stored in half floats.
    pub depth_half: bool,
    /// What light is divided by, where it is a pass of its own: its role and its values.
    pub albedo: Option<(Role, Plane<Rgb>)>,
}

impl Look {
    pub fn new(
        adapter: &Adapter,
        table: &Mapping,
        number: i64,
        images: &[ExrImage],
        links: &mut Links,
    ) -> Result<Self, Error> {
        let (mapping, canvas) = (adapter.mapping(), adapter.canvas());
        let made = adapter.frame(number, images, links)?;
        let frame = made.frame;
        let beauty = match mapping.get(Role::Beauty) {
            Some(pass) => colour(images, pass, canvas)?,
            None => frame.beauty(),
        };
        let trace = Trace::of(&frame, &beauty, made.camera);
        Ok(Self { number, raw: Raw::new(mapping, table, canvas, images)?, beauty, camera: made.camera, trace, frame })
    }
}

impl Raw {
    fn new(mapping: &Mapping, table: &Mapping, canvas: Window, images: &[ExrImage]) -> Result<Self, Error> {
        let mut vectors = Vec::new();
        for role in [Role::Motion, Role::MotionPrevious, Role::MotionNext] {
            let Some(pass) = mapping.get(role) else { continue };
            let pairs = if pass.channels.len() == 4 { 2 } else { 1 };
            for (pair, channels) in pass.channels.chunks_exact(2).take(pairs).enumerate() {
                vectors.push((role, pair, gather(images, channels, canvas, [f32::NAN; 2])?));
            }
        }
        let three = |pass: Option<&Mapped>| pass.map(|p| gather(images, &p.channels, canvas, [0.0; 3])).transpose();
        let colours = [Role::MatteColour, Role::GlossyColour, Role::TransmissionColour, Role::SubsurfaceColour];
        let seen = mapping.get(Role::SeenAlbedo).filter(|_| colours.iter().all(|role| mapping.get(*role).is_none()));
        // What the adapter leaves out is looked at, too.
        let albedo = table.get(Role::Albedo).or(seen);
        let depth = mapping.get(Role::Depth).and_then(|pass| pass.channels.first().copied());
        let depth_half = depth.is_some_and(|id| {
            images
                .get(id.file)
                .and_then(|i| i.samples(id.part, id.channel))
                .is_some_and(|s| s.kind() == SampleKind::Half)
        });
        Ok(Self {
            vectors,
            normal: three(mapping.get(Role::Normal))?,
            depth: depth.map(|id| single(images, id, canvas, 0.0)).transpose()?,
            depth_half,
            albedo: three(albedo)?.and_then(|plane| Some((albedo?.role, plane))),
        })
    }
}

/// Reads what a mapping needs of a frame.
pub(super) fn read(sources: &FrameSources, mapping: &Mapping) -> Result<Vec<ExrImage>, Error> {
    sources.read(mapping)
}

/// A pass's name for a person.
pub(super) fn name_of(mapping: &Mapping, role: Role) -> String {
    mapping
        .get(role)
        .map_or_else(String::new, |pass| if pass.name.is_empty() { "R, G, B".to_owned() } else { pass.name.clone() })
}
