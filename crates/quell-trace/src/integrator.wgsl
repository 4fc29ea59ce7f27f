// Twin of integrator.rs: the walk of a path, and the direct term.

struct Rays {
    closest: u32,
    shadow: u32,
}

// What a segment's end adds when it meets a source: a share of its light, or what light sampling leaves to a direction
// found with a density at a point with a normal.
struct Share {
    balanced: bool,
    // The share, or the density.
    value: f32,
    point: vec3f,
    normal: vec3f,
}

struct Path {
    origin: vec3f,
    direction: vec3f,
    cone: Cone,
    seen: Share,
    scatterings: u32,
    from_eye: bool,
    // What the path's light is multiplied by.
    weight: vec3f,
    // The first surface's distance is all that is asked for.
    only_distance: bool,
    // There is no ray: the distance is 0.
    ends: bool,
}

struct Incoming {
    radiance: vec3f,
    distance: f32,
}

fn fixed_share(share: f32) -> Share {
    return Share(false, share, vec3f(), vec3f());
}

fn lamp_share_of_glossy(roughness: f32) -> f32 {
    let x = saturate((roughness - LAMP_IN_GLOSSY.x) / (LAMP_IN_GLOSSY.y - LAMP_IN_GLOSSY.x));
    return 1.0 - x * x * (3.0 - 2.0 * x);
}

// The side from which a surface takes light: its normal, or 0 for both sides.
fn light_side(b: Bsdf) -> vec3f {
    return select(b.normal, vec3f(), bsdf_is_transmissive(b));
}

fn power_heuristic(a: f32, b: f32) -> f32 {
    if a <= 0.0 {
        return 0.0;
    }
    // Squares of densities may overflow.
    let ratio = min(b / a, 1e18);
    return 1.0 / (1.0 + ratio * ratio);
}

// A path's start at a vertex, by the kind of path. `s` is the sampler of the sample.
fn start_path(kind: u32, point: SurfacePoint, b: Bsdf, direction: vec3f, s: ptr<function, Sampler>) -> Path {
    var path = Path(vec3f(), vec3f(), FINEST, fixed_share(1.0), frame.bounces, false, vec3f(1.0), false, false);
    let exact = frame.exact != 0u || !has_flag(job.flags, IS_SIGNAL);
    switch kind {
        case MATTE_PATH: {
            *s = sampler_fork(*s, MATTE_DOMAIN);
            path.direction = bsdf_sample_matte(b, next_2d(s));
            path.ends = !bsdf_is_above(b, path.direction);
            path.cone = cone_scattered(point.cone, 1.0, false);
            // Every source is sampled by the direct term: the first segment carries none.
            path.seen = fixed_share(0.0);
            let weight = bsdf_matte_weight(b);
            if frame.exact != 0u && max_element(weight) > 0.0 {
                path.weight = bsdf_exact_matte_ratio(b, path.direction);
            }
            if !has_flag(job.flags, IS_SIGNAL) {
                path.weight *= weight;
            }
        }
        case GLOSSY_PATH: {
            *s = sampler_fork(*s, GLOSSY_DOMAIN);
            let sample = bsdf_sample_glossy(b, next_2d(s));
            path.direction = sample.wi;
            path.cone = cone_scattered(point.cone, point.material.roughness, sample.delta);
            path.seen = fixed_share(lamp_share_of_glossy(point.material.roughness));
            path.weight = vec3f(sample.weight);
            if exact {
                path.weight *= bsdf_exact_glossy_ratio(b, path.direction);
            }
            if !has_flag(job.flags, IS_SIGNAL) {
                path.weight *= bsdf_glossy_weight(b);
            }
            if sample.pdf <= 0.0 {
                // Below the horizon: no light, and the distance of the lobe's middle.
                path.direction = bsdf_mirror_direction(b);
                path.only_distance = true;
            }
        }
        case TRANSMISSION_PATH: {
            *s = sampler_fork(*s, TRANSMISSION_DOMAIN);
            let sample = bsdf_sample_transmission(b, next_2d(s));
            path.direction = sample.wi;
            path.ends = sample.pdf <= 0.0;
            path.cone = cone_scattered(point.cone, point.material.roughness, sample.delta);
            path.weight = sample.weight;
        }
        default: {
            // The full integral behind a surface that is not all there.
            path.direction = direction;
            path.cone = point.cone;
            path.scatterings = frame.bounces + 1u;
            path.from_eye = true;
        }
    }
    path.origin = ray_origin(point, path.direction);
    return path;
}

// Light of one sampled source, weighted against the surface's own sampling.
fn one_light_sample(point: SurfacePoint, b: Bsdf, s: ptr<function, Sampler>, rays: ptr<function, Rays>) -> vec3f {
    let light = sample_light(point.position, light_side(b), next_3d(s));
    let at = bsdf_eval(b, light.wi);
    if light.pdf <= 0.0 || max_element(at.value) <= 0.0 || max_element(light.radiance) <= 0.0 {
        return vec3f();
    }
    (*rays).shadow += 1u;
    let ray = shadow_ray(point, light.wi, light.distance);
    if occluded(ray.origin, ray.direction, ray.distance, veils_of(*s, ray.direction)) {
        return vec3f();
    }
    let weight = select(power_heuristic(light.pdf, at.pdf), 1.0, light.delta);
    return at.value * light.radiance * (bsdf_abs_cos(b, light.wi) * weight / light.pdf);
}

// Light along a path, from surfaces that it meets and scatters at.
fn walk(path: Path, s: ptr<function, Sampler>, rays: ptr<function, Rays>) -> Incoming {
    var origin = path.origin;
    var direction = path.direction;
    var cone = path.cone;
    var seen = path.seen;
    var scatterings = path.scatterings;
    var from_eye = path.from_eye;
    var chain = 0u;
    var throughput = vec3f(1.0);
    var incoming = Incoming(vec3f(), INFINITE);
    if path.ends {
        incoming.distance = 0.0;
        return incoming;
    }
    var segment = 0u;
    loop {
        let last = segment == scatterings;
        if last && segment > 0u && (!sources_can_be_hit() || (!seen.balanced && seen.value == 0.0)) {
            break;
        }
        (*rays).closest += 1u;
        let hit = closest(origin, direction, veils_of(*s, direction));
        if segment == 0u {
            incoming.distance = hit.t;
        }
        if path.only_distance {
            break;
        }
        if hit.t >= INFINITE {
            if has_environment() {
                var share = seen.value;
                if seen.balanced {
                    share = power_heuristic(seen.value, pdf_of_environment(seen.point, seen.normal, direction));
                }
                incoming.radiance += throughput * environment_radiance(direction) * share;
            }
            break;
        }
        if last && triangles[hit.triangle].emitter == NONE {
            break;
        }
        let point = surface_point(hit, direction, cone);
        if !point.front && is_transmissive_material(point.material) {
            throughput *= transmittance(point.material, hit.t);
        }
        let emission = emitted(point.material, point.front);
        if max_element(emission) > 0.0 {
            var share = seen.value;
            if seen.balanced {
                share = power_heuristic(seen.value, pdf_of_triangle(seen.point, seen.normal, hit.triangle, direction));
            }
            incoming.radiance += throughput * emission * share;
        }
        if last {
            break;
        }
        let b = bsdf_of(point, direction);
        if bsdf_is_delta_only(b) {
            // The dimensions that the light sample would have drawn.
            (*s).dimension += 2u;
        } else {
            incoming.radiance += throughput * one_light_sample(point, b, s, rays);
        }
        let next = bsdf_sample_full(b, next_3d(s));
        if next.pdf <= 0.0 {
            break;
        }
        throughput *= next.value_times_cos_over_pdf;
        // A path that goes on where the eye looks through has not been scattered yet.
        from_eye = from_eye && chain < MAX_CHAIN && max_element(emission) <= 0.0 && next.transmitted
            && link_of(b).pdf > 0.0;
        if from_eye {
            chain += 1u;
            scatterings += 1u;
        }
        let roulette = next_1d(s);
        if segment + 1u >= ROULETTE_FROM && !from_eye {
            let survival = clamp(max_element(throughput), ROULETTE_FLOOR, 1.0);
            if roulette >= survival {
                break;
            }
            throughput /= survival;
        }
        if max_element(throughput) <= 0.0 {
            break;
        }
        origin = ray_origin(point, next.wi);
        direction = next.wi;
        cone = cone_scattered(point.cone, next.lobe_roughness, next.delta);
        seen = fixed_share(1.0);
        if !next.delta {
            seen = Share(true, next.pdf, point.position, light_side(b));
        }
        segment += 1u;
    }
    return incoming;
}

// The reflecting lobes that the direct term is taken of, and the density of its rays that follow them.
struct DirectLobes {
    glossy_share: f32,
    matte_count: f32,
    glossy_count: f32,
}

fn lobes_value(lobes: DirectLobes, b: Bsdf, wi: vec3f) -> vec3f {
    return bsdf_matte(b, wi) + select(vec3f(), bsdf_glossy(b, wi) * lobes.glossy_share, lobes.glossy_share > 0.0);
}

fn lobes_density(lobes: DirectLobes, b: Bsdf, wi: vec3f) -> f32 {
    return lobes.matte_count * bsdf_matte_pdf(b, wi) + lobes.glossy_count * bsdf_glossy_pdf(b, wi);
}

// Direct light of the reflecting lobes at a vertex of the eye's: `count` shadow rays and a few rays of the lobes.
fn direct_light(
    point: SurfacePoint, b: Bsdf, count: u32, pass_: u32, s: Sampler, rays: ptr<function, Rays>,
) -> vec3f {
    if count == 0u || sources_are_empty() || bsdf_is_delta_only(b) {
        return vec3f();
    }
    let roughness = point.material.roughness;
    var lobes = DirectLobes(1.0 - lamp_share_of_glossy(roughness), 0.0, 0.0);
    let matte_count = select(0u, (count + 1u) / 2u, has_environment());
    let glossy_rays = lobes.glossy_share > 0.0 && roughness < GLOSSY_RAYS_MAX_ROUGHNESS && sources_can_be_hit();
    let glossy_count = select(0u, (count + GLOSSY_RAYS_DIVISOR - 1u) / GLOSSY_RAYS_DIVISOR, glossy_rays);
    lobes.matte_count = f32(matte_count);
    lobes.glossy_count = f32(glossy_count);
    let n_light = f32(count);
    let normal = b.normal;

    var sum = vec3f();
    let stream = sampler_fork(s, DIRECT_LIGHT_DOMAIN);
    var shifting = sampler_with_index(stream, pass_);
    let shift = next_1d(&shifting);
    let places = sampler_fork(stream, 0u);
    // Each source gets a run of successive samples: what they share is made once.
    var e: Emitter;
    var view: LampView;
    var choice = LightChoice(NONE, 0.0, -1.0);
    for (var i = 0u; i < count; i++) {
        let number = (f32(i) + shift) / n_light;
        if number >= choice.end {
            choice = choose_emitter(point.position, normal, min(number, ONE_MINUS_EPSILON));
            if choice.emitter != NONE {
                e = emitter_at(choice.emitter);
                view = view_of(e, point.position);
            }
        }
        if choice.emitter == NONE || choice.probability <= 0.0 {
            continue;
        }
        var times = 1.0;
        if is_delta_light(e) {
            // All samples of a delta light are one.
            while i + 1u < count && (f32(i + 1u) + shift) / n_light < choice.end {
                i += 1u;
                times += 1.0;
            }
        }
        var place = sampler_with_index(places, pass_ * count + i);
        let light = sample_emitter(e, view, choice.probability, point.position, normal, next_2d(&place));
        if light.pdf <= 0.0 || max_element(light.radiance) <= 0.0 {
            continue;
        }
        var value = bsdf_matte(b, light.wi);
        var density = n_light * light.pdf;
        if light.delta {
            value += bsdf_glossy(b, light.wi);
        } else {
            value = lobes_value(lobes, b, light.wi);
            density += lobes_density(lobes, b, light.wi);
        }
        if max_element(value) <= 0.0 {
            continue;
        }
        (*rays).shadow += 1u;
        let ray = shadow_ray(point, light.wi, light.distance);
        if !occluded(ray.origin, ray.direction, ray.distance, veils_of(s, ray.direction)) {
            sum += value * light.radiance * (times * bsdf_abs_cos(b, light.wi) / density);
        }
    }

    // Rays of the lobes, to what they meet.
    for (var i = 0u; i < matte_count + glossy_count; i++) {
        var wi = vec3f();
        if i < matte_count {
            var drawn = sampler_with_index(sampler_fork(s, DIRECT_MATTE_DOMAIN), pass_ * matte_count + i);
            wi = bsdf_sample_matte(b, next_2d(&drawn));
        } else {
            let number = pass_ * glossy_count + i - matte_count;
            var drawn = sampler_with_index(sampler_fork(s, DIRECT_GLOSSY_DOMAIN), number);
            let sample = bsdf_sample_glossy(b, next_2d(&drawn));
            if sample.pdf <= 0.0 {
                continue;
            }
            wi = sample.wi;
        }
        let value = lobes_value(lobes, b, wi);
        if max_element(value) <= 0.0 {
            continue;
        }
        (*rays).closest += 1u;
        let hit = closest(ray_origin(point, wi), wi, veils_of(s, wi));
        var radiance = vec3f();
        var pdf = 0.0;
        if hit.t >= INFINITE {
            if has_environment() {
                radiance = environment_radiance(wi);
                pdf = pdf_of_environment(point.position, normal, wi);
            }
        } else if triangles[hit.triangle].emitter != NONE {
            let met = surface_point(hit, wi, FINEST);
            radiance = emitted(met.material, met.front);
            pdf = pdf_of_triangle(point.position, normal, hit.triangle, wi);
        }
        let density = n_light * pdf + lobes_density(lobes, b, wi);
        if max_element(radiance) > 0.0 && density > 0.0 {
            sum += value * radiance * (bsdf_abs_cos(b, wi) / density);
        }
    }
    return sum;
}
