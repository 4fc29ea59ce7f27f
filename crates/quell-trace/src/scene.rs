//! What can be traced: meshes, instances, materials, lights, an environment and cameras, each over time.

use crate::environment::Environment;
use crate::geometry::GeometryCache;
use crate::material::Material;
use crate::pattern::Pattern;
use crate::texture::{Image, TextureRef};
use crate::track::Track;
use glam::{Affine3A, Vec2, Vec3, Vec4};
use quell::{Camera, Size};
use std::sync::Arc;

/// What cannot be traced, each with its quantity and value.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// No built-in scene has this name.
    #[error("unknown scene `{name}`{}; built-in scenes: {known}", hint(.nearest))]
    UnknownScene {
        /// The name given.
        name: String,
        /// Names that are close to it.
        nearest: Vec<String>,
        /// All names.
        known: String,
    },
    /// The scene has fewer cameras.
    #[error("camera {number} does not exist: scene `{scene}` has cameras 1 to {count}")]
    UnknownCamera {
        /// Name of the scene.
        scene: String,
        /// The number given, from 1.
        number: usize,
        /// How many there are.
        count: usize,
    },
    /// A camera cannot be used at a frame.
    #[error(
        "camera {number} of scene `{scene}` cannot be used at frame {frame}: position, target and up must be finite, \
         the target off the position, up not along the view, the angle between 0 and 180 degrees"
    )]
    Camera {
        /// Name of the scene.
        scene: String,
        /// Number of the camera, from 1.
        number: usize,
        /// The frame.
        frame: i64,
    },
    /// An instance names a mesh or material that is not there, or a triangle a corner that is not there.
    #[error("{what} {index} does not exist: there are {count} ({place})")]
    Index {
        /// `mesh`, `material` or `vertex`.
        what: &'static str,
        /// The index given.
        index: usize,
        /// How many there are.
        count: usize,
        /// Where it was named.
        place: String,
    },
    /// A position, transform, colour or light is NaN or infinite.
    #[error("{what} is not finite at frame {frame}")]
    NotFinite {
        /// Which quantity, of which object.
        what: String,
        /// The frame.
        frame: i64,
    },
    /// The image has no pixels or too many.
    #[error("image size {size} cannot be traced: both extents must be 1 to {limit}")]
    Size {
        /// The size given.
        size: Size,
        /// Largest extent.
        limit: usize,
    },
}

fn hint(nearest: &[String]) -> String {
    if nearest.is_empty() { String::new() } else { format!("; did you mean {}?", nearest.join(", ")) }
}

/// Positions and normals of a mesh at a frame, of the same lengths as the mesh's own (normals may be empty).
pub type Deformed = (Vec<Vec3>, Vec<Vec3>);

/// Moves the vertices of a mesh: a pure function of the frame number and the mesh at rest.
pub type Deform = Arc<dyn Fn(f64, &Mesh) -> Deformed + Send + Sync>;

/// Triangles in a space of their own. Counter-clockwise triangles face the viewer.
#[derive(Clone, Default)]
pub struct Mesh {
    /// Corners at rest.
    pub positions: Vec<Vec3>,
    /// Shading normals of the corners; empty: flat faces.
    pub normals: Vec<Vec3>,
    /// Texture coordinates of the corners, set 0 (v down the picture); empty: all zero.
    pub uvs: Vec<Vec2>,
    /// Texture coordinates of the corners, set 1; empty: all zero.
    pub uvs1: Vec<Vec2>,
    /// Linear colours and opacity of the corners, which multiply base colour and alpha; empty: white.
    pub colors: Vec<Vec4>,
    /// Tangents of the corners for normal maps (along u), in the mesh's space at rest; w is the sign of the bitangent,
    /// w normal x tangent. Empty: each triangle takes those of its texture coordinates.
    pub tangents: Vec<Vec4>,
    /// Three corners each.
    pub triangles: Vec<[u32; 3]>,
    /// Skin, morph targets or anything else that moves the vertices from frame to frame.
    pub deform: Option<Deform>,
}

impl std::fmt::Debug for Mesh {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "Mesh {{ {} vertices, {} triangles, deforms: {} }}",
            self.positions.len(),
            self.triangles.len(),
            self.deform.is_some()
        )
    }
}

/// A material and what varies over it.
#[derive(Clone, Debug)]
pub struct Surface {
    /// Constant properties: the factors of the textures where there are any.
    pub material: Material,
    /// What code paints over the surface.
    pub pattern: Pattern,
    /// What images paint over it.
    pub textures: Option<Box<SurfaceTextures>>,
    /// What opacity means.
    pub alpha: Alpha,
    /// Opacity, 0..1; the base colour texture's alpha and the vertex colours' multiply it.
    pub alpha_factor: f32,
    /// Whether light leaves both sides where the surface emits. Back sides are seen either way (`docs/scenes.md`).
    pub double_sided: bool,
    /// Shines with its base colour on both sides, in place of everything else: `KHR_materials_unlit`. Like any other
    /// emitter it lights the scene.
    pub unlit: bool,
}

impl Default for Surface {
    /// The default material, opaque.
    fn default() -> Self {
        Self {
            material: Material::default(),
            pattern: Pattern::Plain,
            textures: None,
            alpha: Alpha::Opaque,
            alpha_factor: 1.0,
            double_sided: false,
            unlit: false,
        }
    }
}

impl From<Material> for Surface {
    fn from(material: Material) -> Self {
        Self { material, ..Self::default() }
    }
}

/// What the opacity of a surface means, as in glTF 2.0, section 3.9.4.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Alpha {
    /// Nothing: the surface is there.
    #[default]
    Opaque,
    /// The surface is there where opacity is at least `cutoff`.
    Mask {
        /// Least opacity.
        cutoff: f32,
    },
    /// The surface is there with a probability: it covers this share of each point.
    Blend,
}

/// The images of a surface. All but `emissive`, `base_color` and `specular_color` hold linear values.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurfaceTextures {
    /// sRGB, multiplies base colour; alpha multiplies opacity.
    pub base_color: Option<TextureRef>,
    /// Green multiplies roughness, blue multiplies `metallic`.
    pub metallic_roughness: Option<TextureRef>,
    /// Normals in the frame of tangent, bitangent and normal.
    pub normal: Option<NormalMap>,
    /// sRGB, multiplies emission.
    pub emissive: Option<TextureRef>,
    /// Red multiplies `transmission`.
    pub transmission: Option<TextureRef>,
    /// Green is the thickness of the body behind the surface. Never read: the tracer meets the far side itself.
    pub thickness: Option<TextureRef>,
    /// Alpha multiplies `specular`.
    pub specular: Option<TextureRef>,
    /// sRGB, multiplies `specular_color`.
    pub specular_color: Option<TextureRef>,
}

impl SurfaceTextures {
    /// All that are there.
    pub fn all(&self) -> impl Iterator<Item = &TextureRef> {
        let normal = self.normal.as_ref().map(|n| &n.texture);
        let others = [
            &self.base_color,
            &self.metallic_roughness,
            &self.emissive,
            &self.transmission,
            &self.thickness,
            &self.specular,
            &self.specular_color,
        ];
        others.into_iter().flatten().chain(normal)
    }
}

/// A normal map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalMap {
    /// Its image: red along the tangent, green along the bitangent (up in the picture), blue along the normal.
    pub texture: TextureRef,
    /// Multiplies the map's red and green before they become a direction.
    pub scale: f32,
}

/// A mesh placed in the world. Several instances may share a mesh.
#[derive(Clone, Debug)]
pub struct Instance {
    /// Index into [`Scene::meshes`].
    pub mesh: usize,
    /// Index into [`Scene::surfaces`].
    pub surface: usize,
    /// World from mesh.
    pub transform: Track<Affine3A>,
    /// Multiplies the material's emission, >= 0.
    pub emission_scale: Track<f32>,
}

impl Instance {
    /// An instance that does not move.
    pub fn fixed(mesh: usize, surface: usize) -> Self {
        Self { mesh, surface, transform: Affine3A::IDENTITY.into(), emission_scale: 1.0.into() }
    }
}

/// A light without extent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PointlikeLight {
    /// Radiates alike in all directions.
    Point {
        /// World position.
        position: Vec3,
        /// Radiant intensity, power a solid angle.
        intensity: Vec3,
    },
    /// A cone with a soft rim.
    Spot {
        /// World position.
        position: Vec3,
        /// Axis of the cone, away from the light; need not be unit.
        direction: Vec3,
        /// Radiant intensity on the axis.
        intensity: Vec3,
        /// Half angle of full brightness, radians.
        inner: f32,
        /// Half angle where the light ends, radians.
        outer: f32,
    },
    /// Parallel light.
    Directional {
        /// Direction in which the light travels; need not be unit.
        direction: Vec3,
        /// Irradiance on a surface that faces the light.
        irradiance: Vec3,
    },
}

/// A camera that may move.
#[derive(Clone, Debug)]
pub struct CameraPath {
    /// What users may call it; may be empty: cameras also have numbers.
    pub name: String,
    /// Eye.
    pub position: Track<Vec3>,
    /// A point on the axis.
    pub target: Track<Vec3>,
    /// Upwards: need not be unit nor at a right angle to the axis.
    pub up: Track<Vec3>,
    /// Vertical opening angle in radians; orthographic: ignored.
    pub vertical_fov: Track<f32>,
    /// Height of the picture in world units for an orthographic camera.
    pub orthographic_height: Option<f32>,
}

impl CameraPath {
    /// A perspective camera that does not move. `vertical_fov` in degrees.
    pub fn fixed(position: Vec3, target: Vec3, vertical_fov: f32) -> Self {
        Self {
            name: String::new(),
            position: position.into(),
            target: target.into(),
            up: Vec3::Y.into(),
            vertical_fov: vertical_fov.to_radians().into(),
            orthographic_height: None,
        }
    }

    /// A perspective camera whose eye and target are functions of the frame number. `vertical_fov` in degrees.
    pub fn moving(vertical_fov: f32, path: impl Fn(f64) -> (Vec3, Vec3) + Send + Sync + Clone + 'static) -> Self {
        let eye = path.clone();
        Self {
            name: String::new(),
            position: Track::function(move |frame| eye(frame).0),
            target: Track::function(move |frame| path(frame).1),
            up: Vec3::Y.into(),
            vertical_fov: vertical_fov.to_radians().into(),
            orthographic_height: None,
        }
    }

    /// The camera at a frame for an image of `size`, without jitter; `None` where it cannot be used.
    pub fn at(&self, frame: f64, size: Size) -> Option<Camera> {
        let position = self.position.at(frame);
        let forward = (self.target.at(frame) - position).try_normalize()?;
        let up = self.up.at(frame);
        let right = forward.cross(up).try_normalize()?;
        let aspect = size.width as f32 / size.height as f32;
        let camera = match self.orthographic_height {
            None => {
                let fov = self.vertical_fov.at(frame);
                if !(fov > 0.0 && fov < std::f32::consts::PI) {
                    return None;
                }
                Camera::perspective(position.into(), forward.into(), up.into(), fov, aspect)
            }
            Some(height) => {
                if !(height > 0.0 && height.is_finite()) {
                    return None;
                }
                let up = right.cross(forward);
                let x = right * (2.0 / (height * aspect));
                let y = up * (2.0 / height);
                let rows = [
                    [x.x, x.y, x.z, -x.dot(position)],
                    [y.x, y.y, y.z, -y.dot(position)],
                    [-forward.x, -forward.y, -forward.z, forward.dot(position)],
                    [0.0, 0.0, 0.0, 1.0],
                ];
                let mut clip_from_world = [0.0; 16];
                for (r, row) in rows.iter().enumerate() {
                    for (c, value) in row.iter().enumerate() {
                        clip_from_world[c * 4 + r] = *value;
                    }
                }
                Camera { clip_from_world, position: position.into(), jitter: [0.0; 2] }
            }
        };
        camera.projection(size).map(|_| camera)
    }
}

/// Everything that can be seen, over time.
#[derive(Clone, Debug)]
pub struct Scene {
    /// For messages and reports.
    pub name: String,
    /// Stands for the scene's content in [`crate::scene_hash`]: a hash of the code or of the files that made it.
    pub identity: u64,
    /// Geometry, each in its own space.
    pub meshes: Vec<Mesh>,
    /// Materials with their patterns and textures.
    pub surfaces: Vec<Surface>,
    /// Images that textures refer to by their place here.
    pub images: Vec<Arc<Image>>,
    /// Meshes in the world. An instance's number + 1 is its `surface_id`.
    pub instances: Vec<Instance>,
    /// Lights without extent. Surfaces that emit are lights by themselves.
    pub lights: Vec<Track<PointlikeLight>>,
    /// What is seen where nothing is hit, and lights the scene.
    pub environment: Environment,
    /// Multiplies the environment, >= 0.
    pub environment_scale: Track<f32>,
    /// Cameras; users count them from 1.
    pub cameras: Vec<CameraPath>,
    /// Frames of the sequence by default.
    pub frames: usize,
    /// Suggested exposure: multiplies light before the tone curve.
    pub exposure: f32,
    pub(crate) cache: GeometryCache,
}

impl Scene {
    /// A scene with nothing in it.
    pub fn new(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            identity: 0,
            meshes: Vec::new(),
            surfaces: Vec::new(),
            images: Vec::new(),
            instances: Vec::new(),
            lights: Vec::new(),
            environment: Environment::constant(Vec3::ZERO),
            environment_scale: 1.0.into(),
            cameras: Vec::new(),
            frames: 64,
            exposure: 1.0,
            cache: GeometryCache::default(),
        }
    }

    /// Adds a material and returns its index.
    pub fn surface(&mut self, surface: impl Into<Surface>) -> usize {
        self.surfaces.push(surface.into());
        self.surfaces.len() - 1
    }

    /// Adds a mesh without placing it and returns its index.
    pub fn mesh(&mut self, mesh: Mesh) -> usize {
        self.meshes.push(mesh);
        self.meshes.len() - 1
    }

    /// Adds a mesh and an instance of it that does not move; returns the instance's index.
    pub fn place(&mut self, mesh: Mesh, surface: usize) -> usize {
        let mesh = self.mesh(mesh);
        self.instances.push(Instance::fixed(mesh, surface));
        self.instances.len() - 1
    }

    /// Adds a mesh and an instance of it that moves; returns the instance's index.
    pub fn place_moving(&mut self, mesh: Mesh, surface: usize, transform: impl Into<Track<Affine3A>>) -> usize {
        let index = self.place(mesh, surface);
        self.instances[index].transform = transform.into();
        index
    }

    /// Whether anything but cameras may differ between frames: transforms, vertices, lamps, the environment.
    pub fn moves(&self) -> bool {
        let placed = |i: &Instance| !i.transform.is_constant() || !i.emission_scale.is_constant();
        self.instances.iter().any(placed)
            || self.meshes.iter().any(|m| m.deform.is_some())
            || self.lights.iter().any(|l| !l.is_constant())
            || !self.environment_scale.is_constant()
    }

    /// The same scene in another unit: all lengths times `factor`, emitted radiance unchanged.
    pub fn scaled(&self, factor: f32) -> Self {
        let scale = Affine3A::from_scale(Vec3::splat(factor));
        let mut out = self.clone();
        out.cache = GeometryCache::default();
        for instance in &mut out.instances {
            let transform = instance.transform.clone();
            instance.transform = Track::function(move |frame| scale * transform.at(frame));
        }
        for surface in &mut out.surfaces {
            surface.material.attenuation_distance *= factor;
        }
        for light in &mut out.lights {
            let track = light.clone();
            *light = Track::function(move |frame| match track.at(frame) {
                // Intensity falls with the square of the distance.
                PointlikeLight::Point { position, intensity } => {
                    PointlikeLight::Point { position: position * factor, intensity: intensity * factor * factor }
                }
                PointlikeLight::Spot { position, direction, intensity, inner, outer } => PointlikeLight::Spot {
                    position: position * factor,
                    direction,
                    intensity: intensity * factor * factor,
                    inner,
                    outer,
                },
                directional @ PointlikeLight::Directional { .. } => directional,
            });
        }
        for camera in &mut out.cameras {
            let (position, target) = (camera.position.clone(), camera.target.clone());
            camera.position = Track::function(move |frame| position.at(frame) * factor);
            camera.target = Track::function(move |frame| target.at(frame) * factor);
            camera.orthographic_height = camera.orthographic_height.map(|h| h * factor);
        }
        out
    }
}
