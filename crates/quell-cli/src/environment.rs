//! A picture from a file around a scene.

use crate::args::environment::EnvironmentArgs;
use crate::context::Context;
use crate::failure::Failure;
use quell_trace::Scene;
use quell_trace::environment::file;

/// Does what the options ask for; says what was wrong with texels.
pub fn surround(context: &Context, scene: &mut Scene, args: &EnvironmentArgs) -> Result<(), Failure> {
    let Some(path) = &args.environment else { return Ok(()) };
    let degrees = args.environment_rotation;
    if !degrees.is_finite() {
        return Err(Failure::Usage(format!("--environment-rotation {degrees} is no angle in degrees")));
    }
    let map = file::read(path).map_err(|e| Failure::Failed(e.to_string()))?;
    if let Some(note) = map.note(path) {
        context.note(&note);
    }
    map.surround(scene, degrees.to_radians(), args.environment_strength)
        .map_err(|e| Failure::Failed(format!("{}: {e}", path.display())))
}
