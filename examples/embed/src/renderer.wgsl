// A renderer small enough to read: rays traced through a room of spheres and a lamp, one matte and one glossy path a pixel.
// `surfaces` writes the G-buffer, `light` the noisy light, `present` a picture to look at. quell knows nothing of this file.

struct View {
    clip_from_world: mat4x4f,
    previous_clip_from_world: mat4x4f,
    // xyz: position; w: number of the frame.
    eye: vec4f,
    // From the eye to the middle of the picture, and from there to its right and its upper edge, at depth 1. The fourth
    // numbers of the first two are width and height in pixels.
    forward: vec4f,
    right: vec4f,
    up: vec4f,
}
@group(0) @binding(0) var<uniform> view: View;

@group(1) @binding(0) var depth_out: texture_storage_2d<r32float, write>;
@group(1) @binding(1) var normal_out: texture_storage_2d<rgba16float, write>;
@group(1) @binding(2) var motion_out: texture_storage_2d<rg32float, write>;
@group(1) @binding(3) var matte_weight_out: texture_storage_2d<rgba16float, write>;

@group(1) @binding(4) var direct_out: texture_storage_2d<rgba16float, write>;
@group(1) @binding(5) var matte_out: texture_storage_2d<rgba16float, write>;
@group(1) @binding(6) var glossy_out: texture_storage_2d<rgba16float, write>;
@group(1) @binding(7) var glossy_weight_out: texture_storage_2d<rgba16float, write>;

@group(1) @binding(8) var direct: texture_2d<f32>;
@group(1) @binding(9) var matte: texture_2d<f32>;
@group(1) @binding(10) var glossy: texture_2d<f32>;
@group(1) @binding(11) var matte_weight: texture_2d<f32>;
@group(1) @binding(12) var glossy_weight: texture_2d<f32>;
@group(1) @binding(13) var denoised: texture_2d<f32>;
@group(1) @binding(14) var picture: texture_storage_2d<rgba8unorm, write>;

const ROOM = vec3f(3.0, 2.0, 4.0); // half extents of the room, around the origin
const LAMP = vec4f(0.0, 1.99, -0.5, 0.7); // centre and half width of the square lamp under the ceiling
const LAMP_RADIANCE = vec3f(14.0, 12.5, 10.0);
const BALLS = array<vec4f, 3>(vec4f(-1.4, -1.2, -0.8, 0.8), vec4f(0.5, -1.4, -1.7, 0.6), vec4f(1.7, -1.1, 0.3, 0.9));

struct Hit {
    distance: f32,
    normal: vec3f,
    albedo: vec3f,
    roughness: f32,
    // Reflectance at normal incidence.
    f0: vec3f,
    emission: vec3f,
}

fn trace(origin: vec3f, direction: vec3f) -> Hit {
    // The room from inside.
    let inverse = 1.0 / select(direction, vec3f(1e-9), abs(direction) < vec3f(1e-9));
    let t = (sign(inverse) * ROOM - origin) * inverse;
    var hit = Hit(min(t.x, min(t.y, t.z)), vec3f(0.0), vec3f(0.7), 1.0, vec3f(0.0), vec3f(0.0));
    let p = origin + hit.distance * direction;
    if t.y <= t.x && t.y <= t.z {
        hit.normal = vec3f(0.0, -sign(direction.y), 0.0);
        if direction.y < 0.0 {
            let tile = floor(p.xz * 1.5);
            hit.albedo = select(vec3f(0.5, 0.45, 0.4), vec3f(0.15), (i32(tile.x) + i32(tile.y)) % 2 == 0);
            hit.roughness = 0.25;
            hit.f0 = vec3f(0.04);
        } else if all(abs(p.xz - LAMP.xz) < vec2f(LAMP.w)) {
            hit.emission = LAMP_RADIANCE;
        }
    } else if t.x <= t.z {
        hit.normal = vec3f(-sign(direction.x), 0.0, 0.0);
        hit.albedo = select(vec3f(0.15, 0.5, 0.2), vec3f(0.65, 0.12, 0.1), direction.x < 0.0);
    } else {
        hit.normal = vec3f(0.0, 0.0, -sign(direction.z));
    }
    for (var i = 0; i < 3; i++) {
        let ball = BALLS[i];
        let to = origin - ball.xyz;
        let b = dot(to, direction);
        let root = b * b - dot(to, to) + ball.w * ball.w;
        let near = -b - sqrt(max(root, 0.0));
        if root > 0.0 && near > 0.0 && near < hit.distance {
            hit = Hit(near, (to + near * direction) / ball.w, vec3f(0.6, 0.55, 0.5), 1.0, vec3f(0.0), vec3f(0.0));
            if i == 1 {
                hit.albedo = vec3f(0.0);
                hit.roughness = 0.3;
                hit.f0 = vec3f(0.95, 0.75, 0.4);
            } else if i == 2 {
                hit.albedo = vec3f(0.1, 0.2, 0.5);
                hit.roughness = 0.35;
                hit.f0 = vec3f(0.04);
            }
        }
    }
    return hit;
}

// Light of the lamp on a matte point, as 16 fixed points of the lamp make it: no noise. Over pi.
fn lit(p: vec3f, normal: vec3f) -> vec3f {
    var sum = 0.0;
    for (var i = 0; i < 16; i++) {
        let offset = (vec2f(f32(i % 4), f32(i / 4)) - 1.5) * 0.5 * LAMP.w;
        let to = LAMP.xyz + vec3f(offset.x, 0.0, offset.y) - p;
        let distance = length(to);
        let way = to / distance;
        let cosines = max(dot(normal, way), 0.0) * max(way.y, 0.0);
        if cosines > 0.0 && trace(p + 1e-3 * normal, way).distance > distance - 0.05 {
            sum += cosines / (distance * distance);
        }
    }
    return LAMP_RADIANCE * sum * (4.0 * LAMP.w * LAMP.w / 16.0 / 3.14159265);
}

var<private> seed: u32;
fn random() -> f32 {
    seed = seed * 747796405u + 2891336453u;
    let word = ((seed >> ((seed >> 28u) + 4u)) ^ seed) * 277803737u;
    return f32(((word >> 22u) ^ word) >> 8u) / 16777216.0;
}

fn around(axis: vec3f, cosine: f32) -> vec3f {
    let angle = 6.2831853 * random();
    let side = normalize(cross(axis, select(vec3f(1.0, 0.0, 0.0), vec3f(0.0, 1.0, 0.0), abs(axis.x) > 0.5)));
    let sine = sqrt(max(1.0 - cosine * cosine, 0.0));
    return cosine * axis + sine * (cos(angle) * side + sin(angle) * cross(axis, side));
}

// What comes back along a ray: emission where `sees_lamp`, light of the lamp, and two more bounces off matte surfaces.
fn radiance(start: vec3f, way: vec3f, sees_lamp: bool) -> vec4f {
    var p = start;
    var direction = way;
    var through = vec3f(1.0);
    var sum = vec3f(0.0);
    var first = 0.0;
    for (var bounce = 0; bounce < 3; bounce++) {
        let hit = trace(p, direction);
        if bounce == 0 {
            first = hit.distance;
            sum += select(vec3f(0.0), hit.emission, sees_lamp);
        }
        p += hit.distance * direction + 1e-3 * hit.normal;
        through *= hit.albedo + hit.f0;
        sum += through * lit(p, hit.normal);
        direction = around(hit.normal, sqrt(random()));
    }
    return vec4f(sum, first);
}

fn ray(pixel: vec2u) -> vec3f {
    let uv = (vec2f(pixel) + 0.5) / vec2f(view.forward.w, view.right.w);
    return normalize((view.forward + (2.0 * uv.x - 1.0) * view.right + (1.0 - 2.0 * uv.y) * view.up).xyz);
}

fn inside(pixel: vec2u) -> bool {
    return all(pixel < vec2u(u32(view.forward.w), u32(view.right.w)));
}

@compute @workgroup_size(8, 8)
fn surfaces(@builtin(global_invocation_id) id: vec3u) {
    if !inside(id.xy) {
        return;
    }
    let direction = ray(id.xy);
    let hit = trace(view.eye.xyz, direction);
    let p = view.eye.xyz + hit.distance * direction;
    let now = view.clip_from_world * vec4f(p, 1.0);
    let before = view.previous_clip_from_world * vec4f(p, 1.0);
    // As Bevy has it: current minus previous, in texture coordinates, y down.
    let motion = (now.xy / now.w - before.xy / before.w) * vec2f(0.5, -0.5);
    textureStore(depth_out, id.xy, vec4f(dot(hit.distance * direction, view.forward.xyz)));
    textureStore(normal_out, id.xy, vec4f(hit.normal, hit.roughness));
    textureStore(motion_out, id.xy, vec4f(motion, 0.0, 0.0));
    let on_matte = select(hit.albedo * (1.0 - hit.f0), vec3f(0.0), hit.emission.x > 0.0);
    textureStore(matte_weight_out, id.xy, vec4f(on_matte, 1.0));
}

@compute @workgroup_size(8, 8)
fn light(@builtin(global_invocation_id) id: vec3u) {
    if !inside(id.xy) {
        return;
    }
    seed = (id.y * 8191u + id.x) * 9781u + u32(view.eye.w) * 6271u;
    seed = u32(random() * 16777216.0) ^ (id.x << 16u);
    let direction = ray(id.xy);
    let hit = trace(view.eye.xyz, direction);
    let p = view.eye.xyz + hit.distance * direction + 1e-3 * hit.normal;
    // Free of noise: emission, and the lamp's light on the matte part.
    textureStore(direct_out, id.xy, vec4f(hit.emission + hit.albedo * (1.0 - hit.f0) * lit(p, hit.normal), 1.0));
    // One matte path; the lamp itself is in the direct light already.
    textureStore(matte_out, id.xy, radiance(p, around(hit.normal, sqrt(random())), false));
    // One glossy path, around the mirror direction; its alpha is the distance to what it met.
    let alpha = hit.roughness * hit.roughness;
    let u = random();
    let half_vector = around(hit.normal, sqrt((1.0 - u) / (1.0 + (alpha * alpha - 1.0) * u)));
    let mirrored = reflect(direction, half_vector);
    let met = radiance(p, select(reflect(direction, hit.normal), mirrored, dot(mirrored, hit.normal) > 0.0), true);
    textureStore(glossy_out, id.xy, met);
    let grazing = pow(1.0 - max(dot(-direction, hit.normal), 0.0), 5.0);
    let fresnel = select(vec3f(0.0), hit.f0 + (1.0 - hit.f0) * grazing * (1.0 - hit.roughness), hit.f0.x > 0.0);
    textureStore(glossy_weight_out, id.xy, vec4f(fresnel, 1.0));
}

fn shown(colour: vec3f) -> vec4f {
    return vec4f(pow(clamp(colour / (1.0 + colour), vec3f(0.0), vec3f(1.0)), vec3f(1.0 / 2.2)), 1.0);
}

// Left what the renderer made, right what quell made of it.
@compute @workgroup_size(8, 8)
fn present(@builtin(global_invocation_id) id: vec3u) {
    if !inside(id.xy) {
        return;
    }
    let noisy = textureLoad(direct, id.xy, 0).rgb
        + textureLoad(matte, id.xy, 0).rgb * textureLoad(matte_weight, id.xy, 0).rgb
        + textureLoad(glossy, id.xy, 0).rgb * textureLoad(glossy_weight, id.xy, 0).rgb;
    let width = u32(view.forward.w);
    textureStore(picture, id.xy, shown(noisy));
    textureStore(picture, id.xy + vec2u(width, 0u), shown(textureLoad(denoised, id.xy, 0).rgb));
}
