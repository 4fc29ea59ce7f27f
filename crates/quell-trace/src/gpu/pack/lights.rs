//! Light sources: the tree, the emitters, the environment; rows of four numbers.

use crate::environment::{Background, Environment, Map};
use crate::gpu::layout::{self, NONE, Row, bits, row};
use crate::lights::tree::Link;
use crate::lights::{Emitter, NEAR_RADII};
use crate::sources::Sources;
use glam::Vec3;

/// All rows, and where each part begins.
pub(super) fn lights(sources: &Sources) -> (Vec<Row>, layout::Lights) {
    let sampler = &sources.sampler;
    let mut rows: Vec<Row> = Vec::new();
    for node in &sampler.tree.nodes {
        let g = &node.group;
        let (leaf, link) = match node.link {
            Link::Children(second) => (0, second),
            Link::Emitter(emitter) => (2, emitter),
        };
        rows.push(row(g.low, g.sin_spread));
        rows.push(row(g.high, g.cos_spread));
        rows.push(row(g.axis, g.cos_emission));
        rows.push([g.intensity, bits(u32::from(g.two_sided) | leaf), bits(link), 0.0]);
    }
    let mut lights = layout::Lights {
        tree_nodes: sampler.tree.nodes.len() as u32,
        emitters: rows.len() as u32,
        environment_emitter: if sources.environment.is_some() { sources.environment_index as u32 } else { NONE },
        has_area: u32::from(sources.has_area),
        ..layout::Lights::default()
    };
    // Corners come after all emitters, so that these can be found by their number.
    let mut corners: Vec<Row> = Vec::new();
    let first_corner = rows.len() + EMITTER_ROWS * sampler.emitters.len();
    for (index, emitter) in sampler.emitters.iter().enumerate() {
        let trail = sampler.tree.trails.get(index).copied().flatten();
        let (path, depth) = trail.map_or((0, NONE), |t| (t.bits, t.depth));
        let varying = sources.varying.get(index).copied().unwrap_or(NONE);
        let begin = (first_corner + corners.len()) as u32;
        let mut packed = packed_emitter(emitter, begin, &mut corners);
        packed[1] = [path as u32, (path >> 32) as u32, depth, varying].map(bits);
        rows.extend(packed);
    }
    rows.append(&mut corners);
    lights.infinite = rows.len() as u32;
    lights.infinite_count = sampler.infinite.len() as u32;
    rows.extend(sampler.infinite.iter().map(|&(emitter, power)| [bits(emitter as u32), power, 0.0, 0.0]));
    if let Some(environment) = &sources.environment {
        add_environment(environment, sources.environment_scale, &mut rows, &mut lights);
    }
    if rows.is_empty() {
        rows.push([0.0; 4]);
    }
    (rows, lights)
}

/// As in `lights/mod.wgsl`.
const EMITTER_ROWS: usize = 7;

/// The rows of an emitter without its way through the tree; the corners of its triangles go to `corners`, which begin
/// at row `begin` for this emitter.
fn packed_emitter(emitter: &Emitter, begin: u32, corners: &mut Vec<Row>) -> [Row; EMITTER_ROWS] {
    let mut rows = [[0.0; 4]; EMITTER_ROWS];
    let head = |radiance: Vec3, kind: u32, flags: u32| row(radiance, bits(kind | flags));
    match emitter {
        Emitter::Triangle { vertices, radiance, two_sided } => {
            rows[0] = head(*radiance, layout::TRIANGLE, u32::from(*two_sided) << 8 | 1 << 16);
            rows[2] = row(Vec3::ZERO, bits(begin));
            corners.extend(vertices.map(|v| row(v, 1.0)));
        }
        Emitter::Patch { patch, radiance, two_sided } => {
            let flat = u32::from(patch.parallelogram.is_some()) << 9;
            let count = (patch.triangles.len() as u32) << 16;
            rows[0] = head(*radiance, layout::PATCH, u32::from(*two_sided) << 8 | flat | count);
            let near = NEAR_RADII * 0.5 * (patch.high - patch.low).length();
            let [corner, edge1, edge2] = patch.parallelogram.unwrap_or_default();
            rows[2] = row(0.5 * (patch.low + patch.high), bits(begin));
            rows[3] = row(patch.normal, patch.area);
            rows[4] = row(corner, near);
            rows[5] = row(edge1, 0.0);
            rows[6] = row(edge2, 0.0);
            for (triangle, share) in patch.triangles.iter().zip(&patch.cumulative) {
                corners.extend(triangle.map(|v| row(v, *share)));
            }
        }
        Emitter::Point { position, intensity } => {
            rows[0] = head(*intensity, layout::POINT, 0);
            rows[2] = row(*position, 0.0);
        }
        Emitter::Spot { position, direction, intensity, inner_angle, outer_angle } => {
            rows[0] = head(*intensity, layout::SPOT, 0);
            rows[2] = row(*position, 0.0);
            rows[3] = row(*direction, 0.0);
            rows[5] = row(Vec3::ZERO, inner_angle.cos());
            rows[6] = row(Vec3::ZERO, outer_angle.cos());
        }
        Emitter::Directional { direction, irradiance } => {
            rows[0] = head(*irradiance, layout::DIRECTIONAL, 0);
            rows[3] = row(*direction, 0.0);
        }
        Emitter::Environment(_) => rows[0] = head(Vec3::ZERO, layout::ENVIRONMENT, 0),
    }
    rows
}

fn add_environment(environment: &Environment, scale: f32, rows: &mut Vec<Row>, lights: &mut layout::Lights) {
    match &environment.background {
        Background::Constant(radiance) => lights.environment_color = (*radiance * scale).to_array(),
        Background::Map(map) => add_map(map, scale, rows, lights),
    }
    if let Some(sun) = &environment.sun {
        lights.sun_probability = environment.sun_probability;
        lights.sun_direction = sun.direction.to_array();
        lights.sun_one_minus_cos = sun.one_minus_cos;
        lights.sun_radiance = (sun.radiance * scale).to_array();
    }
}

fn add_map(map: &Map, scale: f32, rows: &mut Vec<Row>, lights: &mut layout::Lights) {
    let size = map.texels.size();
    lights.map_extent = [size.width as u32, size.height as u32];
    lights.map_rotation = map.rotation;
    lights.environment = rows.len() as u32;
    let stride = size.width + 1;
    for y in 0..size.height {
        let of_row = map.row_cdf[y + 1] - map.row_cdf[y];
        let columns = &map.column_cdf[y * stride..][..stride];
        for x in 0..size.width {
            let radiance = Vec3::from_array(map.texels.at(x, y)) * scale;
            rows.push(row(radiance, of_row * (columns[x + 1] - columns[x])));
        }
    }
    let mut cdf = |values: &[f32]| {
        let first = rows.len() as u32;
        rows.extend(values.chunks(4).map(|chunk| std::array::from_fn(|i| chunk.get(i).copied().unwrap_or(1.0))));
        first
    };
    lights.row_cdf = cdf(&map.row_cdf);
    lights.column_cdf = cdf(&map.column_cdf);
}
