//! Frames of quell as EXR files: found, read, mapped to roles, written.
//!
//! ```text
//! arrays.rs    frames in memory as images, so that they take the way of files
//! files.rs     where a sequence's frames lie, and files that are never half written
//! doctor/      what is wrong with a sequence, and how to fix it
//! driver/      a sequence filtered, from files to files or frame by frame in memory
//! image/       any flat EXR file: windows, parts, channels, attributes; read, and written back
//! exr_file.rs  channels and attributes of an EXR file; knows no role
//! sequence/    files, folders and patterns to frames with their files
//! adapt/       from passes to frames of the filter, and from filtered light back to passes that add up
//! motion/      what motion vectors mean, and how to find out
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

//!
//! Files of other programs, from finding them to writing them back (`filter` stands for the filter):
//!
//! ```no_run
//! use quell_frames::{AdaptOptions, Adapter, ImageWriteOptions, Links, MapOptions, find_sequence};
//! # fn filter(f: &quell::sequence::SequenceFrame) -> Vec<quell::Plane<quell::Rgb>> { Vec::new() }
//!
//! let sequence = find_sequence(&["shot.####.exr".into()])?;
//! let headers = sequence.frames[0].read_headers()?;
//! let named: Vec<_> = sequence.frames[0].named(&headers);
//! for mapping in quell_frames::map_roles(&named, &MapOptions::default())? {
//!     // Headers of all frames give the canvas; pixels of two frames show sums, encodings and vectors.
//!     let canvas = headers.iter().map(|i| i.full_window()).reduce(|a, b| a.union(b)).unwrap();
//!     let [first, second] = [0, 1].map(|n| sequence.frames[n].read(&mapping));
//!     let adapter = Adapter::new(mapping.clone(), canvas, &first?, Some(&second?), &AdaptOptions::default())?;
//!     let mut links = Links::default();
//!     for sources in &sequence.frames {
//!         let mut images = sources.read(&mapping)?;
//!         let made = adapter.frame(sources.number, &images, &mut links)?;
//!         images.iter_mut().for_each(|image| image.forget()); // while the frame waits; read again below
//!         let lights = filter(&made.frame); // without weight, in the order of `made.frame.lights`
//!         adapter.write_back(&mut images, &made.frame, &lights, None)?;
//!         adapter.sign(&mut images, "[sequence]")?;
//!         for image in &images {
//!             let name = image.path().file_name().unwrap();
//!             image.write(&std::path::Path::new("clean").join(name), &ImageWriteOptions::default())?;
//!         }
//!     }
//! }
//! # Ok::<(), quell_frames::Error>(())
//! ```

pub mod adapt;
pub mod arrays;
pub mod channels;
pub mod doctor;
pub mod driver;
pub mod error;
mod exr_file;
pub mod files;
pub mod frame_file;
pub mod image;
pub mod metadata;
pub mod motion;
mod picture;
pub mod roles;
pub mod sequence;

pub use adapt::{AdaptOptions, Adapted, Adapter, Links, MotionChoice};
pub use error::Error;
pub use files::{find_frames, frame_path};
pub use frame_file::{
    FrameFile, FrameToWrite, Half, HalfBuf, Precision, WriteOptions, Written, frame_bytes, read_frame, write_frame,
};
pub use image::{
    AttributeValue, Channel, ExrImage, ImageWriteOptions, ImageWritten, Part, SampleKind, Samples, Window,
    read_channels, read_headers, read_image, read_image_from,
};
pub use metadata::{Content, Metadata};
pub use picture::read_picture;
pub use roles::{MapOptions, Mapping, Role, map_roles};
pub use sequence::{FrameSource, FrameSources, Sequence, find_sequence};
