// Stage 5's window in workgroup memory: confidence once for each pixel of a tile and its border, then the maximum along
// rows, along columns, and the mean along rows; each is as far as the next needs it. The pass declares `BORDER`: pixels around the tile of 8x8
// for which distrust is wanted as well.

// Largest `disocclusion.radius` and `disocclusion.blur`.
const MOST_RADIUS: i32 = 8;
const TILE: i32 = 8;
const INNER: i32 = TILE + 2 * BORDER;
const WIDEST_SIDE: i32 = INNER + 2 * MOST_RADIUS;
const CONFIDENCE_SIDE: i32 = WIDEST_SIDE + 2 * MOST_RADIUS;

// Confidence, and once it has been read the maximum over the square.
var<workgroup> confidence_tile: array<f32, CONFIDENCE_SIDE * CONFIDENCE_SIDE>;
var<workgroup> widest_row_tile: array<f32, WIDEST_SIDE * CONFIDENCE_SIDE>;
var<workgroup> rows_tile: array<f32, INNER * WIDEST_SIDE>;
// First pixel of the tile with its border.
var<private> inner_first: vec2i;

fn confidence_slot(pixel: vec2i) -> i32 {
    let halo = settings.disocclusion.radius + settings.disocclusion.blur;
    let at = pixel - inner_first + halo;
    return at.y * CONFIDENCE_SIDE + at.x;
}

fn widest_row_slot(pixel: vec2i) -> i32 {
    let blur = settings.disocclusion.blur;
    let at = pixel - inner_first + vec2i(blur, settings.disocclusion.radius + blur);
    return at.y * WIDEST_SIDE + at.x;
}

fn widest_slot(pixel: vec2i) -> i32 {
    let at = pixel - inner_first + settings.disocclusion.blur;
    return at.y * WIDEST_SIDE + at.x;
}

fn rows_slot(pixel: vec2i) -> i32 {
    let at = pixel - inner_first + vec2i(0, settings.disocclusion.blur);
    return at.y * INNER + at.x;
}

fn confidence_at(pixel: vec2i) -> f32 {
    return confidence_tile[confidence_slot(pixel)];
}

fn widest_row_at(pixel: vec2i) -> f32 {
    return widest_row_tile[widest_row_slot(pixel)];
}

fn widest_at(pixel: vec2i) -> f32 {
    return confidence_tile[widest_slot(pixel)];
}

fn rows_at(pixel: vec2i) -> f32 {
    return rows_tile[rows_slot(pixel)];
}

// Fills the tiles; every invocation of the workgroup takes part. `local`: its place in the workgroup; it takes every eighth
// pixel along each axis from there.
fn gather_distrust(group: vec2u, local: vec2i) {
    inner_first = vec2i(group) * TILE - BORDER;
    let radius = settings.disocclusion.radius;
    let blur = settings.disocclusion.blur;
    let wide = INNER + 2 * (radius + blur);
    for (var y = local.y; y < wide; y += TILE) {
        for (var x = local.x; x < wide; x += TILE) {
            let pixel = inner_first - radius - blur + vec2i(x, y);
            if contains(pixel) {
                confidence_tile[confidence_slot(pixel)] = abs(textureLoad(temporal, pixel, 0).w);
            }
        }
    }
    workgroupBarrier();
    let middle = INNER + 2 * blur;
    for (var y = local.y; y < wide; y += TILE) {
        for (var x = local.x; x < middle; x += TILE) {
            let pixel = inner_first - vec2i(blur, radius + blur) + vec2i(x, y);
            if contains(pixel) {
                widest_row_tile[widest_row_slot(pixel)] = disocclusion_widest_row(pixel);
            }
        }
    }
    workgroupBarrier();
    for (var y = local.y; y < middle; y += TILE) {
        for (var x = local.x; x < middle; x += TILE) {
            let pixel = inner_first - blur + vec2i(x, y);
            if contains(pixel) {
                confidence_tile[widest_slot(pixel)] = disocclusion_widest(pixel);
            }
        }
    }
    workgroupBarrier();
    for (var y = local.y; y < middle; y += TILE) {
        for (var x = local.x; x < INNER; x += TILE) {
            let pixel = inner_first - vec2i(0, blur) + vec2i(x, y);
            if contains(pixel) {
                rows_tile[rows_slot(pixel)] = disocclusion_rows(pixel);
            }
        }
    }
    workgroupBarrier();
}

// Stage 5 at one pixel: what is shown, and what is fed back.
struct Blended {
    shown: vec3f,
    floored: vec3f,
}

fn blended_at(pixel: vec2i, accumulated: vec3f) -> Blended {
    let smooth_estimate = textureLoad(prefiltered, pixel, 0).xyz;
    let k = disocclusion_distrust(pixel);
    let least = settings.disocclusion.floor;
    let fed_back = max(least, settings.disocclusion.feedback_floor);
    return Blended(
        disocclusion(accumulated, smooth_estimate, k, least),
        disocclusion(accumulated, smooth_estimate, k, fed_back),
    );
}
