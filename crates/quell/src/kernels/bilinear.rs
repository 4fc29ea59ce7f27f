//! The bilinear footprint: four pixels around a place, and the share of each.

/// The pixels left above, right above, left below and right below of a place, in pixels counted from the centre of the
/// first one: x, y, share in 0..1. The shares add up to 1.
#[inline(always)]
pub(crate) fn footprint(x: f32, y: f32) -> [(isize, isize, f32); 4] {
    let (left, top) = (x.floor(), y.floor());
    let (tx, ty) = (x - left, y - top);
    let (left, top) = (left as isize, top as isize);
    [
        (left, top, (1.0 - tx) * (1.0 - ty)),
        (left + 1, top, tx * (1.0 - ty)),
        (left, top + 1, (1.0 - tx) * ty),
        (left + 1, top + 1, tx * ty),
    ]
}

#[cfg(test)]
mod tests {
    use super::footprint;

    #[test]
    fn shares_lie_around_the_place() {
        for (x, y) in [(0.0, 0.0), (2.25, 5.5), (-0.5, 7.75)] {
            let taps = footprint(x, y);
            let mean = |f: &dyn Fn(&(isize, isize, f32)) -> f32| taps.iter().map(|tap| tap.2 * f(tap)).sum::<f32>();
            assert_eq!((mean(&|_| 1.0), mean(&|tap| tap.0 as f32), mean(&|tap| tap.1 as f32)), (1.0, x, y));
        }
    }
}
