//! The hierarchy and its triangles.

use crate::bvh::{Bvh, Link};
use crate::geometry::Geometry;
use crate::gpu::layout::{self, NONE};

/// Nodes as the CPU walks them; one without children where there are no triangles.
pub(super) fn nodes(geometry: &Geometry) -> Vec<layout::Node> {
    let Some(bvh) = &geometry.bvh else {
        return vec![layout::Node { planes: [[0.0; 8]; 6], links: [0; 8] }];
    };
    // Infinite planes of empty slots may count as anything on a device: finite ones that no ray passes.
    let plane = |v: f32| if v == f32::INFINITY { f32::MAX } else { v.max(f32::MIN) };
    bvh.nodes
        .iter()
        .map(|node| layout::Node {
            planes: node.planes.map(|p| p.map(plane)),
            links: node.links.map(|Link(bits)| bits),
        })
        .collect()
}

/// Entries that a walk may have to keep at once.
pub(super) fn stack(geometry: &Geometry) -> u32 {
    let Some(bvh) = &geometry.bvh else { return 1 };
    needed(bvh)
}

/// Children come after their parents, so one pass from the end serves.
fn needed(bvh: &Bvh) -> u32 {
    let mut below = vec![0_u32; bvh.nodes.len()];
    for (index, node) in bvh.nodes.iter().enumerate().rev() {
        let there = (0..8).filter(|&slot| node.planes[0][slot] <= node.planes[1][slot]);
        let links: Vec<u32> = there.map(|slot| node.links[slot].0).collect();
        let children = links.iter().filter(|link| *link & 3 == 0).map(|link| below[(link >> 2) as usize]);
        let count = links.len() as u32;
        below[index] = count.max(count.saturating_sub(1) + children.max().unwrap_or(0));
    }
    below.first().copied().unwrap_or(1)
}

pub(super) fn triangles(geometry: &Geometry, emitter_of: &[u32]) -> Vec<layout::Triangle> {
    let all = geometry.triangles.iter().zip(&geometry.sources).enumerate();
    let mut packed: Vec<layout::Triangle> = all
        .map(|(index, (triangle, source))| {
            let [a, b, c] = triangle.v.map(|v| v.to_array());
            let emitter = emitter_of.get(index).copied().unwrap_or(NONE);
            layout::Triangle { a, instance: source.instance, b, number: source.triangle, c, emitter }
        })
        .collect();
    if packed.is_empty() {
        let none = [0.0; 3];
        packed.push(layout::Triangle { a: none, instance: 0, b: none, number: 0, c: none, emitter: NONE });
    }
    packed
}
