//! Where the image in a curved mirror was one frame before.
//!
//! At the point of the mirror that shows a thing, the half vector of the directions to the eye and to the thing is the normal (Jakob and
//! Marschner 2012, "Manifold exploration"; motion of images: Zimmer et al. 2015, "Path-space motion estimation and decomposition"). That
//! point is found by Newton's method: normals go on beyond the mirror's triangle as they change within, and the surface bends as they do.

use glam::Vec3;

/// The mirror at the point that shows the thing now, as it stood one frame before.
pub(crate) struct CurvedMirror {
    pub(crate) point: Vec3,
    /// Unit, on the eye's side.
    pub(crate) normal: Vec3,
    /// Two edges of the triangle.
    pub(crate) edges: [Vec3; 2],
    /// By how much the normal changes along each.
    pub(crate) bend: [Vec3; 2],
}

/// What the mirror shows.
#[derive(Clone, Copy)]
pub(crate) enum Shown {
    Point(Vec3),
    /// Infinitely far away, in this unit direction.
    Direction(Vec3),
}

/// Steps of Newton's method.
pub(crate) const NEWTON_STEPS: u32 = 6;
/// Largest length of the half vector beside the normal that counts as found: a ten thousandth of a radian.
pub(crate) const NEWTON_FOUND: f32 = 1e-4;
/// Determinant of the slopes, over the product of the diagonal, under which there is no step: two edges in a line, or an image that breaks up.
pub(crate) const NEWTON_DETERMINANT: f32 = 1e-6;

impl CurvedMirror {
    /// The point of the mirror in which an eye sees what is shown. `None`: not found, as where the image breaks up.
    pub(crate) fn seen_at(&self, eye: Vec3, shown: Shown) -> Option<Vec3> {
        let mut along = Vec3::ZERO;
        let mut turn = Vec3::ZERO;
        let place = |along: Vec3, turn: Vec3| self.point + along - 0.5 * along.dot(turn) * self.normal;
        for _ in 0..NEWTON_STEPS {
            // The slopes are those on the plane of the triangle, which is enough to converge.
            let (half, slope) = half_vector(place(along, turn), eye, shown, self.edges);
            let normal = self.normal + turn;
            let length = normal.length();
            let unit = normal / length;
            let miss = half - unit;
            let across = |v: Vec3| [v.dot(self.edges[0]), v.dot(self.edges[1])];
            let turned = |k: usize| (self.bend[k] - unit * unit.dot(self.bend[k])) / length;
            let [a, c] = across(slope[0] - turned(0));
            let [b, d] = across(slope[1] - turned(1));
            let [p, q] = across(miss);
            let determinant = a * d - b * c;
            // Not a number compares false.
            let solvable = determinant.abs() > NEWTON_DETERMINANT * (a * d).abs().max((b * c).abs());
            if !solvable {
                return None;
            }
            let (i, j) = ((b * q - d * p) / determinant, (c * p - a * q) / determinant);
            along += i * self.edges[0] + j * self.edges[1];
            turn += i * self.bend[0] + j * self.bend[1];
        }
        let at = place(along, turn);
        let (half, _) = half_vector(at, eye, shown, self.edges);
        let found = (half - (self.normal + turn).normalize_or_zero()).length() < NEWTON_FOUND;
        found.then_some(at)
    }
}

/// The unit half vector at a point of the mirror, and how it changes along two edges.
fn half_vector(at: Vec3, eye: Vec3, shown: Shown, edges: [Vec3; 2]) -> (Vec3, [Vec3; 2]) {
    let towards = |target: Vec3| {
        let away = target - at;
        let distance = away.length();
        let unit = away / distance;
        (unit, edges.map(|e| (unit * unit.dot(e) - e) / distance))
    };
    let (out, out_slope) = towards(eye);
    let (shown, shown_slope) = match shown {
        Shown::Point(point) => towards(point),
        Shown::Direction(direction) => (direction, [Vec3::ZERO; 2]),
    };
    let sum = out + shown;
    let length = sum.length();
    let half = sum / length;
    let slope = [0, 1].map(|k| {
        let change = out_slope[k] + shown_slope[k];
        (change - half * half.dot(change)) / length
    });
    (half, slope)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sphere of radius 1 around the origin, seen at `point`, its edges along two tangents.
    fn sphere(point: Vec3) -> CurvedMirror {
        let normal = point.normalize();
        let (u, v) = normal.any_orthonormal_pair();
        let edges = [0.1 * u, 0.07 * v + 0.03 * u];
        CurvedMirror { point, normal, edges, bend: edges }
    }

    #[test]
    fn the_image_in_a_sphere_is_found_where_the_law_of_reflection_holds() {
        let eye = Vec3::new(0.3, 0.2, 4.0);
        let thing = Vec3::new(1.5, -0.8, 2.5);
        let start = Vec3::new(0.22, -0.02, 1.0).normalize();
        for shown in [Shown::Point(thing), Shown::Direction(thing.normalize())] {
            let found = sphere(start).seen_at(eye, shown).unwrap();
            assert!((found.length() - 1.0).abs() < 3e-3, "{found}");
            let normal = found.normalize();
            let to_thing = match shown {
                Shown::Point(p) => (p - found).normalize(),
                Shown::Direction(d) => d,
            };
            let half = ((eye - found).normalize() + to_thing).normalize();
            assert!((half - normal).length() < 2e-3, "{half} {normal}");
            assert!((found - start).length() > 0.05, "{found} {start}");
        }
    }

    #[test]
    fn a_plane_mirror_shows_the_thing_behind_it() {
        let mirror = CurvedMirror {
            point: Vec3::new(0.5, 0.5, 0.0),
            normal: Vec3::Z,
            edges: [Vec3::X, Vec3::new(0.5, 1.0, 0.0)],
            bend: [Vec3::ZERO; 2],
        };
        let (eye, thing) = (Vec3::new(-1.0, 0.3, 3.0), Vec3::new(2.0, -0.4, 1.0));
        let found = mirror.seen_at(eye, Shown::Point(thing)).unwrap();
        // Of the line from the eye to the image, three quarters lie before the mirror.
        let expected = eye + 0.75 * (thing * Vec3::new(1.0, 1.0, -1.0) - eye);
        assert!((found - expected).length() < 1e-4, "{found} {expected}");
    }

    #[test]
    fn what_no_point_of_the_mirror_shows_is_not_found() {
        let behind = sphere(Vec3::Z).seen_at(Vec3::new(0.0, 0.0, 3.0), Shown::Direction(-Vec3::Z));
        assert!(behind.is_none());
    }
}
