//! Synthetic frames: small scenes with exact guides and a known answer, made without a tracer.
