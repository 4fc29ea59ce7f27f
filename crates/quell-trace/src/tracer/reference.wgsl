// Twin of reference.rs: one more sample of each pixel of a reference. Sums of many small numbers are kept as means.

@compute @workgroup_size(8, 8)
fn accumulate(@builtin(global_invocation_id) id: vec3u) {
    let pixel = pixel_of_invocation(id);
    if pixel.index == NONE {
        return;
    }
    let i = pixel.index;
    let direct = plane3(DIRECT, i);
    var matte = vec3f();
    var glossy = vec3f();
    if job.kind != EYE_PATH {
        matte = plane3(MATTE, i);
        glossy = plane3(GLOSSY, i);
    }
    let beauty = direct + plane3(MATTE_WEIGHT, i) * matte + plane3(GLOSSY_WEIGHT, i) * glossy;
    let share = 1.0 / f32(job.count);
    let first = job.count == 1u;
    let mean = select(plane3(BEAUTY_MEAN, i), vec3f(), first);
    let squares = select(plane3(BEAUTY_SQUARES, i), vec3f(), first);
    let delta = beauty - mean;
    let moved = mean + delta * share;
    set_plane3(BEAUTY_MEAN, i, moved);
    set_plane3(BEAUTY_SQUARES, i, squares + delta * (beauty - moved));
    add_to_mean(DIRECT_MEAN, i, direct, share, first);
    add_to_mean(MATTE_MEAN, i, matte, share, first);
    add_to_mean(GLOSSY_MEAN, i, glossy, share, first);
}

fn add_to_mean(plane: u32, i: u32, value: vec3f, share: f32, first: bool) {
    let mean = select(plane3(plane, i), vec3f(), first);
    set_plane3(plane, i, mean + (value - mean) * share);
}
