//! Path tracer that makes the frames and the references of quell: scenes made by code, the factored estimators of
//! Mara et al. 2017, motion vectors, guides and converged references. It knows no filter.
//!
//! ```text
//! scene.rs, track.rs, shapes.rs, pattern.rs, builtin/   scenes as data over time; those made by code
//! gltf/           glTF files made into scenes
//! camera_paths.rs orbit and dolly for scenes in which nothing moves
//! bvh.rs, geometry.rs, world.rs   a scene at one frame: triangles, the eight-wide BVH and its walks, what a hit finds
//! material.rs, bsdf/              the material model and its lobes
//! texture/, cone.rs, appearance.rs   images with levels of detail, ray cones, what they make of a point
//! lights/, environment/, sources.rs  everything that emits, sampled by importance
//! sampler.rs, warp.rs             low-discrepancy numbers; maps from the unit square
//! primary.rs, curved_mirror.rs    primary surface replacement through glass and mirrors; motion of images in curved ones
//! integrator.rs, tracer/          light transport; the frame's planes and references
//! gpu/            the same on a GPU, in the WGSL files that lie beside the Rust files (feature `gpu`)
//! ```
//!
//! `scene_hash` names scene, tracer and options: it keys the cache of references and the frames that come with the demo.
//!
//! ```
//! use quell_trace::{Control, RenderOptions, Tracer, builtin};
//! let scene = builtin("cornell-box")?;
//! let tracer = Tracer::new(&scene, 0, 1)?;
//! let options = RenderOptions { direct_samples: 4, ..RenderOptions::new(quell::Size::new(16, 9)) };
//! let rendered = tracer.render(&options, &Control::default())?;
//! assert!(rendered.frame.matte.is_some());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod appearance;
pub mod bsdf;
mod builtin;
mod bvh;
pub mod camera_paths;
mod cone;
mod curved_mirror;
pub mod environment;
mod geometry;
pub mod gltf;
#[cfg(feature = "gpu")]
pub mod gpu;
mod hash;
mod integrator;
pub mod lights;
pub mod material;
pub mod pattern;
mod primary;
pub mod sampler;
pub mod scene;
pub mod shapes;
mod sources;
pub mod texture;
mod tracer;
mod track;
pub mod warp;
mod world;

pub use builtin::{SceneInfo, builtin, builtin_scenes};
pub use integrator::RayCounts;
pub use material::{Material, MaterialModel};
pub use pattern::Pattern;
pub use primary::PrimaryReplacement;
pub use scene::{
    Alpha, CameraPath, Instance, Mesh, NormalMap, PointlikeLight, Scene, SceneError, Surface, SurfaceTextures,
};
pub use tracer::{
    Control, Estimator, Half, HalfSignals, Reference, ReferenceKind, RenderOptions, Rendered, SIZE_LIMIT,
    TRACER_VERSION, TraceError, Tracer, jitter_of, scene_hash,
};
pub use track::Track;

#[cfg(test)]
mod testing;
