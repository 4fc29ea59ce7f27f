// What a frame of a window has: `HAS_*`.
fn has(there: WindowFrame, what: u32) -> bool {
    return (there.has & what) != 0u;
}
