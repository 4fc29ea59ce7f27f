// The guides' part of the border.
//
// The pass supplies `store_guide`, and the textures; one that is not there is bound to something else.

fn has(plane: u32) -> bool {
    return (prepare.there & plane) != 0u;
}

// Where a pixel was sampled.
fn sample_position(pixel: vec2i) -> vec2f {
    return pixel_centre(pixel) + frame.jitter;
}

// `DepthKind`
const DEPTH_DEVICE: u32 = 1u;
const DEPTH_DISTANCE: u32 = 2u;
// `NormalEncoding`
const NORMAL_UNORM_XYZ: u32 = 1u;
const NORMAL_OCTAHEDRAL: u32 = 2u;
const NORMAL_UNORM_OCTAHEDRAL: u32 = 3u;

fn clean_unit_range(plane: u32, v: f32, when_not_finite: f32) -> f32 {
    if !is_finite(v) {
        note(plane, NOT_FINITE);
        return when_not_finite;
    }
    if v < 0.0 || v > 1.0 {
        note(plane, OUT_OF_RANGE);
    }
    return clamp(v, 0.0, 1.0);
}

// View depth where clip z / clip w is `device` along the ray of a pixel; `FAR` and beyond: background.
fn view_depth_of_device(pixel: vec2i, device: f32) -> f32 {
    if device == prepare.device_far {
        return FAR;
    }
    let coordinate = sample_position(pixel);
    let origin = vec4f(ray_origin(frame.view, coordinate), 1.0);
    let direction = ray_direction(frame.view, coordinate);
    let step = dot(prepare.device_z.xyz, direction) - device * dot(frame.view.w.xyz, direction);
    let start = device * dot(frame.view.w, origin) - dot(prepare.device_z, origin);
    // Behind the eye and nowhere at all are background.
    if step == 0.0 || start / step <= 0.0 {
        return FAR;
    }
    return start / step;
}

fn raw_depth(pixel: vec2i) -> f32 {
    if has(HAS_DEPTH_FORMAT) {
        return textureLoad(depth_texture, pixel, 0);
    }
    return textureLoad(view_depth_texture, pixel, 0).x;
}

fn prepared_depth(pixel: vec2i) -> f32 {
    if !has(HAS_VIEW_DEPTH) {
        return 1.0;
    }
    var depth = raw_depth(pixel);
    if is_nan(depth) {
        note(PLANE_VIEW_DEPTH, NOT_FINITE);
        return BACKGROUND;
    }
    if prepare.depth == DEPTH_DEVICE {
        if depth < 0.0 || depth > 1.0 {
            note(PLANE_VIEW_DEPTH, OUT_OF_RANGE);
            return BACKGROUND;
        }
        depth = view_depth_of_device(pixel, depth);
    } else if depth <= 0.0 {
        note(PLANE_VIEW_DEPTH, OUT_OF_RANGE);
        return BACKGROUND;
    } else if prepare.depth == DEPTH_DISTANCE && depth < FAR {
        depth /= length(ray_direction(frame.view, sample_position(pixel)));
    }
    return select(BACKGROUND, depth, depth < FAR);
}

fn unfolded(e: vec2f) -> vec3f {
    let z = 1.0 - abs(e.x) - abs(e.y);
    let flap = (1.0 - abs(e.yx)) * select(vec2f(-1.0), vec2f(1.0), e >= vec2f(0.0));
    return vec3f(select(flap, e, z >= 0.0), z);
}

fn prepared_normal(pixel: vec2i) -> vec3f {
    if !has(HAS_NORMAL) {
        return -frame.view.forward;
    }
    let texel = textureLoad(normal_texture, pixel, 0).xyz;
    let is_octahedral = prepare.normal >= NORMAL_OCTAHEDRAL;
    if !(is_finite(texel.x) && is_finite(texel.y) && (is_octahedral || is_finite(texel.z))) {
        note(PLANE_NORMAL, NOT_FINITE);
        return vec3f(0.0);
    }
    if !is_octahedral && all(texel == vec3f(0.0)) {
        return texel;
    }
    var decoded = texel;
    if prepare.normal == NORMAL_UNORM_XYZ {
        decoded = 2.0 * texel - 1.0;
    } else if prepare.normal == NORMAL_OCTAHEDRAL {
        decoded = normalize(unfolded(texel.xy));
    } else if prepare.normal == NORMAL_UNORM_OCTAHEDRAL {
        decoded = normalize(unfolded(2.0 * texel.xy - 1.0));
    }
    let squared = dot(decoded, decoded);
    if squared == 0.0 {
        return decoded;
    }
    let off = abs(squared - 1.0);
    if !(off <= prepare.unit_tolerance) {
        note(PLANE_NORMAL, NOT_UNIT);
        // Squares of long ones are infinite.
        decoded /= max(abs(decoded.x), max(abs(decoded.y), abs(decoded.z)));
        decoded = normalize(decoded);
    } else if prepare.normal == NORMAL_UNORM_XYZ {
        decoded = normalize(decoded);
    }
    if prepare.normal_in_view != 0u {
        decoded = prepare.right * decoded.x + prepare.up * decoded.y - frame.view.forward * decoded.z;
    }
    return decoded;
}

// Motion that the cameras alone give to what a pixel shows.
fn camera_motion(pixel: vec2i, depth: f32) -> vec2f {
    let coordinate = sample_position(pixel);
    var before = Place(vec2f(0.0), false);
    if depth != BACKGROUND {
        before = pixel_of(frame.previous_view, world(frame.view, coordinate, depth));
    } else {
        before = pixel_of_direction(frame.previous_view, ray_direction(frame.view, coordinate));
    }
    let moved = before.coordinate - coordinate;
    if !before.found || !is_finite(moved.x) || !is_finite(moved.y) {
        return vec2f(UNKNOWN_MOTION);
    }
    return moved;
}

fn prepared_motion(pixel: vec2i, depth: f32) -> vec2f {
    var moved = vec2f(UNKNOWN_MOTION);
    if !has(HAS_MOTION) {
        moved = camera_motion(pixel, depth);
    } else {
        let texel = textureLoad(motion_texture, pixel, 0).xy;
        if is_finite(texel.x) && is_finite(texel.y) {
            moved = texel * prepare.motion_scale + prepare.motion_shift;
        } else if is_infinite(texel.x) || is_infinite(texel.y) {
            // NaN is legal: unknown.
            note(PLANE_MOTION, NOT_FINITE);
        }
    }
    return clamp(moved, vec2f(-UNKNOWN_MOTION), vec2f(UNKNOWN_MOTION));
}

fn prepared_roughness(pixel: vec2i) -> f32 {
    if !has(HAS_ROUGHNESS) {
        return 1.0;
    }
    let given = clean_unit_range(PLANE_ROUGHNESS, textureLoad(roughness_texture, pixel, 0)[prepare.roughness_channel], 1.0);
    return select(given, sqrt(given), prepare.roughness_is_alpha != 0u);
}

fn prepared_glossy_hit(pixel: vec2i) -> f32 {
    if !has(HAS_GLOSSY_HIT_DISTANCE) {
        return 0.0;
    }
    let hit = textureLoad(glossy_hit_texture, pixel, 0)[prepare.glossy_hit_channel];
    if is_nan(hit) {
        note(PLANE_GLOSSY_HIT, NOT_FINITE);
        return 0.0;
    }
    if hit < 0.0 {
        note(PLANE_GLOSSY_HIT, OUT_OF_RANGE);
        return 0.0;
    }
    return min(hit, FAR);
}

fn prepared_confidence(pixel: vec2i) -> f32 {
    if !has(HAS_CONFIDENCE_IN) {
        return 1.0;
    }
    return clean_unit_range(PLANE_CONFIDENCE_IN, textureLoad(confidence_texture, pixel, 0)[prepare.confidence_channel], 0.0);
}

// The guides of a pixel.
fn prepared_guide(pixel: vec2i) -> Guide {
    var guide: Guide;
    guide.normal = prepared_normal(pixel);
    guide.depth = prepared_depth(pixel);
    // A normal of (0, 0, 0) says background, whatever the depth.
    if all(guide.normal == vec3f(0.0)) {
        guide.depth = BACKGROUND;
    }
    guide.motion = prepared_motion(pixel, guide.depth);
    guide.roughness = prepared_roughness(pixel);
    guide.glossy_hit = prepared_glossy_hit(pixel);
    if has(HAS_SURFACE_ID) {
        guide.id = textureLoad(id_texture, pixel, 0).x;
    }
    guide.confidence_in = prepared_confidence(pixel);
    return guide;
}

@compute @workgroup_size(8, 8)
fn prepare_guides(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) local: u32) {
    let pixel = vec2i(id.xy);
    if contains(pixel) {
        store_guide(pixel, prepared_guide(pixel));
    }
    flush_counts(local);
}
