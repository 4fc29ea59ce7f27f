//! A scene at one frame: triangles in world space, what they are made of, and what lights them.

use crate::appearance::{self, Coverage, Frame, Spot};
use crate::cone::{Cone, Footprint};
use crate::geometry::{Geometry, Hit, Triangle, TriangleSource};
use crate::material::Material;
use crate::sampler::Sampler;
use crate::scene::{Deformed, Mesh, PointlikeLight, Scene, SceneError};
use glam::Vec3Swizzles;
use glam::{Affine3A, Mat3, Mat3A, Vec2, Vec3};
use std::borrow::Cow;
use std::sync::Arc;

/// An instance at this frame and the one before.
pub(crate) struct Placed {
    /// World from mesh, now and one frame before.
    pub(crate) transform: Affine3A,
    pub(crate) previous_transform: Affine3A,
    /// Turns mesh normals into world normals (not unit).
    pub(crate) normal_matrix: Mat3A,
    /// -1 where the transform mirrors, which turns the winding round.
    pub(crate) handedness: f32,
    /// Vertices now and one frame before, for meshes that deform.
    pub(crate) deformed: Option<[Deformed; 2]>,
    pub(crate) emission_scale: f32,
    /// Whether textures or vertex colours change the material from point to point.
    pub(crate) painted: bool,
    pub(crate) coverage: Coverage,
}

/// Which of the surfaces that are partly there a ray meets.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Veils {
    /// All that are not fully clear: the caller looks at their opacity.
    All,
    /// Each with its opacity as probability, chosen by this hash.
    Chance(u64),
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
    /// What the ray stands for here.
    pub(crate) cone: Cone,
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
    /// Where it varies: about its mean.
    pub(crate) radiance: Vec3,
    /// Whether radiance has to be asked for at each point.
    pub(crate) varies: bool,
    pub(crate) two_sided: bool,
    /// Index in the geometry.
    pub(crate) triangle: u32,
}

/// The scene at one frame.
pub(crate) struct World<'s> {
    pub(crate) scene: &'s Scene,
    pub(crate) geometry: Arc<Geometry>,
    pub(crate) placed: Vec<Placed>,
    /// Those of the scene's surfaces, before textures.
    pub(crate) materials: Vec<Material>,
    /// Whether any surface is painted: only then do cones matter.
    pub(crate) painted: bool,
    /// Whether any surface has holes or is partly there.
    pub(crate) has_coverage: bool,
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
        let now = frame as f64;
        Self::between(scene, now - 1.0, now)
    }

    /// The scene at time `now`, in frames, and where it was at `before`.
    pub(crate) fn between(scene: &'s Scene, before: f64, now: f64) -> Result<Self, SceneError> {
        check_indices(scene)?;
        appearance::prepare_images(scene);
        let materials: Vec<Material> = scene.surfaces.iter().map(appearance::plain_material).collect();
        let frame = now.floor() as i64;
        let not_finite = |what: String| SceneError::NotFinite { what, frame };
        let mut placed = Vec::with_capacity(scene.instances.len());
        let mut triangles = Vec::new();
        let mut sources = Vec::new();
        // (number in `triangles`, radiance, varies, two-sided, handedness)
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
            let surface = &scene.surfaces[instance.surface];
            let material = &materials[instance.surface];
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
            let coverage = appearance::coverage(scene, surface, mesh);
            let spot = |corners| Spot { scene, surface, mesh, corners, weights: Vec2::ZERO };
            let varies = spot([0; 3]).emission_varies() || coverage != Coverage::Full;
            for (number, corners) in mesh.triangles.iter().enumerate() {
                let v = corners.map(|i| world[i as usize].into());
                let triangle = Triangle { v };
                let area = (v[1] - v[0]).cross(v[2] - v[0]);
                if !(area.length_squared() > 0.0 && area.is_finite()) {
                    degenerate_triangles += 1;
                    continue;
                }
                if radiance.max_element() > 0.0 {
                    let mean = if varies { radiance * spot(*corners).mean_emission() } else { radiance };
                    if mean.max_element() > 0.0 {
                        emitting.push((triangles.len(), mean, varies, material.two_sided_emission, handedness));
                    }
                }
                triangles.push(triangle);
                sources.push(TriangleSource { instance: index as u32, triangle: number as u32 });
            }
            let painted = surface.textures.is_some() || !mesh.colors.is_empty();
            placed.push(Placed {
                transform,
                previous_transform,
                normal_matrix,
                handedness,
                deformed,
                emission_scale,
                painted,
                coverage,
            });
        }
        let corners_of: Vec<[Vec3; 3]> = emitting.iter().map(|(n, ..)| triangles[*n].v.map(Vec3::from)).collect();
        let geometry = scene.cache.geometry(triangles, sources);
        let emissive = emitting
            .into_iter()
            .zip(corners_of)
            .map(|((n, radiance, varies, two_sided, handedness), [a, b, c])| EmissiveTriangle {
                corners: if handedness < 0.0 { [a, c, b] } else { [a, b, c] },
                radiance,
                varies,
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
        Ok(Self {
            scene,
            geometry,
            painted: placed.iter().any(|p| p.painted),
            has_coverage: placed.iter().any(|p| p.coverage != Coverage::Full),
            placed,
            materials,
            emissive,
            lights,
            environment_scale,
            degenerate_triangles,
        })
    }

    fn mesh(&self, instance: u32) -> &'s Mesh {
        &self.scene.meshes[self.scene.instances[instance as usize].mesh]
    }

    /// A point of a triangle of the geometry.
    fn spot(&self, triangle: u32, weights: Vec2) -> Spot<'s> {
        let source = self.geometry.source(triangle);
        let instance = &self.scene.instances[source.instance as usize];
        let mesh = &self.scene.meshes[instance.mesh];
        Spot {
            scene: self.scene,
            surface: &self.scene.surfaces[instance.surface],
            mesh,
            corners: mesh.triangles[source.triangle as usize],
            weights,
        }
    }

    fn coverage(&self, triangle: u32) -> Coverage {
        self.placed[self.geometry.source(triangle).instance as usize].coverage
    }

    /// Share of a point that a surface covers: below 1 only where it blends.
    pub(crate) fn opacity(&self, hit: &Hit) -> f32 {
        if !self.has_coverage || self.coverage(hit.triangle) != Coverage::Blend {
            return 1.0;
        }
        self.spot(hit.triangle, hit.barycentric).opacity()
    }

    fn is_there(&self, triangle: u32, weights: Vec2, veils: Veils) -> bool {
        match (self.coverage(triangle), veils) {
            (Coverage::Full, _) => true,
            (Coverage::Mask(cutoff), _) => self.spot(triangle, weights).opacity() >= cutoff,
            (Coverage::Blend, Veils::All) => self.spot(triangle, weights).opacity() > 0.0,
            (Coverage::Blend, Veils::Chance(seed)) => {
                let source = self.geometry.source(triangle);
                let key = (u64::from(source.instance) << 32) | u64::from(source.triangle);
                let chance = (crate::sampler::mix(seed ^ crate::sampler::mix(key)) >> 40) as f32 / (1 << 24) as f32;
                chance < self.spot(triangle, weights).opacity()
            }
        }
    }

    /// Which veils a ray of a stream meets.
    #[inline]
    pub(crate) fn veils(&self, sampler: &Sampler, direction: Vec3) -> Veils {
        // Without veils the hash would be wasted.
        Veils::Chance(if self.has_coverage { sampler.ray_seed(direction) } else { 0 })
    }

    /// The nearest surface along a unit direction.
    #[inline]
    pub(crate) fn closest(&self, origin: Vec3, direction: Vec3, veils: Veils) -> Option<Hit> {
        if !self.has_coverage {
            return self.geometry.closest(origin, direction);
        }
        self.geometry.closest_where(origin, direction, |triangle, weights| self.is_there(triangle, weights, veils))
    }

    /// True where something lies between the origin and `distance` along a unit direction (infinite: anywhere).
    #[inline]
    pub(crate) fn occluded(&self, origin: Vec3, direction: Vec3, distance: f32, veils: Veils) -> bool {
        if !self.has_coverage {
            return self.geometry.occluded(origin, direction, distance);
        }
        let there = |triangle, weights| self.is_there(triangle, weights, veils);
        self.geometry.occluded_where(origin, direction, distance, there)
    }

    /// Radiance of a point of an emissive triangle (weights of its corners in the order of [`EmissiveTriangle`]) at the
    /// finest level, times the share of the point that is there.
    pub(crate) fn radiance_of(&self, triangle: u32, weights: Vec3) -> Vec3 {
        let source = self.geometry.source(triangle);
        let placed = &self.placed[source.instance as usize];
        let weights = if placed.handedness < 0.0 { Vec2::new(weights.z, weights.y) } else { weights.yz() };
        let spot = self.spot(triangle, weights);
        let material = &self.materials[self.scene.instances[source.instance as usize].surface];
        let share = match placed.coverage {
            Coverage::Full => 1.0,
            Coverage::Mask(cutoff) => f32::from(u8::from(spot.opacity() >= cutoff)),
            Coverage::Blend => spot.opacity(),
        };
        material.emission * placed.emission_scale * spot.emission(None) * share
    }

    /// What a ray met. `direction` is the ray's, `cone` what it stands for where it starts.
    #[inline]
    pub(crate) fn surface_point(&self, hit: &Hit, direction: Vec3, cone: Cone) -> SurfacePoint {
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
        let mut material = self.materials[instance.surface];
        let cone = cone.at(hit.t);
        let mut shading_normal = shading_normal;
        if placed.painted {
            let spot = Spot { scene: self.scene, surface, mesh, corners, weights: hit.barycentric };
            let footprint = Footprint::new(cone, [a, b, c], geometric_normal, direction);
            spot.paint(&mut material, &footprint, cone);
            if let Some(map) = surface.textures.as_ref().and_then(|t| t.normal.as_ref()) {
                let frame = Frame {
                    corners: [a, b, c],
                    normal: shading_normal,
                    world_from_mesh: Mat3::from(placed.transform.matrix3),
                    handedness: placed.handedness,
                    deformed: placed.deformed.is_some(),
                };
                let mapped = spot.mapped_normal(map, &footprint, &frame);
                let side = if geometric_normal.dot(direction) < 0.0 { 1.0 } else { -1.0 };
                shading_normal = appearance::usable_normal(mapped * side, geometric_normal * side, -direction) * side;
            }
        }
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
            cone,
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

    /// Two edges of the point's triangle one frame before, and by how much `normal`, a unit normal of the point, changes along each.
    /// `None` where it does not: plane.
    pub(crate) fn previous_bend(&self, point: &SurfacePoint, normal: Vec3) -> Option<([Vec3; 2], [Vec3; 2])> {
        let source = self.geometry.source(point.triangle);
        let placed = &self.placed[source.instance as usize];
        let mesh = self.mesh(source.instance);
        let (positions, normals) = match &placed.deformed {
            None => (&mesh.positions, &mesh.normals),
            Some([now, before]) => (&before.0, &now.1),
        };
        if normals.is_empty() {
            return None;
        }
        let corners = mesh.triangles[source.triangle as usize];
        let [a, b, c] = corners.map(|i| placed.previous_transform.transform_point3(positions[i as usize]));
        let n = corners.map(|i| (placed.normal_matrix * normals[i as usize]).normalize_or_zero());
        let Vec2 { x: u, y: v } = point.barycentric;
        let mean = n[0] * (1.0 - u - v) + n[1] * u + n[2] * v;
        let scale = if mean.dot(normal) < 0.0 { -1.0 } else { 1.0 } / mean.length();
        let [first, second, third] = n.map(|n| self.previous_normal(point, n));
        let bend = [(second - first) * scale, (third - first) * scale];
        let curved = bend.iter().any(|b| b.length() > LEAST_BEND);
        curved.then_some(([b - a, c - a], bend))
    }
}

/// Change of a normal within a triangle that is no more than rounding.
pub(crate) const LEAST_BEND: f32 = 1e-5;

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
