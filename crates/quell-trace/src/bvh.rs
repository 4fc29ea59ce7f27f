//! An eight-wide hierarchy of boxes, and the two walks through it.
//!
//! `obvhs` builds it: locally ordered clustering (PLOC), reinsertion, and the collapse to eight children of Ylitie et al.
//! 2017. Its own nodes are 80 bytes small, which serves GPUs; on a CPU most of a walk went into decoding them. Here the
//! boxes are kept as floats, eight to a vector, and children are visited by distance.

use crate::geometry::Triangle;
use fearless_simd::prelude::*;
use fearless_simd::{Level, f32x8};
use glam::Vec3A;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh;
use obvhs::ploc::PlocBuilder;

/// Children of a node.
const WIDTH: usize = 8;

/// As many as the collapse puts into a leaf.
const MAX_TRIANGLES_PER_LEAF: u32 = 3;

/// Far sides of boxes count as farther by this share, so that no rounding of the slab test loses a hit (Ize 2013,
/// "Robust BVH ray traversal").
pub(crate) const SLACK: f32 = 1.0 + 4.0 * f32::EPSILON;

/// A component of a direction below this counts as this much: its inverse and what is multiplied by it stay finite.
pub(crate) const LEAST_COMPONENT: f32 = 1e-20;

/// A node that is still to be visited or a run of triangles to be tested: an index times 4 plus the number of
/// triangles, 0 for a node.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Link(pub(crate) u32);

impl Link {
    const ROOT: Self = Self(0);

    fn node(index: u32) -> Self {
        Self(index << 2)
    }

    fn leaf(first: u32, count: u32) -> Self {
        Self(first << 2 | count)
    }

    #[inline(always)]
    fn index(self) -> usize {
        (self.0 >> 2) as usize
    }

    #[inline(always)]
    fn count(self) -> usize {
        (self.0 & 3) as usize
    }
}

/// The boxes of up to eight children. Empty ones lie at +inf and end at -inf, where no ray passes.
#[repr(align(64))]
pub(crate) struct Node {
    /// Low and high planes of x, of y, of z.
    pub(crate) planes: [[f32; WIDTH]; 6],
    pub(crate) links: [Link; WIDTH],
}

impl Node {
    const EMPTY: Self = {
        let (low, high) = ([f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]);
        Self { planes: [low, high, low, high, low, high], links: [Link::ROOT; WIDTH] }
    };

    fn set(&mut self, slot: usize, link: Link, bounds: &Aabb) {
        for axis in 0..3 {
            self.planes[2 * axis][slot] = bounds.min[axis];
            self.planes[2 * axis + 1][slot] = bounds.max[axis];
        }
        self.links[slot] = link;
    }
}

/// A ray as boxes are tested against it.
struct Slabs<S: Simd> {
    origin: [f32x8<S>; 3],
    inverse: [f32x8<S>; 3],
    /// Which planes are met first, by axis.
    near: [usize; 3],
}

impl<S: Simd> Slabs<S> {
    #[inline(always)]
    fn new(simd: S, origin: Vec3A, direction: Vec3A) -> Self {
        let inverse = direction.to_array().map(|d| 1.0 / if d.abs() < LEAST_COMPONENT { LEAST_COMPONENT } else { d });
        let near = [0, 1, 2].map(|axis| 2 * axis + usize::from(inverse[axis] < 0.0));
        let splat = |v: f32| f32x8::splat(simd, v);
        Self { origin: origin.to_array().map(splat), inverse: inverse.map(splat), near }
    }

    /// Which children the ray meets before `limit`, as bits, and where it enters them.
    #[inline(always)]
    fn meets(&self, simd: S, node: &Node, limit: f32) -> (u32, [f32; WIDTH]) {
        let at = |plane: usize, axis: usize| {
            (f32x8::simd_from(simd, node.planes[plane]) - self.origin[axis]) * self.inverse[axis]
        };
        let [x, y, z] = self.near;
        let near = at(x, 0).max(at(y, 1)).max(at(z, 2)).max(f32x8::splat(simd, 0.0));
        let far = at(x ^ 1, 0).min(at(y ^ 1, 1)).min(at(z ^ 1, 2)).min(f32x8::splat(simd, limit));
        let hit = near.simd_le(far * f32x8::splat(simd, SLACK));
        (hit.to_bitmask() as u32, near.into())
    }
}

/// What is still to be visited. Deep trees spill into the heap.
struct Stack<T> {
    few: [T; FEW],
    len: usize,
    more: Vec<T>,
}

/// Entries without the heap: ten levels of eight children.
const FEW: usize = 72;

impl<T: Copy> Stack<T> {
    #[inline(always)]
    fn new(any: T) -> Self {
        Self { few: [any; FEW], len: 0, more: Vec::new() }
    }

    #[inline(always)]
    fn push(&mut self, entry: T) {
        match self.few.get_mut(self.len) {
            Some(place) => {
                *place = entry;
                self.len += 1;
            }
            None => self.more.push(entry),
        }
    }

    #[inline(always)]
    fn pop(&mut self) -> Option<T> {
        if !self.more.is_empty() {
            return self.more.pop();
        }
        self.len = self.len.checked_sub(1)?;
        self.few.get(self.len).copied()
    }
}

/// The hierarchy over a list of triangles in the order of its leaves.
pub(crate) struct Bvh {
    pub(crate) nodes: Vec<Node>,
    pub(crate) level: Level,
}

impl Bvh {
    /// Builds over at least one triangle and at most 2^30. Gives the triangles' order: the leaf that is walked
    /// to names places in it.
    pub(crate) fn new(triangles: &[Triangle]) -> (Self, Vec<u32>) {
        // Step by step: `build_cwbvh` checks its result in debug builds with bounds that hold for small coordinates
        // only, and panics.
        let parameters = BvhBuildParams::medium_build();
        let indices = (0..triangles.len() as u32).collect();
        let mut binary = PlocBuilder::with_capacity(triangles.len()).build(
            parameters.ploc_search_distance,
            triangles,
            indices,
            parameters.sort_precision,
            parameters.search_depth_threshold,
        );
        ReinsertionOptimizer::default().run(&mut binary, parameters.reinsertion_batch_ratio, None);
        let wide = bvh2_to_cwbvh(&binary, MAX_TRIANGLES_PER_LEAF, false, true);
        let order = wide.primitive_indices;
        let exact = wide.exact_node_aabbs.unwrap_or_default();
        let nodes = wide
            .nodes
            .iter()
            .map(|packed| {
                let mut node = Node::EMPTY;
                for slot in (0..WIDTH).filter(|&slot| !packed.is_child_empty(slot)) {
                    if packed.is_leaf(slot) {
                        let (first, count) = packed.child_primitives(slot);
                        let mut bounds = Aabb::empty();
                        for &i in &order[first as usize..(first + count) as usize] {
                            bounds = bounds.union(&triangles[i as usize].bounds());
                        }
                        node.set(slot, Link::leaf(first, count), &bounds);
                    } else {
                        let child = packed.child_node_index(slot);
                        node.set(slot, Link::node(child), &exact[child as usize]);
                    }
                }
                node
            })
            .collect();
        (Self { nodes, level: Level::new() }, order)
    }

    /// Instructions that this machine has.
    #[inline]
    pub(crate) fn level(&self) -> Level {
        self.level
    }

    /// Hands out the triangles that the ray may meet, near ones first, until what lies before the smallest
    /// distance that `test` has returned is done. `test` gets the distance so far and returns the new one.
    #[inline(always)]
    pub(crate) fn walk_to_nearest<S: Simd>(
        &self,
        simd: S,
        origin: Vec3A,
        direction: Vec3A,
        mut test: impl FnMut(usize, f32) -> f32,
    ) {
        let slabs = Slabs::new(simd, origin, direction);
        let mut limit = f32::INFINITY;
        let mut stack = Stack::new((0.0_f32, Link::ROOT));
        let mut next = Some((0.0, Link::ROOT));
        while let Some((near, link)) = next {
            if near <= limit * SLACK {
                let (index, count) = (link.index(), link.count());
                if count > 0 {
                    for triangle in index..index + count {
                        limit = test(triangle, limit);
                    }
                } else {
                    let node = &self.nodes[index];
                    let (mut hits, nears) = slabs.meets(simd, node, limit);
                    let begin = stack.len;
                    while hits != 0 {
                        let slot = hits.trailing_zeros() as usize & (WIDTH - 1);
                        hits &= hits - 1;
                        stack.push((nears[slot], node.links[slot]));
                    }
                    // Nearest on top.
                    if let Some(new) = stack.few.get_mut(begin..stack.len) {
                        for i in 1..new.len() {
                            let mut j = i;
                            while j > 0 && new[j - 1].0 < new[j].0 {
                                new.swap(j - 1, j);
                                j -= 1;
                            }
                        }
                    }
                }
            }
            next = stack.pop();
        }
    }

    /// Hands out triangles that the ray may meet before `limit`, until `test` says true. Returns whether it did.
    #[inline(always)]
    pub(crate) fn walk_to_any<S: Simd>(
        &self,
        simd: S,
        origin: Vec3A,
        direction: Vec3A,
        limit: f32,
        mut test: impl FnMut(usize) -> bool,
    ) -> bool {
        let slabs = Slabs::new(simd, origin, direction);
        let mut stack = Stack::new(Link::ROOT);
        let mut next = Some(Link::ROOT);
        while let Some(link) = next {
            let node = &self.nodes[link.index()];
            let (mut hits, _) = slabs.meets(simd, node, limit);
            while hits != 0 {
                let slot = hits.trailing_zeros() as usize & (WIDTH - 1);
                hits &= hits - 1;
                let child = node.links[slot];
                if child.count() == 0 {
                    stack.push(child);
                } else {
                    for triangle in child.index()..child.index() + child.count() {
                        if test(triangle) {
                            return true;
                        }
                    }
                }
            }
            next = stack.pop();
        }
        false
    }
}
