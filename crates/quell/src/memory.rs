//! Whether memory for an image will do, asked before anything is allocated: what cannot be had is then an error, not an
//! abort in the middle of a frame.

use crate::error::Error;
use crate::plane::Size;

/// Bytes a pixel that a back end holds at the least for a frame with both signals, jitter and no passes.
///
/// The fast back end: guides of two frames 60, lengths and confidences of two signals 32, three histories 36, four
/// images shown 48, and never fewer than three colour images at work 36.
pub(crate) const CPU: usize = 212;
/// The reference: guides of two frames 112, all intermediate images.
pub(crate) const REFERENCE: usize = 300;

/// Asks for the whole and gives it back untouched.
///
/// That is an estimate from below, of one moment: systems that promise more memory than they have can still end the
/// process later.
///
/// # Errors
/// [`Error::Memory`] where the system refuses.
pub(crate) fn probe(size: Size, bytes_per_pixel: usize) -> Result<(), Error> {
    let bytes = size.pixels().saturating_mul(bytes_per_pixel);
    let mut room: Vec<u8> = Vec::new();
    room.try_reserve_exact(bytes).map_err(|_| Error::Memory { size, bytes: bytes as u64 })?;
    // Seen by the optimiser as used: an allocation that nobody looks at may be left out.
    std::hint::black_box(&mut room);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_no_machine_has_is_refused() {
        assert!(probe(Size::new(1280, 720), CPU).is_ok());
        let error = probe(Size::new(1 << 22, 1 << 22), CPU).unwrap_err();
        assert!(error.to_string().contains("4194304x4194304"), "{error}");
        assert!(probe(Size::new(usize::MAX, 1), CPU).is_err());
    }
}
