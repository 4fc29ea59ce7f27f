//! The last stage: L = direct + matte_weight M' + glossy_weight G'. Emission is in `direct`.
//!
//! | | |
//! |---|---|
//! | reads | direct light, filtered signals, their weights |
//! | writes | the picture |
//! | reach | none |
//! | equation | as above; noisy direct light, where a host gives it, is added with the weight of its lobe, unfiltered |
//! | source | \[S] |
//! | parameters | none |

use crate::frame::Rgb;

#[cfg(feature = "cpu")]
pub(crate) mod cpu;
pub mod reference;

use crate::reach::Reach;

/// One pixel: `terms` are (signal, weight), added in this order.
#[inline(always)]
pub(crate) fn pixel(direct: Rgb, terms: impl IntoIterator<Item = (Rgb, Rgb)>) -> Rgb {
    let mut sum = direct;
    for (signal, weight) in terms {
        for c in 0..3 {
            sum[c] += weight[c] * signal[c];
        }
    }
    sum
}

/// The stage looks at the pixel alone.
pub(crate) fn reach() -> Reach {
    Reach::NONE
}
