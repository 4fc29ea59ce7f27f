// Dammertz et al. 2010, twin of quell-lab's `methods/atrous.rs`: each frame by itself, no history.

@group(0) @binding(1) var surface: texture_2d<f32>;
@group(0) @binding(2) var matte_in: texture_2d<f32>;
@group(0) @binding(3) var glossy_in: texture_2d<f32>;
@group(0) @binding(4) var matte_out: texture_storage_2d<rgba32float, write>;
@group(0) @binding(5) var glossy_out: texture_storage_2d<rgba32float, write>;
// Of each workgroup: sums of both signals' luminance over surfaces, and their number. The first becomes that of the picture.
@group(0) @binding(6) var<storage, read_write> sums: array<vec4f>;
@group(0) @binding(7) var<storage, read> total: array<vec4f>;

const THREADS: u32 = 256u;
var<workgroup> parts: array<vec4f, THREADS>;

// The sum of all threads' parts, in the first.
fn add_up(thread: u32, part: vec4f) {
    parts[thread] = part;
    for (var half = THREADS / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if thread < half {
            parts[thread] += parts[thread + half];
        }
    }
}

@compute @workgroup_size(16, 16)
fn tile_sums(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_id) local: vec3u,
    @builtin(local_invocation_index) thread: u32,
    @builtin(num_workgroups) groups: vec3u,
) {
    var sum = vec4f();
    for (var k = 0u; k < 4u; k++) {
        let at = vec2i(32u * group.xy + 16u * vec2u(k % 2u, k / 2u) + local.xy);
        if is_inside(at) && textureLoad(surface, at, 0).w < BACKGROUND {
            let matte = dot(max(textureLoad(matte_in, at, 0).xyz, vec3f()), LUMINANCE);
            let glossy = dot(max(textureLoad(glossy_in, at, 0).xyz, vec3f()), LUMINANCE);
            sum += vec4f(matte, glossy, 1.0, 0.0);
        }
    }
    add_up(thread, sum);
    if thread == 0u {
        sums[group.y * groups.x + group.x] = parts[0];
    }
}

@compute @workgroup_size(THREADS)
fn whole_sum(@builtin(local_invocation_index) thread: u32) {
    var sum = vec4f();
    for (var i = thread; i < arrayLength(&sums); i += THREADS) {
        sum += sums[i];
    }
    add_up(thread, sum);
    if thread == 0u {
        sums[0] = parts[0];
    }
}

// Equations 5 to 8: w = w_rt w_n w_x, each min(1, exp(-|difference|^2 / sigma^2)); the distance of normals is divided by the step.
@compute @workgroup_size(8, 8)
fn level(@builtin(global_invocation_id) id: vec3u) {
    let at = vec2i(id.xy);
    if !is_inside(at) {
        return;
    }
    let step = f32(frame.step);
    let mean = total[0].xy / max(total[0].z, 1.0);
    let sigma_colour = frame.atrous.x * mean / step;
    let inverse_colour = select(vec2f(), 1.0 / max(sigma_colour * sigma_colour, vec2f(LEAST)), sigma_colour > vec2f());
    let inverse_normal = 1.0 / (frame.atrous.y * frame.atrous.y * step * step);
    let own = textureLoad(surface, at, 0);
    let is_surface = own.w < BACKGROUND;
    let place = world(at, select(0.0, own.w, is_surface));
    let sigma_position = frame.atrous.z * own.w;
    let inverse_position = select(0.0, 1.0 / (sigma_position * sigma_position), is_surface);
    let matte = max(textureLoad(matte_in, at, 0).xyz, vec3f());
    let glossy = max(textureLoad(glossy_in, at, 0).xyz, vec3f());
    var matte_sum = CENTRE * matte;
    var glossy_sum = CENTRE * glossy;
    var weights = vec2f(CENTRE);
    for (var y = -2; y <= 2; y++) {
        for (var x = -2; x <= 2; x++) {
            let q = at + frame.step * vec2i(x, y);
            if (x == 0 && y == 0) || !is_inside(q) {
                continue;
            }
            let other = textureLoad(surface, q, 0);
            // The background is infinitely far away.
            if (other.w < BACKGROUND) != is_surface {
                continue;
            }
            let turn = own.xyz - other.xyz;
            let apart = place - world(q, select(0.0, other.w, is_surface));
            let off = dot(turn, turn) * inverse_normal + dot(apart, apart) * inverse_position;
            let m = max(textureLoad(matte_in, q, 0).xyz, vec3f());
            let g = max(textureLoad(glossy_in, q, 0).xyz, vec3f());
            let colour = vec2f(dot(matte - m, matte - m), dot(glossy - g, glossy - g)) * inverse_colour;
            let w = kernel(x, y) * exp(-min(vec2f(off) + colour, vec2f(MOST)));
            weights += w;
            matte_sum += w.x * m;
            glossy_sum += w.y * g;
        }
    }
    textureStore(matte_out, at, vec4f(matte_sum / weights.x, 1.0));
    textureStore(glossy_out, at, vec4f(glossy_sum / weights.y, 1.0));
}
