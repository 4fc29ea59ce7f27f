// Twin of primary.rs: the primary surface of a pixel, and what the eye passes on the way to it.

// A place where the eye ray, or what it becomes, meets a surface; from it the vertex can be made again.
struct Slot {
    direction: vec3f,
    distance: f32,
    throughput: vec3f,
    // Of the cone where the ray starts.
    cone_width: f32,
    barycentric: vec2f,
    cone_spread: f32,
    triangle: u32,
    flags: u32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

// What one dispatch does with one slot of each pixel.
struct Job {
    slot: u32,
    // Only pixels whose primary surface has these flags.
    only: u32,
    kind: u32,
    // A domain that comes before the one of the path itself; 0: none.
    domain: u32,
    // First index of the sampler, and number of samples.
    first: u32,
    count: u32,
    // Number of the sampler's sample for what is not counted by samples.
    sample: u32,
    flags: u32,
    seed: vec2u,
    second_seed: vec2u,
    // Of the direct term: how often it was repeated before.
    pass_: u32,
    direct_samples: u32,
    pad0: u32,
    pad1: u32,
}

@group(1) @binding(0) var<storage, read_write> slots: array<Slot>;
@group(1) @binding(1) var<storage, read_write> planes: array<f32>;
@group(1) @binding(2) var<uniform> job: Job;

// The pixel of an invocation and its place in the band; `index` is NONE outside.
struct Pixel {
    at: vec2u,
    index: u32,
}

fn pixel_of_invocation(id: vec3u) -> Pixel {
    let inside = id.x < frame.width && id.y < frame.rows;
    return Pixel(vec2u(id.x, frame.first_row + id.y), select(NONE, id.y * frame.width + id.x, inside));
}

fn plane1(plane: u32, pixel: u32) -> f32 {
    return planes[plane * frame.pixels + pixel];
}

fn plane3(plane: u32, pixel: u32) -> vec3f {
    return vec3f(plane1(plane, pixel), plane1(plane + 1u, pixel), plane1(plane + 2u, pixel));
}

fn set_plane1(plane: u32, pixel: u32, value: f32) {
    planes[plane * frame.pixels + pixel] = value;
}

fn set_plane3(plane: u32, pixel: u32, value: vec3f) {
    set_plane1(plane, pixel, value.x);
    set_plane1(plane + 1u, pixel, value.y);
    set_plane1(plane + 2u, pixel, value.z);
}

fn count_rays(pixel: u32, counted: Rays) {
    let closest = bitcast<u32>(plane1(CLOSEST_RAYS, pixel)) + counted.closest;
    let shadow = bitcast<u32>(plane1(SHADOW_RAYS, pixel)) + counted.shadow;
    set_plane1(CLOSEST_RAYS, pixel, bitcast<f32>(closest));
    set_plane1(SHADOW_RAYS, pixel, bitcast<f32>(shadow));
}

struct EyeRay {
    origin: vec3f,
    direction: vec3f,
    cone: Cone,
}

// Where in the pixel the eye looks: of a reference whose frames are jittered every sample has a place of its own.
fn eye_place(pixel: vec2u, sample: u32) -> vec2f {
    if !has_flag(job.flags, IN_AREA) {
        return vec2f(0.5) + frame.jitter;
    }
    var s = sampler_fork(sampler_new(pixel, sample, job.seed), PIXEL_DOMAIN);
    return next_2d(&s);
}

fn eye_ray(pixel: vec2u, sample: u32) -> EyeRay {
    let at = vec2f(pixel) + eye_place(pixel, sample);
    var ray = EyeRay(eye_origin(at), eye_direction(at), Cone(0.0, 0.0, true));
    if PAINTED {
        for (var axis = 0u; axis < 2u; axis++) {
            let beside = at + select(vec2f(1.0, 0.0), vec2f(0.0, 1.0), axis == 1u);
            ray.cone.width += 0.5 * length(eye_origin(beside) - ray.origin);
            ray.cone.spread += 0.5 * length(eye_direction(beside) - ray.direction);
        }
    }
    return ray;
}

fn eye_origin(at: vec2f) -> vec3f {
    return frame.origin * vec3f(1.0, at);
}

fn eye_direction(at: vec2f) -> vec3f {
    return normalize_or(frame.direction * vec3f(1.0, at), frame.forward);
}

// Pixel coordinate of a homogeneous point relative to this frame's eye; z is 0 behind the eye.
fn pixel_coordinate(p: Projection, at: vec4f) -> vec3f {
    let w = dot(p.w, at);
    if !(w > 0.0) {
        return vec3f();
    }
    return vec3f(dot(p.u, at) / w, dot(p.v, at) / w, 1.0);
}

// Pixels from where a point is seen now to where it was seen one frame before.
fn motion_of(now: vec4f, before: vec4f) -> vec2f {
    let to = pixel_coordinate(frame.now, now);
    let then = pixel_coordinate(frame.before, before);
    return select(vec2f(UNKNOWN_MOTION), then.xy - to.xy, to.z * then.z > 0.0);
}

fn view_depth_of(position: vec3f) -> f32 {
    return max(dot(position - frame.eye, frame.forward), MIN_POSITIVE);
}

fn vertex_of(slot: Slot) -> SurfacePoint {
    let hit = Hit(slot.distance, slot.triangle, slot.barycentric);
    return surface_point(hit, slot.direction, Cone(slot.cone_width, slot.cone_spread, true));
}

fn bsdf_of(point: SurfacePoint, direction: vec3f) -> Bsdf {
    return bsdf_new(point.material, point.shading_normal, point.geometric_normal, -direction, !point.front);
}

// Whether a surface is looked through, and how; a density of 0: it is not. In a mirror it may be looked into.
fn link_of(b: Bsdf) -> TransmissionSample {
    if !GLASS || !bsdf_is_transmissive(b) || !bsdf_is_delta_only(b) || !bsdf_is_transmission_delta(b) {
        return TransmissionSample(vec3f(), vec3f(), 0.0, true);
    }
    return bsdf_delta_transmission(b);
}

fn mirror_link_of(b: Bsdf) -> TransmissionSample {
    if !MIRRORS || bsdf_is_transmissive(b) || !bsdf_is_delta_only(b) {
        return TransmissionSample(vec3f(), vec3f(), 0.0, true);
    }
    let wi = bsdf_mirror_direction(b);
    return TransmissionSample(wi, b.fresnel_mirror, select(0.0, 1.0, bsdf_is_above(b, wi)), true);
}

// What unfolds a chain of mirrors, with one more at its end: a point behind it is mirrored in that first.
fn unfolded(chain: mat4x3f, point: vec3f, normal: vec3f) -> mat4x3f {
    let across = chain * vec4f(normal, 0.0);
    return mat4x3f(
        chain[0] - 2.0 * normal.x * across,
        chain[1] - 2.0 * normal.y * across,
        chain[2] - 2.0 * normal.z * across,
        chain[3] + 2.0 * dot(point, normal) * across,
    );
}

@compute @workgroup_size(8, 8)
fn primary(@builtin(global_invocation_id) id: vec3u) {
    let pixel = pixel_of_invocation(id);
    if pixel.index == NONE {
        return;
    }
    let i = pixel.index;
    for (var slot = 0u; slot < SLOTS; slot++) {
        slots[slot * frame.pixels + i].flags = 0u;
    }
    let eye = eye_ray(pixel.at, job.sample);
    var origin = eye.origin;
    var direction = eye.direction;
    var cone = eye.cone;
    var throughput = vec3f(1.0);
    var reach = 0.0;
    var glass = 0u;
    var mirrors = 0u;
    var unfold = mat4x3f(vec3f(1.0, 0.0, 0.0), vec3f(0.0, 1.0, 0.0), vec3f(0.0, 0.0, 1.0), vec3f());
    var previous_unfold = unfold;
    // The first mirror.
    var mirror: CurvedMirror;
    var veils = 0u;
    var behind = 0u;
    var chain_id = 0u;
    // Of the first glass, which has the glossy signal.
    var first_weight = vec3f();
    var first_roughness = 0.0;
    var rays = Rays(0u, 0u);
    loop {
        rays.closest += 1u;
        let hit = closest(origin, direction, Veils(true, vec2u()));
        if hit.t >= INFINITE {
            slots[i] = Slot(direction, INFINITE, throughput, 0.0, vec2f(), 0.0, NONE, ESCAPED, 0u, 0u, 0u);
            var motion = vec2f(UNKNOWN_MOTION);
            if chain_id == 0u {
                motion = background_motion(direction, direction);
            } else if MIRRORS && glass == 0u && frame.far_motion == FAR_TURNS {
                // Both through the same arithmetic: what does not move moves by exactly 0.
                motion = background_motion(unfold * vec4f(direction, 0.0), previous_unfold * vec4f(direction, 0.0));
                if mirrors == 1u {
                    let place = seen_in_curved(mirror, false, vec4f(direction, 0.0));
                    if place.w > 0.0 {
                        motion = motion_of(vec4f(eye.direction, 0.0), place - vec4f(frame.eye, 0.0));
                    }
                }
            }
            store_background(i, motion);
            break;
        }
        reach += hit.t;
        let start = cone;
        let point = surface_point(hit, direction, cone);
        cone = point.cone;
        if !point.front && is_transmissive_material(point.material) {
            throughput *= transmittance(point.material, hit.t);
        }
        let b = bsdf_of(point, direction);
        let opacity = opacity_of(hit);
        var slot = Slot(
            direction, hit.t, throughput * opacity, start.width, hit.barycentric, start.spread, hit.triangle, OCCUPIED,
            0u, 0u, 0u,
        );
        if BLENDS && opacity < VEIL_OPACITY && veils < MAX_CHAIN {
            slots[(VEIL_SLOT + veils) * frame.pixels + i] = slot;
            veils += 1u;
            throughput *= 1.0 - opacity;
            origin = ray_origin(point, direction);
            continue;
        }
        if BLENDS && opacity < 1.0 {
            slot.throughput = throughput * (1.0 - opacity);
            slots[(BEHIND_SLOT + behind) * frame.pixels + i] = slot;
            behind += 1u;
            throughput *= opacity;
        }
        slot.throughput = throughput;
        var next = link_of(b);
        let is_mirror = MIRRORS && next.pdf <= 0.0;
        if is_mirror {
            next = mirror_link_of(b);
        }
        let looked_through = next.pdf > 0.0 && glass + mirrors < MAX_CHAIN
            && max_element(emitted(point.material, point.front)) <= 0.0;
        if !looked_through {
            slot.flags = select(OCCUPIED, OCCUPIED | BEHIND_GLASS, glass > 0u);
            slots[i] = slot;
            var position = point.position;
            var before = previous_position(point);
            var normal = b.normal;
            var in_curved = vec4f();
            var surface_id = point.instance + 1u;
            if glass + mirrors > 0u {
                // Seen at the end of a chain: unfolded, as if the eye ray had gone on straight.
                position = eye.origin + eye.direction * reach;
                var straight = point.position;
                if MIRRORS && mirrors > 0u {
                    if mirrors == 1u && glass == 0u {
                        in_curved = seen_in_curved(mirror, any(before != point.position), vec4f(before, 1.0));
                    }
                    straight = unfold * vec4f(straight, 1.0);
                    before = previous_unfold * vec4f(before, 1.0);
                    normal = unfold * vec4f(normal, 0.0);
                }
                before = select(before + (position - straight), in_curved.xyz, in_curved.w > 0.0);
                let away = dot(normal, eye.direction);
                if away > -MIN_VIEW_COS {
                    normal = normalize_or(normal - eye.direction * (away + MIN_VIEW_COS), -eye.direction);
                }
                normal = normalize_or(normal, -eye.direction);
                surface_id = max(surface_id + ((chain_id * 0x9e3779b9u) & 0xffff0000u), 1u);
            }
            let own_weight = bsdf_glossy_weight(b) * throughput;
            let own_roughness = saturate(point.material.roughness);
            set_plane3(MATTE_WEIGHT, i, bsdf_matte_weight(b) * throughput);
            set_plane3(GLOSSY_WEIGHT, i, select(own_weight, first_weight, glass > 0u));
            set_plane1(ROUGHNESS, i, select(own_roughness, first_roughness, glass > 0u));
            set_plane3(NORMAL, i, normal);
            set_plane1(VIEW_DEPTH, i, view_depth_of(position));
            set_motion(i, motion_of(vec4f(position - frame.eye, 1.0), vec4f(before - frame.eye, 1.0)));
            set_plane1(SURFACE_ID, i, bitcast<f32>(surface_id));
            break;
        }
        if is_mirror {
            chain_id = chain_id * 31u + point.instance + 1u;
            unfold = unfolded(unfold, point.position, b.normal);
            previous_unfold = unfolded(previous_unfold, previous_position(point), previous_normal(point, b.normal));
            if mirrors == 0u {
                mirror = curved_mirror(point, b.normal);
            }
            mirrors += 1u;
            throughput *= next.weight;
            origin = ray_origin(point, next.wi);
            direction = next.wi;
            continue;
        }
        if dot(next.wi, direction) < 1.0 - 1e-6 {
            chain_id = chain_id * 31u + point.instance + 1u;
        }
        if glass == 0u {
            first_weight = bsdf_glossy_weight(b) * throughput;
            first_roughness = saturate(point.material.roughness);
        }
        slots[(GLASS_SLOT + glass) * frame.pixels + i] = slot;
        glass += 1u;
        throughput *= next.weight;
        origin = ray_origin(point, next.wi);
        direction = next.wi;
    }
    if has_flag(job.flags, IN_AREA) {
        count_rays(i, rays);
    } else {
        set_plane1(CLOSEST_RAYS, i, bitcast<f32>(rays.closest));
        set_plane1(SHADOW_RAYS, i, bitcast<f32>(0u));
    }
}

fn set_motion(i: u32, motion: vec2f) {
    set_plane1(MOTION, i, motion.x);
    set_plane1(MOTION + 1u, i, motion.y);
}

// Motion of what is infinitely far away, seen in direction `now`, and in direction `before` had the eye been where it is: only the camera's
// rotation moves it.
fn background_motion(now: vec3f, before: vec3f) -> vec2f {
    if frame.far_motion == FAR_IS_STILL {
        return vec2f();
    }
    if frame.far_motion == FAR_TURNS {
        return motion_of(vec4f(now, 0.0), vec4f(before, 0.0));
    }
    return vec2f(UNKNOWN_MOTION);
}

// Guides where nothing is hit.
fn store_background(i: u32, motion: vec2f) {
    set_plane3(MATTE_WEIGHT, i, vec3f());
    set_plane3(GLOSSY_WEIGHT, i, vec3f());
    set_plane1(ROUGHNESS, i, 1.0);
    set_plane3(NORMAL, i, vec3f());
    set_plane1(VIEW_DEPTH, i, INFINITE);
    set_motion(i, motion);
    set_plane1(SURFACE_ID, i, bitcast<f32>(0u));
}
