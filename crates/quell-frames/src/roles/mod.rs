//! What the passes of a file are, by their names: an alias table, the renderer first, the user's word before all.

mod aliases;
mod mapping;
mod names;
mod role;

pub use aliases::{ALIASES, Aliases, DepthKind, Renderer, Space};
pub use mapping::{ChannelId, MapOptions, Mapped, Mapping, map_roles};
pub use role::Role;
