// A small path tracer in a compute pass: one path a pixel from what the raster pass left in the G-buffer, over the same boxes and
// spheres. It gives light without albedo, as the denoiser takes it: diffuse surfaces as matte light, metals as glossy light.

/** Boxes and spheres at most. */
const MOST = 32;
/** Numbers of a thing: a matrix and three vectors. */
const THING = 28;

const CODE = /* wgsl */ `
struct Thing {
    // A box from -1/2 to 1/2, or a sphere of radius 1/2, in its own space.
    object_from_world: mat4x4f,
    // Colour; w: 1 for a sphere.
    colour: vec4f,
    emission: vec4f,
    // Roughness, metalness.
    material: vec4f,
}
struct Scene {
    world_from_clip: mat4x4f,
    world_from_view: mat4x4f,
    eye: vec4f,
    sky: vec4f,
    // The lamp: a rectangle, its middle and half its sides; its emission.
    lamp: vec4f,
    lamp_u: vec4f,
    lamp_v: vec4f,
    lamp_emission: vec4f,
    size: vec2u,
    seed: u32,
    paths: u32,
    count: u32,
}

@group(0) @binding(0) var<uniform> scene: Scene;
@group(0) @binding(1) var<storage, read> things: array<Thing, ${MOST}>;
@group(0) @binding(2) var depth_texture: texture_depth_2d;
@group(0) @binding(3) var normal_texture: texture_2d<f32>;
@group(0) @binding(4) var velocity_texture: texture_2d<f32>;
@group(0) @binding(5) var matte: texture_storage_2d<rgba16float, write>;
@group(0) @binding(6) var glossy: texture_storage_2d<rgba16float, write>;
@group(0) @binding(7) var hit_distance: texture_storage_2d<r32float, write>;

const PI = 3.14159265;
const FAR = 1e30;

var<private> state: u32;

// PCG: O'Neill, "PCG: A Family of Simple Fast Space-Efficient Statistically Good Algorithms for Random Number Generation" (2014).
fn random() -> f32 {
    state = state * 747796405u + 2891336453u;
    let word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return f32(((word >> 22u) ^ word) >> 8u) / 16777216.0;
}

struct Hit { distance: f32, normal: vec3f, thing: u32 }

fn hit_of(origin: vec3f, direction: vec3f, most: f32) -> Hit {
    var nearest = Hit(most, vec3f(0.0), MISSED);
    for (var i = 0u; i < scene.count; i++) {
        let m = things[i].object_from_world;
        let o = (m * vec4f(origin, 1.0)).xyz;
        let d = (m * vec4f(direction, 0.0)).xyz;
        var t = FAR;
        var n = vec3f(0.0);
        if things[i].colour.w > 0.5 {
            let a = dot(d, d);
            let b = dot(o, d);
            let inside = b * b - a * (dot(o, o) - 0.25);
            if inside > 0.0 {
                t = (-b - sqrt(inside)) / a;
                n = o + t * d;
            }
        } else {
            let near = (-sign(d) * 0.5 - o) / d;
            let far = (sign(d) * 0.5 - o) / d;
            t = max(near.x, max(near.y, near.z));
            n = -sign(d) * select(vec3f(0.0), vec3f(1.0), near == vec3f(t));
            if t > min(far.x, min(far.y, far.z)) {
                t = FAR;
            }
        }
        if t > 1e-4 && t < nearest.distance {
            nearest = Hit(t, normalize((vec4f(n, 0.0) * m).xyz), i);
        }
    }
    return nearest;
}
const MISSED = 0xffffffffu;

// Light of the lamp on a surface, over its albedo, by one point of the lamp.
fn lamp_light(position: vec3f, normal: vec3f) -> vec3f {
    let point = scene.lamp.xyz + (2.0 * random() - 1.0) * scene.lamp_u.xyz + (2.0 * random() - 1.0) * scene.lamp_v.xyz;
    let side = cross(scene.lamp_u.xyz, scene.lamp_v.xyz);
    let path = point - position;
    let distance = length(path);
    let direction = path / distance;
    let facing = max(dot(normal, direction), 0.0) * abs(dot(normalize(side), direction));
    if facing <= 0.0 || hit_of(position, direction, distance * 0.999 - 0.01).thing != MISSED {
        return vec3f(0.0);
    }
    return scene.lamp_emission.xyz * facing * 4.0 * length(side) / (PI * distance * distance);
}

fn around(normal: vec3f, local: vec3f) -> vec3f {
    let s = select(-1.0, 1.0, normal.z >= 0.0);
    let a = -1.0 / (s + normal.z);
    let b = normal.x * normal.y * a;
    let u = vec3f(1.0 + s * normal.x * normal.x * a, s * b, -s * normal.x);
    let v = vec3f(b, s + normal.y * normal.y * a, -normal.y);
    return normalize(u * local.x + v * local.y + normal * local.z);
}

// What a ray brings: emission where it counts, the lamp's light on what it meets, one metal mirror on the way (no caustics: diffuse
// surfaces see the lamp by lamp_light alone).
fn radiance(start: vec3f, towards: vec3f, with_emission: bool, length_of_first: ptr<function, f32>) -> vec3f {
    var origin = start;
    var direction = towards;
    var weight = vec3f(1.0);
    for (var bounce = 0; bounce < 2; bounce++) {
        let hit = hit_of(origin, direction, FAR);
        if bounce == 0 {
            *length_of_first = hit.distance;
        }
        if hit.thing == MISSED {
            return weight * scene.sky.xyz;
        }
        let thing = things[hit.thing];
        if any(thing.emission.xyz > vec3f(0.0)) {
            return select(vec3f(0.0), weight * thing.emission.xyz, with_emission);
        }
        origin += direction * hit.distance + hit.normal * 1e-3;
        weight *= thing.colour.xyz;
        if thing.material.y < 0.5 {
            return weight * lamp_light(origin, hit.normal);
        }
        direction = reflect(direction, hit.normal);
    }
    return vec3f(0.0);
}

@compute @workgroup_size(8, 8)
fn trace(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= scene.size) {
        return;
    }
    let pixel = vec2i(id.xy);
    let device_depth = textureLoad(depth_texture, pixel, 0);
    var matte_light = vec3f(0.0);
    var glossy_light = vec3f(0.0);
    var distance = FAR;
    if device_depth < 1.0 {
        state = (id.x * 1973u + id.y * 9277u + scene.seed * 26699u) | 1u;
        state = u32(random() * 16777216.0) ^ (id.x << 16u) ^ id.y ^ (scene.seed << 8u);
        let at = (vec2f(id.xy) + 0.5) / vec2f(scene.size) * vec2f(2.0, -2.0) + vec2f(-1.0, 1.0);
        let point = scene.world_from_clip * vec4f(at, device_depth, 1.0);
        let surface = textureLoad(normal_texture, pixel, 0);
        let normal = normalize((scene.world_from_view * vec4f(surface.xyz, 0.0)).xyz);
        let position = point.xyz / point.w + normal * 2e-3;
        let is_metal = textureLoad(velocity_texture, pixel, 0).z > 0.5;
        for (var path = 0u; path < scene.paths; path++) {
            let r = random();
            let turn = 2.0 * PI * random();
            var met = FAR;
            if is_metal {
                // A normal of GGX's distribution; its shadowing is left out.
                let alpha = surface.w * surface.w;
                let cosine = sqrt((1.0 - r) / (1.0 + (alpha * alpha - 1.0) * r));
                let sine = sqrt(max(1.0 - cosine * cosine, 0.0));
                let half_way = around(normal, vec3f(sine * cos(turn), sine * sin(turn), cosine));
                var direction = reflect(normalize(position - scene.eye.xyz), half_way);
                if dot(direction, normal) <= 0.0 {
                    direction = reflect(direction, normal);
                }
                glossy_light += radiance(position, direction, true, &met);
                distance = min(distance, met);
            } else {
                let direction = around(normal, vec3f(sqrt(r) * cos(turn), sqrt(r) * sin(turn), sqrt(1.0 - r)));
                matte_light += lamp_light(position, normal) + radiance(position, direction, false, &met);
            }
        }
    }
    let share = 1.0 / f32(scene.paths);
    textureStore(matte, pixel, vec4f(min(matte_light * share, vec3f(6e4)), 0.0));
    textureStore(glossy, pixel, vec4f(min(glossy_light * share, vec3f(6e4)), 0.0));
    textureStore(hit_distance, pixel, vec4f(distance));
}
`;

/** The tracer for images of [width, height] on a device. */
export class Tracer {
  constructor(device, [width, height]) {
    this.device = device;
    this.size = [width, height];
    const { TEXTURE_BINDING, STORAGE_BINDING, COPY_SRC } = GPUTextureUsage;
    const plane = (label, format) => device.createTexture({
      label, size: [width, height], format, usage: TEXTURE_BINDING | STORAGE_BINDING | COPY_SRC,
    });
    this.matte = plane("matte", "rgba16float");
    this.glossy = plane("glossy", "rgba16float");
    this.hitDistance = plane("glossy hit distance", "r32float");
    const buffer = (label, size, usage) => device.createBuffer({ label, size, usage: usage | GPUBufferUsage.COPY_DST });
    this.scene = buffer("scene", 4 * 72, GPUBufferUsage.UNIFORM);
    this.things = buffer("things", 4 * THING * MOST, GPUBufferUsage.STORAGE);
    const module = device.createShaderModule({ label: "tracer", code: CODE });
    this.pipeline = device.createComputePipeline({ label: "tracer", layout: "auto", compute: { module, entryPoint: "trace" } });
  }

  /**
   * Appends a frame to an encoder.
   * @param meshes  three.js meshes of unit boxes and spheres
   * @param lamp    the mesh that gives light: a box; its lower side counts
   * @param buffer  { depth, normal, velocity }: the G-buffer's textures on the device
   */
  encode(encoder, { camera, meshes, lamp, sky, buffer, seed, paths = 1 }) {
    if (meshes.length > MOST) throw new Error(`${meshes.length} things, not ${MOST} at most`);
    const { device } = this;
    const things = new Float32Array(THING * MOST);
    meshes.forEach((mesh, i) => {
      const { color, emissive, emissiveIntensity, roughness, metalness } = mesh.material;
      const isSphere = mesh.geometry.type === "SphereGeometry";
      things.set(mesh.matrixWorld.clone().invert().elements, THING * i);
      things.set([color.r, color.g, color.b, isSphere ? 1 : 0], THING * i + 16);
      things.set([emissive.r, emissive.g, emissive.b].map((v) => v * emissiveIntensity), THING * i + 20);
      things.set([roughness, metalness], THING * i + 24);
    });
    device.queue.writeBuffer(this.things, 0, things);

    const { elements: m } = lamp.matrixWorld;
    const half = (column) => [0, 1, 2].map((i) => m[4 * column + i] / 2);
    const below = half(1).map((v, i) => m[12 + i] - v);
    const { emissive, emissiveIntensity } = lamp.material;
    const scene = new ArrayBuffer(4 * 72);
    const numbers = new Float32Array(scene);
    const clip = camera.projectionMatrix.clone().multiply(camera.matrixWorldInverse);
    numbers.set(clip.invert().elements, 0);
    numbers.set(camera.matrixWorld.elements, 16);
    numbers.set(camera.matrixWorld.elements.slice(12, 15), 32);
    numbers.set(sky, 36);
    numbers.set(below, 40);
    numbers.set(half(0), 44);
    numbers.set(half(2), 48);
    numbers.set([emissive.r, emissive.g, emissive.b].map((v) => v * emissiveIntensity), 52);
    new Uint32Array(scene).set([...this.size, seed, paths, meshes.length], 56);
    device.queue.writeBuffer(this.scene, 0, scene);

    const resources = [
      { buffer: this.scene }, { buffer: this.things },
      ...[buffer.depth, buffer.normal, buffer.velocity, this.matte, this.glossy, this.hitDistance].map((t) => t.createView()),
    ];
    const entries = resources.map((resource, binding) => ({ binding, resource }));
    const pass = encoder.beginComputePass({ label: "path tracer" });
    pass.setPipeline(this.pipeline);
    pass.setBindGroup(0, device.createBindGroup({ layout: this.pipeline.getBindGroupLayout(0), entries }));
    pass.dispatchWorkgroups(...this.size.map((v) => Math.ceil(v / 8)));
    pass.end();
  }

  destroy() {
    for (const made of [this.matte, this.glossy, this.hitDistance, this.scene, this.things]) made.destroy();
  }
}
