//! How a picture larger than the device's textures is cut into tiles.
//!
//! Each tile has a core that is its own, and a margin around it, as far as the results of its core depend on other
//! pixels: within a frame ([`quell::gpu::reach_px`]), and by motion to the frame before.

use quell::gpu::{Area, Tile, reach_px};
use quell::settings::REFERENCE_ROWS;
use quell::{PlaneRef, Settings, Size};

/// How far history is looked for beyond a tile's core, pixels at 720 rows: what moves farther between two frames
/// begins afresh where it comes in over the edge of a tile.
const MOTION: f32 = 64.0;
/// Pixels of the footprint around the place where history lies.
const FOOTPRINT: usize = 2;

/// First and last pixel but one along an axis, of the core and of the whole tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Span {
    core: [usize; 2],
    all: [usize; 2],
}

/// A tile of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Piece {
    columns: Span,
    rows: Span,
}

/// All tiles of a picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    pub(super) whole: Size,
    /// Around each core, where the picture goes on.
    pub(super) margin: usize,
    pub(super) pieces: Vec<Piece>,
}

impl Layout {
    /// `most`: pixels along a side of a texture. `None`: they are too few for the margins.
    pub(super) fn new(whole: Size, settings: &Settings, most: usize) -> Option<Self> {
        let motion = (MOTION * whole.height as f32 / REFERENCE_ROWS).ceil() as usize;
        Self::with_margin(whole, reach_px(settings, whole.height) + motion + FOOTPRINT, most)
    }

    pub(super) fn with_margin(whole: Size, margin: usize, most: usize) -> Option<Self> {
        let (columns, rows) = (spans(whole.width, margin, most)?, spans(whole.height, margin, most)?);
        let row = |rows: &Span| columns.iter().map(|&columns| Piece { columns, rows: *rows }).collect::<Vec<_>>();
        Some(Self { whole, margin, pieces: rows.iter().flat_map(row).collect() })
    }

    /// Which tile takes what from which, so that its margin is as its neighbours' cores are.
    pub(super) fn exchanges(&self) -> Vec<(usize, usize, Area)> {
        let pieces = || self.pieces.iter().enumerate();
        let pairs = pieces().flat_map(|(to, a)| pieces().filter(move |(from, _)| *from != to).map(move |b| (to, a, b)));
        pairs
            .filter_map(|(to, a, (from, b))| {
                let [x, width] = common(a.columns.all, b.columns.core)?;
                let [y, height] = common(a.rows.all, b.rows.core)?;
                Some((to, from, Area { origin: [x as u32, y as u32], size: Size::new(width, height) }))
            })
            .collect()
    }

    /// Pixels of all tiles over those of the picture.
    pub(super) fn overlap(&self) -> f64 {
        let run: usize = self.pieces.iter().map(|piece| piece.size().pixels()).sum();
        run as f64 / self.whole.pixels().max(1) as f64
    }

    /// Pixels of cores whose motion leads to a place in the picture that their tile does not hold: they lose history.
    pub(super) fn beyond(&self, motion: PlaneRef<'_, [f32; 2]>) -> u64 {
        let outside = |[begin, end]: [usize; 2], place: f32, extent: usize| {
            let is_held = place >= begin as f32 && place <= end as f32;
            !is_held && place >= 0.0 && place <= extent as f32
        };
        let of_row = |piece: &Piece, y: usize| {
            let [first, end] = piece.columns.core;
            let row = motion.row(y).get(first..end).unwrap_or_default();
            let is_lost = |&(x, [dx, dy]): &(usize, &[f32; 2])| {
                let place = [x as f32 + 0.5 + dx, y as f32 + 0.5 + dy];
                outside(piece.columns.all, place[0], self.whole.width)
                    || outside(piece.rows.all, place[1], self.whole.height)
            };
            (first..).zip(row).filter(is_lost).count() as u64
        };
        let of = |piece: &Piece| (piece.rows.core[0]..piece.rows.core[1]).map(|y| of_row(piece, y)).sum::<u64>();
        if self.pieces.len() > 1 { self.pieces.iter().map(of).sum() } else { 0 }
    }
}

impl Piece {
    pub(super) const fn size(&self) -> Size {
        let ([left, right], [top, bottom]) = (self.columns.all, self.rows.all);
        Size::new(right - left, bottom - top)
    }

    /// First pixel in the picture.
    pub(super) const fn origin(&self) -> [usize; 2] {
        [self.columns.all[0], self.rows.all[0]]
    }

    /// Its place, as its frames say it; `None`: it is all of the picture.
    pub(super) fn tile(&self, whole: Size) -> Option<Tile> {
        let origin = self.origin().map(|n| n as u32);
        (self.size() != whole).then_some(Tile { origin, whole })
    }

    /// First pixel of the core in the picture, and the core's extent.
    pub(super) const fn core(&self) -> ([usize; 2], Size) {
        let ([x, right], [y, bottom]) = (self.columns.core, self.rows.core);
        ([x, y], Size::new(right - x, bottom - y))
    }
}

/// Begin and length of what two ranges share.
fn common(a: [usize; 2], b: [usize; 2]) -> Option<[usize; 2]> {
    let (begin, end) = (a[0].max(b[0]), a[1].min(b[1]));
    (begin < end).then(|| [begin, end - begin])
}

/// One where it fits; else cores of one size, but for the last.
fn spans(extent: usize, margin: usize, most: usize) -> Option<Vec<Span>> {
    if extent <= most {
        return Some(vec![Span { core: [0, extent], all: [0, extent] }]);
    }
    let step = Tile::STEP as usize;
    // The left edge goes out to a multiple of the step.
    let widest = most.checked_sub(2 * margin + step - 1)? / step * step;
    if widest == 0 {
        return None;
    }
    let core = extent.div_ceil(extent.div_ceil(widest)).next_multiple_of(step);
    let span = |begin: usize| {
        let end = (begin + core).min(extent);
        let all = [begin.saturating_sub(margin) / step * step, (end + margin).min(extent)];
        Span { core: [begin, end], all }
    };
    Some((0..extent).step_by(core).map(span).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use quell::Plane;

    fn layout(width: usize, height: usize, most: usize) -> Option<Layout> {
        Layout::new(Size::new(width, height), &Settings::default(), most)
    }

    #[test]
    fn a_picture_that_fits_is_one_tile() {
        let one = layout(160, 90, 160).unwrap();
        assert_eq!((one.pieces.len(), one.pieces[0].tile(one.whole), one.exchanges().len()), (1, None, 0));
        assert_eq!(one.overlap(), 1.0);
    }

    #[test]
    fn cores_cover_the_picture_once_and_margins_come_from_them() {
        for (width, height, most) in
            [(160, 90, 96), (161, 90, 80), (97, 210, 180), (8448, 128, 8192), (20000, 11000, 16384)]
        {
            let all = layout(width, height, most).unwrap();
            let mut covered = 0;
            for piece in &all.pieces {
                let size = piece.size();
                assert!(size.width <= most && size.height <= most, "{size}");
                assert!(piece.origin().iter().all(|n| n.is_multiple_of(4)));
                covered += piece.core().1.pixels();
            }
            assert_eq!(covered, all.whole.pixels());
            // What a tile takes and its own core are all of it.
            for (to, piece) in all.pieces.iter().enumerate() {
                let taken = all.exchanges().into_iter().filter(|(taker, ..)| *taker == to);
                let taken: usize = taken.map(|(_, _, area)| area.size.pixels()).sum();
                assert_eq!(taken + piece.core().1.pixels(), piece.size().pixels());
                let ([x, y], core) = piece.core();
                let ([left, top], size) = (piece.origin(), piece.size());
                let around =
                    [x - left, y - top, left + size.width - x - core.width, top + size.height - y - core.height];
                let at_edge = [left == 0, top == 0, left + size.width == width, top + size.height == height];
                for (around, at_edge) in around.into_iter().zip(at_edge) {
                    assert!(at_edge || around >= all.margin, "{around} of {}", all.margin);
                }
            }
        }
        assert_eq!(layout(160, 90, 40), None);
    }

    #[test]
    fn motion_that_leaves_a_tile_is_counted() {
        let all = layout(160, 90, 96).unwrap();
        let moved = |by: [f32; 2]| all.beyond(Plane::filled(all.whole, by).view());
        assert_eq!(moved([0.0, 0.0]), 0);
        assert_eq!(moved([all.margin as f32, 0.0]), 0);
        // Out of the picture, or unknown.
        assert_eq!((moved([400.0, 0.0]), moved([f32::NAN; 2])), (0, 0));
        assert!(moved([70.0, 0.0]) > 0);
        assert_eq!(layout(160, 90, 160).unwrap().beyond(Plane::filled(all.whole, [70.0, 0.0]).view()), 0);
    }
}
