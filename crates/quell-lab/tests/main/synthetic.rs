//! A sequence made by formula, with exact guides and motion: a textured wall and floor, a textured board that moves
//! before them, a moving camera, and a soft shadow that moves over everything.

use glam::{Vec2, Vec3};
use quell::{Camera, FrameBuf, Plane, Rgb, Size};

pub struct Scene {
    pub size: Size,
    /// Whether camera, board and shadow move.
    pub moves: bool,
}

struct Hit {
    world: Vec3,
    normal: Vec3,
    id: u32,
    /// Where the same point of the surface was a frame ago.
    before: Vec3,
    albedo: Vec3,
}

fn hash(mut z: u64) -> f32 {
    z = z.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 40) as f32 / (1u64 << 24) as f32
}

/// Smooth noise, 0..1, a cell a unit.
fn smooth(p: Vec2, seed: u64) -> f32 {
    let base = p.floor();
    let t = p - base;
    let s = t * t * (Vec2::splat(3.0) - 2.0 * t);
    let at = |i: f32, j: f32| {
        hash(seed.wrapping_mul(7919) ^ (((base.x + i) as i64 as u64) << 32) ^ ((base.y + j) as i64 as u32 as u64))
    };
    let row = |j: f32| at(0.0, j) + s.x * (at(1.0, j) - at(0.0, j));
    row(0.0) + s.y * (row(1.0) - row(0.0))
}

impl Scene {
    fn time(&self, t: i64) -> f32 {
        if self.moves { t as f32 } else { 0.0 }
    }

    pub fn camera(&self, t: i64) -> Camera {
        let t = self.time(t);
        let aspect = self.size.width as f32 / self.size.height as f32;
        Camera::perspective([0.012 * t, 0.1, 3.0 - 0.006 * t], [0.0, -0.05, -1.0], [0.0, 1.0, 0.0], 0.9, aspect)
    }

    fn board(&self, t: i64) -> Vec3 {
        Vec3::new(-0.9 + 0.035 * self.time(t), -0.1, 0.4)
    }

    fn hit(&self, origin: Vec3, direction: Vec3, t: i64) -> Option<Hit> {
        let mut nearest: Option<(f32, Hit)> = None;
        let mut consider = |distance: f32, hit: Hit| {
            if distance > 0.0 && nearest.as_ref().is_none_or(|n| distance < n.0) {
                nearest = Some((distance, hit));
            }
        };
        let texture = |p: Vec2, seed: u64| {
            // Fine texture on a part of each surface, coarse on all.
            let fine = if smooth(p * 0.7, seed + 9) > 0.45 { 1.0 } else { 0.15 };
            let v = 0.6 * smooth(p * 3.0, seed) + 0.4 * fine * (smooth(p * 15.0, seed + 1) - 0.5) + 0.2;
            Vec3::new(v, 0.9 * v, 0.75 * v + 0.05).clamp(Vec3::splat(0.05), Vec3::splat(0.95))
        };
        let wall = (-2.0 - origin.z) / direction.z;
        let world = origin + wall * direction;
        if world.y > -1.0 && world.y < 1.8 {
            let albedo = texture(Vec2::new(world.x, world.y), 1);
            consider(wall, Hit { world, normal: Vec3::Z, id: 1, before: world, albedo });
        }
        let floor = (-1.0 - origin.y) / direction.y;
        let world = origin + floor * direction;
        if world.z > -2.0 {
            consider(
                floor,
                Hit { world, normal: Vec3::Y, id: 2, before: world, albedo: texture(Vec2::new(world.x, world.z), 2) },
            );
        }
        let board = self.board(t);
        let distance = (board.z - origin.z) / direction.z;
        let world = origin + distance * direction;
        let local = world - board;
        if local.x.abs() < 0.35 && local.y.abs() < 0.55 {
            let before = local + self.board(t - 1);
            consider(
                distance,
                Hit { world, normal: Vec3::Z, id: 3, before, albedo: texture(Vec2::new(local.x, local.y), 3) },
            );
        }
        nearest.map(|n| n.1)
    }

    /// Indirect light: smooth gradients, dark contact of wall and floor, and a shadow that moves.
    fn indirect(&self, p: Vec3, t: i64) -> f32 {
        let contact = 1.0 - 0.5 * (-(p.y + 1.0).abs().min((p.z + 2.0).abs().max((p.y + 1.0).abs())) / 0.25).exp();
        let shadow = Vec2::new(1.0 - 0.1 * self.time(t), 0.1);
        let d = (Vec2::new(p.x, p.y + 0.4 * p.z + 0.8) - shadow) / Vec2::new(0.35, 0.6);
        let dark = 1.0 - 0.85 / (1.0 + (8.0 * (d.length() - 1.0)).exp());
        1.0 * (1.0 + 0.3 * p.x.sin()) * contact * dark
    }

    /// Guides, weights and direct light of frame t, and the true picture.
    pub fn frame(&self, t: i64) -> (FrameBuf, Plane<Rgb>) {
        let camera = self.camera(t);
        let mut frame = FrameBuf::new(self.size, camera);
        frame.previous_camera = self.camera(t - 1);
        frame.index = t;
        let (now, then) = (camera.projection(self.size).unwrap(), frame.previous_camera.projection(self.size).unwrap());
        let mut depth = Plane::filled(self.size, f32::INFINITY);
        let mut normal = Plane::filled(self.size, [0.0; 3]);
        let mut motion = Plane::filled(self.size, [f32::NAN; 2]);
        let mut id = Plane::filled(self.size, 0u32);
        let mut weight = Plane::filled(self.size, [0.0; 3]);
        let mut direct = Plane::filled(self.size, [0.3, 0.4, 0.6]);
        let mut picture = direct.clone();
        for y in 0..self.size.height {
            for x in 0..self.size.width {
                let pixel = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
                let Some(hit) = self.hit(now.eye().into(), now.ray_direction(pixel), t) else { continue };
                depth.set(x, y, now.view_depth(hit.world));
                normal.set(x, y, hit.normal.to_array());
                id.set(x, y, hit.id);
                if let Some(old) = then.pixel(hit.before) {
                    motion.set(x, y, (old - pixel).to_array());
                }
                weight.set(x, y, hit.albedo.to_array());
                let light = hit.albedo * 0.15 * (1.0 + 0.2 * hit.world.y);
                direct.set(x, y, light.to_array());
                picture.set(x, y, (light + hit.albedo * self.indirect(hit.world, t)).to_array());
            }
        }
        frame.view_depth = Some(depth);
        frame.normal = Some(normal);
        frame.motion = Some(motion);
        frame.surface_id = Some(id);
        frame.matte_weight = Some(weight);
        frame.direct = Some(direct);
        (frame, picture)
    }
}

/// Independent noise on the part of a picture that is not direct light: a factor with this relative rms.
pub fn with_noise(frame: &FrameBuf, picture: &Plane<Rgb>, rms: f32, seed: u64) -> Plane<Rgb> {
    let direct = frame.direct.as_ref().unwrap();
    let mut count = seed.wrapping_mul(0x1_0000_0000).wrapping_add((frame.index as u64) << 20);
    Plane::from_fn(picture.size(), |x, y| {
        count += 1;
        let sum: f32 = (0..4).map(|k| hash(count.wrapping_mul(4) + k) - 0.5).sum();
        let factor = 1.0 + rms * sum * 3f32.sqrt();
        let (p, d) = (picture.at(x, y), direct.at(x, y));
        std::array::from_fn(|c| d[c] + factor * (p[c] - d[c]))
    })
}
