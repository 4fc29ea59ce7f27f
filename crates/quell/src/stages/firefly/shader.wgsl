// Twin of reference.rs: stage 6.
//
// The pass supplies `firefly_input` and `firefly_is_surface`.
//
// The nine colours have names: an array that a loop indexes lies in memory on a GPU, not in registers.

// Of the 3x3 pixels around one, in reading order.
struct FireflyNine {
    a: vec3f,
    b: vec3f,
    c: vec3f,
    d: vec3f,
    e: vec3f,
    f: vec3f,
    g: vec3f,
    h: vec3f,
    i: vec3f,
}

// Pixel k of the 3x3 around a surface; the surface itself in place of what is none.
fn firefly_neighbour(pixel: vec2i, k: u32) -> vec2i {
    let q = pixel + vec2i(i32(k % 3u), i32(k / 3u)) - 1;
    var chosen = pixel;
    if contains(q) {
        chosen = select(pixel, q, firefly_is_surface(q));
    }
    return chosen;
}

// Its colour, or in all three channels its luminance: what the median is taken of.
fn firefly_value(pixel: vec2i) -> vec3f {
    let colour = firefly_input(pixel);
    return select(colour, vec3f(luminance(colour)), settings.firefly.luminance != 0u);
}

fn firefly_values(pixel: vec2i) -> FireflyNine {
    return FireflyNine(
        firefly_value(firefly_neighbour(pixel, 0u)),
        firefly_value(firefly_neighbour(pixel, 1u)),
        firefly_value(firefly_neighbour(pixel, 2u)),
        firefly_value(firefly_neighbour(pixel, 3u)),
        firefly_value(firefly_neighbour(pixel, 4u)),
        firefly_value(firefly_neighbour(pixel, 5u)),
        firefly_value(firefly_neighbour(pixel, 6u)),
        firefly_value(firefly_neighbour(pixel, 7u)),
        firefly_value(firefly_neighbour(pixel, 8u)),
    );
}

// The smaller value first, per channel.
fn firefly_order(a: ptr<function, vec3f>, b: ptr<function, vec3f>) {
    let least = min(*a, *b);
    *b = max(*a, *b);
    *a = least;
}

// The median of each channel, by 20 exchanges that drop the least and the largest of six, five, four and three values
// (McGuire 2008, "A Fast, Small-Radius GPU Median Filter").
fn firefly_median(values: FireflyNine) -> vec3f {
    var a = values.a;
    var b = values.b;
    var c = values.c;
    var d = values.d;
    var e = values.e;
    var f = values.f;
    var g = values.g;
    var h = values.h;
    var i = values.i;
    firefly_order(&a, &d);
    firefly_order(&b, &e);
    firefly_order(&c, &f);
    firefly_order(&a, &b);
    firefly_order(&a, &c);
    firefly_order(&e, &f);
    firefly_order(&d, &f);
    firefly_order(&b, &c);
    firefly_order(&d, &e);
    firefly_order(&b, &d);
    firefly_order(&b, &g);
    firefly_order(&e, &g);
    firefly_order(&c, &g);
    firefly_order(&c, &d);
    firefly_order(&e, &h);
    firefly_order(&c, &e);
    firefly_order(&d, &h);
    firefly_order(&e, &i);
    firefly_order(&d, &i);
    firefly_order(&d, &e);
    return e;
}

// Channels that take their median.
fn firefly_takes(own: vec3f, median: vec3f) -> vec3<bool> {
    return (own > settings.firefly.threshold * median) | vec3<bool>(settings.firefly.plain != 0u);
}

// Where the search for the median among the nine stands, per channel.
struct FireflySearch {
    // How many of the values that equal the median come before the one that is it.
    left: vec3u,
    // Which of the nine it is.
    found: vec3u,
}

fn firefly_search(so_far: FireflySearch, k: u32, value: vec3f, median: vec3f) -> FireflySearch {
    let is_equal = value == median;
    let found = select(so_far.found, vec3u(k), is_equal & (so_far.left == vec3u(0u)));
    return FireflySearch(so_far.left - vec3u(is_equal), found);
}

// Which of the nine is the median of each channel; of equal values the first in reading order has the lowest rank.
fn firefly_middle(n: FireflyNine, m: vec3f) -> vec3u {
    let less = vec3u(n.a < m) + vec3u(n.b < m) + vec3u(n.c < m) + vec3u(n.d < m) + vec3u(n.e < m) + vec3u(n.f < m)
        + vec3u(n.g < m) + vec3u(n.h < m) + vec3u(n.i < m);
    var search = FireflySearch(FIREFLY_MIDDLE - less, vec3u(FIREFLY_MIDDLE));
    search = firefly_search(search, 0u, n.a, m);
    search = firefly_search(search, 1u, n.b, m);
    search = firefly_search(search, 2u, n.c, m);
    search = firefly_search(search, 3u, n.d, m);
    search = firefly_search(search, 4u, n.e, m);
    search = firefly_search(search, 5u, n.f, m);
    search = firefly_search(search, 6u, n.g, m);
    search = firefly_search(search, 7u, n.h, m);
    search = firefly_search(search, 8u, n.i, m);
    return search.found;
}

// The pixel that stage 6 takes for each channel.
fn firefly_choice(pixel: vec2i) -> array<vec2i, 3> {
    if !firefly_is_surface(pixel) {
        return array(pixel, pixel, pixel);
    }
    let values = firefly_values(pixel);
    let median = firefly_median(values);
    let takes = firefly_takes(firefly_value(pixel), median);
    let middle = firefly_middle(values, median);
    return array(
        select(pixel, firefly_neighbour(pixel, middle.x), takes.x),
        select(pixel, firefly_neighbour(pixel, middle.y), takes.y),
        select(pixel, firefly_neighbour(pixel, middle.z), takes.z),
    );
}

// Stage 6 at one pixel.
fn firefly(pixel: vec2i) -> vec3f {
    let own = firefly_input(pixel);
    if settings.firefly.luminance != 0u {
        return firefly_input(firefly_choice(pixel)[0]);
    }
    if !firefly_is_surface(pixel) {
        return own;
    }
    let median = firefly_median(firefly_values(pixel));
    return select(own, median, firefly_takes(own, median));
}
