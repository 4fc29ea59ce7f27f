//! Bad input: every error names the thing, nothing panics.
