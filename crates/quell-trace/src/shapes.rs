//! Meshes made by code. All are closed or flat, counter-clockwise seen from outside, with texture coordinates.

use crate::scene::Mesh;
use glam::{Affine3A, Vec2, Vec3};
use std::f32::consts::{PI, TAU};

/// A parallelogram from a corner and two edges; its front is the side of `edge_u` x `edge_v`.
pub fn quad(corner: Vec3, edge_u: Vec3, edge_v: Vec3) -> Mesh {
    Mesh {
        positions: vec![corner, corner + edge_u, corner + edge_u + edge_v, corner + edge_v],
        normals: Vec::new(),
        uvs: vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        deform: None,
        ..Default::default()
    }
}

/// An axis-aligned box between two corners, faces outwards.
pub fn cuboid(min: Vec3, max: Vec3) -> Mesh {
    let d = max - min;
    let (x, y, z) = (Vec3::X * d.x, Vec3::Y * d.y, Vec3::Z * d.z);
    merge(&[
        quad(min + z, x, y),
        quad(min + x, -x, y),
        quad(min, z, y),
        quad(min + x + z, -z, y),
        quad(min + y + z, x, -z),
        quad(min, x, z),
    ])
}

/// The inside of an axis-aligned box: faces inwards.
pub fn room(min: Vec3, max: Vec3) -> Mesh {
    let mut mesh = cuboid(min, max);
    flip(&mut mesh);
    mesh
}

/// Turns a mesh inside out.
pub fn flip(mesh: &mut Mesh) {
    for triangle in &mut mesh.triangles {
        triangle.swap(1, 2);
    }
    for normal in &mut mesh.normals {
        *normal = -*normal;
    }
}

/// A sphere around the origin, pole along y; smooth normals.
pub fn uv_sphere(radius: f32, slices: u32, stacks: u32) -> Mesh {
    let stacks = stacks.max(2);
    let profile: Vec<Vec2> = (0..=stacks)
        .map(|i| {
            let angle = PI * (i as f32 / stacks as f32 - 0.5);
            let x = if i == 0 || i == stacks { 0.0 } else { angle.cos() };
            Vec2::new(x, angle.sin()) * radius
        })
        .collect();
    let mut mesh = lathe(&profile, slices, true);
    // Exact normals, not those of the profile's chords.
    mesh.normals = mesh.positions.iter().map(|p| p.normalize_or(Vec3::Y)).collect();
    mesh
}

/// A body of revolution about y from a profile of (radius, height), from the bottom to the top on the outside.
///
/// `smooth` averages normals along the profile; without it each ring of faces is flat along the profile.
pub fn lathe(profile: &[Vec2], slices: u32, smooth: bool) -> Mesh {
    let slices = slices.max(3);
    let mut mesh = Mesh::default();
    let outward = |a: Vec2, b: Vec2| {
        let d = b - a;
        Vec2::new(d.y, -d.x).normalize_or_zero()
    };
    let ring = |mesh: &mut Mesh, p: Vec2, n: Vec2, v: f32| {
        let start = mesh.positions.len() as u32;
        for i in 0..=slices {
            // The seam repeats the first angle exactly, so that it closes.
            let angle = TAU * (i % slices) as f32 / slices as f32;
            let (s, c) = angle.sin_cos();
            mesh.positions.push(Vec3::new(p.x * c, p.y, -p.x * s));
            mesh.normals.push(Vec3::new(n.x * c, n.y, -n.x * s));
            mesh.uvs.push(Vec2::new(i as f32 / slices as f32, v));
        }
        start
    };
    let count = profile.len();
    let mut length = 0.0;
    let total: f32 = profile.windows(2).map(|w| (w[1] - w[0]).length()).sum::<f32>().max(f32::MIN_POSITIVE);
    let mut previous_ring = None;
    for i in 0..count.saturating_sub(1) {
        let (a, b) = (profile[i], profile[i + 1]);
        let n = outward(a, b);
        let before = if smooth && i > 0 { outward(profile[i - 1], a) } else { n };
        let after = if smooth && i + 2 < count { outward(b, profile[i + 2]) } else { n };
        let next_length = length + (b - a).length();
        let lower = match previous_ring {
            Some(lower) if smooth => lower,
            _ => ring(&mut mesh, a, (n + before).normalize_or(n), length / total),
        };
        let upper = ring(&mut mesh, b, (n + after).normalize_or(n), next_length / total);
        for s in 0..slices {
            let (a0, a1, b0, b1) = (lower + s, lower + s + 1, upper + s, upper + s + 1);
            if a.x > 0.0 {
                mesh.triangles.push([a0, a1, b1]);
            }
            if b.x > 0.0 {
                mesh.triangles.push([a0, b1, b0]);
            }
        }
        length = next_length;
        previous_ring = Some(upper);
    }
    mesh
}

/// A closed cylinder about y, standing on y = 0.
pub fn cylinder(radius: f32, height: f32, slices: u32) -> Mesh {
    lathe(
        &[Vec2::new(0.0, 0.0), Vec2::new(radius, 0.0), Vec2::new(radius, height), Vec2::new(0.0, height)],
        slices,
        false,
    )
}

/// A ring in the xz plane about y; smooth normals.
pub fn torus(radius: f32, tube: f32, slices: u32, stacks: u32) -> Mesh {
    let stacks = stacks.max(3);
    let profile: Vec<Vec2> = (0..=stacks)
        .map(|i| {
            let angle = TAU * (i % stacks) as f32 / stacks as f32;
            Vec2::new(radius + tube * angle.cos(), tube * angle.sin())
        })
        .collect();
    let mut mesh = lathe(&profile, slices, true);
    mesh.normals = mesh
        .positions
        .iter()
        .map(|p| (*p - Vec3::new(p.x, 0.0, p.z).normalize_or_zero() * radius).normalize_or(Vec3::Y))
        .collect();
    mesh
}

/// A box with rounded edges: half extents include the rounding `radius`; each rounded edge has `steps` faces.
pub fn rounded_box(half: Vec3, radius: f32, steps: u32) -> Mesh {
    let steps = steps.max(1);
    let radius = radius.min(half.min_element()).max(0.0);
    let core = half - Vec3::splat(radius);
    // Coordinates along one axis of a cube's face: the arcs at both ends and the flat between them.
    let coordinates: Vec<f32> = (0..=steps)
        .map(|i| -1.0 + i as f32 / steps as f32)
        .chain((0..=steps).map(|i| i as f32 / steps as f32))
        .collect();
    let n = coordinates.len() as u32;
    let mut mesh = Mesh::default();
    for face in 0..6 {
        let (axis, sign) = (face / 2, if face % 2 == 0 { 1.0 } else { -1.0 });
        let normal = Vec3::AXES[axis] * sign;
        let right = Vec3::AXES[(axis + 1) % 3] * sign;
        let up = Vec3::AXES[(axis + 2) % 3];
        let start = mesh.positions.len() as u32;
        for (j, &v) in coordinates.iter().enumerate() {
            for (i, &u) in coordinates.iter().enumerate() {
                // Tangent spacing spreads the faces of the arc evenly over its eighth of a sphere.
                let warp = |x: f32| (x * PI * 0.25).tan();
                let direction = (normal + right * warp(u) + up * warp(v)).normalize();
                let side = |index: usize| if index as u32 > steps { 1.0 } else { -1.0 };
                let anchor = (normal + right * side(i) + up * side(j)) * core;
                mesh.positions.push(anchor + direction * radius);
                mesh.normals.push(direction);
                mesh.uvs.push(Vec2::new(i as f32, j as f32) / (n - 1) as f32);
            }
        }
        for j in 0..n - 1 {
            for i in 0..n - 1 {
                let a = start + j * n + i;
                mesh.triangles.push([a, a + 1, a + n + 1]);
                mesh.triangles.push([a, a + n + 1, a + n]);
            }
        }
    }
    mesh
}

/// A flat grid of `columns` x `rows` cells over a parallelogram, for meshes that deform.
pub fn grid(corner: Vec3, edge_u: Vec3, edge_v: Vec3, columns: u32, rows: u32) -> Mesh {
    let (columns, rows) = (columns.max(1), rows.max(1));
    let mut mesh = Mesh::default();
    let normal = edge_u.cross(edge_v).normalize_or(Vec3::Y);
    for j in 0..=rows {
        for i in 0..=columns {
            let uv = Vec2::new(i as f32 / columns as f32, j as f32 / rows as f32);
            mesh.positions.push(corner + edge_u * uv.x + edge_v * uv.y);
            mesh.normals.push(normal);
            mesh.uvs.push(uv);
        }
    }
    for j in 0..rows {
        for i in 0..columns {
            let a = j * (columns + 1) + i;
            let b = a + columns + 1;
            mesh.triangles.push([a, a + 1, b + 1]);
            mesh.triangles.push([a, b + 1, b]);
        }
    }
    mesh
}

/// Joins meshes into one; those without normals become flat-shaded by their own face normals if any other has some.
pub fn merge(meshes: &[Mesh]) -> Mesh {
    let mut out = Mesh::default();
    let with_normals = meshes.iter().any(|m| !m.normals.is_empty());
    for mesh in meshes {
        let start = out.positions.len() as u32;
        let unshared;
        let mesh = if with_normals && mesh.normals.is_empty() {
            unshared = flat(mesh);
            &unshared
        } else {
            mesh
        };
        out.positions.extend_from_slice(&mesh.positions);
        out.normals.extend_from_slice(&mesh.normals);
        if mesh.uvs.is_empty() {
            out.uvs.resize(out.positions.len(), Vec2::ZERO);
        } else {
            out.uvs.extend_from_slice(&mesh.uvs);
        }
        out.triangles.extend(mesh.triangles.iter().map(|t| t.map(|i| i + start)));
    }
    out
}

/// The same mesh with corners of its own for every triangle and the face's normal on them.
pub fn flat(mesh: &Mesh) -> Mesh {
    let mut out = Mesh::default();
    for t in &mesh.triangles {
        let p = t.map(|i| mesh.positions[i as usize]);
        let normal = (p[1] - p[0]).cross(p[2] - p[0]).normalize_or(Vec3::Y);
        let start = out.positions.len() as u32;
        for (k, &i) in t.iter().enumerate() {
            out.positions.push(p[k]);
            out.normals.push(normal);
            out.uvs.push(mesh.uvs.get(i as usize).copied().unwrap_or_default());
        }
        out.triangles.push([start, start + 1, start + 2]);
    }
    out
}

/// Moves a mesh, normals included.
pub fn transformed(mut mesh: Mesh, transform: Affine3A) -> Mesh {
    let normal_matrix = transform.matrix3.inverse().transpose();
    for p in &mut mesh.positions {
        *p = transform.transform_point3(*p);
    }
    for n in &mut mesh.normals {
        *n = (normal_matrix * *n).normalize_or(Vec3::Y);
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Volume by the divergence theorem: wrong winding or holes change it.
    fn volume(mesh: &Mesh) -> f32 {
        mesh.triangles
            .iter()
            .map(|t| {
                let p = t.map(|i| mesh.positions[i as usize]);
                p[0].dot(p[1].cross(p[2])) / 6.0
            })
            .sum()
    }

    #[test]
    fn solids_have_their_volume() {
        let cases = [
            ("box", cuboid(Vec3::new(1.0, 2.0, 3.0), Vec3::new(2.0, 4.0, 6.0)), 6.0),
            ("sphere", uv_sphere(2.0, 128, 64), 4.0 / 3.0 * PI * 8.0),
            ("cylinder", cylinder(0.5, 2.0, 256), PI * 0.25 * 2.0),
            ("torus", torus(2.0, 0.5, 128, 64), 2.0 * PI * PI * 2.0 * 0.25),
            ("sharp box", rounded_box(Vec3::new(1.0, 0.5, 2.0), 0.0, 2), 8.0),
            ("all round", rounded_box(Vec3::splat(1.0), 1.0, 24), 4.0 / 3.0 * PI),
            ("room", room(Vec3::ZERO, Vec3::ONE), -1.0),
        ];
        for (name, mesh, expected) in cases {
            let found = volume(&mesh);
            assert!((found / expected - 1.0).abs() < 5e-3, "{name}: {found} instead of {expected}");
        }
    }

    #[test]
    fn normals_face_outwards() {
        for mesh in [uv_sphere(1.0, 16, 8), torus(2.0, 0.5, 24, 12), rounded_box(Vec3::new(1.0, 2.0, 3.0), 0.3, 4)] {
            for t in &mesh.triangles {
                let p = t.map(|i| mesh.positions[i as usize]);
                let face = (p[1] - p[0]).cross(p[2] - p[0]);
                if face.length() < 1e-7 {
                    continue;
                }
                for &i in t {
                    assert!(face.normalize().dot(mesh.normals[i as usize]) > 0.5, "{p:?}");
                }
            }
        }
    }
}
