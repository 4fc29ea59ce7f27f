//! The whole put together: what the chosen scene's nodes show, as meshes, instances, lights and cameras.

use super::accessor::Reader;
use super::animation::{self, Choice};
use super::buffers::{Buffers, Folder};
use super::deform::{Deformer, Skin};
use super::error::{Fault, Place, Problem, item};
use super::mesh::{self, Part, Wanted};
use super::nodes::{Pose, Rig, Tree, single};
use super::report::{LoadReport, Warnings};
use super::schema::{Root, SUPPORTED};
use super::textures::Images;
use super::{Budget, Counter, Loaded, Options, Stage, Watcher, cameras, container, lights, materials};
use crate::environment::{Environment, Sky};
use crate::hash::Hash;
use crate::scene::{Instance, Mesh, Scene};
use crate::track::Track;
use glam::{Affine3A, Vec3};
use rayon::prelude::*;
use std::collections::{BTreeSet, HashMap};
use std::path::Path;
use std::sync::Arc;

/// Frames of a scene in which nothing moves.
const STILL_FRAMES: usize = 64;
/// Fewer make no sequence.
const LEAST_FRAMES: usize = 8;
/// More than any run has.
const MOST_FRAMES: usize = 1_000_000;

/// Beyond this squares of distances overflow.
const FARTHEST: f32 = 1e17;

/// What lights a scene that has no light.
const DEFAULT_SKY: Sky = Sky {
    zenith: Vec3::new(0.45, 0.65, 1.0),
    horizon: Vec3::new(1.0, 1.0, 1.0),
    ground: Vec3::new(0.3, 0.28, 0.25),
    sun_direction: Vec3::new(0.4, 0.8, 0.45),
    sun_radiance: Vec3::ZERO,
    sun_angular_radius: 0.0,
};

pub(super) fn scene(
    bytes: Vec<u8>,
    folder: &Path,
    name: &str,
    options: &Options,
    watcher: Watcher<'_>,
) -> Result<Loaded, Fault> {
    let mut identity = Hash::new();
    identity.bytes(&bytes);
    let container = container::parse(bytes, &options.limits)?;
    let root = &container.root;
    let mut warnings = Warnings::default();
    let mut report = LoadReport {
        generator: root.asset.generator.clone(),
        copyright: root.asset.copyright.clone(),
        materials: root.materials.len(),
        ..LoadReport::default()
    };
    extensions(root, &mut warnings)?;

    let budget = Budget::new(options.limits.decoded_bytes);
    let folder = Folder { path: folder, limits: &options.limits, budget: &budget };
    let binary = container.binary.clone().and_then(|range| container.bytes.get(range));
    let buffers = Buffers::load(root, binary, &folder)?;
    for bytes in buffers.external() {
        identity.bytes(bytes);
    }
    let reader = Reader { root, buffers: &buffers, budget: &budget };

    report.scenes =
        root.scenes.iter().enumerate().map(|(n, s)| s.name.clone().unwrap_or_else(|| (n + 1).to_string())).collect();
    report.scene = match &options.scene {
        Some(choice) => Some(animation::chosen(&report.scenes, choice, "scene")?),
        None => match root.scene {
            Some(scene) => {
                item(&root.scenes, scene, "scene", &Place::root("scene"))?;
                Some(scene)
            }
            None => (!root.scenes.is_empty()).then_some(0),
        },
    };
    let choice = match options.clip.as_deref() {
        None => Choice::All,
        Some("none") => Choice::None,
        Some(clip) => Choice::One(animation::chosen(&animation::names(root), clip, "clip")?),
    };
    let tree = Tree::new(root, &mut warnings)?;
    let shown = tree.shown(root, report.scene)?;
    report.nodes = shown.len();
    let textures = textures_of(root, &shown);
    report.textures = textures.len();
    let images = Images::read(root, &buffers, &folder, &budget, &textures, watcher, &mut warnings)?;
    for &hash in &images.external {
        identity.number(hash);
    }
    identity.number(report.scene.map_or(u64::MAX, |s| s as u64));
    identity.number(match choice {
        Choice::All => u64::MAX,
        Choice::None => u64::MAX - 1,
        Choice::One(clip) => clip as u64,
    });
    identity.number(options.frames_per_second.to_bits());

    let played = animation::read(&reader, choice, &mut warnings)?;
    report.clips = played.clips;
    report.seconds = played.seconds;
    let frames_per_second = options.frames_per_second;
    if !(frames_per_second.is_finite() && frames_per_second > 0.0) {
        let problem = format!("{frames_per_second} frames a second are none; give a number above 0, such as 24");
        return Err(Fault::whole(Problem::Nothing(problem)));
    }
    let moves = !played.channels.is_empty();
    let rig = Arc::new(Rig::new(tree, played.channels, frames_per_second));

    let mut scene = Scene::new(name);
    scene.identity = identity.finish();
    scene.frames = STILL_FRAMES;
    if moves && played.seconds > 0.0 {
        let frames = (played.seconds * frames_per_second - 1e-6).ceil() + 1.0;
        scene.frames = (frames as usize).clamp(LEAST_FRAMES, MOST_FRAMES);
    }
    scene.surfaces = materials::read(root, &images, &mut warnings)?;
    report.images = images.list.len();
    scene.images = images.list;
    let rest = rig.pose(0.0);
    let mut builder = Builder {
        reader,
        rig: Arc::clone(&rig),
        rest: &rest,
        parts: HashMap::new(),
        shared: HashMap::new(),
        skins: HashMap::new(),
        scene,
        report,
        bounds: None,
    };
    builder.read_parts(&shown, watcher, &mut warnings)?;
    for &node in &shown {
        let data = item(&root.nodes, node, "node", &Place::root("nodes"))?;
        if let Some(mesh) = data.mesh {
            builder.place(node, mesh, options.limits.triangles, &mut warnings)?;
        }
        if let Some(camera) = data.camera
            && let Some((path, info)) = cameras::read(root, &rig, &rest, node, camera, &mut warnings)?
        {
            builder.scene.cameras.push(path);
            builder.report.cameras.push(info);
        }
        if let Some(light) = &data.extensions.light
            && let Some(light) = lights::read(root, &rig, &rest, node, light.light, &mut warnings)?
        {
            builder.scene.lights.push(light);
        }
    }
    builder.finish(warnings)
}

/// Textures of the materials that the nodes show.
fn textures_of(root: &Root, shown: &[usize]) -> BTreeSet<usize> {
    let meshes: BTreeSet<usize> = shown.iter().filter_map(|&n| root.nodes.get(n)?.mesh).collect();
    let primitives = meshes.iter().filter_map(|&m| root.meshes.get(m)).flat_map(|m| &m.primitives);
    let used: BTreeSet<usize> = primitives.filter_map(|p| p.material).collect();
    used.iter().filter_map(|&m| root.materials.get(m)).flat_map(materials::textures).map(|t| t.index).collect()
}

/// Names extensions that are not read; an error where the file cannot do without.
fn extensions(root: &Root, warnings: &mut Warnings) -> Result<(), Fault> {
    let short = |name: &String| name.chars().take(80).collect::<String>();
    let missing = |names: &[String]| -> Vec<String> {
        names.iter().filter(|n| !SUPPORTED.contains(&n.as_str())).take(20).map(short).collect()
    };
    let required = missing(&root.extensions_required);
    if !required.is_empty() {
        let place = Place::root("extensionsRequired");
        return Err(Fault::new(&place, Problem::Required(required.join(", "))));
    }
    for name in missing(&root.extensions_used) {
        warnings.push(&Place::root("extensionsUsed"), format!("{name} is not read: what it adds is left out"));
    }
    Ok(())
}

struct Builder<'a> {
    reader: Reader<'a>,
    rig: Arc<Rig>,
    rest: &'a Pose,
    /// Parts by mesh and primitive.
    parts: HashMap<(usize, usize), Arc<Part>>,
    /// Index of the scene's mesh for parts that do not deform.
    shared: HashMap<(usize, usize), usize>,
    skins: HashMap<usize, Arc<Skin>>,
    scene: Scene,
    report: LoadReport,
    /// Around all instances at frame 0.
    bounds: Option<(Vec3, Vec3)>,
}

impl Builder<'_> {
    /// Reads all primitives that the nodes show, in parallel.
    fn read_parts(&mut self, shown: &[usize], watcher: Watcher<'_>, warnings: &mut Warnings) -> Result<(), Fault> {
        let root = self.reader.root;
        let nodes = Place::root("nodes");
        let mut used = BTreeSet::new();
        for &node in shown {
            if let Some(mesh) = root.nodes.get(node).and_then(|n| n.mesh) {
                item(&root.meshes, mesh, "mesh", &nodes.item(node).field("mesh"))?;
                used.insert(mesh);
            }
        }
        let all: Vec<(usize, usize)> = used
            .iter()
            .flat_map(|&m| (0..root.meshes.get(m).map_or(0, |mesh| mesh.primitives.len())).map(move |p| (m, p)))
            .collect();
        let counter = Counter::new(watcher, Stage::Meshes, all.len());
        let reader = self.reader;
        let surfaces = &self.scene.surfaces;
        let read = |&(m, p): &(usize, usize)| {
            let mut warnings = Warnings::default();
            let list = Place::root("meshes");
            let mesh = list.item(m);
            let primitives = mesh.field("primitives");
            let place = primitives.item(p);
            let primitive = item(&root.meshes, m, "mesh", &list)?;
            let primitive = item(&primitive.primitives, p, "primitive", &primitives)?;
            if let Some(material) = primitive.material {
                item(&root.materials, material, "material", &place.field("material"))?;
            }
            let surface = surfaces.get(primitive.material.unwrap_or(root.materials.len()));
            let normal = surface.and_then(|s| s.textures.as_ref()?.normal);
            let wanted = Wanted { tangents: normal.map(|map| map.texture.uv_set) };
            let part = mesh::read(&reader, primitive, wanted, &place, &mut warnings)?;
            counter.one_more();
            Ok((part, warnings))
        };
        let parts: Vec<(Option<Part>, Warnings)> = all.par_iter().map(read).collect::<Result<_, Fault>>()?;
        for (key, (part, own)) in all.into_iter().zip(parts) {
            warnings.append(own);
            if let Some(part) = part {
                self.parts.insert(key, Arc::new(part));
            }
        }
        Ok(())
    }

    /// Places the parts of a mesh at a node.
    fn place(&mut self, node: usize, mesh: usize, limit: u64, warnings: &mut Warnings) -> Result<(), Fault> {
        let root = self.reader.root;
        let nodes = Place::root("nodes");
        let at = nodes.item(node);
        let mesh_data = item(&root.meshes, mesh, "mesh", &at.field("mesh"))?;
        let node_data = item(&root.nodes, node, "node", &at)?;
        let skin = match node_data.skin {
            None => None,
            Some(skin) => {
                item(&root.skins, skin, "skin", &at.field("skin"))?;
                if !self.skins.contains_key(&skin) {
                    let read = Arc::new(Skin::read(&self.reader, skin, warnings)?);
                    self.skins.insert(skin, read);
                }
                self.skins.get(&skin).cloned()
            }
        };
        let weights = node_data.weights.as_ref().or(mesh_data.weights.as_ref());
        for (number, primitive) in mesh_data.primitives.iter().enumerate() {
            let key = (mesh, number);
            let Some(part) = self.parts.get(&key).cloned() else { continue };
            let triangles = part.mesh.triangles.len();
            self.report.triangles += triangles;
            if self.report.triangles as u64 > limit {
                let value = self.report.triangles as u64;
                return Err(Fault::new(&at, Problem::Limit { what: "triangles in the world", value, limit }));
            }
            let skin = self.skin_of(&part, skin.as_ref(), mesh, number, &at, warnings)?;
            let mut rest_weights: Vec<f32> = weights.cloned().unwrap_or_default();
            rest_weights.retain(|w| w.is_finite());
            rest_weights.resize(part.targets.len(), 0.0);
            let morphs =
                !part.targets.is_empty() && (self.rig.drives_weights(node) || rest_weights.iter().any(|w| *w != 0.0));
            let skinned = skin.is_some();
            let index = if skinned || morphs {
                let rig = Arc::clone(&self.rig);
                self.deforming(Deformer { rig, part: Arc::clone(&part), node, skin, weights: rest_weights }, &at)?
            } else {
                match self.shared.get(&key) {
                    Some(&index) => index,
                    None => {
                        let index = self.scene.mesh(part.mesh.clone());
                        self.shared.insert(key, index);
                        index
                    }
                }
            };
            let surface = primitive.material.unwrap_or(root.materials.len());
            let mut instance = Instance::fixed(index, surface);
            if !skinned {
                instance.transform = if self.rig.moves(node) {
                    let rig = Arc::clone(&self.rig);
                    Track::function(move |frame| single(rig.pose(frame).world(node)))
                } else {
                    single(self.rest.world(node)).into()
                };
            }
            self.add(instance, &part, &at, warnings);
        }
        Ok(())
    }

    /// The skin, if the part is bound to it.
    fn skin_of(
        &self,
        part: &Part,
        skin: Option<&Arc<Skin>>,
        mesh: usize,
        primitive: usize,
        at: &Place<'_>,
        warnings: &mut Warnings,
    ) -> Result<Option<Arc<Skin>>, Fault> {
        let Some(skin) = skin else { return Ok(None) };
        let place = at.field("skin");
        if part.influences.is_empty() || skin.len() == 0 {
            let what = if skin.len() == 0 { "the skin has no joints" } else { "has no joints or weights" };
            warnings.push(&place, format!("primitive {primitive} of mesh {mesh}: {what}; the skin does not move it"));
            return Ok(None);
        }
        let used = |i: &super::mesh::Influences| {
            i.joints.iter().flatten().zip(i.weights.iter().flatten()).filter(|(_, w)| **w > 0.0).map(|(j, _)| *j).max()
        };
        match part.influences.iter().filter_map(used).max() {
            Some(joint) if joint as usize >= skin.len() => {
                let problem = Problem::Index { what: "joint", index: joint as usize, count: skin.len() };
                Err(Fault::new(&place, problem))
            }
            _ => Ok(Some(Arc::clone(skin))),
        }
    }

    /// A mesh of its own, moved by a skin or morph targets; if neither ever moves, as it stands.
    fn deforming(&mut self, deformer: Deformer, at: &Place<'_>) -> Result<usize, Fault> {
        let mut mesh = deformer.part.mesh.clone();
        self.reader.budget.charge((mesh.positions.len() * size_of::<[Vec3; 4]>()) as u64, at)?;
        if deformer.moves() {
            self.report.deforming_meshes += 1;
            mesh.deform = Some(Arc::new(move |frame: f64, mesh: &Mesh| deformer.at(frame, mesh)));
        } else {
            let (positions, normals) = deformer.at(0.0, &mesh);
            mesh.positions = positions;
            mesh.normals = normals;
        }
        Ok(self.scene.mesh(mesh))
    }

    fn add(&mut self, instance: Instance, part: &Part, at: &Place<'_>, warnings: &mut Warnings) {
        let mesh = &self.scene.meshes[instance.mesh];
        let transform = instance.transform.at(0.0);
        let moved;
        let positions = match &mesh.deform {
            None => &mesh.positions,
            Some(deform) => {
                moved = deform(0.0, mesh).0;
                &moved
            }
        };
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for &index in mesh.triangles.iter().flatten() {
            let p = transform.transform_point3(positions[index as usize]);
            (low, high) = (low.min(p), high.max(p));
        }
        if !(transform.is_finite() && low.min_element() > -FARTHEST && high.max_element() < FARTHEST) {
            warnings.push(at, "stands where arithmetic in single precision ends: its mesh is left out");
            return;
        }
        if singular(&transform) && instance.transform.is_constant() {
            warnings.push(at, "the transform is singular: the mesh is flat, and what lost its area is left out");
        }
        self.bounds = Some(match self.bounds {
            None => (low, high),
            Some((l, h)) => (l.min(low), h.max(high)),
        });
        self.report.degenerate_triangles += part.degenerate;
        self.report.instances += 1;
        let surface = &self.scene.surfaces[instance.surface];
        if surface.material.is_emissive() || surface.unlit {
            self.report.emitters += 1;
            if part.degenerate == part.mesh.triangles.len() {
                warnings.push(at, "emits, but has no area: it lights nothing");
            }
        }
        self.scene.instances.push(instance);
    }

    fn finish(mut self, warnings: Warnings) -> Result<Loaded, Fault> {
        let report = &mut self.report;
        let scene = &mut self.scene;
        report.meshes = scene.meshes.len();
        report.lights = scene.lights.len();
        let Some((low, high)) = self.bounds else {
            let problem = "holds no triangle that can be shown; export meshes of triangles";
            return Err(Fault::whole(Problem::Nothing(problem.to_owned())));
        };
        if scene.lights.is_empty() && report.emitters == 0 {
            scene.environment = Environment::sky(&DEFAULT_SKY);
            report.notes.push("the file has no light: a default sky lights the scene".to_owned());
        }
        if scene.cameras.is_empty() {
            scene.cameras.push(cameras::framing(low, high));
            report.notes.push("the file has no camera: one frames the scene from outside".to_owned());
        }
        if report.degenerate_triangles > 0 {
            report.notes.push(format!("{} triangles without area are left out", report.degenerate_triangles));
        }
        warnings.into_report(report);
        Ok(Loaded { scene: self.scene, report: self.report })
    }
}

fn singular(transform: &Affine3A) -> bool {
    let m = transform.matrix3;
    let size = m.x_axis.length() * m.y_axis.length() * m.z_axis.length();
    m.determinant().abs() <= 1e-7 * size
}
