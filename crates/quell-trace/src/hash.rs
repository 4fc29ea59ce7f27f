//! A hash that is the same on every machine (FNV-1a, 64 bits).

/// Collects bytes into a hash.
pub(crate) struct Hash(u64);

impl Hash {
    pub(crate) fn new() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }

    pub(crate) fn bytes(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }

    /// Text without carriage returns, so that a checkout with other line ends has the same hash.
    pub(crate) fn text(&mut self, text: &str) {
        for line in text.lines() {
            self.bytes(line.as_bytes());
            self.bytes(b"\n");
        }
    }

    pub(crate) fn number(&mut self, value: u64) {
        self.bytes(&value.to_le_bytes());
    }

    pub(crate) fn finish(&self) -> u64 {
        self.0
    }
}
