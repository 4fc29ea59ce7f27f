//! The tree of nodes, and where each is at a frame.

use super::animation::{Channel, Driven};
use super::error::{Fault, Place, Problem, item};
use super::report::Warnings;
use super::schema::{Node, Root};
use glam::{Affine3A, DAffine3, DMat4, DQuat, DVec3};
use std::sync::{Arc, Mutex};

/// A node's transform relative to its parent.
#[derive(Clone, Copy, Debug)]
pub(super) struct Local {
    pub(super) translation: DVec3,
    pub(super) rotation: DQuat,
    pub(super) scale: DVec3,
    /// Where the file gives a matrix that no channel takes apart.
    matrix: Option<DAffine3>,
}

impl Local {
    fn affine(&self) -> DAffine3 {
        self.matrix
            .unwrap_or_else(|| DAffine3::from_scale_rotation_translation(self.scale, self.rotation, self.translation))
    }

    /// `None` where a number is not finite.
    fn new(node: &Node, place: &Place<'_>, warnings: &mut Warnings) -> Option<Self> {
        let mut local = Self { translation: DVec3::ZERO, rotation: DQuat::IDENTITY, scale: DVec3::ONE, matrix: None };
        if let Some(matrix) = node.matrix {
            let matrix = DMat4::from_cols_array(&matrix.map(f64::from));
            if !matrix.is_finite() {
                return None;
            }
            local.matrix = Some(DAffine3::from_mat4(matrix));
        }
        if let Some(t) = node.translation {
            local.translation = DVec3::from_array(t.map(f64::from));
        }
        if let Some(s) = node.scale {
            local.scale = DVec3::from_array(s.map(f64::from));
        }
        if let Some(r) = node.rotation {
            let r = DQuat::from_array(r.map(f64::from));
            if !r.is_finite() {
                return None;
            }
            local.rotation = if r.length_squared() > 1e-12 {
                r.normalize()
            } else {
                warnings.push(&place.field("rotation"), "is no rotation (its length is 0): none is applied");
                DQuat::IDENTITY
            };
        }
        (local.translation.is_finite() && local.scale.is_finite()).then_some(local)
    }

    /// The matrix taken apart, for nodes whose channels replace a part of it.
    fn take_apart(&mut self) {
        if let Some(matrix) = self.matrix.take() {
            let (scale, rotation, translation) = matrix.to_scale_rotation_translation();
            self.translation = translation;
            if scale.is_finite() && rotation.is_finite() && rotation.is_normalized() {
                (self.scale, self.rotation) = (scale, rotation);
            }
        }
    }
}

/// The tree as the file has it.
pub(super) struct Tree {
    parent: Vec<Option<usize>>,
    /// All nodes, parents before children.
    order: Vec<usize>,
    locals: Vec<Local>,
    /// Nodes whose transform is not finite, and all below them.
    unusable: Vec<bool>,
}

impl Tree {
    pub(super) fn new(root: &Root, warnings: &mut Warnings) -> Result<Self, Fault> {
        let nodes = &root.nodes;
        let list = Place::root("nodes");
        let mut parent: Vec<Option<usize>> = vec![None; nodes.len()];
        for (index, node) in nodes.iter().enumerate() {
            let place = list.item(index);
            let children = place.field("children");
            for (number, &child) in node.children.iter().enumerate() {
                let place = children.item(number);
                item(nodes, child, "node", &place)?;
                let problem = match parent[child] {
                    _ if child == index => "the node is its own child".to_owned(),
                    Some(other) => format!("node {child} is a child of node {other} already"),
                    None => {
                        parent[child] = Some(index);
                        continue;
                    }
                };
                return Err(Fault::new(&place, Problem::Hierarchy(problem)));
            }
        }
        let mut order: Vec<usize> = (0..nodes.len()).filter(|&n| parent[n].is_none()).collect();
        let mut next = 0;
        while let Some(&node) = order.get(next) {
            order.extend(&nodes[node].children);
            next += 1;
        }
        if order.len() < nodes.len() {
            let mut reached = vec![false; nodes.len()];
            for &node in &order {
                reached[node] = true;
            }
            let one = reached.iter().position(|r| !r).unwrap_or(0);
            // Every node has one parent: what no root reaches hangs below a ring.
            let problem = "the node is its own ancestor, or hangs below one that is".to_owned();
            return Err(Fault::new(&list.item(one), Problem::Hierarchy(problem)));
        }
        let mut locals = Vec::with_capacity(nodes.len());
        let mut unusable = vec![false; nodes.len()];
        for (index, node) in nodes.iter().enumerate() {
            let place = list.item(index);
            let local = Local::new(node, &place, warnings);
            if local.is_none() {
                unusable[index] = true;
                warnings.push(&place, "the transform is not finite: the node and all below it are left out");
            }
            locals.push(local.unwrap_or(Local {
                translation: DVec3::ZERO,
                rotation: DQuat::IDENTITY,
                scale: DVec3::ONE,
                matrix: None,
            }));
        }
        for &node in &order {
            if let Some(parent) = parent[node] {
                unusable[node] |= unusable[parent];
            }
        }
        Ok(Self { parent, order, locals, unusable })
    }

    /// Nodes of the chosen scene, parents before children, in the order of the file's trees; without unusable ones.
    pub(super) fn shown(&self, root: &Root, scene: Option<usize>) -> Result<Vec<usize>, Fault> {
        let mut roots = Vec::new();
        match scene {
            None => roots.extend((0..root.nodes.len()).filter(|&n| self.parent[n].is_none())),
            Some(scene) => {
                let list = Place::root("scenes");
                let place = list.item(scene);
                let nodes = place.field("nodes");
                for (number, &node) in item(&root.scenes, scene, "scene", &place)?.nodes.iter().enumerate() {
                    item(&root.nodes, node, "node", &nodes.item(number))?;
                    roots.push(node);
                }
            }
        }
        let mut seen = vec![false; root.nodes.len()];
        let mut out = Vec::new();
        let mut stack: Vec<usize> = roots.into_iter().rev().collect();
        while let Some(node) = stack.pop() {
            if std::mem::replace(&mut seen[node], true) || self.unusable[node] {
                continue;
            }
            out.push(node);
            stack.extend(root.nodes[node].children.iter().rev());
        }
        Ok(out)
    }
}

/// Where all nodes are at one frame.
pub(super) struct Pose {
    world: Vec<DAffine3>,
    /// Weights of the morph targets, where a channel drives them.
    weights: Vec<Option<Vec<f32>>>,
}

impl Pose {
    /// World from node.
    pub(super) fn world(&self, node: usize) -> DAffine3 {
        self.world.get(node).copied().unwrap_or(DAffine3::IDENTITY)
    }

    pub(super) fn weights(&self, node: usize) -> Option<&[f32]> {
        self.weights.get(node)?.as_deref()
    }
}

/// Nodes and the channels that play: a pure function from frames to poses, with a short memory.
pub(super) struct Rig {
    tree: Tree,
    channels: Vec<Channel>,
    /// Whether the node's place in the world changes.
    moves: Vec<bool>,
    weights_driven: Vec<bool>,
    frames_per_second: f64,
    recent: Mutex<Vec<(u64, Arc<Pose>)>>,
}

/// A frame asks for two moments; cameras and lights ask again.
const POSES_KEPT: usize = 4;

impl Rig {
    pub(super) fn new(mut tree: Tree, channels: Vec<Channel>, frames_per_second: f64) -> Self {
        let mut moves = vec![false; tree.parent.len()];
        let mut weights_driven = moves.clone();
        for channel in &channels {
            if matches!(channel.driven, Driven::Weights) {
                weights_driven[channel.node] = true;
            } else {
                moves[channel.node] = true;
                tree.locals[channel.node].take_apart();
            }
        }
        for &node in &tree.order {
            moves[node] |= tree.parent[node].is_some_and(|parent| moves[parent]);
        }
        Self { tree, channels, moves, weights_driven, frames_per_second, recent: Mutex::new(Vec::new()) }
    }

    /// Whether the node's place in the world changes.
    pub(super) fn moves(&self, node: usize) -> bool {
        self.moves.get(node).copied().unwrap_or(false)
    }

    /// Whether a channel drives the node's morph targets.
    pub(super) fn drives_weights(&self, node: usize) -> bool {
        self.weights_driven.get(node).copied().unwrap_or(false)
    }

    /// Where everything is at a frame. Before the first key and after the last, values stay.
    pub(super) fn pose(&self, frame: f64) -> Arc<Pose> {
        let key = frame.to_bits();
        if let Ok(recent) = self.recent.lock()
            && let Some((_, pose)) = recent.iter().find(|(k, _)| *k == key)
        {
            return Arc::clone(pose);
        }
        let pose = Arc::new(self.evaluate(frame / self.frames_per_second));
        if let Ok(mut recent) = self.recent.lock() {
            if recent.len() >= POSES_KEPT {
                recent.remove(0);
            }
            recent.push((key, Arc::clone(&pose)));
        }
        pose
    }

    fn evaluate(&self, seconds: f64) -> Pose {
        let mut locals = self.tree.locals.clone();
        let mut weights = vec![None; locals.len()];
        for channel in &self.channels {
            channel.apply(seconds, &mut locals[channel.node], &mut weights[channel.node]);
        }
        let mut world = vec![DAffine3::IDENTITY; locals.len()];
        for &node in &self.tree.order {
            let local = locals[node].affine();
            world[node] = match self.tree.parent[node] {
                Some(parent) => world[parent] * local,
                None => local,
            };
        }
        Pose { world, weights }
    }
}

/// In single precision, as the tracer has it.
pub(super) fn single(affine: DAffine3) -> Affine3A {
    Affine3A { matrix3: affine.matrix3.as_mat3().into(), translation: affine.translation.as_vec3().into() }
}
