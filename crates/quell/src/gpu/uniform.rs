//! Structs as WGSL lays them out in memory. Those of the real-time filter are declared once here and once in WGSL, and a test
//! compares the two; the sequence filter's are declared here, and WGSL is made from that.

use glam::{IVec2, UVec2, UVec4, Vec2, Vec3, Vec4};

/// A member of a struct as the shader finds it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Member {
    /// Its name, the same in WGSL.
    pub name: &'static str,
    /// Its type in WGSL.
    pub ty: &'static str,
    /// Bytes from the struct's begin.
    pub offset: usize,
}

/// A struct of the shaders: name, size and members.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Uniform {
    /// Its name in WGSL.
    pub name: &'static str,
    /// Size in bytes, with padding at the end.
    pub size: usize,
    /// Members in order.
    pub members: Vec<Member>,
}

impl Uniform {
    /// The struct in WGSL.
    pub(super) fn declared(&self) -> String {
        let mut members = String::new();
        for (i, member) in self.members.iter().enumerate() {
            let align = if i == 0 { "@align(16) " } else { "" };
            members += &format!("    {align}{}: {},\n", member.name, member.ty);
        }
        format!("struct {} {{\n{members}}}\n\n", self.name)
    }
}

/// A value with WGSL's alignment and size.
pub(super) trait Value {
    const TYPE: &'static str;
    const ALIGN: usize;
    const SIZE: usize;
    /// Appends exactly `SIZE` bytes to `out`, whose length is a multiple of `ALIGN`.
    fn write(&self, out: &mut Vec<u8>);
}

macro_rules! scalars {
    ($($T:ty as $wgsl:literal: $align:literal, $size:literal, $parts:expr;)+) => { $(
        impl Value for $T {
            const TYPE: &'static str = $wgsl;
            const ALIGN: usize = $align;
            const SIZE: usize = $size;
            fn write(&self, out: &mut Vec<u8>) {
                let parts: fn(&$T) -> _ = $parts;
                parts(self).iter().for_each(|part| out.extend_from_slice(&part.to_le_bytes()));
            }
        }
    )+ };
}

scalars! {
    f32 as "f32": 4, 4, |v| [*v];
    u32 as "u32": 4, 4, |v| [*v];
    i32 as "i32": 4, 4, |v| [*v];
    Vec2 as "vec2f": 8, 8, |v| v.to_array();
    UVec2 as "vec2u": 8, 8, |v| v.to_array();
    IVec2 as "vec2i": 8, 8, |v| v.to_array();
    Vec3 as "vec3f": 16, 12, |v| v.to_array();
    Vec4 as "vec4f": 16, 16, |v| v.to_array();
    UVec4 as "vec4u": 16, 16, |v| v.to_array();
}

impl Value for [Vec3; 3] {
    const TYPE: &'static str = "array<vec3f, 3>";
    const ALIGN: usize = 16;
    const SIZE: usize = 48;
    fn write(&self, out: &mut Vec<u8>) {
        self.iter().for_each(|v| v.extend(0.0).write(out));
    }
}

pub(super) const fn round_up(n: usize, align: usize) -> usize {
    n.div_ceil(align) * align
}

/// Appends zeros until the length from `start` on is a multiple of `align`.
pub(super) fn pad(out: &mut Vec<u8>, start: usize, align: usize) {
    out.resize(start + round_up(out.len() - start, align), 0);
}

/// Declares structs that shaders read: alignment 16, as every struct inside a uniform has.
macro_rules! uniforms {
    ($( $(#[$meta:meta])* $visibility:vis $Name:ident as $wgsl:literal {
        $( $(#[$fmeta:meta])* $field_visibility:vis $field:ident: $T:ty ),+ $(,)?
    } )+) => { $(
        $(#[$meta])*
        #[derive(Clone, Copy, Debug)]
        $visibility struct $Name { $( $(#[$fmeta])* $field_visibility $field: $T ),+ }

        impl $crate::gpu::uniform::Value for $Name {
            const TYPE: &'static str = $wgsl;
            const ALIGN: usize = 16;
            const SIZE: usize = {
                let mut end = 0;
                $( end = $crate::gpu::uniform::round_up(end, <$T as $crate::gpu::uniform::Value>::ALIGN)
                    + <$T as $crate::gpu::uniform::Value>::SIZE; )+
                $crate::gpu::uniform::round_up(end, 16)
            };
            fn write(&self, out: &mut Vec<u8>) {
                let start = out.len();
                $(
                    $crate::gpu::uniform::pad(out, start, <$T as $crate::gpu::uniform::Value>::ALIGN);
                    $crate::gpu::uniform::Value::write(&self.$field, out);
                )+
                $crate::gpu::uniform::pad(out, start, 16);
            }
        }

        impl $Name {
            pub(super) fn layout() -> $crate::gpu::uniform::Uniform {
                let (mut end, mut members) = (0, Vec::new());
                $(
                    let offset = $crate::gpu::uniform::round_up(end, <$T as $crate::gpu::uniform::Value>::ALIGN);
                    let ty = <$T as $crate::gpu::uniform::Value>::TYPE;
                    members.push($crate::gpu::uniform::Member { name: stringify!($field), ty, offset });
                    end = offset + <$T as $crate::gpu::uniform::Value>::SIZE;
                )+
                let size = $crate::gpu::uniform::round_up(end, 16);
                $crate::gpu::uniform::Uniform { name: $wgsl, size, members }
            }
        }
    )+ };
}

pub(super) use uniforms;
