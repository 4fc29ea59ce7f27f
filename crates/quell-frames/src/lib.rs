//! Frames of quell as EXR files: found, read, mapped to roles, written.
//!
//! ```text
//! files.rs     where a sequence's frames lie, and files that are never half written
//! driver/      a sequence filtered from files to files: plan, three things at once, what may be replaced
//! image/       any flat EXR file: windows, parts, channels, attributes; read, and written back
//! exr_file.rs  channels and attributes of an EXR file; knows no role
//! sequence/    files, folders and patterns to frames with their files
//! roles/       what the passes of any program's file are: the alias table, the mapping and its reasons
//! channels.rs  the one table of quell's own channel names and what they mean
//! metadata.rs  header attributes: cameras, frame, sampling, version, settings
//! frame_file.rs  a frame with all that quell writes beside it; channels to planes and back
//! picture.rs   one colour picture from a file of any program
//! error.rs     what can go wrong
//! ```
//!
//! Writing and reading back keeps every plane and every camera to the bit where colours are stored as float:
//!
//! ```
//! use quell::{Camera, FrameBuf, Plane, Size};
//! use quell_frames::{FrameToWrite, WriteOptions, read_frame, write_frame};
//!
//! let size = Size::new(4, 3);
//! let camera = Camera::perspective([0.0; 3], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0], 0.8, 4.0 / 3.0);
//! let mut frame = FrameBuf::new(size, camera);
//! frame.matte = Some(Plane::filled(size, [0.1, 0.2, 0.3]));
//!
//! let folder = std::env::temp_dir().join(format!("quell-frames-doc-{}", std::process::id()));
//! let path = folder.join("noisy.0001.exr");
//! write_frame(&path, &FrameToWrite::new(frame.frame(&[])), &WriteOptions::default())?;
//! assert_eq!(read_frame(&path)?.frame, frame);
//! # std::fs::remove_dir_all(&folder).unwrap();
//! # Ok::<(), quell_frames::Error>(())
//! ```

pub mod channels;
pub mod driver;
pub mod error;
mod exr_file;
pub mod files;
pub mod frame_file;
pub mod image;
pub mod metadata;
mod picture;
pub mod roles;
pub mod sequence;

pub use error::Error;
pub use files::{find_frames, frame_path};
pub use frame_file::{
    FrameFile, FrameToWrite, Half, HalfBuf, Precision, WriteOptions, Written, read_frame, write_frame,
};
pub use image::{
    AttributeValue, Channel, ExrImage, ImageWriteOptions, ImageWritten, Part, SampleKind, Samples, Window,
    read_channels, read_headers, read_image, read_image_from,
};
pub use metadata::{Content, Metadata};
pub use picture::read_picture;
pub use roles::{MapOptions, Mapping, Role, map_roles};
pub use sequence::{FrameSource, FrameSources, Sequence, find_sequence};
