// Twin of curved_mirror.rs: where the image in a curved mirror was one frame before.

// A mirror at the point that shows a thing now, as it stood one frame before.
struct CurvedMirror {
    point: vec3f,
    // Unit, on the eye's side.
    normal: vec3f,
    // Two edges of the triangle, and by how much the normal changes along each.
    edge_u: vec3f,
    edge_v: vec3f,
    bend_u: vec3f,
    bend_v: vec3f,
    // Whether the normal changes at all.
    curved: bool,
    // Whether point or normal moved since the frame before.
    moved: bool,
}

// The mirror at a point with this unit normal.
fn curved_mirror(p: SurfacePoint, normal: vec3f) -> CurvedMirror {
    var mirror: CurvedMirror;
    mirror.point = previous_position(p);
    mirror.normal = previous_normal(p, normal);
    mirror.moved = any(mirror.point != p.position) || any(mirror.normal != normal);
    mirror.curved = false;
    if instances[p.instance].normals == NONE {
        return mirror;
    }
    let corners = corners_of(p.triangle);
    let first = instances[p.instance].previous_positions;
    let place = instances[p.instance].previous;
    let a = place * vec4f(attribute3(first, corners.x), 1.0);
    mirror.edge_u = place * vec4f(attribute3(first, corners.y), 1.0) - a;
    mirror.edge_v = place * vec4f(attribute3(first, corners.z), 1.0) - a;
    let n0 = corner_normal(p.instance, corners.x);
    let n1 = corner_normal(p.instance, corners.y);
    let n2 = corner_normal(p.instance, corners.z);
    let mean = n0 * (1.0 - p.barycentric.x - p.barycentric.y) + n1 * p.barycentric.x + n2 * p.barycentric.y;
    let scale = select(1.0, -1.0, dot(mean, normal) < 0.0) / length(mean);
    let before = previous_normal(p, n0);
    mirror.bend_u = (previous_normal(p, n1) - before) * scale;
    mirror.bend_v = (previous_normal(p, n2) - before) * scale;
    mirror.curved = length(mirror.bend_u) > LEAST_BEND || length(mirror.bend_v) > LEAST_BEND;
    return mirror;
}

fn corner_normal(instance: u32, corner: u32) -> vec3f {
    return normalize_or(instances[instance].normal_matrix * attribute3(instances[instance].normals, corner), vec3f());
}

// The unit half vector at a point of the mirror, and how it changes along the two edges.
struct HalfVector {
    unit: vec3f,
    slope_u: vec3f,
    slope_v: vec3f,
}

// `shown`: what the mirror shows: a point (w = 1), or a unit direction (w = 0).
fn half_vector(at: vec3f, shown: vec4f, edge_u: vec3f, edge_v: vec3f) -> HalfVector {
    let away = frame.previous_eye - at;
    let distance = length(away);
    let towards_eye = away / distance;
    var sum = towards_eye;
    var slope_u = (towards_eye * dot(towards_eye, edge_u) - edge_u) / distance;
    var slope_v = (towards_eye * dot(towards_eye, edge_v) - edge_v) / distance;
    if shown.w > 0.0 {
        let to_shown = shown.xyz - at;
        let there = length(to_shown);
        let unit = to_shown / there;
        sum += unit;
        slope_u += (unit * dot(unit, edge_u) - edge_u) / there;
        slope_v += (unit * dot(unit, edge_v) - edge_v) / there;
    } else {
        sum += shown.xyz;
    }
    let size = length(sum);
    let half = sum / size;
    return HalfVector(
        half,
        (slope_u - half * dot(half, slope_u)) / size,
        (slope_v - half * dot(half, slope_v)) / size,
    );
}

// The point of the mirror in which the eye of the frame before saw what is shown; w is 0: not found, as where the image breaks up, or
// not looked for: the mirror is plane, or nothing moved. `moved`: what is shown did.
fn seen_in_curved(mirror: CurvedMirror, moved: bool, shown: vec4f) -> vec4f {
    if !(mirror.curved && frame.far_motion == FAR_TURNS && (moved || mirror.moved || frame.eye_moved != 0u)) {
        return vec4f();
    }
    var along = vec3f();
    var turn = vec3f();
    for (var step = 0u; step < NEWTON_STEPS; step++) {
        let half = half_vector(bent_place(mirror, along, turn), shown, mirror.edge_u, mirror.edge_v);
        let normal = mirror.normal + turn;
        let size = length(normal);
        let unit = normal / size;
        let miss = half.unit - unit;
        let along_u = half.slope_u - (mirror.bend_u - unit * dot(unit, mirror.bend_u)) / size;
        let along_v = half.slope_v - (mirror.bend_v - unit * dot(unit, mirror.bend_v)) / size;
        let a = dot(along_u, mirror.edge_u);
        let b = dot(along_v, mirror.edge_u);
        let c = dot(along_u, mirror.edge_v);
        let d = dot(along_v, mirror.edge_v);
        let p = dot(miss, mirror.edge_u);
        let q = dot(miss, mirror.edge_v);
        let determinant = a * d - b * c;
        if !(abs(determinant) > NEWTON_DETERMINANT * max(abs(a * d), abs(b * c))) {
            return vec4f();
        }
        let i = (b * q - d * p) / determinant;
        let j = (c * p - a * q) / determinant;
        along += i * mirror.edge_u + j * mirror.edge_v;
        turn += i * mirror.bend_u + j * mirror.bend_v;
    }
    let at = bent_place(mirror, along, turn);
    let half = half_vector(at, shown, mirror.edge_u, mirror.edge_v);
    let found = length(half.unit - normalize_or(mirror.normal + turn, vec3f())) < NEWTON_FOUND;
    return select(vec4f(), vec4f(at, 1.0), found);
}

// The point of the mirror that lies `along` its plane, where its normal has turned by so much.
fn bent_place(mirror: CurvedMirror, along: vec3f, turn: vec3f) -> vec3f {
    return mirror.point + along - 0.5 * dot(along, turn) * mirror.normal;
}
