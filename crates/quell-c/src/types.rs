//! The structs and numbers of `include/quell.h`, in its order; what they mean stands there.

use std::ffi::{c_char, c_int, c_void};

pub type quell_status = c_int;
pub const QUELL_OK: quell_status = 0;
pub const QUELL_INVALID_ARGUMENT: quell_status = 1;
pub const QUELL_BUSY: quell_status = 2;
pub const QUELL_STOPPED: quell_status = 3;
pub const QUELL_FAILED: quell_status = 4;

pub const QUELL_F16: u32 = 1;
pub const QUELL_F32: u32 = 2;
pub const QUELL_U32: u32 = 3;

#[repr(C)]
#[derive(Clone, Copy)]
pub struct quell_pass {
    pub struct_size: usize,
    pub name: *const c_char,
    pub role: *const c_char,
    pub data: *const c_void,
    pub type_: u32,
    pub channels: u32,
    pub channel_stride: isize,
    pub pixel_stride: isize,
    pub row_stride: isize,
}

#[repr(C)]
#[derive(Clone, Copy)]
pub struct quell_frame {
    pub struct_size: usize,
    pub number: i64,
    pub width: u32,
    pub height: u32,
    pub passes: *const quell_pass,
    pub pass_count: usize,
    pub clip_from_world: *const f32,
}

#[repr(C)]
#[derive(Clone, Copy)]
pub struct quell_target {
    pub struct_size: usize,
    pub data: *mut c_void,
    pub type_: u32,
    pub channels: u32,
    pub channel_stride: isize,
    pub pixel_stride: isize,
    pub row_stride: isize,
}

pub type quell_warn = Option<unsafe extern "C" fn(user: *mut c_void, text: *const c_char)>;
pub type quell_ready =
    Option<unsafe extern "C" fn(user: *mut c_void, clean: *const crate::sequence::quell_clean) -> c_int>;

#[repr(C)]
#[derive(Clone, Copy)]
pub struct quell_sequence_options {
    pub struct_size: usize,
    pub threads: u32,
    pub motion: *const c_char,
    pub renderer: *const c_char,
    pub warn: quell_warn,
    pub warn_user: *mut c_void,
    pub preset: *const c_char,
}

#[repr(C)]
#[derive(Clone, Copy)]
pub struct quell_realtime_options {
    pub struct_size: usize,
    pub width: u32,
    pub height: u32,
    pub threads: u32,
    pub preset: *const c_char,
}

#[repr(C)]
#[derive(Clone, Copy)]
pub struct quell_camera {
    pub struct_size: usize,
    pub clip_from_world: [f32; 16],
    pub position: [f32; 3],
    pub jitter: [f32; 2],
}

#[repr(C)]
#[derive(Clone, Copy)]
pub struct quell_realtime_frame {
    pub struct_size: usize,
    pub index: i64,
    pub camera: *const quell_camera,
    pub previous_camera: *const quell_camera,
    pub planes: *const quell_pass,
    pub plane_count: usize,
}
