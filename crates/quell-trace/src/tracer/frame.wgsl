// Twin of frame.rs: paths of one kind from one slot of each pixel, for a signal or for the direct term.

// Mean and variance of the mean of a stream of colours.
struct Moments {
    count: f32,
    mean: vec3f,
    squares: vec3f,
}

fn moments_push(m: ptr<function, Moments>, value: vec3f) {
    (*m).count += 1.0;
    let delta = value - (*m).mean;
    (*m).mean += delta / (*m).count;
    (*m).squares += delta * (value - (*m).mean);
}

fn moments_variance(m: Moments) -> vec3f {
    return select(vec3f(), m.squares / (m.count * (m.count - 1.0)), m.count > 1.0);
}

// Scales a sample down to the largest luminance allowed.
fn capped(radiance: vec3f) -> vec3f {
    let l = luminance(radiance);
    let limit = frame.indirect_clamp;
    return select(radiance, radiance * (limit / l), limit > 0.0 && l > limit);
}

@compute @workgroup_size(8, 8)
fn paths(@builtin(global_invocation_id) id: vec3u) {
    let pixel = pixel_of_invocation(id);
    if pixel.index == NONE {
        return;
    }
    let i = pixel.index;
    let surface_flags = slots[i].flags;
    var number = job.slot;
    if GLASS && has_flag(job.flags, IS_SIGNAL) && job.kind == GLOSSY_PATH && has_flag(surface_flags, BEHIND_GLASS) {
        // The glossy signal is the glass's own reflection.
        number = GLASS_SLOT;
    }
    let place = number * frame.pixels + i;
    let traced = job.kind == EYE_PATH || (has_flag(slots[place].flags, OCCUPIED) && has_flag(surface_flags, job.only));
    if !traced && !has_flag(job.flags, IS_SIGNAL) {
        return;
    }
    let slot = slots[place];
    var point: SurfacePoint;
    var b: Bsdf;
    if traced && job.kind != EYE_PATH {
        point = vertex_of(slot);
        b = bsdf_of(point, slot.direction);
    }
    var rays = Rays(0u, 0u);
    var moments = Moments(0.0, vec3f(), vec3f());
    var luminances = Moments(0.0, vec3f(), vec3f());
    var halves = array<Moments, 2>(moments, moments);
    var distance = INFINITE;
    for (var sample = 0u; sample < select(0u, job.count, traced); sample++) {
        // Halves of one low-discrepancy sequence would complement each other, not be independent.
        let separate = has_flag(job.flags, IN_HALVES);
        let half = select(0u, sample & 1u, separate);
        let index = job.first + select(sample, sample / 2u, separate);
        var s = sampler_new(pixel.at, index, select(job.seed, job.second_seed, half == 1u));
        if job.domain != 0u {
            s = sampler_fork(s, job.domain);
        }
        var path: Path;
        if job.kind == EYE_PATH {
            let eye = eye_ray(pixel.at, index);
            path = Path(eye.origin, eye.direction, eye.cone, fixed_share(1.0), frame.bounces + 1u, true, vec3f(1.0), false, false);
        } else {
            path = start_path(job.kind, point, b, slot.direction, &s);
        }
        let incoming = walk(path, &s, &rays);
        if sample == 0u {
            distance = incoming.distance;
        }
        var value = incoming.radiance * path.weight;
        if has_flag(job.flags, IS_SIGNAL) {
            value = capped(value);
            moments_push(&luminances, vec3f(luminance(value)));
            if separate {
                var of_half = halves[half];
                moments_push(&of_half, value);
                halves[half] = of_half;
            }
        }
        moments_push(&moments, value);
    }
    if has_flag(job.flags, IS_SIGNAL) {
        let glossy = job.kind == GLOSSY_PATH;
        set_plane3(select(MATTE, GLOSSY, glossy), i, moments.mean);
        set_plane1(select(MATTE_DISTANCE, GLOSSY_DISTANCE, glossy), i, distance);
        set_plane1(select(MATTE_VARIANCE, GLOSSY_VARIANCE, glossy), i, moments_variance(luminances).x);
        if has_flag(job.flags, IN_HALVES) {
            set_plane3(select(MATTE_HALF_A, GLOSSY_HALF_A, glossy), i, halves[0].mean);
            set_plane3(select(MATTE_HALF_B, GLOSSY_HALF_B, glossy), i, halves[1].mean);
        }
    } else if job.kind == EYE_PATH {
        set_plane3(DIRECT, i, moments.mean);
    } else {
        set_plane3(DIRECT, i, plane3(DIRECT, i) + slot.throughput * moments.mean);
    }
    count_rays(i, rays);
}
