//! The one reader of accessors: every offset, stride and count is checked before a byte is touched or memory taken.

use super::Budget;
use super::buffers::Buffers;
use super::error::{Fault, Place, Problem, item};
use super::schema::{Accessor, Root};

/// Type of a component, by its number in the JSON.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn new(number: u64, place: &Place<'_>) -> Result<Self, Fault> {
        Ok(match number {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => {
                let problem = format!("componentType {number} does not exist; there are 5120 to 5123, 5125 and 5126");
                return Err(Fault::data(place, problem));
            }
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// The component at the start of `bytes`; normalised integers as in section 3.6.2.2 of the specification.
    #[inline(always)]
    fn float(self, bytes: &[u8], normalized: bool) -> f32 {
        let (value, scale) = match (self, bytes) {
            (Self::I8, &[a, ..]) => (f32::from(a as i8), 1.0 / 127.0),
            (Self::U8, &[a, ..]) => (f32::from(a), 1.0 / 255.0),
            (Self::I16, &[a, b, ..]) => (f32::from(i16::from_le_bytes([a, b])), 1.0 / 32767.0),
            (Self::U16, &[a, b, ..]) => (f32::from(u16::from_le_bytes([a, b])), 1.0 / 65535.0),
            (Self::U32, &[a, b, c, d, ..]) => (u32::from_le_bytes([a, b, c, d]) as f32, 1.0),
            (Self::F32, &[a, b, c, d, ..]) => return f32::from_le_bytes([a, b, c, d]),
            _ => (0.0, 1.0),
        };
        if normalized { (value * scale).max(-1.0) } else { value }
    }

    #[inline(always)]
    fn integer(self, bytes: &[u8]) -> u32 {
        match (self, bytes) {
            (Self::U8, &[a, ..]) => u32::from(a),
            (Self::U16, &[a, b, ..]) => u32::from(u16::from_le_bytes([a, b])),
            (Self::U32, &[a, b, c, d, ..]) => u32::from_le_bytes([a, b, c, d]),
            _ => 0,
        }
    }
}

/// A run of elements that lies within its buffer.
#[derive(Clone, Copy)]
struct Run<'a> {
    bytes: &'a [u8],
    stride: usize,
    size: usize,
    count: usize,
}

impl<'a> Run<'a> {
    fn new(
        (bytes, stride): (&'a [u8], Option<u64>),
        offset: u64,
        size: usize,
        count: usize,
        place: &Place<'_>,
    ) -> Result<Self, Fault> {
        let stride = stride.unwrap_or(size as u64);
        if stride < size as u64 {
            let problem = format!("the byteStride of {stride} is shorter than an element, which has {size} bytes");
            return Err(Fault::data(place, problem));
        }
        let needed = (count as u64 - 1).checked_mul(stride).and_then(|n| n.checked_add(size as u64));
        let end = needed.and_then(|n| n.checked_add(offset));
        let range = end.and_then(|end| Some(usize::try_from(offset).ok()?..usize::try_from(end).ok()?));
        match range.and_then(|r| bytes.get(r)) {
            Some(bytes) => Ok(Self { bytes, stride: stride as usize, size, count }),
            None => Err(Fault::data(
                place,
                format!(
                    "{count} elements of {size} bytes, {stride} apart from byteOffset {offset} on, reach beyond the \
                     {} bytes of the buffer view",
                    bytes.len()
                ),
            )),
        }
    }

    fn elements(self) -> impl Iterator<Item = &'a [u8]> {
        (0..self.count).map(move |i| self.bytes.get(i * self.stride..i * self.stride + self.size).unwrap_or_default())
    }
}

/// Reads accessors of a file.
#[derive(Clone, Copy)]
pub(super) struct Reader<'a> {
    pub(super) root: &'a Root,
    pub(super) buffers: &'a Buffers<'a>,
    pub(super) budget: &'a Budget,
}

impl Reader<'_> {
    /// Elements of `N` numbers, integers turned into floats. A file's values may be NaN or infinite.
    pub(super) fn floats<const N: usize>(&self, index: usize, place: &Place<'_>) -> Result<Vec<[f32; N]>, Fault> {
        let accessor = item(&self.root.accessors, index, "accessor", place)?;
        let place = place.refers("accessors", index);
        let component = component::<N>(accessor, &place)?;
        let normalized = accessor.normalized;
        let element = |bytes: &[u8]| {
            let mut out = [0.0; N];
            for (lane, chunk) in out.iter_mut().zip(bytes.chunks_exact(component.size())) {
                *lane = component.float(chunk, normalized);
            }
            out
        };
        self.read(accessor, component, N, &place, [0.0; N], element)
    }

    /// Colours: three or four numbers; alpha is 1 where there are three.
    pub(super) fn colors(&self, index: usize, place: &Place<'_>) -> Result<Vec<[f32; 4]>, Fault> {
        let accessor = item(&self.root.accessors, index, "accessor", place)?;
        if accessor.kind == "VEC3" {
            let three = self.floats::<3>(index, place)?;
            return Ok(three.into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect());
        }
        self.floats(index, place)
    }

    /// Elements of `N` unsigned integers.
    pub(super) fn integers<const N: usize>(&self, index: usize, place: &Place<'_>) -> Result<Vec<[u32; N]>, Fault> {
        let accessor = item(&self.root.accessors, index, "accessor", place)?;
        let place = place.refers("accessors", index);
        let component = component::<N>(accessor, &place)?;
        if !matches!(component, Component::U8 | Component::U16 | Component::U32) {
            let problem = "must be of unsigned integers: 5121, 5123 or 5125";
            return Err(Fault::data(&place.field("componentType"), problem));
        }
        let element = |bytes: &[u8]| {
            let mut out = [0; N];
            for (lane, chunk) in out.iter_mut().zip(bytes.chunks_exact(component.size())) {
                *lane = component.integer(chunk);
            }
            out
        };
        self.read(accessor, component, N, &place, [0; N], element)
    }

    fn read<T: Copy>(
        &self,
        accessor: &Accessor,
        component: Component,
        lanes: usize,
        place: &Place<'_>,
        zero: T,
        element: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>, Fault> {
        if accessor.count == 0 {
            return Err(Fault::new(&place.field("count"), Problem::Empty));
        }
        let size = component.size() * lanes;
        // The range is checked first: it says more than the limit does.
        let count = usize::try_from(accessor.count).unwrap_or(usize::MAX);
        let run = match accessor.buffer_view {
            None => None,
            Some(view) => {
                let view = self.buffers.view(self.root, view, &place.field("bufferView"))?;
                Some(Run::new(view, accessor.byte_offset, size, count, place)?)
            }
        };
        self.budget.charge(accessor.count.saturating_mul(size_of::<T>() as u64), &place.field("count"))?;
        let mut values: Vec<T> = match run {
            None => vec![zero; count],
            Some(run) => run.elements().map(&element).collect(),
        };
        if let Some(sparse) = &accessor.sparse {
            let place = place.field("sparse");
            if sparse.count == 0 {
                return Ok(values);
            }
            let changed = usize::try_from(sparse.count).unwrap_or(usize::MAX);
            if changed > count {
                let problem = format!("{changed} replaced elements are more than the accessor's {count}");
                return Err(Fault::data(&place.field("count"), problem));
            }
            let at = place.field("indices");
            let number = Component::new(sparse.indices.component_type, &at.field("componentType"))?;
            let (bytes, _) = self.buffers.view(self.root, sparse.indices.buffer_view, &at.field("bufferView"))?;
            let indices = Run::new((bytes, None), sparse.indices.byte_offset, number.size(), changed, &at)?;
            let from = place.field("values");
            let (bytes, _) = self.buffers.view(self.root, sparse.values.buffer_view, &from.field("bufferView"))?;
            let replaced = Run::new((bytes, None), sparse.values.byte_offset, size, changed, &from)?;
            for (number_bytes, bytes) in indices.elements().zip(replaced.elements()) {
                let index = number.integer(number_bytes) as usize;
                match values.get_mut(index) {
                    Some(value) => *value = element(bytes),
                    None => return Err(Fault::new(&at, Problem::Index { what: "element", index, count })),
                }
            }
        }
        Ok(values)
    }
}

/// The type of the components of an accessor that must have elements of `N` numbers.
fn component<const N: usize>(accessor: &Accessor, place: &Place<'_>) -> Result<Component, Fault> {
    if lanes(accessor, place)? != N {
        let problem = format!("is of type {}, where {} is needed", accessor.kind, kind_of(N));
        return Err(Fault::data(&place.field("type"), problem));
    }
    Component::new(accessor.component_type, &place.field("componentType"))
}

/// Numbers an element.
fn lanes(accessor: &Accessor, place: &Place<'_>) -> Result<usize, Fault> {
    Ok(match accessor.kind.as_str() {
        "SCALAR" => 1,
        "VEC2" => 2,
        "VEC3" => 3,
        "VEC4" => 4,
        // Matrices of two and three rows have gaps with short components; nothing that is read uses them.
        "MAT4" => 16,
        other => {
            let short: String = other.chars().take(40).collect();
            return Err(Fault::data(&place.field("type"), format!("`{short}` is no type that is read here")));
        }
    })
}

fn kind_of(lanes: usize) -> &'static str {
    match lanes {
        1 => "SCALAR",
        2 => "VEC2",
        3 => "VEC3",
        4 => "VEC4",
        _ => "MAT4",
    }
}
