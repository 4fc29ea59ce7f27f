//! What a renderer's motion vectors mean: towards which frame, which signs, which axis first, which unit.

use quell::Size;

/// The frame that a vector leads to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Direction {
    /// The frame before.
    Previous,
    /// The next frame.
    Next,
}

/// The unit of a vector.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Unit {
    /// Pixels.
    Pixels,
    /// 1 is the picture's width or height.
    Uv,
    /// 2 is the picture's width or height.
    Ndc,
}

/// A convention: the surface at `pixel` lies at `pixel + offset(value)` in the other frame, y down.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct MotionConvention {
    /// Which frame.
    pub direction: Direction,
    /// True where the first number is vertical.
    pub swapped: bool,
    /// What multiplies the horizontal and the vertical number: 1 or -1.
    pub sign: [i8; 2],
    /// Of both numbers.
    pub unit: Unit,
}

impl MotionConvention {
    const fn pixels(direction: Direction, sign: [i8; 2]) -> Self {
        Self { direction, swapped: false, sign, unit: Unit::Pixels }
    }

    /// Conventions of the presets: of the first two numbers (or of `motion_previous`), and of the numbers for the
    /// other direction of time. Blender is measured; the rest is as the frames README assumes it: `auto` finds out.
    pub fn preset(name: &str) -> Option<[Self; 2]> {
        use Direction::{Next, Previous};
        Some(match name {
            // The contract of `quell::frame`: where the surface was, relative to the pixel, y down.
            "pixels" => [Self::pixels(Previous, [1, 1]), Self::pixels(Next, [1, 1])],
            // (x + X, y - Y) in the frame before, (x - Z, y + W) in the next.
            "blender" | "quell" => [Self::pixels(Previous, [1, -1]), Self::pixels(Next, [-1, 1])],
            "arnold" => [Self::pixels(Next, [1, -1]), Self::pixels(Previous, [1, -1])],
            "renderman" => [Self::pixels(Previous, [1, 1]), Self::pixels(Next, [1, 1])],
            "nuke" => [Self::pixels(Previous, [1, -1]), Self::pixels(Next, [1, -1])],
            "unreal" | "uv" => [
                Self { direction: Previous, swapped: false, sign: [-1, -1], unit: Unit::Uv },
                Self { direction: Next, swapped: false, sign: [1, 1], unit: Unit::Uv },
            ],
            _ => return None,
        })
    }

    /// Names of the presets.
    pub const PRESETS: [&'static str; 6] = ["blender", "arnold", "renderman", "nuke", "uv", "pixels"];

    /// All 48: 4 pairs of signs, previous or next, 2 orders of axes, 3 units.
    pub fn all() -> Vec<Self> {
        let mut all = Vec::with_capacity(48);
        for direction in [Direction::Previous, Direction::Next] {
            for swapped in [false, true] {
                for sign in [[1, 1], [1, -1], [-1, 1], [-1, -1]] {
                    for unit in [Unit::Pixels, Unit::Uv, Unit::Ndc] {
                        all.push(Self { direction, swapped, sign, unit });
                    }
                }
            }
        }
        all
    }

    /// The offset in pixels, y down, that a file's two numbers mean in a picture of `size`.
    pub fn offset(&self, value: [f32; 2], size: Size) -> [f32; 2] {
        let [x, y] = if self.swapped { [value[1], value[0]] } else { value };
        let scale = match self.unit {
            Unit::Pixels => [1.0, 1.0],
            Unit::Uv => [size.width as f32, size.height as f32],
            Unit::Ndc => [size.width as f32 * 0.5, size.height as f32 * 0.5],
        };
        [x * scale[0] * f32::from(self.sign[0]), y * scale[1] * f32::from(self.sign[1])]
    }

    /// The inverse of [`MotionConvention::offset`].
    pub fn value(&self, offset: [f32; 2], size: Size) -> [f32; 2] {
        let unit = self.offset([1.0, 1.0], size);
        let value = [offset[0] / unit[0], offset[1] / unit[1]];
        if self.swapped {
            // The scale belongs to the axis, not to the number's place.
            [value[1], value[0]]
        } else {
            value
        }
    }
}

impl std::fmt::Display for MotionConvention {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let names = if self.swapped { ["second", "first"] } else { ["first", "second"] };
        let sign = self.sign.map(|s| if s < 0 { "-" } else { "+" });
        let frame = match self.direction {
            Direction::Previous => "previous",
            Direction::Next => "next",
        };
        let unit = match self.unit {
            Unit::Pixels => "pixels",
            Unit::Uv => "0..1",
            Unit::Ndc => "-1..1",
        };
        write!(f, "{frame} = (x {} {}, y {} {}), y down, in {unit}", sign[0], names[0], sign[1], names[1])
    }
}
