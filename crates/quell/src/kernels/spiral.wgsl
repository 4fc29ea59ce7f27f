// What the GPU needs of spiral.rs: the taps themselves come from the CPU, 16 phases one after another.

// Index of the first tap of pixel (x, y).
fn spiral_at(pixel: vec2i, taps: u32) -> u32 {
    return u32((pixel.y % PERIOD) * PERIOD + pixel.x % PERIOD) * taps;
}

// Where a tap lands along one axis: inside 0..extent, or -1 where it is left out.
fn land(position: i32, extent: i32, mirror: bool) -> i32 {
    if position >= 0 && position < extent {
        return position;
    }
    if !mirror {
        return -1;
    }
    let mirrored = select(2 * extent - 1 - position, -1 - position, position < 0);
    return select(-1, mirrored, mirrored >= 0 && mirrored < extent);
}
