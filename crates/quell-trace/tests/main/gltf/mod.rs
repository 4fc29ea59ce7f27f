//! glTF files: what they mean, what is refused, and that nothing brings the loader down.

mod animation;
mod bad_input;
mod file;
mod replay;
mod shared;
mod static_scenes;
