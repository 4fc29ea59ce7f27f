//! The specification of `blend`.

use super::{
    Blend, BlendFrame, DIRECTIONS, FRAMES, HIGH_PASS, LEAST_BRIGHTNESS, MOST_CHANGE, NEAR, NOISE_NEAR, NOISE_WIDE,
    OUTPUTS, Pooled, Read, SECOND_DIFFERENCE, Steady, WIDE, by_thresholds, drawn_back, follow,
    kernel::{self, RADIUS},
    net,
    outlier::{Limits, believed},
    read, shares, silhouette, without_outlier,
};
use crate::frame::Rgb;
use crate::kernels::conv::{ConvNet, GRID, LEAK, MOST_INPUT};
use crate::kernels::math::lerp;
use crate::plane::{Plane, Size};
use crate::sequence::settings::{Blend as Settings, Gather, Stabilise};

/// Shares of input, wavelet's picture and the stabilised one, of `window[centre]`, and what the kernels change, on the whole image.
pub fn run(
    window: &[BlendFrame<'_>],
    centre: usize,
    (steady, steady_alpha): Steady<'_>,
    (gather, stabilise): (&Gather, &Stabilise),
    s: &Settings,
) -> Blend {
    let here = &window[centre];
    let size = here.input.size();
    let (w, h) = (size.width, size.height);
    let (pooled, brightness) = pooled(window, centre, steady, (gather, stabilise));
    let relative = |a: &Plane<Rgb>, b: &Plane<Rgb>, x: usize, y: usize| -> [f64; 3] {
        [0, 1, 2].map(|c| (f64::from(a.at(x, y)[c]) - f64::from(b.at(x, y)[c])) / brightness.at(x, y))
    };
    let wavelet = Plane::from_fn(size, |x, y| relative(here.input, here.picture, x, y));
    let stabilised = Plane::from_fn(size, |x, y| relative(here.input, steady, x, y));
    let squared = |v: [f64; 3]| v.iter().map(|v| v * v).sum::<f64>();
    let read = |x: usize, y: usize| {
        let candidates = [here.input.at(x, y), here.picture.at(x, y), steady.at(x, y)];
        let depth = |x: usize, y: usize| f64::from(here.features.surface[y * w + x].inverse_depth);
        let around = mean(w, h, (x, y), NOISE_NEAR, depth) as f32;
        read(&pooled.at(x, y), candidates, (1.0 / brightness.at(x, y)) as f32, (here.features, y * w + x, around))
    };
    let said = s.net.then(|| judged(net(), size, here.features.first_row, &read));
    let wanted = Plane::from_fn(size, |x, y| match &said {
        Some(said) => {
            let [first, second, third, error, ..] = said.at(x, y);
            shares([first, second, third, error], s.strength)
        }
        None => by_thresholds(&pooled.at(x, y), s),
    });
    let moved = |x: usize, y: usize| {
        let [_, a, b] = wanted.at(x, y).0.map(f64::from);
        squared([0, 1, 2].map(|c| a * wavelet.at(x, y)[c] + b * stabilised.at(x, y)[c]))
    };
    let shares = Plane::from_fn(size, |x, y| {
        let difference = mean(w, h, (x, y), NOISE_NEAR, moved) as f32;
        let kept = drawn_back(difference, pooled.at(x, y).least_noise(s), s);
        let [_, wavelet, steady] = wanted.at(x, y).0.map(|v| v * kept);
        let believed = believed(
            (window, centre),
            |frame| frame.input,
            (x, y),
            gather,
            Limits::new(stabilise, pooled.at(x, y).noise(1)),
        );
        without_outlier([1.0 - (wavelet + steady), wavelet, steady], believed, s)
    });
    let noise = Plane::from_fn(size, |x, y| {
        let expected = wanted.at(x, y).1 * pooled.at(x, y).noise(1) / 3.0;
        (f64::from(expected).sqrt() * brightness.at(x, y)) as f32
    });
    let alpha = here
        .alpha
        .zip(steady_alpha)
        .map(|(own, steady)| Plane::from_fn(size, |x, y| lerp(own.at(x, y), steady.at(x, y), shares.at(x, y)[2])));
    let Some(said) = said.filter(|_| s.kernel > 0.0) else { return Blend { shares, gain: None, alpha, noise } };
    let mixture = Plane::from_fn(size, |x, y| {
        let of = [here.input.at(x, y), here.picture.at(x, y), steady.at(x, y)];
        [0, 1, 2].map(|c| (0..3).map(|k| f64::from(shares.at(x, y)[k]) * f64::from(of[k][c])).sum::<f64>())
    });
    let change = |x: usize, y: usize, of: &dyn Fn(usize, usize) -> f64| -> f64 {
        let place = |v: usize, d: usize, extent: usize| (v + d).saturating_sub(RADIUS).min(extent - 1);
        let [_, _, _, _, taps @ ..] = said.at(x, y);
        let taps = kernel::weights(taps).into_iter().enumerate();
        let side = 2 * RADIUS + 1;
        taps.map(|(k, v)| f64::from(v) * (of(place(x, k % side, w), place(y, k / side, h)) - of(x, y))).sum()
    };
    let single = |x: usize, y: usize| mixture.at(x, y).map(|v| v as f32);
    let changed = Plane::from_fn(size, |x, y| {
        let own = kernel::brightness(single(x, y));
        let limited = |x: usize, y: usize, c: usize| f64::from(kernel::limited(single(x, y), own, s)[c]);
        [0, 1, 2].map(|c| change(x, y, &|x, y| limited(x, y, c)))
    });
    let kept = Plane::from_fn(size, |x, y| {
        let relative = |x: usize, y: usize| squared(changed.at(x, y).map(|d| d / brightness.at(x, y)));
        let difference = mean(w, h, (x, y), NOISE_NEAR, relative) as f32;
        let pooled = pooled.at(x, y);
        kernel::kept(difference, pooled.noise(1), pooled.least_noise(s), s)
    });
    let gain = Plane::from_fn(size, |x, y| {
        let kept = kept.at(x, y);
        let change = changed.at(x, y).map(|v| if kept > 0.0 { v as f32 * kept } else { 0.0 });
        kernel::gain(mixture.at(x, y).map(|v| v as f32), change)
    });
    let alpha = alpha.map(|alpha| {
        let change = |x: usize, y: usize| change(x, y, &|x, y| f64::from(alpha.at(x, y))) as f32;
        Plane::from_fn(size, |x, y| {
            let kept = kept.at(x, y);
            alpha.at(x, y) + if kept > 0.0 { kept * change(x, y) } else { 0.0 }
        })
    });
    Blend { shares, gain: Some(gain), alpha, noise }
}

/// What the net says of every pixel: the whole net in double precision, layer by layer.
fn judged(net: &ConvNet, size: Size, first_row: usize, read: &dyn Fn(usize, usize) -> Read) -> Plane<[f32; OUTPUTS]> {
    let above = first_row % GRID;
    let padded = Size::new(size.width.next_multiple_of(GRID), (above + size.height).next_multiple_of(GRID));
    let inside = |x: usize, y: usize| (x.min(size.width - 1), y.saturating_sub(above).min(size.height - 1));
    let standard: Vec<Vec<f64>> = (0..padded.pixels())
        .map(|p| {
            let (x, y) = inside(p % padded.width, p / padded.width);
            let values = read(x, y).into_iter().zip(&net.mean).zip(&net.scale);
            let most = f64::from(MOST_INPUT);
            values.map(|((v, mean), scale)| (f64::from(v - mean) * f64::from(*scale)).clamp(-most, most)).collect()
        })
        .collect();
    // Images are rows of pixels of channels.
    let layer = |image: &[Vec<f64>], size: Size, k: usize| -> Vec<Vec<f64>> {
        let (l, last) = (&net.layers[k], k + 1 == net.layers.len());
        let around = l.side as isize / 2;
        let place = |v: usize, d: isize, extent: usize| (v as isize + d).clamp(0, extent as isize - 1) as usize;
        (0..size.pixels())
            .map(|p| {
                let (x, y) = (p % size.width, p / size.width);
                (0..l.outputs)
                    .map(|o| {
                        let mut sum = f64::from(l.bias[o]);
                        for c in 0..l.inputs {
                            for (dy, dx) in (-around..=around).flat_map(|dy| (-around..=around).map(move |dx| (dy, dx)))
                            {
                                let tap = (dy + around) as usize * l.side + (dx + around) as usize;
                                let weight = l.weights[(o * l.inputs + c) * l.side * l.side + tap];
                                let q = place(y, dy, size.height) * size.width + place(x, dx, size.width);
                                sum += f64::from(weight) * image[q][c];
                            }
                        }
                        if sum < 0.0 && !last { f64::from(LEAK) * sum } else { sum }
                    })
                    .collect()
            })
            .collect()
    };
    let halved = |image: &[Vec<f64>], size: Size| -> (Vec<Vec<f64>>, Size) {
        let half = Size::new(size.width / 2, size.height / 2);
        let mean = |p: usize| {
            let q = 2 * (p / half.width) * size.width + 2 * (p % half.width);
            let four = [q, q + 1, q + size.width, q + size.width + 1];
            (0..image[0].len()).map(|c| four.iter().map(|&q| image[q][c]).sum::<f64>() / 4.0).collect()
        };
        ((0..half.pixels()).map(mean).collect(), half)
    };
    let beside = |whole: &[Vec<f64>], half: &[Vec<f64>], size: Size| -> Vec<Vec<f64>> {
        let both = |p: usize| {
            let q = p / size.width / 2 * (size.width / 2) + p % size.width / 2;
            whole[p].iter().chain(&half[q]).copied().collect()
        };
        (0..size.pixels()).map(both).collect()
    };
    let a = layer(&layer(&standard, padded, 0), padded, 1);
    let (b, half) = halved(&a, padded);
    let b = layer(&b, half, 2);
    let (c, quarter) = halved(&b, half);
    let c = layer(&layer(&c, quarter, 3), quarter, 4);
    let d = layer(&beside(&b, &c, half), half, 5);
    let out = layer(&layer(&beside(&a, &d, padded), padded, 6), padded, 7);
    Plane::from_fn(size, |x, y| std::array::from_fn(|k| out[(above + y) * padded.width + x][k] as f32))
}

/// What is known of the noise at every pixel, and the brightness that it is relative to.
pub(crate) fn pooled(
    window: &[BlendFrame<'_>],
    centre: usize,
    steady: &Plane<Rgb>,
    (gather, stabilise): (&Gather, &Stabilise),
) -> (Plane<Pooled>, Plane<f64>) {
    let here = &window[centre];
    let size = here.input.size();
    let (w, h) = (size.width, size.height);
    let grey = |c: Rgb| f64::from(c[0] + c[1] + c[2]) / 3.0;
    let brightness = Plane::from_fn(size, |x, y| {
        mean(w, h, (x, y), NOISE_NEAR, |x, y| 0.5 * (grey(here.picture.at(x, y)) + grey(steady.at(x, y)))).max(0.0)
            + f64::from(LEAST_BRIGHTNESS)
    });
    let relative = |a: &Plane<Rgb>, b: &Plane<Rgb>, x: usize, y: usize| -> [f64; 3] {
        [0, 1, 2].map(|c| (f64::from(a.at(x, y)[c]) - f64::from(b.at(x, y)[c])) / brightness.at(x, y))
    };
    let wavelet = Plane::from_fn(size, |x, y| relative(here.input, here.picture, x, y));
    let stabilised = Plane::from_fn(size, |x, y| relative(here.input, steady, x, y));
    let between = Plane::from_fn(size, |x, y| relative(here.picture, steady, x, y));
    let time = Plane::from_fn(size, |x, y| over_time(window, centre, (x, y), gather, brightness.at(x, y)));
    let squared = |v: [f64; 3]| v.iter().map(|v| v * v).sum::<f64>();
    let high = |x: usize, y: usize, at: &dyn Fn(usize, usize) -> [f64; 3]| squared(high_pass(w, h, (x, y), at));
    let pooled = Plane::from_fn(size, |x, y| {
        let pool = |radius: usize, f: &dyn Fn(usize, usize) -> f64| mean(w, h, (x, y), radius, f) as f32;
        let signed = |plane: &dyn Fn(usize, usize) -> [f64; 3]| {
            squared([0, 1, 2].map(|c| mean(w, h, (x, y), NOISE_NEAR, |x, y| plane(x, y)[c]))) as f32
        };
        let space = |x: usize, y: usize| high(x, y, &|x, y| wavelet.at(x, y)) / f64::from(HIGH_PASS);
        let detail = |picture: &Plane<Rgb>, x: usize, y: usize| {
            high(x, y, &|x, y| picture.at(x, y).map(f64::from)) / brightness.at(x, y).powi(2)
        };
        let second = |plane: &dyn Fn(usize, usize) -> [f64; 3], [dx, dy]: [isize; 2]| {
            pool(NOISE_NEAR, &|x, y| {
                let place = |v: usize, d: isize, limit: usize| (v as isize + d).clamp(0, limit as isize - 1) as usize;
                let at = |d: isize| plane(place(x, d * dx, w), place(y, d * dy, h));
                let (a, b, c) = (at(-1), at(0), at(1));
                squared([0, 1, 2].map(|k| a[k] - 2.0 * b[k] + c[k])) / f64::from(SECOND_DIFFERENCE)
            })
        };
        // Relative to the brightness of the middle pixel.
        let input_second = |[dx, dy]: [isize; 2]| {
            pool(NOISE_NEAR, &|x, y| {
                let place = |v: usize, d: isize, limit: usize| (v as isize + d).clamp(0, limit as isize - 1) as usize;
                let at = |d: isize| here.input.at(place(x, d * dx, w), place(y, d * dy, h)).map(f64::from);
                let (a, b, c) = (at(-1), at(0), at(1));
                squared([0, 1, 2].map(|k| (a[k] - 2.0 * b[k] + c[k]) / brightness.at(x, y)))
                    / f64::from(SECOND_DIFFERENCE)
            })
        };
        Pooled {
            over_time: [NOISE_NEAR, NOISE_WIDE].map(|r| pool(r, &|x, y| time.at(x, y).change)),
            seen: [NOISE_NEAR, NOISE_WIDE].map(|r| pool(r, &|x, y| time.at(x, y).seen)),
            over_space: [NOISE_NEAR, NOISE_WIDE].map(|r| pool(r, &space)),
            input: [NOISE_NEAR, NOISE_WIDE].map(|r| pool(r, &|x, y| detail(here.input, x, y) / f64::from(HIGH_PASS))),
            along: [
                DIRECTIONS.into_iter().map(input_second).fold(f32::MAX, f32::min),
                DIRECTIONS.into_iter().map(|d| second(&|x, y| wavelet.at(x, y), d)).fold(f32::MAX, f32::min),
            ],
            apart: [
                pool(NEAR, &|x, y| squared(wavelet.at(x, y))),
                pool(NEAR, &|x, y| squared(stabilised.at(x, y))),
                pool(NEAR, &|x, y| squared(between.at(x, y))),
                pool(WIDE, &|x, y| squared(wavelet.at(x, y))),
                pool(WIDE, &|x, y| squared(stabilised.at(x, y))),
                pool(WIDE, &|x, y| squared(between.at(x, y))),
            ],
            detail: [pool(NEAR, &|x, y| detail(steady, x, y)), pool(NEAR, &|x, y| detail(here.picture, x, y))],
            mean: [
                signed(&|x, y| wavelet.at(x, y)),
                signed(&|x, y| stabilised.at(x, y)),
                signed(&|x, y| time.at(x, y).mean),
            ],
            silhouette: silhouette(here.features, x, y, stabilise.nearer),
        }
    });
    (pooled, brightness)
}

/// What the trajectory of a pixel says of its noise, relative to the brightness.
#[derive(Clone, Copy, Default)]
struct OverTime {
    /// Input less wavelet's picture, averaged.
    mean: [f64; 3],
    /// Half the squared changes to the pixel's own, over the most frames.
    change: f64,
    /// Share of frames that show it.
    seen: f64,
}

fn over_time(
    window: &[BlendFrame<'_>],
    centre: usize,
    (x, y): (usize, usize),
    gather: &Gather,
    brightness: f64,
) -> OverTime {
    let here = &window[centre];
    let p = y * here.features.size.width + x;
    let difference = |frame: &BlendFrame<'_>, q: usize| -> [f64; 3] {
        [0, 1, 2].map(|c| f64::from(frame.input.data()[q][c]) - f64::from(frame.picture.data()[q][c]))
    };
    let sum = |frame: &BlendFrame<'_>, q: usize| frame.picture.data()[q].iter().sum::<f32>() + LEAST_BRIGHTNESS;
    let own = difference(here, p);
    let mut met = Vec::new();
    for forward in [false, true].into_iter().filter(|forward| !forward || gather.future) {
        let mut at = [x as f32, (here.features.first_row + y) as f32];
        let origin = at[1];
        let (mut q, mut frame) = (p, centre);
        for _ in 0..FRAMES {
            let next = if forward { frame + 1 } else { frame.wrapping_sub(1) };
            let Some(there) = window.get(next) else { break };
            let reflected = here.features.is_mirror(p);
            let found = follow(window[frame].features, there.features, forward, reflected, (&mut at, q));
            let farthest = gather.travel * here.features.picture_height as f32;
            let Some(found) = found.filter(|_| (at[1] - origin).abs() <= farthest) else { break };
            (q, frame) = (found, next);
            let ratio = f64::from((sum(here, p) / sum(there, q)).clamp(1.0 / MOST_CHANGE, MOST_CHANGE));
            met.push(difference(there, q).map(|d| d * ratio));
        }
    }
    let all = (2 * FRAMES) as f64;
    let change: f64 = met.iter().flat_map(|d| (0..3).map(|c| 0.5 * (own[c] - d[c]).powi(2))).sum();
    let total = [0, 1, 2].map(|c| own[c] + met.iter().map(|d| d[c]).sum::<f64>());
    OverTime {
        mean: total.map(|v| v / brightness / (1.0 + met.len() as f64)),
        change: change / brightness.powi(2) / all,
        seen: met.len() as f64 / all,
    }
}

/// The mean over a window of 2 `radius` + 1 pixels, of what lies in the picture.
fn mean(w: usize, h: usize, (x, y): (usize, usize), radius: usize, f: impl Fn(usize, usize) -> f64) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for v in y.saturating_sub(radius)..(y + radius + 1).min(h) {
        for u in x.saturating_sub(radius)..(x + radius + 1).min(w) {
            sum += f(u, v);
            count += 1.0;
        }
    }
    sum / count
}

/// A value less its binomial mean over 3x3; beyond the border the border counts.
fn high_pass(w: usize, h: usize, (x, y): (usize, usize), at: &dyn Fn(usize, usize) -> [f64; 3]) -> [f64; 3] {
    let mut blurred = [0.0; 3];
    for (dy, wy) in [(-1, 0.25), (0, 0.5), (1, 0.25)] {
        for (dx, wx) in [(-1, 0.25), (0, 0.5), (1, 0.25)] {
            let place = |v: usize, d: isize, limit: usize| (v as isize + d).clamp(0, limit as isize - 1) as usize;
            let value = at(place(x, dx, w), place(y, dy, h));
            for c in 0..3 {
                blurred[c] += wx * wy * value[c];
            }
        }
    }
    let value = at(x, y);
    [0, 1, 2].map(|c| value[c] - blurred[c])
}
