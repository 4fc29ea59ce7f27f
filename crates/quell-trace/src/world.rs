//! A scene at one frame: triangles in world space, what they are made of, and what lights them.

use crate::geometry::{Geometry, Hit, Triangle, TriangleSource};
use crate::material::Material;
use crate::scene::{Deformed, Mesh, PointlikeLight, Scene, SceneError};
use glam::{Affine3A, Mat3A, Vec2, Vec3};
use std::borrow::Cow;

/// An instance at this frame and the one before.
struct Placed {
    /// World from mesh, now and one frame before.
    transform: Affine3A,
    previous_transform: Affine3A,
    /// Turns mesh normals into world normals (not unit).
    normal_matrix: Mat3A,
    /// -1 where the transform mirrors, which turns the winding round.
    handedness: f32,
    /// Vertices now and one frame before, for meshes that deform.
    deformed: Option<[Deformed; 2]>,
    emission_scale: f32,
}

/// A point of a surface, seen from somewhere.
pub(crate) struct SurfacePoint {
    /// World position.
    pub(crate) position: Vec3,
    /// Unit normal of the triangle on its front side.
    pub(crate) geometric_normal: Vec3,
    /// Interpolated unit normal on the triangle's front side.
    pub(crate) shading_normal: Vec3,
    /// Whether the ray came from the front.
    pub(crate) front: bool,
    /// Material with its pattern applied and the instance's emission scale multiplied in.
    pub(crate) material: Material,
    /// How far rays that leave must start from the surface.
    pub(crate) offset: f32,
    pub(crate) triangle: u32,
    pub(crate) instance: u32,
    /// Weights of the triangle's corners 1 and 2.
    pub(crate) barycentric: Vec2,
}

impl SurfacePoint {
    /// Where a ray that leaves towards `direction` starts.
    #[inline]
    pub(crate) fn ray_origin(&self, direction: Vec3) -> Vec3 {
        let side = if self.geometric_normal.dot(direction) >= 0.0 { 1.0 } else { -1.0 };
        self.position + self.geometric_normal * (side * self.offset)
    }

    /// A shadow ray to what lies `distance` away along the unit `direction`: origin, direction and length.
    ///
    /// It aims at the same point of the light from the shifted origin, and ends as far before it as it starts off the
    /// surface: with the length of the unshifted ray the light itself would stand in the way where the shift is not
    /// small against it (far from the world's origin).
    #[inline]
    pub(crate) fn shadow_ray(&self, direction: Vec3, distance: f32) -> (Vec3, Vec3, f32) {
        let origin = self.ray_origin(direction);
        if !distance.is_finite() {
            return (origin, direction, distance);
        }
        let to_light = self.position + direction * distance - origin;
        let length = to_light.length();
        (origin, to_light / length, (length - self.offset).max(0.0))
    }
}

/// A triangle that emits.
pub(crate) struct EmissiveTriangle {
    pub(crate) corners: [Vec3; 3],
    pub(crate) radiance: Vec3,
    pub(crate) two_sided: bool,
    /// Index in the geometry.
    pub(crate) triangle: u32,
}

/// The scene at one frame.
pub(crate) struct World<'s> {
    scene: &'s Scene,
    pub(crate) geometry: Geometry,
    placed: Vec<Placed>,
    pub(crate) emissive: Vec<EmissiveTriangle>,
    pub(crate) lights: Vec<PointlikeLight>,
    pub(crate) environment_scale: f32,
    /// Triangles without area, left out.
    pub(crate) degenerate_triangles: usize,
}

impl<'s> World<'s> {
    /// Evaluates the scene.
    ///
    /// # Errors
    /// Indices that name nothing; positions, transforms or lights that are not finite.
    pub(crate) fn new(scene: &'s Scene, frame: i64) -> Result<Self, SceneError> {
        check_indices(scene)?;
        let now = frame as f64;
        let before = now - 1.0;
        let not_finite = |what: String| SceneError::NotFinite { what, frame };
        let mut placed = Vec::with_capacity(scene.instances.len());
        let mut triangles = Vec::new();
        let mut sources = Vec::new();
        // (number in `triangles`, radiance, two-sided)
        let mut emitting = Vec::new();
        let mut degenerate_triangles = 0;
        for (index, instance) in scene.instances.iter().enumerate() {
            let mesh = &scene.meshes[instance.mesh];
            let transform = instance.transform.at(now);
            let previous_transform = instance.transform.at(before);
            let emission_scale = instance.emission_scale.at(now);
            if !(transform.is_finite() && previous_transform.is_finite()) {
                return Err(not_finite(format!("the transform of instance {index}")));
            }
            let material = &scene.surfaces[instance.surface].material;
            if !(emission_scale.is_finite() && material.emission.is_finite() && emission_scale >= 0.0) {
                return Err(not_finite(format!("the emission of instance {index}")));
            }
            let deformed = match &mesh.deform {
                None => None,
                Some(deform) => {
                    let states = [deform(now, mesh), deform(before, mesh)];
                    for (positions, normals) in &states {
                        for (what, found, needed) in [
                            ("vertex", positions.len(), mesh.positions.len()),
                            ("normal", normals.len(), mesh.normals.len()),
                        ] {
                            if found < needed {
                                let place = format!("deformed mesh {}", instance.mesh);
                                return Err(SceneError::Index { what, index: needed - 1, count: found, place });
                            }
                        }
                    }
                    Some(states)
                }
            };
            let positions = deformed.as_ref().map_or(&mesh.positions, |[now, _]| &now.0);
            let world: Vec<Vec3> = positions.iter().map(|p| transform.transform_point3(*p)).collect();
            if world.iter().any(|p| !p.is_finite()) {
                return Err(not_finite(format!("a vertex of instance {index}")));
            }
            let determinant = transform.matrix3.determinant();
            let handedness = if determinant < 0.0 { -1.0 } else { 1.0 };
            // The cofactor matrix also serves flattened instances, whose inverse does not exist.
            let m = transform.matrix3;
            let normal_matrix =
                Mat3A::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis))
                    * handedness;
            let radiance = material.emission * emission_scale;
            for (number, corners) in mesh.triangles.iter().enumerate() {
                let v = corners.map(|i| world[i as usize].into());
                let triangle = Triangle { v };
                let area = (v[1] - v[0]).cross(v[2] - v[0]);
                if !(area.length_squared() > 0.0 && area.is_finite()) {
                    degenerate_triangles += 1;
                    continue;
                }
                if radiance.max_element() > 0.0 {
                    emitting.push((triangles.len(), radiance, material.two_sided_emission, handedness));
                }
                triangles.push(triangle);
                sources.push(TriangleSource { instance: index as u32, triangle: number as u32 });
            }
            placed.push(Placed { transform, previous_transform, normal_matrix, handedness, deformed, emission_scale });
        }
        let corners_of: Vec<[Vec3; 3]> = emitting.iter().map(|(n, ..)| triangles[*n].v.map(Vec3::from)).collect();
        let geometry = Geometry::new(triangles, sources);
        let emissive = emitting
            .into_iter()
            .zip(corners_of)
            .map(|((n, radiance, two_sided, handedness), [a, b, c])| EmissiveTriangle {
                corners: if handedness < 0.0 { [a, c, b] } else { [a, b, c] },
                radiance,
                two_sided,
                triangle: geometry.position_of(n),
            })
            .collect();
        let lights: Vec<PointlikeLight> = scene.lights.iter().map(|l| l.at(now)).collect();
        for (index, light) in lights.iter().enumerate() {
            let finite = match light {
                PointlikeLight::Point { position, intensity } => position.is_finite() && intensity.is_finite(),
                PointlikeLight::Spot { position, direction, intensity, inner, outer } => {
                    position.is_finite()
                        && direction.is_finite()
                        && intensity.is_finite()
                        && inner.is_finite()
                        && outer.is_finite()
                }
                PointlikeLight::Directional { direction, irradiance } => {
                    direction.is_finite() && irradiance.is_finite()
                }
            };
            if !finite {
                return Err(not_finite(format!("light {index}")));
            }
        }
        let environment_scale = scene.environment_scale.at(now);
        if !(environment_scale.is_finite() && environment_scale >= 0.0) {
            return Err(not_finite("the scale of the environment".to_owned()));
        }
        Ok(Self { scene, geometry, placed, emissive, lights, environment_scale, degenerate_triangles })
    }

    fn mesh(&self, instance: u32) -> &'s Mesh {
        &self.scene.meshes[self.scene.instances[instance as usize].mesh]
    }

    /// What a ray met. `direction` is the ray's.
    #[inline]
    pub(crate) fn surface_point(&self, hit: &Hit, direction: Vec3) -> SurfacePoint {
        let source = self.geometry.source(hit.triangle);
        let placed = &self.placed[source.instance as usize];
        let mesh = self.mesh(source.instance);
        let [a, b, c] = self.geometry.corners(hit.triangle);
        let Vec2 { x: u, y: v } = hit.barycentric;
        let w = 1.0 - u - v;
        let position = a * w + b * u + c * v;
        let geometric_normal = ((b - a).cross(c - a) * placed.handedness).normalize();
        let corners = mesh.triangles[source.triangle as usize];
        let normals: &[Vec3] = placed.deformed.as_ref().map_or(&mesh.normals, |[now, _]| &now.1);
        let shading_normal = if normals.is_empty() {
            geometric_normal
        } else {
            let [n0, n1, n2] = corners.map(|i| normals[i as usize]);
            let n = (placed.normal_matrix * (n0 * w + n1 * u + n2 * v)).try_normalize();
            match n {
                Some(n) if n.dot(geometric_normal) >= 0.0 => n,
                // Data with inverted or missing normals: the face's own side decides.
                Some(n) if n.dot(geometric_normal) < 0.0 => -n,
                _ => geometric_normal,
            }
        };
        let instance = &self.scene.instances[source.instance as usize];
        let surface = &self.scene.surfaces[instance.surface];
        let mut material = surface.material;
        if !matches!(surface.pattern, crate::pattern::Pattern::Plain) {
            let uv = if mesh.uvs.is_empty() {
                Vec2::ZERO
            } else {
                let [t0, t1, t2] = corners.map(|i| mesh.uvs[i as usize]);
                t0 * w + t1 * u + t2 * v
            };
            let [p0, p1, p2] = corners.map(|i| mesh.positions[i as usize]);
            surface.pattern.apply(&mut material, uv, p0 * w + p1 * u + p2 * v);
        }
        material.emission *= placed.emission_scale;
        SurfacePoint {
            position,
            geometric_normal,
            shading_normal,
            front: geometric_normal.dot(direction) < 0.0,
            material,
            offset: self.geometry.offset(hit.triangle),
            triangle: hit.triangle,
            instance: source.instance,
            barycentric: hit.barycentric,
        }
    }

    /// Where a point of a surface was one frame before.
    pub(crate) fn previous_position(&self, point: &SurfacePoint) -> Vec3 {
        let source = self.geometry.source(point.triangle);
        let placed = &self.placed[source.instance as usize];
        let mesh = self.mesh(source.instance);
        if placed.deformed.is_none() && placed.transform == placed.previous_transform {
            // Exactly the same place: no rounding may look like motion.
            return point.position;
        }
        let corners = mesh.triangles[source.triangle as usize];
        let positions = placed.deformed.as_ref().map_or(&mesh.positions, |[_, before]| &before.0);
        let [a, b, c] = corners.map(|i| positions[i as usize]);
        let Vec2 { x: u, y: v } = point.barycentric;
        placed.previous_transform.transform_point3(a * (1.0 - u - v) + b * u + c * v)
    }

    /// A normal of a surface point, turned back to where it was one frame before.
    pub(crate) fn previous_normal(&self, point: &SurfacePoint, normal: Vec3) -> Vec3 {
        let source = self.geometry.source(point.triangle);
        let placed = &self.placed[source.instance as usize];
        if placed.deformed.is_none() && placed.transform == placed.previous_transform {
            return normal;
        }
        let mesh = self.mesh(source.instance);
        let corners = mesh.triangles[source.triangle as usize];
        let face = |transform: Affine3A, positions: &[Vec3]| {
            let [a, b, c] = corners.map(|i| transform.transform_point3(positions[i as usize]));
            (b - a, c - a, (b - a).cross(c - a))
        };
        let (now, before) = match &placed.deformed {
            None => (&mesh.positions, &mesh.positions),
            Some([now, before]) => (&now.0, &before.0),
        };
        let (u, v, n) = face(placed.transform, now);
        let (previous_u, previous_v, previous_n) = face(placed.previous_transform, before);
        // The map that takes the triangle and its normal of now to those of before, as normals go.
        let from = Mat3A::from_cols(u.into(), v.into(), n.normalize_or_zero().into());
        let to = Mat3A::from_cols(previous_u.into(), previous_v.into(), previous_n.normalize_or_zero().into());
        let map = to * from.inverse();
        let turned = Vec3::from(map.inverse().transpose() * glam::Vec3A::from(normal));
        turned.try_normalize().unwrap_or(normal)
    }
}

fn check_indices(scene: &Scene) -> Result<(), SceneError> {
    let check = |what: &'static str, index: usize, count: usize, place: &dyn Fn() -> Cow<'static, str>| {
        if index < count { Ok(()) } else { Err(SceneError::Index { what, index, count, place: place().into_owned() }) }
    };
    for (number, instance) in scene.instances.iter().enumerate() {
        let place = || Cow::from(format!("instance {number}"));
        check("mesh", instance.mesh, scene.meshes.len(), &place)?;
        check("material", instance.surface, scene.surfaces.len(), &place)?;
    }
    for (number, surface) in scene.surfaces.iter().enumerate() {
        let place = || Cow::from(format!("material {number}"));
        for texture in surface.textures.iter().flat_map(|t| t.all()) {
            check("image", texture.image, scene.images.len(), &place)?;
        }
    }
    for (number, mesh) in scene.meshes.iter().enumerate() {
        let place = || Cow::from(format!("mesh {number}"));
        for &index in mesh.triangles.iter().flatten() {
            check("vertex", index as usize, mesh.positions.len(), &place)?;
        }
        if !mesh.normals.is_empty() {
            check("normal", mesh.positions.len().saturating_sub(1), mesh.normals.len(), &place)?;
        }
        for (what, count) in [
            ("texture coordinate", mesh.uvs.len()),
            ("second texture coordinate", mesh.uvs1.len()),
            ("vertex colour", mesh.colors.len()),
            ("tangent", mesh.tangents.len()),
        ] {
            if count > 0 {
                check(what, mesh.positions.len().saturating_sub(1), count, &place)?;
            }
        }
    }
    Ok(())
}
