//! Path tracer that makes the frames and the references of quell: scenes made by code, the factored estimators of
//! Mara et al. 2017, motion vectors, guides and converged references. It knows no filter.
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
pub mod environment;
mod geometry;
pub mod gltf;
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
    TRACER_VERSION, TraceError, Tracer, scene_hash,
};
pub use track::Track;

#[cfg(test)]
mod testing;
