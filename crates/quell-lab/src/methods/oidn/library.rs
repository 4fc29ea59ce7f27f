//! The C interface of Open Image Denoise 2, loaded at run time: the few functions that are needed.

#![expect(unsafe_code, reason = "a foreign library behind a C interface")]

use libloading::Library;
use quell::{Rgb, Size};
use std::ffi::{CStr, OsStr, c_char, c_int, c_void};
use std::path::{Path, PathBuf};

/// `OIDN_DEVICE_TYPE_CPU`: images may lie in the caller's memory, and times compare with the other methods'.
const CPU_DEVICE: c_int = 1;
/// `OIDN_FORMAT_FLOAT3`.
const FLOAT3: c_int = 3;

/// File names of version 2, on this platform.
const NAMES: &[&str] = if cfg!(target_os = "windows") {
    &["OpenImageDenoise.dll"]
} else if cfg!(target_os = "macos") {
    &["libOpenImageDenoise.2.dylib", "libOpenImageDenoise.dylib"]
} else {
    &["libOpenImageDenoise.so.2", "libOpenImageDenoise.so"]
};

/// Folders that are tried after the loader's own.
const FOLDERS: &[&str] = if cfg!(target_os = "windows") {
    &[]
} else if cfg!(target_os = "macos") {
    &["/opt/homebrew/lib", "/usr/local/lib"]
} else {
    &["/usr/local/lib", "/usr/local/lib64", "/usr/lib64", "/usr/lib"]
};

type Handle = *mut c_void;

/// The functions; valid as long as the library is loaded.
#[derive(Clone, Copy)]
struct Functions {
    new_device: unsafe extern "C" fn(c_int) -> Handle,
    set_device_int: unsafe extern "C" fn(Handle, *const c_char, c_int),
    commit_device: unsafe extern "C" fn(Handle),
    release_device: unsafe extern "C" fn(Handle),
    device_error: unsafe extern "C" fn(Handle, *mut *const c_char) -> c_int,
    new_filter: unsafe extern "C" fn(Handle, *const c_char) -> Handle,
    set_image: unsafe extern "C" fn(Handle, *const c_char, Handle, c_int, usize, usize, usize, usize, usize),
    set_bool: unsafe extern "C" fn(Handle, *const c_char, bool),
    set_int: unsafe extern "C" fn(Handle, *const c_char, c_int),
    commit_filter: unsafe extern "C" fn(Handle),
    execute_filter: unsafe extern "C" fn(Handle),
    release_filter: unsafe extern "C" fn(Handle),
}

/// How much time may be spent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub enum Quality {
    /// For previews.
    Fast = 4,
    /// For interactive rendering.
    Balanced = 5,
    /// For final frames.
    High = 6,
}

/// What a filter reads: planes of equal extent. Of a feature buffer that is filtered itself nothing else.
pub(super) struct Images<'a> {
    pub(super) colour: Option<&'a [Rgb]>,
    pub(super) albedo: Option<&'a [Rgb]>,
    /// Needs albedo.
    pub(super) normal: Option<&'a [[f32; 3]]>,
}

/// A CPU device with one filter for one extent.
pub(super) struct Denoiser {
    functions: Functions,
    device: Handle,
    filter: Handle,
    size: Size,
    /// Unloaded last.
    _library: Library,
}

// SAFETY: the interface of Open Image Denoise is thread-safe, and the handles are used through `&mut self` only.
unsafe impl Send for Denoiser {}

impl Denoiser {
    /// Loads the library from `path` (a file, or a folder), else from the loader's path and the usual folders, and makes
    /// a filter of images of `size`: of HDR pictures with auxiliary images free of noise (`hdr`), or of one auxiliary image.
    pub(super) fn open(path: Option<&OsStr>, size: Size, quality: Quality, hdr: bool) -> Result<Self, String> {
        let (library, file) = load(path)?;
        let functions = functions(&library)
            .map_err(|e| format!("{} lacks a function of Open Image Denoise 2: {e}", file.display()))?;
        // SAFETY: the signatures are those of the public header, version 2; handles are checked before use.
        let (device, filter) = unsafe {
            let device = (functions.new_device)(CPU_DEVICE);
            if device.is_null() {
                return Err(format!("{}: {}", file.display(), last_error(&functions, device)));
            }
            let threads = c_int::try_from(rayon::current_num_threads()).unwrap_or(0);
            (functions.set_device_int)(device, c"numThreads".as_ptr(), threads);
            (functions.commit_device)(device);
            let filter = (functions.new_filter)(device, c"RT".as_ptr());
            if filter.is_null() {
                let reason = last_error(&functions, device);
                (functions.release_device)(device);
                return Err(format!("{}: {reason}", file.display()));
            }
            (functions.set_bool)(filter, c"hdr".as_ptr(), hdr);
            (functions.set_bool)(filter, c"cleanAux".as_ptr(), hdr);
            (functions.set_int)(filter, c"quality".as_ptr(), quality as c_int);
            (device, filter)
        };
        Ok(Self { functions, device, filter, size, _library: library })
    }

    pub(super) fn size(&self) -> Size {
        self.size
    }

    /// Filters one image into `out`.
    pub(super) fn denoise(&mut self, images: &Images<'_>, out: &mut [Rgb]) -> Result<(), String> {
        let Size { width, height } = self.size;
        let inputs = [(c"color", images.colour), (c"albedo", images.albedo), (c"normal", images.normal)];
        let f = &self.functions;
        for (name, image) in inputs {
            let Some(image) = image else { continue };
            self.check(image)?;
            self.set_image(name, image.as_ptr().cast_mut().cast(), width, height);
        }
        self.check(out)?;
        self.set_image(c"output", out.as_mut_ptr().cast(), width, height);
        // SAFETY: the filter is alive, and all images outlive the call, which waits for the end; the library writes to
        // the output only, which is borrowed mutably.
        unsafe {
            (f.commit_filter)(self.filter);
            (f.execute_filter)(self.filter);
        }
        match last_error(f, self.device) {
            none if none.is_empty() => Ok(()),
            reason => Err(reason),
        }
    }

    fn check(&self, image: &[Rgb]) -> Result<(), String> {
        let expected = self.size.pixels();
        if image.len() == expected { Ok(()) } else { Err(format!("{} pixels instead of {expected}", image.len())) }
    }

    fn set_image(&self, name: &CStr, pixels: *mut c_void, width: usize, height: usize) {
        // SAFETY: the filter is alive; `pixels` are width x height times three floats without padding (`check`). The
        // filter keeps the pointer, but reads it only in `denoise`, which sets it anew.
        unsafe { (self.functions.set_image)(self.filter, name.as_ptr(), pixels, FLOAT3, width, height, 0, 0, 0) };
    }
}

impl Drop for Denoiser {
    fn drop(&mut self) {
        // SAFETY: both handles are alive and are not used again; the library is still loaded.
        unsafe {
            (self.functions.release_filter)(self.filter);
            (self.functions.release_device)(self.device);
        }
    }
}

/// What the device complains about; empty: nothing.
fn last_error(functions: &Functions, device: Handle) -> String {
    let mut message = std::ptr::null();
    // SAFETY: `message` is written by the call; the text belongs to the library and lives until the next call.
    unsafe {
        match (functions.device_error)(device, &raw mut message) {
            0 => String::new(),
            code if message.is_null() => format!("error {code}"),
            _ => CStr::from_ptr(message).to_string_lossy().into_owned(),
        }
    }
}

/// The library and the file or name it came by; else where it was looked for.
fn load(path: Option<&OsStr>) -> Result<(Library, PathBuf), String> {
    let candidates: Vec<PathBuf> = match path.map(Path::new) {
        Some(path) if path.is_dir() => {
            let folders = [path.to_owned(), path.join("lib"), path.join("bin")];
            folders.iter().flat_map(|folder| NAMES.iter().map(|name| folder.join(name))).collect()
        }
        Some(path) => vec![path.to_owned()],
        None => {
            let plain = NAMES.iter().map(PathBuf::from);
            let folders = FOLDERS.iter().flat_map(|folder| NAMES.iter().map(|name| Path::new(folder).join(name)));
            plain.chain(folders).collect()
        }
    };
    let mut broken = None;
    for candidate in &candidates {
        // SAFETY: loading runs the library's initialisers; the user named the file, or it is the one that this system
        // has under the name of Open Image Denoise.
        match unsafe { Library::new(candidate) } {
            Ok(library) => return Ok((library, candidate.clone())),
            // A file that is there and does not load says more than one that is not there.
            Err(error) if candidate.is_file() => broken = Some(format!("{}: {error}", candidate.display())),
            Err(_) => {}
        }
    }
    Err(broken.unwrap_or_else(|| {
        let looked: Vec<String> = candidates.iter().map(|c| c.display().to_string()).collect();
        format!("Open Image Denoise 2 was not found as {}", looked.join(", "))
    }))
}

fn functions(library: &Library) -> Result<Functions, libloading::Error> {
    // SAFETY: names and signatures are those of the public header `oidn.h`, version 2.
    unsafe {
        Ok(Functions {
            new_device: *library.get(b"oidnNewDevice\0")?,
            set_device_int: *library.get(b"oidnSetDeviceInt\0")?,
            commit_device: *library.get(b"oidnCommitDevice\0")?,
            release_device: *library.get(b"oidnReleaseDevice\0")?,
            device_error: *library.get(b"oidnGetDeviceError\0")?,
            new_filter: *library.get(b"oidnNewFilter\0")?,
            set_image: *library.get(b"oidnSetSharedFilterImage\0")?,
            set_bool: *library.get(b"oidnSetFilterBool\0")?,
            set_int: *library.get(b"oidnSetFilterInt\0")?,
            commit_filter: *library.get(b"oidnCommitFilter\0")?,
            execute_filter: *library.get(b"oidnExecuteFilter\0")?,
            release_filter: *library.get(b"oidnReleaseFilter\0")?,
        })
    }
}
