// Twin of triangle.rs and patch.rs: emitting triangles, and flat lamps of several, sampled from a point. The CPU works in
// double precision here; the same maps are written so that single precision loses no digits, from differences of
// positions and never from those of nearly equal numbers.

// A triangle of a lamp is three rows of `lights`; w of the first is the share of the lamp's area up to and with it.
const CORNER_ROWS = 3u;

// A lamp as a point sees it.
struct LampView {
    // Whether its light reaches the point.
    lit: bool,
    by_solid_angle: bool,
    solid_angle: f32,
    // Distance of the point from its plane, for lamps of several triangles.
    height: f32,
}

struct LampSample {
    wi: vec3f,
    distance: f32,
    pdf: f32,
    barycentrics: vec3f,
}

// A triangle of a lamp relative to a point.
struct Seen {
    a: vec3f,
    b: vec3f,
    c: vec3f,
    area: vec3f,
    solid_angle: f32,
}

fn triangle_seen(row: u32, point: vec3f) -> Seen {
    var s: Seen;
    s.a = lights[row].xyz - point;
    s.b = lights[row + 1u].xyz - point;
    s.c = lights[row + 2u].xyz - point;
    s.area = cross(lights[row + 1u].xyz - lights[row].xyz, lights[row + 2u].xyz - lights[row].xyz);
    // Van Oosterom and Strackee 1983.
    let l = vec3f(length(s.a), length(s.b), length(s.c));
    let volume = abs(dot(s.a, s.area));
    let rest = l.x * l.y * l.z + dot(s.a, s.b) * l.z + dot(s.b, s.c) * l.x + dot(s.c, s.a) * l.y;
    s.solid_angle = select(0.0, 2.0 * atan2_precise(volume, rest), min(min(l.x, l.y), l.z) > 0.0);
    return s;
}

fn lamp_view(e: Emitter, point: vec3f) -> LampView {
    var view = LampView(false, false, 0.0, 0.0);
    if e.kind == TRIANGLE {
        let seen = triangle_seen(e.corners, point);
        let height = -dot(seen.a, seen.area);
        view.lit = height != 0.0 && (height > 0.0 || e.two_sided) && seen.solid_angle > 0.0;
        view.solid_angle = seen.solid_angle;
        view.by_solid_angle = is_spherical(seen.solid_angle);
        return view;
    }
    // The middle vertex of a fan.
    let height = dot(point - lights[e.corners + 1u].xyz, e.normal);
    view.lit = height != 0.0 && (height > 0.0 || e.two_sided);
    view.height = abs(height);
    if length_squared(point - e.centre) < e.near * e.near {
        for (var i = 0u; i < e.count; i++) {
            view.solid_angle += triangle_seen(e.corners + CORNER_ROWS * i, point).solid_angle;
        }
        view.by_solid_angle = is_spherical(view.solid_angle);
    }
    return view;
}

fn is_spherical(solid_angle: f32) -> bool {
    return solid_angle >= MIN_SPHERICAL_SOLID_ANGLE && solid_angle <= MAX_SPHERICAL_SOLID_ANGLE;
}

// Density of `lamp_sample` per steradian, for a direction that meets the lamp.
fn lamp_pdf(e: Emitter, view: LampView, point: vec3f, wi: vec3f) -> f32 {
    if view.by_solid_angle {
        return 1.0 / view.solid_angle;
    }
    if e.kind == TRIANGLE {
        let a = lights[e.corners].xyz;
        let area = cross(lights[e.corners + 1u].xyz - a, lights[e.corners + 2u].xyz - a);
        let across = abs(dot(wi, area));
        if across <= 0.0 {
            return 0.0;
        }
        let distance = abs(dot(a - point, area) / across);
        return 2.0 * distance * distance / across;
    }
    let cosine = abs(dot(wi, e.normal));
    if cosine <= 0.0 {
        return 0.0;
    }
    let distance = view.height / cosine;
    return distance * distance / (cosine * e.area);
}

// A density of 0: there is none.
fn lamp_sample(e: Emitter, view: LampView, point: vec3f, u: vec2f) -> LampSample {
    var s = LampSample(vec3f(), 0.0, 0.0, vec3f());
    if view.by_solid_angle {
        // Which triangle: the first whose solid angle, with those before, is above the target.
        let target_ = u.x * view.solid_angle;
        var start = 0.0;
        var chosen = 0u;
        var seen = triangle_seen(e.corners, point);
        while start + seen.solid_angle <= target_ && chosen + 1u < e.count {
            start += seen.solid_angle;
            chosen += 1u;
            seen = triangle_seen(e.corners + CORNER_ROWS * chosen, point);
        }
        let within = clamp((target_ - start) / seen.solid_angle, 0.0, ONE_MINUS_EPSILON);
        s.wi = normalize(direction_in(seen, vec2f(select(within, u.x, e.kind == TRIANGLE), u.y)));
        s.distance = dot(seen.a, seen.area) / dot(s.wi, seen.area);
        s.pdf = 1.0 / view.solid_angle;
        let hit = s.wi * s.distance - seen.a;
        let norm = length_squared(seen.area);
        let wb = saturate(dot(cross(hit, seen.c - seen.a), seen.area) / norm);
        let wc = saturate(dot(cross(seen.b - seen.a, hit), seen.area) / norm);
        s.barycentrics = vec3f(max(1.0 - wb - wc, 0.0), wb, wc);
    } else {
        var to_light = vec3f();
        if e.kind == TRIANGLE {
            s.barycentrics = uniform_triangle(u);
            to_light = (lights[e.corners].xyz - point) * s.barycentrics.x
                + (lights[e.corners + 1u].xyz - point) * s.barycentrics.y
                + (lights[e.corners + 2u].xyz - point) * s.barycentrics.z;
        } else if e.is_parallelogram {
            to_light = e.corner + u.x * e.edge1 + u.y * e.edge2 - point;
        } else {
            var chosen = 0u;
            var start = 0.0;
            while chosen + 1u < e.count && lights[e.corners + CORNER_ROWS * chosen].w <= u.x {
                start = lights[e.corners + CORNER_ROWS * chosen].w;
                chosen += 1u;
            }
            let row = e.corners + CORNER_ROWS * chosen;
            let within = saturate((u.x - start) / (lights[row].w - start));
            let apex = lights[row + 1u].xyz;
            let far = mix(lights[row].xyz, lights[row + 2u].xyz, within);
            to_light = apex + sqrt(u.y) * (far - apex) - point;
        }
        s.distance = length(to_light);
        s.wi = to_light / s.distance;
        s.pdf = lamp_pdf(e, view, point, s.wi);
    }
    if !(s.distance > 0.0 && s.distance < INFINITE && s.pdf < INFINITE) {
        s.pdf = 0.0;
    }
    return s;
}

// A direction uniform over the spherical triangle (Arvo 1995): `u.x` cuts off a triangle of that share of the area, with
// the same vertices a and b; `u.y` places along the arc from its third vertex to b.
fn direction_in(seen: Seen, u: vec2f) -> vec3f {
    let a = normalize(seen.a);
    let b = normalize(seen.b);
    let c = normalize(seen.c);
    let ab = b - a;
    let ac = c - a;
    // The tangent of the arc ac at a.
    let tangent = normalize_or(ac - dot(ac, a) * a, vec3f());
    // The cut lies at the angle x from a towards c. By the formula of Van Oosterom and Strackee, with t = tan(x / 2), the
    // cut-off area A obeys tan(A / 2) ((1 + a.b) + (b.tangent) t) = |tangent . (a x b)| t.
    let half_area = 0.5 * u.x * seen.solid_angle;
    let across = abs(dot(tangent, cross(a, ab)));
    let n = sin(half_area) * (1.0 + dot(a, b));
    let d = cos(half_area) * across - sin(half_area) * dot(ab, tangent);
    let scale = 1.0 / max(n * n + d * d, MIN_POSITIVE);
    let cut = (d * d - n * n) * scale * a + 2.0 * n * d * scale * tangent;
    let way = cut - b;
    let one_minus_cos = 0.5 * length_squared(way);
    let z = 1.0 - u.y * one_minus_cos;
    let aside = way + one_minus_cos * b;
    return z * b + sqrt(u.y * (1.0 + z) / max(2.0 - one_minus_cos, MIN_POSITIVE)) * aside;
}
