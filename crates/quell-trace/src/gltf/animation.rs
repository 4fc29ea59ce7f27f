//! Clips of animation: which of them play, and what their channels say at a time.

use super::accessor::Reader;
use super::error::{Fault, Place, Problem, item};
use super::nodes::Local;
use super::report::{ClipInfo, Plays, Warnings};
use super::schema::Root;
use glam::{DQuat, DVec3};
use std::collections::HashMap;
use std::sync::Arc;

/// What a channel sets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Driven {
    Translation,
    Rotation,
    Scale,
    Weights,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Interpolation {
    Step,
    Linear,
    CubicSpline,
}

/// Keys over time. `values` holds `width` numbers a key; cubic ones three times as many: tangent in, value, tangent out.
#[derive(Debug)]
struct Keys {
    /// Seconds, ascending, at least one.
    times: Vec<f32>,
    values: Vec<f32>,
    width: usize,
    interpolation: Interpolation,
}

/// One channel of a clip that plays.
#[derive(Clone, Debug)]
pub(super) struct Channel {
    pub(super) node: usize,
    pub(super) driven: Driven,
    keys: Arc<Keys>,
}

/// All that plays, and what is known of the rest.
pub(super) struct Played {
    pub(super) channels: Vec<Channel>,
    pub(super) clips: Vec<ClipInfo>,
    /// Time of the last key of what plays.
    pub(super) seconds: f64,
}

impl Keys {
    /// The numbers of lane `lane` at key `key`: part 0 tangent in, 1 value, 2 tangent out.
    fn at(&self, key: usize, part: usize, lane: usize) -> f64 {
        let index = if self.interpolation == Interpolation::CubicSpline {
            (key * 3 + part) * self.width + lane
        } else {
            key * self.width + lane
        };
        self.values.get(index).copied().map_or(0.0, f64::from)
    }

    /// The key at or before a time, the next one, and how far between them the time lies, with the seconds between.
    fn place(&self, seconds: f64) -> (usize, usize, f64, f64) {
        let last = self.times.len().saturating_sub(1);
        let after = self.times.partition_point(|t| f64::from(*t) <= seconds);
        if after == 0 {
            return (0, 0, 0.0, 0.0);
        }
        if after > last {
            return (last, last, 0.0, 0.0);
        }
        let [begin, end] = [after - 1, after].map(|k| f64::from(self.times[k]));
        (after - 1, after, (seconds - begin) / (end - begin), end - begin)
    }

    /// One number at a time; rotations take another way where they are linear.
    fn number(&self, lane: usize, (a, b, s, span): (usize, usize, f64, f64)) -> f64 {
        let value = self.at(a, 1, lane);
        if a == b {
            return value;
        }
        match self.interpolation {
            Interpolation::Step => value,
            Interpolation::Linear => value + (self.at(b, 1, lane) - value) * s,
            // Appendix C.5 of the specification: Hermite's spline, tangents scaled by the seconds between the keys.
            Interpolation::CubicSpline => {
                let (s2, s3) = (s * s, s * s * s);
                (2.0 * s3 - 3.0 * s2 + 1.0) * value
                    + span * (s3 - 2.0 * s2 + s) * self.at(a, 2, lane)
                    + (3.0 * s2 - 2.0 * s3) * self.at(b, 1, lane)
                    + span * (s3 - s2) * self.at(b, 0, lane)
            }
        }
    }

    fn vector(&self, seconds: f64) -> DVec3 {
        let place = self.place(seconds);
        DVec3::new(self.number(0, place), self.number(1, place), self.number(2, place))
    }

    fn rotation(&self, seconds: f64) -> DQuat {
        let place = self.place(seconds);
        let key = |k: usize| DQuat::from_xyzw(self.at(k, 1, 0), self.at(k, 1, 1), self.at(k, 1, 2), self.at(k, 1, 3));
        let unit = |q: DQuat| if q.length_squared() > 1e-12 { q.normalize() } else { DQuat::IDENTITY };
        let (a, b, s, _) = place;
        if self.interpolation == Interpolation::Linear && a != b {
            // glam takes the shorter arc, as the specification demands.
            return unit(key(a)).slerp(unit(key(b)), s);
        }
        unit(DQuat::from_xyzw(
            self.number(0, place),
            self.number(1, place),
            self.number(2, place),
            self.number(3, place),
        ))
    }
}

impl Channel {
    /// Sets what the channel drives to its value at a time.
    pub(super) fn apply(&self, seconds: f64, local: &mut Local, weights: &mut Option<Vec<f32>>) {
        match self.driven {
            Driven::Translation => local.translation = self.keys.vector(seconds),
            Driven::Scale => local.scale = self.keys.vector(seconds),
            Driven::Rotation => local.rotation = self.keys.rotation(seconds),
            Driven::Weights => {
                let place = self.keys.place(seconds);
                *weights = Some((0..self.keys.width).map(|lane| self.keys.number(lane, place) as f32).collect());
            }
        }
    }
}

/// Which clips play: all that do not share a channel with one before them, or the one that was chosen, or none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Choice {
    All,
    One(usize),
    None,
}

/// The number of the item that a user named, by name or by number from 1.
pub(super) fn chosen(names: &[String], choice: &str, what: &'static str) -> Result<usize, Fault> {
    let by_name = || names.iter().position(|name| name == choice);
    let by_number = || choice.parse::<usize>().ok().and_then(|n| n.checked_sub(1)).filter(|n| *n < names.len());
    by_name().or_else(by_number).ok_or_else(|| {
        let known = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
        Fault::whole(Problem::Choice { what, name: choice.to_owned(), known })
    })
}

/// Names of the clips.
pub(super) fn names(root: &Root) -> Vec<String> {
    root.animations.iter().enumerate().map(|(n, a)| a.name.clone().unwrap_or_else(|| format!("{}", n + 1))).collect()
}

/// Reads the clips and decides which play.
pub(super) fn read(reader: &Reader<'_>, choice: Choice, warnings: &mut Warnings) -> Result<Played, Fault> {
    let root = reader.root;
    let mut played = Played { channels: Vec::new(), clips: Vec::new(), seconds: 0.0 };
    // Which clip drives what.
    let mut drivers: HashMap<(usize, Driven), usize> = HashMap::new();
    for (index, name) in names(root).into_iter().enumerate() {
        let channels = clip(reader, index, warnings)?;
        let seconds = channels.iter().filter_map(|c| c.keys.times.last()).fold(0.0, |a: f32, b| a.max(*b));
        let other = channels.iter().find_map(|c| drivers.get(&(c.node, c.driven)));
        let plays = match (choice, other) {
            _ if channels.is_empty() => Plays::Empty,
            (Choice::None, _) => Plays::NotChosen,
            (Choice::One(one), _) if one != index => Plays::NotChosen,
            (Choice::All, Some(&other)) => {
                Plays::SharesChannels(played.clips.get(other).map_or_else(String::new, |c: &ClipInfo| c.name.clone()))
            }
            _ => Plays::Yes,
        };
        let count = channels.len();
        if plays == Plays::Yes {
            played.seconds = played.seconds.max(f64::from(seconds));
            drivers.extend(channels.iter().map(|c| ((c.node, c.driven), index)));
            played.channels.extend(channels);
        }
        played.clips.push(ClipInfo { name, seconds: f64::from(seconds), channels: count, plays });
    }
    Ok(played)
}

/// The channels of one clip that can be played; each property of a node once.
fn clip(reader: &Reader<'_>, index: usize, warnings: &mut Warnings) -> Result<Vec<Channel>, Fault> {
    let root = reader.root;
    let animation = &root.animations[index];
    let list = Place::root("animations");
    let place = list.item(index);
    let channels = place.field("channels");
    let samplers = place.field("samplers");
    // Several channels may share a sampler; morph targets give it another width.
    let mut read: HashMap<(usize, usize), Option<Arc<Keys>>> = HashMap::new();
    let mut out: Vec<Channel> = Vec::new();
    let mut driven_already = std::collections::HashSet::new();
    for (number, channel) in animation.channels.iter().enumerate() {
        let place = channels.item(number);
        let target = place.field("target");
        let Some(node) = channel.target.node else {
            warnings.push(&target, "drives no node: the channel is left out");
            continue;
        };
        item(&root.nodes, node, "node", &target.field("node"))?;
        let driven = match channel.target.path.as_str() {
            "translation" => Driven::Translation,
            "rotation" => Driven::Rotation,
            "scale" => Driven::Scale,
            "weights" => Driven::Weights,
            _ => {
                warnings.push(&target.field("path"), "drives what quell cannot move: the channel is left out");
                continue;
            }
        };
        if !driven_already.insert((node, driven)) {
            warnings.push(&place, "drives what a channel before it drives already: left out");
            continue;
        }
        item(&animation.samplers, channel.sampler, "sampler", &place.field("sampler"))?;
        let width = match driven {
            Driven::Translation | Driven::Scale => 3,
            Driven::Rotation => 4,
            Driven::Weights => targets(root, node),
        };
        if width == 0 {
            warnings.push(&target, "the node's mesh has no morph targets: the channel is left out");
            continue;
        }
        let keys = match read.get(&(channel.sampler, width)) {
            Some(keys) => keys.clone(),
            None => {
                let keys = sampler(reader, index, channel.sampler, width, &samplers.item(channel.sampler), warnings)?;
                read.insert((channel.sampler, width), keys.clone());
                keys
            }
        };
        if let Some(keys) = keys {
            if keys.interpolation == Interpolation::CubicSpline && keys.times.len() < 2 {
                warnings.push(&place, "a cubic spline needs two keys: its only one holds");
            }
            out.push(Channel { node, driven, keys });
        }
    }
    Ok(out)
}

/// Morph targets of a node's mesh.
fn targets(root: &Root, node: usize) -> usize {
    let mesh = root.nodes.get(node).and_then(|n| n.mesh).and_then(|m| root.meshes.get(m));
    mesh.and_then(|m| m.primitives.iter().map(|p| p.targets.len()).max()).unwrap_or(0)
}

/// Keys of a sampler; `None`, with a warning, where they cannot be played.
fn sampler(
    reader: &Reader<'_>,
    clip: usize,
    index: usize,
    width: usize,
    place: &Place<'_>,
    warnings: &mut Warnings,
) -> Result<Option<Arc<Keys>>, Fault> {
    let Some(sampler) = reader.root.animations.get(clip).and_then(|a| a.samplers.get(index)) else { return Ok(None) };
    let interpolation = match sampler.interpolation.as_deref() {
        None | Some("LINEAR") => Interpolation::Linear,
        Some("STEP") => Interpolation::Step,
        Some("CUBICSPLINE") => Interpolation::CubicSpline,
        Some(_) => {
            warnings.push(&place.field("interpolation"), "is unknown: LINEAR is used");
            Interpolation::Linear
        }
    };
    let (input, output) = (place.field("input"), place.field("output"));
    let times: Vec<f32> = reader.floats::<1>(sampler.input, &input)?.into_iter().map(|[t]| t).collect();
    let values: Vec<f32> = match width {
        // Weights are stored one by one, whatever their number; so may be three or four of them.
        3 if is_vector(reader, sampler.output) => reader.floats::<3>(sampler.output, &output)?.into_flattened(),
        4 if is_vector(reader, sampler.output) => reader.floats::<4>(sampler.output, &output)?.into_flattened(),
        _ => reader.floats::<1>(sampler.output, &output)?.into_flattened(),
    };
    if times.iter().any(|t| !t.is_finite()) || times.windows(2).any(|w| w[0] >= w[1]) {
        warnings.push(&input, "times must be finite and ascend: the channels that use them are left out");
        return Ok(None);
    }
    if values.iter().any(|v| !v.is_finite()) {
        warnings.push(&output, "holds values that are not finite: the channels that use them are left out");
        return Ok(None);
    }
    let parts = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
    let needed = times.len().saturating_mul(parts).saturating_mul(width);
    if values.len() < needed {
        let problem = format!("{} keys need {needed} numbers, {} are there", times.len(), values.len());
        return Err(Fault::data(&output, problem));
    }
    Ok(Some(Arc::new(Keys { times, values, width, interpolation })))
}

fn is_vector(reader: &Reader<'_>, accessor: usize) -> bool {
    reader.root.accessors.get(accessor).is_some_and(|a| a.kind != "SCALAR")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keys(interpolation: Interpolation, values: &[f32]) -> Keys {
        Keys { times: vec![1.0, 3.0], values: values.to_vec(), width: 1, interpolation }
    }

    fn at(keys: &Keys, seconds: f64) -> f64 {
        keys.number(0, keys.place(seconds))
    }

    #[test]
    fn values_hold_before_the_first_key_and_after_the_last() {
        let linear = keys(Interpolation::Linear, &[2.0, 6.0]);
        for (seconds, value) in [(-5.0, 2.0), (1.0, 2.0), (2.0, 4.0), (2.5, 5.0), (3.0, 6.0), (9.0, 6.0)] {
            assert_eq!(at(&linear, seconds), value, "{seconds}");
        }
        let step = keys(Interpolation::Step, &[2.0, 6.0]);
        for (seconds, value) in [(0.0, 2.0), (2.999, 2.0), (3.0, 6.0)] {
            assert_eq!(at(&step, seconds), value, "{seconds}");
        }
    }

    #[test]
    fn a_cubic_with_the_tangents_of_a_cubic_is_that_cubic() {
        let cubic = |t: f64| t * t * t - 2.0 * t;
        let slope = |t: f64| (3.0 * t * t - 2.0) as f32;
        let values = [slope(1.0), cubic(1.0) as f32, slope(1.0), slope(3.0), cubic(3.0) as f32, slope(3.0)];
        let keys = keys(Interpolation::CubicSpline, &values);
        for step in 0..=20 {
            let t = 1.0 + f64::from(step) * 0.1;
            assert!((at(&keys, t) - cubic(t)).abs() < 1e-9, "{t}");
        }
    }

    #[test]
    fn rotations_take_the_shorter_way_at_even_speed() {
        let (a, b) = (DQuat::from_rotation_y(0.0), -DQuat::from_rotation_y(1.0));
        let values: Vec<f32> = a.to_array().iter().chain(&b.to_array()).map(|v| *v as f32).collect();
        let keys = Keys { times: vec![0.0, 1.0], values, width: 4, interpolation: Interpolation::Linear };
        for t in [0.0, 0.25, 0.5, 1.0] {
            assert!(keys.rotation(t).angle_between(DQuat::from_rotation_y(t)) < 1e-6, "{t}");
        }
    }
}
