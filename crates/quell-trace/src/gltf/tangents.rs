//! Tangents for normal maps where a file has none: MikkTSpace, as the specification asks for (section 3.7.2.1).

use super::mesh::Part;
use glam::{Vec2, Vec3, Vec4};

/// Corners whose tangents differ by less share a vertex.
const SAME: f32 = 1e-4;

struct Corners<'a> {
    positions: &'a [Vec3],
    normals: &'a [Vec3],
    uvs: &'a [Vec2],
    triangles: &'a [[u32; 3]],
    /// Three a triangle.
    tangents: Vec<Option<Vec4>>,
}

impl Corners<'_> {
    fn vertex(&self, face: usize, corner: usize) -> usize {
        self.triangles[face][corner] as usize
    }
}

impl bevy_mikktspace::Geometry for Corners<'_> {
    fn num_faces(&self) -> usize {
        self.triangles.len()
    }

    fn num_vertices_of_face(&self, _face: usize) -> usize {
        3
    }

    fn position(&self, face: usize, corner: usize) -> [f32; 3] {
        self.positions[self.vertex(face, corner)].to_array()
    }

    fn normal(&self, face: usize, corner: usize) -> [f32; 3] {
        self.normals[self.vertex(face, corner)].to_array()
    }

    fn tex_coord(&self, face: usize, corner: usize) -> [f32; 2] {
        self.uvs[self.vertex(face, corner)].to_array()
    }

    fn set_tangent(&mut self, tangent: Option<bevy_mikktspace::TangentSpace>, face: usize, corner: usize) {
        // v runs down in glTF's pictures and up in MikkTSpace: the bitangent points the other way.
        let encoded = tangent.map(|t| t.tangent_encoded()).map(|[x, y, z, w]| Vec4::new(x, y, z, -w));
        if let Some(slot) = self.tangents.get_mut(face * 3 + corner) {
            *slot = encoded.filter(|t| t.is_finite());
        }
    }
}

/// Gives the part tangents along its texture coordinates of `uv_set`. Vertices whose corners disagree are split. Parts
/// without normals or coordinates keep none: the tracer then takes each triangle's own.
pub(super) fn generate(part: &mut Part, uv_set: u8) {
    let mesh = &part.mesh;
    let uvs = if uv_set == 0 { &mesh.uvs } else { &mesh.uvs1 };
    let count = mesh.positions.len();
    if mesh.normals.len() < count || uvs.len() < count {
        return;
    }
    let mut corners = Corners {
        positions: &mesh.positions,
        normals: &mesh.normals,
        uvs,
        triangles: &mesh.triangles,
        tangents: vec![None; mesh.triangles.len() * 3],
    };
    if bevy_mikktspace::generate_tangents(&mut corners).is_err() {
        return;
    }
    let found = corners.tangents;
    // The vertex that each vertex was split from, and the vertices split from one: a list linked through `next`.
    let mut origin: Vec<u32> = (0..count as u32).collect();
    let mut next: Vec<Option<u32>> = vec![None; count];
    let mut tangents: Vec<Option<Vec4>> = vec![None; count];
    let mut triangles = part.mesh.triangles.clone();
    for (corner, tangent) in triangles.iter_mut().flatten().zip(found) {
        // Corners without texture area take the first axis at a right angle.
        let tangent = tangent.unwrap_or_else(|| {
            let normal = part.mesh.normals[*corner as usize].normalize_or(Vec3::Z);
            normal.any_orthonormal_vector().extend(1.0)
        });
        let mut at = *corner;
        loop {
            match tangents[at as usize] {
                None => {
                    tangents[at as usize] = Some(tangent);
                    break;
                }
                Some(other) if other.abs_diff_eq(tangent, SAME) => break,
                Some(_) => {}
            }
            at = match next[at as usize] {
                Some(further) => further,
                None => {
                    let Ok(new) = u32::try_from(origin.len()) else { return };
                    next[at as usize] = Some(new);
                    origin.push(origin[*corner as usize]);
                    next.push(None);
                    tangents.push(None);
                    new
                }
            };
        }
        *corner = at;
    }
    part.mesh.triangles = triangles;
    part.mesh.tangents = tangents.into_iter().map(|t| t.unwrap_or(Vec4::new(1.0, 0.0, 0.0, 1.0))).collect();
    if origin.len() > count {
        part.split(&origin[count..]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Mesh;

    /// A square whose left half is mapped mirror-wise: u runs outwards on both sides.
    fn mirrored() -> Part {
        let positions = vec![
            Vec3::new(-1.0, 0.0, 0.0),
            Vec3::new(0.0, 0.0, 0.0),
            Vec3::new(1.0, 0.0, 0.0),
            Vec3::new(-1.0, 1.0, 0.0),
            Vec3::new(0.0, 1.0, 0.0),
            Vec3::new(1.0, 1.0, 0.0),
        ];
        let uvs = positions.iter().map(|p| Vec2::new(p.x.abs(), 1.0 - p.y)).collect();
        let triangles = vec![[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]];
        let mesh = Mesh { normals: vec![Vec3::Z; 6], positions, uvs, triangles, ..Mesh::default() };
        Part { mesh, targets: Vec::new(), influences: Vec::new(), degenerate: 0 }
    }

    #[test]
    fn tangents_follow_u_and_bitangents_point_up_the_picture() {
        let mut part = mirrored();
        generate(&mut part, 0);
        let mesh = &part.mesh;
        // Vertices 1 and 4 lie on the seam: one of each more.
        assert_eq!(mesh.positions.len(), 8);
        assert_eq!(mesh.tangents.len(), 8);
        assert_eq!(mesh.uvs.len(), 8);
        for (number, triangle) in mesh.triangles.iter().enumerate() {
            for &i in triangle {
                let t = mesh.tangents[i as usize];
                let side = if number < 2 { -1.0 } else { 1.0 };
                assert!(t.truncate().abs_diff_eq(Vec3::X * side, 1e-5), "{number}: {t}");
                let bitangent = mesh.normals[i as usize].cross(t.truncate()) * t.w;
                assert!(bitangent.abs_diff_eq(Vec3::Y, 1e-5), "{number}: {bitangent}");
            }
        }
        let mut flat = mirrored();
        flat.mesh.normals.clear();
        generate(&mut flat, 0);
        assert!(flat.mesh.tangents.is_empty());
    }
}
