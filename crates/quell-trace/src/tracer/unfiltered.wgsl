// Twin of unfiltered.rs: emission and direct light of one slot of each pixel.

@compute @workgroup_size(8, 8)
fn direct(@builtin(global_invocation_id) id: vec3u) {
    let pixel = pixel_of_invocation(id);
    if pixel.index == NONE {
        return;
    }
    let i = pixel.index;
    let place = job.slot * frame.pixels + i;
    // Of most pixels, further slots are empty.
    if !has_flag(slots[place].flags, OCCUPIED | ESCAPED) && !has_flag(job.flags, IS_FIRST) {
        return;
    }
    let slot = slots[place];
    var light = vec3f();
    if has_flag(slot.flags, ESCAPED) {
        if has_environment() {
            light = slot.throughput * environment_radiance(slot.direction);
        }
    } else if has_flag(slot.flags, OCCUPIED) {
        let point = vertex_of(slot);
        let b = bsdf_of(point, slot.direction);
        var s = sampler_new(pixel.at, job.sample, job.seed);
        if job.domain != 0u {
            s = sampler_fork(s, job.domain);
        }
        var rays = Rays(0u, 0u);
        light = emitted(point.material, point.front);
        light += direct_light(point, b, job.direct_samples, job.pass_, s, &rays);
        light *= slot.throughput;
        count_rays(i, rays);
    }
    if !has_flag(job.flags, IS_FIRST) {
        light += plane3(DIRECT, i);
    }
    set_plane3(DIRECT, i, light);
}
