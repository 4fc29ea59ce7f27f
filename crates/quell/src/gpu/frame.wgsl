// Twin of camera.rs (`Projection`). Positions are relative to this frame's eye: f32 has to hold them.

// The map between pixels and the world for one camera.
struct View {
    // Position of view depth 0 for pixel coordinate (u, v), relative to the view's own eye: [0] + u [1] + v [2].
    origin: array<vec3f, 3>,
    // Displacement of one unit of view depth, of the same form.
    direction: array<vec3f, 3>,
    // Homogeneous pixel coordinate of a point relative to the view's own eye: xyz . X + w each.
    u: vec4f,
    v: vec4f,
    w: vec4f,
    // Unit viewing direction.
    forward: vec3f,
    // Focal length in pixels; orthographic: pixels a unit of length.
    focal_px: f32,
    // The view's eye relative to this frame's eye.
    eye: vec3f,
    // 0: orthographic.
    perspective: u32,
}

struct Frame {
    // This frame's camera.
    view: View,
    // The camera of the frame before, as this frame has it: for the motion of what does not move by itself.
    previous_view: View,
    // The camera of the frame before, as that frame had it: for the places of its pixels.
    before_view: View,
    // Sample positions relative to pixel centres: of this frame, and of the one before.
    jitter: vec2f,
    before_jitter: vec2f,
    // Extent of this frame, of the one before, and what takes a coordinate in this frame's pixels to that one's.
    size: vec2u,
    before_size: vec2u,
    to_before: vec2f,
    // Which images of the frame before may be used.
    matte_history: u32,
    glossy_history: u32,
    direct_history: u32,
    has_glossy_hit: u32,
    has_roughness: u32,
    picture_history: u32,
    // A frame may be a tile of a larger picture: where its pixel (0, 0) lies there, and the picture's extent.
    origin: vec2u,
    whole: vec2u,
}

// A place in an image, where there is one.
struct Place {
    coordinate: vec2f,
    found: bool,
}

// Pixels are the frame's own; continuous coordinates are those of the whole picture, so that a tile's are the same bits.
fn pixel_centre(pixel: vec2i) -> vec2f {
    return vec2f(pixel + vec2i(frame.origin)) + 0.5;
}

// The frame's own pixel from one of the whole picture.
fn own_pixel(pixel: vec2i) -> vec2i {
    return pixel - vec2i(frame.origin);
}

fn ray_origin(view: View, pixel: vec2f) -> vec3f {
    return view.origin[0] + view.origin[1] * pixel.x + view.origin[2] * pixel.y;
}

// Ray direction scaled to one unit of view depth.
fn ray_direction(view: View, pixel: vec2f) -> vec3f {
    return view.direction[0] + view.direction[1] * pixel.x + view.direction[2] * pixel.y;
}

// Position of a pixel coordinate and a finite view depth.
fn world(view: View, pixel: vec2f, view_depth: f32) -> vec3f {
    return view.eye + (ray_origin(view, pixel) + ray_direction(view, pixel) * view_depth);
}

fn place_of(homogeneous: vec3f) -> Place {
    if !(homogeneous.z > 0.0) {
        return Place(vec2f(0.0), false);
    }
    return Place(homogeneous.xy / homogeneous.z, true);
}

// Pixel coordinate of a position; none behind the eye.
fn pixel_of(view: View, position: vec3f) -> Place {
    let p = vec4f(position - view.eye, 1.0);
    return place_of(vec3f(dot(view.u, p), dot(view.v, p), dot(view.w, p)));
}

// Pixel coordinate in which a direction is seen (a point at infinity); none behind the eye.
fn pixel_of_direction(view: View, direction: vec3f) -> Place {
    let d = vec4f(direction, 0.0);
    return place_of(vec3f(dot(view.u, d), dot(view.v, d), dot(view.w, d)));
}

// View depth of a position.
fn view_depth_of(view: View, position: vec3f) -> f32 {
    return dot(position - view.eye, view.forward);
}

// Size of a pixel at a view depth, in world units.
fn pixel_size_at(view: View, view_depth: f32) -> f32 {
    return select(1.0, view_depth, view.perspective != 0u) / view.focal_px;
}

// Whether the image of the frame before has this pixel.
fn contains_before(pixel: vec2i) -> bool {
    return all(pixel >= vec2i(0)) && all(pixel < vec2i(frame.before_size));
}

// A coordinate of the previous image in its own pixels, from one in this frame's.
fn to_before(coordinate: vec2f) -> vec2f {
    return coordinate * frame.to_before;
}

fn contains(pixel: vec2i) -> bool {
    return all(pixel >= vec2i(0)) && all(pixel < vec2i(frame.size));
}
