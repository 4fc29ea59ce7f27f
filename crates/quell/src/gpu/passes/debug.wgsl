// Debug views: what a frame's planes hold and why history was dropped, as colours for a display. debug.rs says what each
// looks like when all is right, and when it is not.

// Twin of debug.rs (`DebugUniforms`).
struct Debug {
    // The frame's eye, world space: positions are relative to it.
    eye: vec3f,
    // `DebugView`
    view: u32,
    // The pixel whose weights are shown.
    centre: vec2i,
    // Multiplies light before it is shown; cells a scene unit; shares of full colour a pixel.
    scale: f32,
    // Taps of stage 7.
    taps: u32,
    // The fourth value of `image` is a confidence.
    has_confidence: u32,
}

// `DebugView`
const VIEW_LIGHT: u32 = 0u;
const VIEW_DEPTH: u32 = 1u;
const VIEW_NORMAL: u32 = 2u;
const VIEW_ROUGHNESS: u32 = 3u;
const VIEW_SURFACE_ID: u32 = 4u;
const VIEW_GLOSSY_HIT: u32 = 5u;
const VIEW_MOTION: u32 = 6u;
const VIEW_CONFIDENCE_IN: u32 = 7u;
const VIEW_WORLD_GRID: u32 = 8u;
const VIEW_NORMAL_ERROR: u32 = 9u;
const VIEW_MOTION_ERROR: u32 = 10u;
const VIEW_DEPTH_ERROR: u32 = 11u;
const VIEW_CONFIDENCE: u32 = 12u;
const VIEW_HISTORY_LENGTH: u32 = 13u;
const VIEW_REJECTION: u32 = 14u;
const VIEW_WEIGHTS_AROUND: u32 = 15u;
const VIEW_WEIGHT_SUM: u32 = 16u;

struct SpiralTap {
    @align(16) dx: i32,
    dy: i32,
    weight: f32,
}

// Directions as hues: right red, down green-yellow, left cyan, up violet; `strength` 0..1.
fn direction_colour(v: vec2f, strength: f32) -> vec3f {
    let hue = atan2(v.y, v.x);
    let turned = vec3f(hue, hue - 2.0943951, hue + 2.0943951);
    return clamp(strength, 0.0, 1.0) * (0.5 + 0.5 * cos(turned));
}

// Pixels on a scale of logarithms: 1/20 px begins to show, 16 px are full.
fn pixels_shown(v: vec2f) -> f32 {
    let size = length(v) * debug.scale;
    return select(0.0, clamp(log2(size * 20.0 + 1.0) / 8.0, 0.0, 1.0), size > 0.0);
}

fn mixed(id: u32) -> vec3f {
    let h = (id + 1u) * 0x9e3779b1u;
    return vec3f(vec3u(h >> 24u, h >> 16u, h >> 8u) & vec3u(255u)) / 255.0;
}

fn grid_colour(pixel: vec2i) -> vec3f {
    let own = surface_of(pixel);
    let cell = vec3i(floor((own.position + debug.eye) * debug.scale + 1e-3));
    let odd = ((cell.x + cell.y + cell.z) & 1) != 0;
    return select(0.35, 0.8, odd) * (0.6 + 0.4 * abs(own.normal));
}

// Where the neighbour along an axis lies that is nearer in depth: edges have a wrong side.
fn neighbour_position(pixel: vec2i, axis: vec2i, own: Surface) -> vec3f {
    var best = vec3f(0.0);
    var least = FAR;
    for (var side = -1; side <= 1; side += 2) {
        let q = pixel + side * axis;
        if contains(q) && is_surface(q) {
            let there = surface_of(q);
            let change = abs(there.view_depth - own.view_depth);
            if change < least {
                least = change;
                best = f32(side) * (there.position - own.position);
            }
        }
    }
    return best;
}

// The sine of the angle between the normal that was given and the one that depths make.
fn normal_error(pixel: vec2i) -> f32 {
    let own = surface_of(pixel);
    let right = neighbour_position(pixel, vec2i(1, 0), own);
    let down = neighbour_position(pixel, vec2i(0, 1), own);
    let across = cross(down, right);
    let size = length(across);
    if size == 0.0 {
        return 0.0;
    }
    return length(cross(across / size, own.normal));
}

// Motion beside what cameras and depth alone would give.
fn motion_error(pixel: vec2i) -> vec2f {
    let own = surface_of(pixel);
    let moved = moving_at(pixel, own.view_depth).motion;
    let before = pixel_of(frame.previous_view, own.position);
    return moved - (before.coordinate - sample_position(pixel));
}

fn is_unknown(motion: vec2f) -> bool {
    return any(abs(motion) >= vec2f(1e5));
}

// Depth found in the frame before, beside what cameras and depth say it should be: relative; x says whether there is any.
fn depth_error(pixel: vec2i) -> vec2f {
    let own = surface_of(pixel);
    let place = pixel_centre(pixel) + moving_at(pixel, own.view_depth).motion;
    let q = own_pixel(vec2i(floor(to_before(place))));
    if frame.matte_history + frame.glossy_history == 0u || !contains_before(q) {
        return vec2f(0.0);
    }
    let found = depth_before(q);
    if found == BACKGROUND {
        return vec2f(0.0);
    }
    let wanted = view_depth_of(frame.previous_view, own.position);
    return vec2f(1.0, (found - wanted) / wanted);
}

const REASON_KEPT: vec3f = vec3f(0.0, 0.3, 0.05);
const REASON_NO_HISTORY: vec3f = vec3f(1.0);
const REASON_UNKNOWN_MOTION: vec3f = vec3f(1.0, 0.0, 1.0);
const REASON_OFF_SCREEN: vec3f = vec3f(0.1, 0.2, 1.0);
const REASON_NO_TRACE: vec3f = vec3f(0.0, 0.9, 0.9);
const REASON_BACKGROUND: vec3f = vec3f(0.45);
const REASON_OTHER_ID: vec3f = vec3f(1.0, 0.9, 0.0);
const REASON_TURNED: vec3f = vec3f(1.0, 0.5, 0.0);
const REASON_TOO_FAR: vec3f = vec3f(0.9, 0.0, 0.0);
const REASON_HOST: vec3f = vec3f(0.5, 0.2, 0.8);

// Why stage 3 took no history for a pixel.
fn rejection(pixel: vec2i) -> vec3f {
    if frame.matte_history + frame.glossy_history == 0u {
        return REASON_NO_HISTORY;
    }
    let own = surface_of(pixel);
    let moves = moving_at(pixel, own.view_depth);
    if is_unknown(moves.motion) {
        return REASON_UNKNOWN_MOTION;
    }
    if !on_screen(pixel_centre(pixel) + moves.motion) {
        return REASON_OFF_SCREEN;
    }
    if moves.confidence_in <= 0.0 {
        return REASON_HOST;
    }
    let expected = expected_surface(pixel);
    if !expected.found {
        return REASON_NO_TRACE;
    }
    if surface_lookup(expected, pixel).trust > 0.0 {
        return REASON_KEPT;
    }
    // The heaviest pixel of the footprint decides.
    let footprint = footprint_of(to_before(expected.coordinate));
    var weights = footprint.weight;
    var most = 0;
    for (var k = 1; k < 4; k++) {
        if weights[k] > weights[most] {
            most = k;
        }
    }
    let q = footprint_pixel(footprint.first, most);
    if !contains_before(q) {
        return REASON_OFF_SCREEN;
    }
    let there = before_at(q);
    if there.depth == BACKGROUND {
        return REASON_BACKGROUND;
    }
    if there.id != own.id {
        return REASON_OTHER_ID;
    }
    if dot(there.normal, expected.normal) < settings.surface.normal_min {
        return REASON_TURNED;
    }
    return REASON_TOO_FAR;
}

fn weight_between(p: Surface, q: vec2i) -> f32 {
    let coordinate = sample_position(q);
    let origin = ray_origin(frame.view, coordinate);
    let direction = ray_direction(frame.view, coordinate);
    let size = pixel_size_at(frame.view, p.view_depth);
    return edge_weight(settings.matte_edge, p, surface_of(q), origin, direction, size);
}

// Share of its taps' weight that stage 7 keeps at a pixel.
fn weight_share(pixel: vec2i) -> f32 {
    let p = surface_of(pixel);
    let first = spiral_at(pixel, debug.taps);
    var kept = 0.0;
    var most = 0.0;
    for (var i = 0u; i < debug.taps; i++) {
        let tap = spiral[first + i];
        let q = pixel + vec2i(tap.dx, tap.dy);
        most += tap.weight;
        if contains(q) {
            kept += tap.weight * weight_between(p, q);
        }
    }
    return kept / max(most, 1e-6);
}

fn surface_view(pixel: vec2i) -> vec3f {
    let own = surface_of(pixel);
    switch debug.view {
        case VIEW_DEPTH: {
            return vec3f(0.15 + 0.85 * fract(log2(own.view_depth)));
        }
        case VIEW_NORMAL: {
            return 0.5 + 0.5 * own.normal;
        }
        case VIEW_ROUGHNESS: {
            return vec3f(own.roughness);
        }
        case VIEW_SURFACE_ID: {
            return mixed(own.id);
        }
        case VIEW_GLOSSY_HIT: {
            let hit = moving_at(pixel, own.view_depth).glossy_hit;
            return select(vec3f(hit / (hit + own.view_depth)), vec3f(0.3, 0.5, 1.0), hit >= FAR);
        }
        case VIEW_WORLD_GRID: {
            return grid_colour(pixel);
        }
        case VIEW_NORMAL_ERROR: {
            return heat(normal_error(pixel));
        }
        case VIEW_MOTION_ERROR: {
            let moved = moving_at(pixel, own.view_depth).motion;
            if is_unknown(moved) {
                return vec3f(1.0);
            }
            let error = motion_error(pixel);
            return direction_colour(error, pixels_shown(error));
        }
        case VIEW_DEPTH_ERROR: {
            let error = depth_error(pixel);
            let strength = clamp(abs(error.y) * debug.scale * 20.0, 0.0, 1.0);
            let colour = select(vec3f(0.2, 0.4, 1.0), vec3f(1.0, 0.2, 0.1), error.y < 0.0);
            return select(vec3f(0.25), strength * colour, error.x > 0.0);
        }
        case VIEW_REJECTION: {
            return rejection(pixel);
        }
        case VIEW_WEIGHTS_AROUND: {
            if all(pixel == debug.centre) {
                return vec3f(0.0, 1.0, 0.0);
            }
            return heat(weight_between(surface_of(debug.centre), pixel));
        }
        case VIEW_WEIGHT_SUM: {
            return heat(weight_share(pixel));
        }
        default: {
            return BLACK;
        }
    }
}

fn debug_colour(pixel: vec2i) -> vec3f {
    let texel = textureLoad(image, pixel, 0);
    let on_surface = is_surface(pixel);
    switch debug.view {
        case VIEW_LIGHT: {
            return shown_light(texel.xyz);
        }
        case VIEW_MOTION: {
            let moved = moving_at(pixel, depth_at(pixel)).motion;
            return select(direction_colour(moved, pixels_shown(moved)), vec3f(1.0), is_unknown(moved));
        }
        case VIEW_CONFIDENCE_IN: {
            return vec3f(moving_at(pixel, depth_at(pixel)).confidence_in);
        }
        case VIEW_CONFIDENCE: {
            let trust = select(0.0, abs(texel.w), debug.has_confidence != 0u);
            return select(NOWHERE, vec3f(1.0 - trust, trust, 0.0), on_surface);
        }
        case VIEW_HISTORY_LENGTH: {
            return select(NOWHERE, heat(log2(max(textureLoad(history_length, pixel, 0).x, 1.0)) / 6.0), on_surface);
        }
        default: {
            if !on_surface {
                return NOWHERE;
            }
            return surface_view(pixel);
        }
    }
}

@compute @workgroup_size(8, 8)
fn show(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if contains(pixel) {
        textureStore(target_texture, pixel, vec4f(debug_colour(pixel), 1.0));
    }
}
