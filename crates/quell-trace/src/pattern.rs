//! Procedural textures: a closed set, evaluated at hit points.
//!
//! They change the base colour and the roughness of a material. Lengths are in the unit of the coordinates that the
//! pattern reads: texture coordinates, or positions of the mesh at rest, so that patterns stick to what moves.

use crate::material::Material;
use glam::{Vec2, Vec3, Vec3Swizzles};

/// What a pattern draws.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pattern {
    /// The material as it is.
    Plain,
    /// Squares of one texture-coordinate unit divided by `cells`.
    Checker {
        /// Colour of the other squares (the material's own is the first).
        other: Vec3,
        /// Squares a unit, along u and v.
        cells: Vec2,
    },
    /// Tiles with joints; the tiles vary in brightness and roughness.
    Tiles {
        /// Colour of the joints.
        joint: Vec3,
        /// Tiles a unit, along u and v.
        cells: Vec2,
        /// Width of a joint as a share of a tile.
        width: f32,
        /// Share by which the brightness of tiles varies.
        variation: f32,
        /// Shift of every other row as a share of a tile: 0.5 makes bricks or planks.
        shift: f32,
    },
    /// Stripes across u with soft edges.
    Stripes {
        /// Colour of the other stripes.
        other: Vec3,
        /// Pairs of stripes a unit.
        count: f32,
    },
    /// Wood: grain along the mesh's z axis.
    Wood {
        /// Colour of the late wood.
        dark: Vec3,
        /// Rings a unit.
        rings: f32,
    },
    /// Marble: veins in a base.
    Marble {
        /// Colour of the veins.
        vein: Vec3,
        /// Veins a unit.
        scale: f32,
    },
    /// Soft spots of several sizes: plaster, rust, clouds.
    Mottled {
        /// Colour of the other spots.
        other: Vec3,
        /// Largest spots a unit.
        scale: f32,
    },
    /// Wooden planks along v: tiles whose grain and tone differ from board to board.
    Planks {
        /// Colour of grain and joints.
        dark: Vec3,
        /// Boards a unit along u, lengths a unit along v.
        cells: Vec2,
    },
    /// A painting in texture coordinates: discs and bars of three colours.
    Picture {
        /// Colours beside the material's own.
        colors: [Vec3; 3],
        /// Chooses the composition.
        seed: u32,
    },
}

impl Pattern {
    /// Changes `material` at texture coordinate `uv` and rest position `local`.
    pub fn apply(&self, material: &mut Material, uv: Vec2, local: Vec3) {
        match *self {
            Self::Plain => {}
            Self::Checker { other, cells } => {
                let cell = (uv * cells).floor();
                if (cell.x + cell.y).rem_euclid(2.0) >= 1.0 {
                    material.base_color = other;
                }
            }
            Self::Tiles { joint, cells, width, variation, shift } => {
                let mut p = uv * cells;
                p.x += shift * p.y.floor().rem_euclid(2.0);
                let cell = p.floor();
                let inside = p - cell;
                // The joint is as wide along v as along u, whatever the tile's shape.
                let width = Vec2::new(width, width * cells.y / cells.x);
                if inside.x < width.x || inside.y < width.y {
                    material.base_color = joint;
                    material.roughness = material.roughness.max(0.7);
                } else {
                    let h = hash(cell.extend(7.0));
                    material.base_color = (material.base_color * (1.0 + variation * (h - 0.5))).min(Vec3::splat(0.95));
                    material.roughness = (material.roughness * (0.9 + 0.2 * hash(cell.extend(3.0)))).clamp(0.0, 1.0);
                }
            }
            Self::Stripes { other, count } => {
                let phase = (uv.x * count).rem_euclid(1.0);
                let s = smoothstep(0.23, 0.27, phase) - smoothstep(0.73, 0.77, phase);
                material.base_color = material.base_color.lerp(other, s);
            }
            Self::Wood { dark, rings } => {
                let grain = wood(local, rings);
                material.base_color = material.base_color.lerp(dark, grain);
                material.roughness = (material.roughness + 0.12 * grain).min(1.0);
            }
            Self::Marble { vein, scale } => {
                let p = local * scale;
                let turbulence = fbm(p * 1.7, 5);
                let wave = ((p.x + 0.6 * p.y + 0.8 * p.z) * 2.0 + 4.0 * turbulence).sin().abs();
                let s = (1.0 - wave).powi(6) + 0.25 * fbm(p * 4.0 + Vec3::splat(9.0), 3);
                material.base_color = material.base_color.lerp(vein, s.clamp(0.0, 1.0));
            }
            Self::Mottled { other, scale } => {
                let s = smoothstep(0.35, 0.65, fbm(local * scale, 4));
                material.base_color = material.base_color.lerp(other, s);
            }
            Self::Planks { dark, cells } => {
                let p = uv * cells;
                let board = p.x.floor();
                let along = p.y + hash(Vec3::new(board, 1.0, 5.0));
                let cell = Vec2::new(board, along.floor());
                let inside = Vec2::new(p.x - board, along - cell.y);
                let tone = hash(cell.extend(11.0));
                let grain_at = Vec3::new(inside.x * 0.25, tone * 40.0, along * 0.6 * cells.x / cells.y);
                let grain = 0.55 * wood(grain_at, 9.0);
                material.base_color = material.base_color.lerp(dark, grain) * (0.72 + 0.5 * tone);
                material.roughness = (material.roughness * (0.85 + 0.3 * tone) + 0.06 * grain).clamp(0.0, 1.0);
                let gap = Vec2::new(0.012, 0.012 * cells.y / cells.x);
                if inside.x < gap.x || inside.y < gap.y {
                    // Lacquer fills the gaps: they are dark, but reflect as the boards do.
                    material.base_color = dark * 0.35;
                }
            }
            Self::Picture { colors, seed } => {
                let bar = (uv.x * 5.0).floor();
                let tone = hash(Vec3::new(bar, seed as f32, 2.0));
                if uv.y < 0.25 + 0.3 * tone {
                    material.base_color = colors[(tone * 3.0) as usize % 3];
                }
                for k in 0..4 {
                    let key = |c: f32| hash(Vec3::new(k as f32, seed as f32, c));
                    let centre = Vec2::new(0.2 + 0.6 * key(13.0), 0.3 + 0.5 * key(17.0));
                    if (uv - centre).length() < 0.05 + 0.16 * key(19.0) {
                        material.base_color = colors[k % 3] * (0.6 + 0.4 * key(23.0));
                    }
                }
            }
        }
    }
}

/// Grain of wood in 0..1: 1 is late wood.
fn wood(p: Vec3, rings: f32) -> f32 {
    let bend = Vec3::new(fbm(p * Vec3::new(1.5, 1.5, 0.4), 2), fbm(p.yzx() * 1.3, 2), 0.0) * 0.5;
    let q = p + bend;
    let ring = ((q.x * q.x + q.y * q.y).sqrt() * rings).rem_euclid(1.0);
    let fibre = value_noise(p * Vec3::new(60.0, 60.0, 2.5));
    (0.75 * smoothstep(0.3, 0.9, ring) * smoothstep(1.0, 0.92, ring) + 0.35 * fibre).clamp(0.0, 1.0)
}

fn smoothstep(edge0: f32, edge1: f32, x: f32) -> f32 {
    let t = ((x - edge0) / (edge1 - edge0)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// A hash of whole numbers to 0..1.
fn hash(p: Vec3) -> f32 {
    let mut h = (p.x as i32 as u32).wrapping_mul(0x8da6_b343)
        ^ (p.y as i32 as u32).wrapping_mul(0xd816_3841)
        ^ (p.z as i32 as u32).wrapping_mul(0xcb1a_b31f);
    h ^= h >> 16;
    h = h.wrapping_mul(0x7feb_352d);
    h ^= h >> 15;
    h = h.wrapping_mul(0x846c_a68b);
    h ^= h >> 16;
    (h >> 8) as f32 / (1 << 24) as f32
}

/// Trilinear value noise with smooth fades, 0..1.
fn value_noise(p: Vec3) -> f32 {
    let cell = p.floor();
    let f = p - cell;
    let f = f * f * (Vec3::splat(3.0) - 2.0 * f);
    let corner = |x: f32, y: f32, z: f32| hash(cell + Vec3::new(x, y, z));
    let lerp = |a: f32, b: f32, t: f32| a + (b - a) * t;
    let x00 = lerp(corner(0.0, 0.0, 0.0), corner(1.0, 0.0, 0.0), f.x);
    let x10 = lerp(corner(0.0, 1.0, 0.0), corner(1.0, 1.0, 0.0), f.x);
    let x01 = lerp(corner(0.0, 0.0, 1.0), corner(1.0, 0.0, 1.0), f.x);
    let x11 = lerp(corner(0.0, 1.0, 1.0), corner(1.0, 1.0, 1.0), f.x);
    lerp(lerp(x00, x10, f.y), lerp(x01, x11, f.y), f.z)
}

/// Several octaves of value noise, 0..1.
fn fbm(p: Vec3, octaves: u32) -> f32 {
    let (mut sum, mut amplitude, mut total, mut p) = (0.0, 1.0, 0.0, p);
    for _ in 0..octaves {
        sum += amplitude * value_noise(p);
        total += amplitude;
        amplitude *= 0.5;
        p = p * 2.03 + Vec3::new(5.3, 1.7, 9.1);
    }
    sum / total
}
