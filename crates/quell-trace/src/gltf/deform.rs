//! Skins and morph targets: where the vertices of a mesh are at a frame.

use super::accessor::Reader;
use super::error::{Fault, Place, item};
use super::mesh::Part;
use super::nodes::{Rig, single};
use super::report::Warnings;
use crate::scene::{Deformed, Mesh};
use glam::{Affine3A, DAffine3, DMat4, Mat3A, Vec3, Vec3A};
use rayon::prelude::*;
use std::sync::Arc;

/// Vertices that one task moves.
const TASK: usize = 2048;

/// Joints of a skin, with the matrices that take a vertex at rest into the joint's space.
#[derive(Debug)]
pub(super) struct Skin {
    joints: Vec<(usize, DAffine3)>,
}

impl Skin {
    pub(super) fn read(reader: &Reader<'_>, index: usize, warnings: &mut Warnings) -> Result<Self, Fault> {
        let list = Place::root("skins");
        let place = list.item(index);
        let skin = item(&reader.root.skins, index, "skin", &place)?;
        let named = place.field("joints");
        for (number, &joint) in skin.joints.iter().enumerate() {
            item(&reader.root.nodes, joint, "node", &named.item(number))?;
        }
        let mut joints: Vec<(usize, DAffine3)> = skin.joints.iter().map(|&j| (j, DAffine3::IDENTITY)).collect();
        if let Some(accessor) = skin.inverse_bind_matrices {
            let place = place.field("inverseBindMatrices");
            let matrices = reader.floats::<16>(accessor, &place)?;
            if matrices.len() < joints.len() {
                let problem = format!("has {} matrices for {} joints", matrices.len(), joints.len());
                return Err(Fault::data(&place, problem));
            }
            for (joint, matrix) in joints.iter_mut().zip(matrices) {
                let matrix = DMat4::from_cols_array(&matrix.map(f64::from));
                if matrix.is_finite() {
                    joint.1 = DAffine3::from_mat4(matrix);
                } else {
                    warnings.push(&place, "a matrix is not finite: the joint binds where it stands");
                }
            }
        }
        Ok(Self { joints })
    }

    pub(super) fn len(&self) -> usize {
        self.joints.len()
    }
}

/// Moves the vertices of one placed part.
pub(super) struct Deformer {
    pub(super) rig: Arc<Rig>,
    pub(super) part: Arc<Part>,
    pub(super) node: usize,
    pub(super) skin: Option<Arc<Skin>>,
    /// Weights of the morph targets where no channel drives them.
    pub(super) weights: Vec<f32>,
}

impl Deformer {
    /// Whether the vertices move from frame to frame, in their own space.
    pub(super) fn moves(&self) -> bool {
        let morphs = !self.part.targets.is_empty() && self.rig.drives_weights(self.node);
        morphs || self.skin.as_ref().is_some_and(|skin| skin.joints.iter().any(|(j, _)| self.rig.moves(*j)))
    }

    /// Positions and normals at a frame: morph targets first, then the skin, as the specification has it. With a skin
    /// the result stands in the world: the mesh's own node does not count.
    pub(super) fn at(&self, frame: f64, mesh: &Mesh) -> Deformed {
        let pose = self.rig.pose(frame);
        let weights = pose.weights(self.node).unwrap_or(&self.weights);
        let targets: Vec<_> = self.part.targets.iter().zip(weights).filter(|(_, w)| **w != 0.0).collect();
        let matrices: Vec<Affine3A> = match &self.skin {
            None => Vec::new(),
            Some(skin) => skin.joints.iter().map(|(joint, bind)| single(pose.world(*joint) * *bind)).collect(),
        };
        let moved = |i: usize| {
            let mut position = mesh.positions[i];
            let mut normal = mesh.normals.get(i).copied().unwrap_or(Vec3::ZERO);
            for (target, weight) in &targets {
                if let Some(offset) = target.positions.get(i) {
                    position += *offset * **weight;
                }
                if let Some(offset) = target.normals.get(i) {
                    normal += *offset * **weight;
                }
            }
            if !matrices.is_empty()
                && let Some(matrix) = self.blended(&matrices, i)
            {
                position = matrix.transform_point3(position);
                normal = turned(&matrix.matrix3, normal);
            }
            (position, normal)
        };
        let both: (Vec<Vec3>, Vec<Vec3>) =
            (0..mesh.positions.len()).into_par_iter().with_min_len(TASK).map(moved).unzip();
        if mesh.normals.is_empty() { (both.0, Vec::new()) } else { both }
    }

    /// The mean of a vertex's joints.
    fn blended(&self, matrices: &[Affine3A], vertex: usize) -> Option<Affine3A> {
        let mut sum = 0.0;
        let mut matrix3 = Mat3A::ZERO;
        let mut translation = Vec3A::ZERO;
        for influences in &self.part.influences {
            for (joint, &weight) in influences.joints.get(vertex)?.iter().zip(influences.weights.get(vertex)?) {
                if weight > 0.0 {
                    let matrix = matrices.get(*joint as usize)?;
                    sum += weight;
                    matrix3 += matrix.matrix3 * weight;
                    translation += matrix.translation * weight;
                }
            }
        }
        if sum > 0.0 {
            let scale = 1.0 / sum;
            return Some(Affine3A { matrix3: matrix3 * scale, translation: translation * scale });
        }
        // Bound to nothing: it goes with its first joint.
        matrices.get(self.part.influences.first()?.joints.get(vertex)?[0] as usize).copied()
    }
}

/// A normal turned as normals are: by the cofactors, which also serve flattened matrices.
fn turned(m: &Mat3A, normal: Vec3) -> Vec3 {
    let sign = if m.determinant() < 0.0 { -1.0 } else { 1.0 };
    let cofactors = Mat3A::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
    (Vec3::from(cofactors * Vec3A::from(normal)) * sign).normalize_or_zero()
}
