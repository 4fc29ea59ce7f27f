// Twin of pattern.rs: what code paints over a surface.

fn apply_pattern(p: Pattern, m: ptr<function, Material>, uv: vec2f, local: vec3f) {
    let color = p.colors[0].xyz;
    let cells = p.numbers.xy;
    switch p.kind {
        case CHECKER: {
            let cell = floor(uv * cells);
            if remainder_of(cell.x + cell.y, 2.0) >= 1.0 {
                (*m).base_color = color;
            }
        }
        case TILES: {
            var at = uv * cells;
            at.x += p.colors[2].w * remainder_of(floor(at.y), 2.0);
            let cell = floor(at);
            let inside = at - cell;
            let width = vec2f(p.colors[0].w, p.colors[0].w * cells.y / cells.x);
            if inside.x < width.x || inside.y < width.y {
                (*m).base_color = color;
                (*m).roughness = max((*m).roughness, 0.7);
            } else {
                let h = lattice_hash(vec3f(cell, 7.0));
                (*m).base_color = min((*m).base_color * (1.0 + p.colors[1].w * (h - 0.5)), vec3f(0.95));
                (*m).roughness = saturate((*m).roughness * (0.9 + 0.2 * lattice_hash(vec3f(cell, 3.0))));
            }
        }
        case STRIPES: {
            let phase = remainder_of(uv.x * p.colors[0].w, 1.0);
            let s = smoothstep(0.23, 0.27, phase) - smoothstep(0.73, 0.77, phase);
            (*m).base_color = mix((*m).base_color, color, s);
        }
        case WOOD: {
            let grain = wood(local, p.colors[0].w);
            (*m).base_color = mix((*m).base_color, color, grain);
            (*m).roughness = min((*m).roughness + 0.12 * grain, 1.0);
        }
        case MARBLE: {
            let at = local * p.colors[0].w;
            let turbulence = fbm(at * 1.7, 5u);
            let wave = abs(sin((at.x + 0.6 * at.y + 0.8 * at.z) * 2.0 + 4.0 * turbulence));
            let trough = (1.0 - wave) * (1.0 - wave);
            let s = trough * trough * trough + 0.25 * fbm(at * 4.0 + 9.0, 3u);
            (*m).base_color = mix((*m).base_color, color, saturate(s));
        }
        case MOTTLED: {
            let s = smoothstep(0.35, 0.65, fbm(local * p.colors[0].w, 4u));
            (*m).base_color = mix((*m).base_color, color, s);
        }
        case PLANKS: {
            let at = uv * cells;
            let board = floor(at.x);
            let along = at.y + lattice_hash(vec3f(board, 1.0, 5.0));
            let cell = vec2f(board, floor(along));
            let inside = vec2f(at.x - board, along - cell.y);
            let tone = lattice_hash(vec3f(cell, 11.0));
            let grain_at = vec3f(inside.x * 0.25, tone * 40.0, along * 0.6 * cells.x / cells.y);
            let grain = 0.55 * wood(grain_at, 9.0);
            (*m).base_color = mix((*m).base_color, color, grain) * (0.72 + 0.5 * tone);
            (*m).roughness = saturate((*m).roughness * (0.85 + 0.3 * tone) + 0.06 * grain);
            let gap = vec2f(0.012, 0.012 * cells.y / cells.x);
            if inside.x < gap.x || inside.y < gap.y {
                (*m).base_color = color * 0.35;
            }
        }
        case PICTURE: {
            let seed = p.numbers.z;
            let tone = lattice_hash(vec3f(floor(uv.x * 5.0), seed, 2.0));
            if uv.y < 0.25 + 0.3 * tone {
                (*m).base_color = picture_color(p, u32(tone * 3.0) % 3u);
            }
            for (var k = 0u; k < 4u; k++) {
                let key = vec2f(f32(k), seed);
                let centre = vec2f(0.2 + 0.6 * lattice_hash(vec3f(key, 13.0)), 0.3 + 0.5 * lattice_hash(vec3f(key, 17.0)));
                if length(uv - centre) < 0.05 + 0.16 * lattice_hash(vec3f(key, 19.0)) {
                    (*m).base_color = picture_color(p, k % 3u) * (0.6 + 0.4 * lattice_hash(vec3f(key, 23.0)));
                }
            }
        }
        default: {}
    }
}

fn picture_color(p: Pattern, k: u32) -> vec3f {
    return select(select(p.colors[2].xyz, p.colors[1].xyz, k == 1u), p.colors[0].xyz, k == 0u);
}

fn remainder_of(x: f32, by: f32) -> f32 {
    return x - by * floor(x / by);
}

// Grain of wood in 0..1: 1 is late wood.
fn wood(p: vec3f, rings: f32) -> f32 {
    let bend = vec3f(fbm(p * vec3f(1.5, 1.5, 0.4), 2u), fbm(p.yzx * 1.3, 2u), 0.0) * 0.5;
    let q = p + bend;
    let ring = remainder_of(sqrt(q.x * q.x + q.y * q.y) * rings, 1.0);
    let fibre = value_noise(p * vec3f(60.0, 60.0, 2.5));
    return saturate(0.75 * smoothstep(0.3, 0.9, ring) * (1.0 - smoothstep(0.92, 1.0, ring)) + 0.35 * fibre);
}

fn lattice_hash(p: vec3f) -> f32 {
    let cell = bitcast<vec3u>(vec3i(p));
    var h = (cell.x * 0x8da6b343u) ^ (cell.y * 0xd8163841u) ^ (cell.z * 0xcb1ab31fu);
    h ^= h >> 16u;
    h *= 0x7feb352du;
    h ^= h >> 15u;
    h *= 0x846ca68bu;
    h ^= h >> 16u;
    return f32(h >> 8u) / 16777216.0;
}

fn value_noise(p: vec3f) -> f32 {
    let cell = floor(p);
    var f = p - cell;
    f = f * f * (3.0 - 2.0 * f);
    var planes = vec2f();
    for (var z = 0u; z < 2u; z++) {
        var rows = vec2f();
        for (var y = 0u; y < 2u; y++) {
            let at = cell + vec3f(0.0, f32(y), f32(z));
            let a = lattice_hash(at);
            rows[y] = a + (lattice_hash(at + vec3f(1.0, 0.0, 0.0)) - a) * f.x;
        }
        planes[z] = rows.x + (rows.y - rows.x) * f.y;
    }
    return planes.x + (planes.y - planes.x) * f.z;
}

fn fbm(start: vec3f, octaves: u32) -> f32 {
    var sum = 0.0;
    var amplitude = 1.0;
    var total = 0.0;
    var p = start;
    for (var i = 0u; i < octaves; i++) {
        sum += amplitude * value_noise(p);
        total += amplitude;
        amplitude *= 0.5;
        p = p * 2.03 + vec3f(5.3, 1.7, 9.1);
    }
    return sum / total;
}
