//! Primitives: vertices, indices and topology made into triangles.

use super::accessor::Reader;
use super::error::{Fault, Place, Problem};
use super::report::Warnings;
use super::schema::Primitive;
use super::tangents;
use crate::scene::Mesh;
use glam::{Vec2, Vec3, Vec4};
use std::collections::BTreeMap;

/// Farther out no arithmetic in single precision makes sense; squares must stay finite.
const FARTHEST: f32 = 1e15;

fn near(v: &Vec3) -> bool {
    // The largest element of a vector ignores NaN.
    v.is_finite() && v.abs().max_element() <= FARTHEST
}

/// Offsets of one morph target; empty: none.
#[derive(Debug, Default)]
pub(super) struct Target {
    pub(super) positions: Vec<Vec3>,
    pub(super) normals: Vec<Vec3>,
}

/// Joints and weights of the vertices: four a set.
#[derive(Debug)]
pub(super) struct Influences {
    pub(super) joints: Vec<[u32; 4]>,
    pub(super) weights: Vec<[f32; 4]>,
}

/// What a primitive holds.
pub(super) struct Part {
    pub(super) mesh: Mesh,
    pub(super) targets: Vec<Target>,
    pub(super) influences: Vec<Influences>,
    pub(super) degenerate: usize,
}

impl Part {
    /// Adds a copy of each of these vertices; the mesh's tangents have theirs already.
    pub(super) fn split(&mut self, vertices: &[u32]) {
        fn copy<T: Copy>(list: &mut Vec<T>, vertices: &[u32]) {
            if !list.is_empty() {
                let copies: Vec<T> = vertices.iter().filter_map(|&v| list.get(v as usize).copied()).collect();
                list.extend(copies);
            }
        }
        let mesh = &mut self.mesh;
        copy(&mut mesh.positions, vertices);
        copy(&mut mesh.normals, vertices);
        copy(&mut mesh.uvs, vertices);
        copy(&mut mesh.uvs1, vertices);
        copy(&mut mesh.colors, vertices);
        for target in &mut self.targets {
            copy(&mut target.positions, vertices);
            copy(&mut target.normals, vertices);
        }
        for influences in &mut self.influences {
            influences.joints.truncate(mesh.positions.len() - vertices.len());
            influences.weights.truncate(mesh.positions.len() - vertices.len());
            copy(&mut influences.joints, vertices);
            copy(&mut influences.weights, vertices);
        }
    }
}

/// Which of the optional vertex data the material asks for.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Wanted {
    /// Tangents, and the set of texture coordinates that they follow.
    pub(super) tangents: Option<u8>,
}

/// Reads a primitive; `None`, with a warning, where it has no triangles.
pub(super) fn read(
    reader: &Reader<'_>,
    primitive: &Primitive,
    wanted: Wanted,
    place: &Place<'_>,
    warnings: &mut Warnings,
) -> Result<Option<Part>, Fault> {
    match read_unless_empty(reader, primitive, wanted, place, warnings) {
        Err(Fault { place, problem: Problem::Empty }) => {
            warnings.at(place, format!("{}: the primitive is left out", Problem::Empty));
            Ok(None)
        }
        other => other,
    }
}

fn read_unless_empty(
    reader: &Reader<'_>,
    primitive: &Primitive,
    wanted: Wanted,
    place: &Place<'_>,
    warnings: &mut Warnings,
) -> Result<Option<Part>, Fault> {
    let mode = primitive.mode.unwrap_or(TRIANGLES);
    if !(TRIANGLES..=FAN).contains(&mode) {
        let what = if mode < TRIANGLES { "points and lines have no surface" } else { "this mode does not exist" };
        warnings.push(&place.field("mode"), format!("{what}: the primitive is left out"));
        return Ok(None);
    }
    let attributes = place.field("attributes");
    let vertices = Vertices { reader, named: &primitive.attributes, place: &attributes };
    let Some(positions) = vertices.get("POSITION", |r, i, p| r.floats::<3>(i, p))? else {
        warnings.push(&attributes, "has no POSITION: the primitive is left out");
        return Ok(None);
    };
    let mut positions: Vec<Vec3> = positions.into_iter().map(Vec3::from).collect();
    let count = positions.len();
    if u32::try_from(count).is_err() {
        let problem = Problem::Limit { what: "vertices of a primitive", value: count as u64, limit: u32::MAX.into() };
        return Err(Fault::new(&attributes, problem));
    }
    let indices = match primitive.indices {
        None => None,
        Some(index) => {
            let place = place.field("indices");
            let indices = reader.integers::<1>(index, &place)?.into_flattened();
            if let Some(&index) = indices.iter().find(|&&i| i as usize >= count) {
                let problem = Problem::Index { what: "vertex", index: index as usize, count };
                return Err(Fault::new(&place, problem));
            }
            Some(indices)
        }
    };
    let mut triangles = triangles(indices.as_deref(), count as u32, mode);

    let unusable: Vec<bool> = positions.iter().map(|p| !near(p)).collect();
    let bad = unusable.iter().filter(|u| **u).count();
    if bad > 0 {
        for (position, unusable) in positions.iter_mut().zip(&unusable) {
            if *unusable {
                *position = Vec3::ZERO;
            }
        }
        let before = triangles.len();
        triangles.retain(|t| t.iter().all(|&i| !unusable[i as usize]));
        let message = format!(
            "{bad} vertices are not finite or farther than {FARTHEST:e}: {} triangles are left out",
            before - triangles.len()
        );
        warnings.push(&attributes.field("POSITION"), message);
    }
    if triangles.is_empty() {
        warnings.push(place, "has no triangle: the primitive is left out");
        return Ok(None);
    }

    let mut mesh = Mesh { positions, triangles, ..Mesh::default() };
    mesh.normals = vertices.vectors("NORMAL", count, warnings)?;
    mesh.uvs = vertices.pairs("TEXCOORD_0", count, warnings)?;
    mesh.uvs1 = vertices.pairs("TEXCOORD_1", count, warnings)?;
    mesh.colors = vertices.colors(count, warnings)?;
    if wanted.tangents.is_some() && !mesh.normals.is_empty() {
        mesh.tangents = vertices.tangents(count, warnings)?;
    }
    let mut targets = Vec::with_capacity(primitive.targets.len());
    let list = place.field("targets");
    for (number, named) in primitive.targets.iter().enumerate() {
        let place = list.item(number);
        let offsets = Vertices { reader, named, place: &place };
        let positions = offsets.vectors("POSITION", count, warnings)?;
        let normals = if mesh.normals.is_empty() { Vec::new() } else { offsets.vectors("NORMAL", count, warnings)? };
        targets.push(Target { positions, normals });
    }
    let mut influences = Vec::new();
    for (joints, weights) in [("JOINTS_0", "WEIGHTS_0"), ("JOINTS_1", "WEIGHTS_1")] {
        let joints = vertices.get(joints, |r, i, p| r.integers::<4>(i, p))?;
        let weights = vertices.get(weights, |r, i, p| r.floats::<4>(i, p))?;
        if let (Some(joints), Some(mut weights)) = (joints, weights) {
            if joints.len() < count || weights.len() < count {
                let problem = format!(
                    "joints ({}) and weights ({}) must be as many as the {count} positions",
                    joints.len(),
                    weights.len()
                );
                return Err(Fault::data(&attributes, problem));
            }
            for weight in weights.iter_mut().flatten().filter(|w| !(w.is_finite() && **w >= 0.0)) {
                *weight = 0.0;
            }
            influences.push(Influences { joints, weights });
        }
    }
    let degenerate = mesh.triangles.iter().filter(|t| !has_area(&mesh.positions, t)).count();
    let mut part = Part { mesh, targets, influences, degenerate };
    if let Some(set) = wanted.tangents
        && part.mesh.tangents.is_empty()
    {
        tangents::generate(&mut part, set);
    }
    Ok(Some(part))
}

fn has_area(positions: &[Vec3], corners: &[u32; 3]) -> bool {
    let [a, b, c] = corners.map(|i| positions[i as usize]);
    (b - a).cross(c - a).length_squared() > 0.0
}

const TRIANGLES: u64 = 4;
const STRIP: u64 = 5;
const FAN: u64 = 6;

/// Triangles from a list, strip or fan of vertices; those with a corner twice are dropped.
fn triangles(indices: Option<&[u32]>, vertices: u32, mode: u64) -> Vec<[u32; 3]> {
    let count = indices.map_or(vertices as usize, <[u32]>::len);
    let vertex = |i: usize| indices.map_or(i as u32, |list| list[i]);
    let number = if mode == TRIANGLES { count / 3 } else { count.saturating_sub(2) };
    let corners = |i: usize| match mode {
        STRIP => [i, i + 1 + i % 2, i + 2 - i % 2],
        FAN => [i + 1, i + 2, 0],
        _ => [3 * i, 3 * i + 1, 3 * i + 2],
    };
    let all = (0..number).map(|i| corners(i).map(vertex));
    all.filter(|[a, b, c]| a != b && b != c && a != c).collect()
}

/// Named vertex data of a primitive or a morph target.
struct Vertices<'a, 'r> {
    reader: &'a Reader<'r>,
    named: &'a BTreeMap<String, usize>,
    place: &'a Place<'a>,
}

impl<'r> Vertices<'_, 'r> {
    fn get<T>(
        &self,
        name: &str,
        read: impl Fn(&Reader<'r>, usize, &Place<'_>) -> Result<T, Fault>,
    ) -> Result<Option<T>, Fault> {
        match self.named.get(name) {
            None => Ok(None),
            Some(&accessor) => read(self.reader, accessor, &self.place.field(name)).map(Some),
        }
    }

    /// Fewer elements than vertices are an error; values that are not finite become 0.
    fn checked<T: Copy + Default>(
        &self,
        name: &str,
        values: Option<Vec<T>>,
        count: usize,
        finite: impl Fn(&T) -> bool,
        warnings: &mut Warnings,
    ) -> Result<Vec<T>, Fault> {
        let Some(mut values) = values else { return Ok(Vec::new()) };
        if values.len() < count {
            let problem = format!("has {} elements for {count} positions", values.len());
            return Err(Fault::data(&self.place.field(name), problem));
        }
        values.truncate(count);
        let mut bad = 0;
        for value in values.iter_mut().filter(|v| !finite(v)) {
            *value = T::default();
            bad += 1;
        }
        if bad > 0 {
            warnings.push(&self.place.field(name), format!("{bad} elements are not finite: 0 is used"));
        }
        Ok(values)
    }

    fn vectors(&self, name: &str, count: usize, warnings: &mut Warnings) -> Result<Vec<Vec3>, Fault> {
        let values = self.get(name, |r, i, p| r.floats::<3>(i, p))?;
        let values = values.map(|v| v.into_iter().map(Vec3::from).collect());
        self.checked(name, values, count, near, warnings)
    }

    fn pairs(&self, name: &str, count: usize, warnings: &mut Warnings) -> Result<Vec<Vec2>, Fault> {
        let values = self.get(name, |r, i, p| r.floats::<2>(i, p))?;
        let values = values.map(|v| v.into_iter().map(Vec2::from).collect());
        self.checked(name, values, count, |v: &Vec2| v.is_finite() && v.abs().max_element() <= FARTHEST, warnings)
    }

    fn colors(&self, count: usize, warnings: &mut Warnings) -> Result<Vec<Vec4>, Fault> {
        let values = self.get("COLOR_0", |r, i, p| r.colors(i, p))?;
        let values = values.map(|v| v.into_iter().map(|c| Vec4::from(c).max(Vec4::ZERO)).collect());
        self.checked("COLOR_0", values, count, |v: &Vec4| v.is_finite(), warnings)
    }

    fn tangents(&self, count: usize, warnings: &mut Warnings) -> Result<Vec<Vec4>, Fault> {
        let values = self.get("TANGENT", |r, i, p| r.floats::<4>(i, p))?;
        let values = values.map(|v| v.into_iter().map(Vec4::from).collect());
        self.checked("TANGENT", values, count, |v: &Vec4| v.is_finite(), warnings)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_and_fans_face_the_same_way_as_their_first_triangle() {
        assert_eq!(triangles(None, 5, STRIP), [[0, 1, 2], [1, 3, 2], [2, 3, 4]]);
        assert_eq!(triangles(None, 5, FAN), [[1, 2, 0], [2, 3, 0], [3, 4, 0]]);
        assert_eq!(triangles(None, 7, TRIANGLES), [[0, 1, 2], [3, 4, 5]]);
        assert_eq!(triangles(Some(&[2, 1, 0, 0, 3]), 4, STRIP), [[2, 1, 0]]);
        for mode in [TRIANGLES, STRIP, FAN] {
            assert!(triangles(None, 2, mode).is_empty());
            assert!(triangles(Some(&[]), 9, mode).is_empty());
        }
    }
}
