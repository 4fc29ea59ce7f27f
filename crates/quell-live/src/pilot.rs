//! Cameras that a user moves: about a point, or through the scene; and the scene's own.

use crate::error::LiveError;
use glam::Vec3;
use quell::{Camera, Size};
use quell_trace::Scene;

/// Who moves the camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// The scene's own path.
    Path,
    /// The user, about the point that is looked at.
    Orbit,
    /// The user, through the scene.
    Fly,
}

impl Mode {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Path, Self::Orbit, Self::Fly];

    /// As a user reads it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Path => "path",
            Self::Orbit => "orbit",
            Self::Fly => "fly",
        }
    }
}

/// Steepest look up or down, radians.
const STEEPEST: f32 = 1.55;
/// Radians of a drag over the picture's height.
const TURN: f32 = 2.5;
/// Opening angle in the place of an orthographic camera's, radians.
const USUAL_FOV: f32 = 0.7;
/// Nearest and farthest point that is looked at, as shares of the first one's distance.
const DISTANCES: (f32, f32) = (1e-3, 1e3);

/// Where a camera stands and looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pilot {
    /// Who moves it.
    pub mode: Mode,
    /// Number of the scene's camera, from 1.
    pub camera: usize,
    eye: Vec3,
    /// About `up`, and above the plane across it; radians.
    yaw: f32,
    pitch: f32,
    up: Vec3,
    /// To the point that is looked at.
    distance: f32,
    /// The distance that it began with: the scene's measure.
    measure: f32,
    fov: f32,
}

/// A place to look from, in words `EX,EY,EZ,TX,TY,TZ[,TIME]`: the eye, what it looks at, the time in frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Where the eye is, world space.
    pub eye: [f32; 3],
    /// What it looks at, world space.
    pub target: [f32; 3],
    /// Time in frames of the scene.
    pub time: f64,
}

impl std::str::FromStr for View {
    type Err = &'static str;

    fn from_str(words: &str) -> Result<Self, Self::Err> {
        let numbers: Vec<f64> = words.split(',').map_while(|word| word.trim().parse().ok()).collect();
        let is_usable = |v: &f64| v.is_finite() && v.abs() < f64::from(f32::MAX);
        let is_whole = numbers.len() == words.split(',').count() && numbers.iter().all(is_usable);
        match (numbers.as_slice(), is_whole) {
            ([a, b, c, d, e, f, time @ ..], true) if time.len() < 2 => Ok(Self {
                eye: [*a as f32, *b as f32, *c as f32],
                target: [*d as f32, *e as f32, *f as f32],
                time: time.first().map_or(0.0, |t| t.max(0.0)),
            }),
            _ => Err(
                "three numbers of the eye, three of what it looks at, and if wanted the time in frames, with commas",
            ),
        }
    }
}

impl Pilot {
    /// The view in words, as [`View`] reads it.
    pub fn words(&self, time: f64) -> String {
        let target = self.eye + self.forward() * self.distance;
        let place = self.eye.to_array().into_iter().chain(target.to_array()).map(|v| v.to_string());
        place.chain([time.to_string()]).collect::<Vec<_>>().join(",")
    }

    /// Takes the camera to a view.
    ///
    /// # Errors
    /// One that looks at where it stands.
    pub fn place(&mut self, view: &View) -> Result<(), LiveError> {
        let (eye, target) = (Vec3::from(view.eye), Vec3::from(view.target));
        let forward = (target - eye).try_normalize().ok_or(LiveError::Camera("the view looks at where it stands"))?;
        self.take();
        self.eye = eye;
        self.distance = (target - eye).length();
        self.look_along(forward);
        Ok(())
    }

    /// Where the scene's camera number `camera` (from 1) stands at `time`, in frames.
    ///
    /// # Errors
    /// A camera that does not exist or has no direction.
    pub fn at(scene: &Scene, camera: usize, time: f64, mode: Mode) -> Result<Self, LiveError> {
        let count = scene.cameras.len();
        let unknown = quell_trace::SceneError::UnknownCamera { scene: scene.name.clone(), number: camera, count };
        let path = camera.checked_sub(1).and_then(|i| scene.cameras.get(i)).ok_or(unknown)?;
        let (eye, target) = (path.position.at(time), path.target.at(time));
        let forward = (target - eye).try_normalize().ok_or(LiveError::Camera("its target is where it stands"))?;
        let up = path.up.at(time).try_normalize().ok_or(LiveError::Camera("it has no upward direction"))?;
        let distance = (target - eye).length();
        let fov = if path.orthographic_height.is_some() { USUAL_FOV } else { path.vertical_fov.at(time) };
        let mut pilot = Self { mode, camera, eye, yaw: 0.0, pitch: 0.0, up, distance, measure: distance, fov };
        pilot.look_along(forward);
        Ok(pilot)
    }

    /// Two directions across `up`.
    fn across(&self) -> (Vec3, Vec3) {
        let ahead = self.up.any_orthonormal_vector();
        (ahead, ahead.cross(self.up))
    }

    fn look_along(&mut self, forward: Vec3) {
        let (ahead, right) = self.across();
        self.pitch = forward.dot(self.up).clamp(-1.0, 1.0).asin().clamp(-STEEPEST, STEEPEST);
        self.yaw = forward.dot(right).atan2(forward.dot(ahead));
    }

    /// Where it stands, world space.
    pub fn eye(&self) -> Vec3 {
        self.eye
    }

    /// Where it looks, unit.
    pub fn forward(&self) -> Vec3 {
        let (ahead, right) = self.across();
        let level = ahead * self.yaw.cos() + right * self.yaw.sin();
        level * self.pitch.cos() + self.up * self.pitch.sin()
    }

    fn right(&self) -> Vec3 {
        self.forward().cross(self.up).normalize_or(Vec3::X)
    }

    /// A drag with the mouse, in shares of the picture's height, to the right and down: turns about the point that is
    /// looked at, or the head. Takes the camera from its path.
    pub fn drag(&mut self, by: [f32; 2]) {
        self.take();
        let pivot = self.eye + self.forward() * self.distance;
        let [x, y] = by.map(|v| if v.is_finite() { v * TURN } else { 0.0 });
        self.yaw += x;
        self.pitch = (self.pitch - y).clamp(-STEEPEST, STEEPEST);
        if self.mode == Mode::Orbit {
            self.eye = pivot - self.forward() * self.distance;
        }
    }

    /// A drag with the second button: moves across the view.
    pub fn pan(&mut self, by: [f32; 2]) {
        self.take();
        let [x, y] = by.map(|v| if v.is_finite() { v } else { 0.0 });
        let right = self.right();
        let up = right.cross(self.forward());
        self.eye += (up * y - right * x) * self.distance;
    }

    /// The wheel: nearer by a share (positive) or farther. Flying: forwards or backwards.
    pub fn zoom(&mut self, steps: f32) {
        if !steps.is_finite() || steps == 0.0 {
            return;
        }
        self.take();
        if self.mode == Mode::Fly {
            self.eye += self.forward() * self.measure * 0.1 * steps;
            return;
        }
        let pivot = self.eye + self.forward() * self.distance;
        let (least, most) = (self.measure * DISTANCES.0, self.measure * DISTANCES.1);
        self.distance = (self.distance * (-0.2 * steps.clamp(-20.0, 20.0)).exp()).clamp(least, most);
        self.eye = pivot - self.forward() * self.distance;
    }

    /// Flies: right, up and forward in -1..1, for so many seconds.
    pub fn fly(&mut self, along: [f32; 3], seconds: f32) {
        let along = Vec3::from(along);
        if along == Vec3::ZERO || !along.is_finite() || !seconds.is_finite() {
            return;
        }
        self.take();
        let step = self.right() * along.x + self.up * along.y + self.forward() * along.z;
        self.eye += step.clamp_length_max(2.0) * self.measure * 0.5 * seconds.clamp(0.0, 0.25);
    }

    fn take(&mut self) {
        if self.mode == Mode::Path {
            self.mode = Mode::Orbit;
        }
    }

    /// The camera for pictures of `size`, without jitter. On a path: the scene's at `time`, in frames.
    ///
    /// # Errors
    /// A path's camera that cannot be used at that time; a place that is not finite.
    pub fn view(&self, scene: &Scene, time: f64, size: Size) -> Result<Camera, LiveError> {
        if self.mode == Mode::Path {
            let path = self.camera.checked_sub(1).and_then(|i| scene.cameras.get(i));
            let camera = path.and_then(|path| path.at(time, size));
            return camera.ok_or(LiveError::Camera("the scene's path gives none at this time"));
        }
        let aspect = size.width as f32 / size.height as f32;
        let (eye, forward) = (self.eye.to_array(), self.forward().to_array());
        let camera = Camera::perspective(eye, forward, self.up.to_array(), self.fov, aspect);
        camera.projection(size).map(|_| camera).ok_or(LiveError::Camera("its place is not finite"))
    }

    /// Follows the scene's path for as long as it is on it, so that whoever takes over begins there.
    pub fn follow(&mut self, scene: &Scene, time: f64) {
        if self.mode == Mode::Path
            && let Ok(there) = Self::at(scene, self.camera, time, Mode::Path)
        {
            *self = there;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use quell_trace::builtin;

    const SIZE: Size = Size::new(32, 18);

    #[test]
    fn a_taken_camera_begins_where_the_path_was() {
        let scene = builtin("cornell-box").unwrap();
        let pilot = Pilot::at(&scene, 1, 5.0, Mode::Path).unwrap();
        let path = pilot.view(&scene, 5.0, SIZE).unwrap();
        let taken = Pilot { mode: Mode::Fly, ..pilot }.view(&scene, 5.0, SIZE).unwrap();
        for (a, b) in path.clip_from_world.iter().zip(taken.clip_from_world) {
            assert!((a - b).abs() < 1e-3 * a.abs().max(1.0), "{path:?} {taken:?}");
        }
        assert!(Pilot::at(&scene, 99, 0.0, Mode::Path).is_err());
    }

    #[test]
    fn a_view_comes_back_from_its_words() {
        let scene = builtin("cornell-box").unwrap();
        let mut pilot = Pilot::at(&scene, 1, 0.0, Mode::Orbit).unwrap();
        pilot.drag([0.3, -0.2]);
        let view: View = pilot.words(3.5).parse().unwrap();
        let mut other = Pilot::at(&scene, 1, 0.0, Mode::Path).unwrap();
        other.place(&view).unwrap();
        assert!((other.eye - pilot.eye).length() + (other.forward() - pilot.forward()).length() < 1e-4);
        assert_eq!((view.time, other.mode), (3.5, Mode::Orbit));
        for words in ["", "1,2,3", "1,2,3,4,5,x", "1,2,3,4,5,6,7,8", "1,2,3,4,5,inf", "1,2,3,4,5,6,"] {
            assert!(words.parse::<View>().is_err(), "{words}");
        }
        let nowhere: View = "1,2,3,1,2,3".parse().unwrap();
        assert!(other.place(&nowhere).is_err());
    }

    #[test]
    fn orbiting_keeps_the_point_and_flying_the_place() {
        let scene = builtin("cornell-box").unwrap();
        let mut pilot = Pilot::at(&scene, 1, 0.0, Mode::Orbit).unwrap();
        let pivot = pilot.eye + pilot.forward() * pilot.distance;
        pilot.drag([0.3, -0.2]);
        pilot.zoom(2.0);
        let after = pilot.eye + pilot.forward() * pilot.distance;
        assert!((pivot - after).length() < 1e-3 * pilot.measure, "{pivot} {after}");
        let mut pilot = Pilot { mode: Mode::Fly, ..pilot };
        let eye = pilot.eye;
        pilot.drag([0.3, 0.1]);
        assert_eq!(pilot.eye, eye);
        pilot.fly([0.0, 0.0, 1.0], 0.1);
        assert!((pilot.eye - eye).normalize().dot(pilot.forward()) > 0.999);
    }

    #[test]
    fn nothing_a_mouse_does_breaks_a_camera() {
        let scene = builtin("cornell-box").unwrap();
        let mut pilot = Pilot::at(&scene, 1, 0.0, Mode::Orbit).unwrap();
        for v in [0.0, 1e9, -1e9, f32::NAN, f32::INFINITY] {
            pilot.drag([v, v]);
            pilot.zoom(v);
            pilot.fly([v, v, v], v);
            assert!(pilot.view(&scene, 0.0, SIZE).is_ok(), "{v}");
        }
    }
}
