// Debug views of the sequence filter: what its buffers hold, as colours for a display. `SequenceView` says what each shows.

fn count_colour(count: f32) -> vec3f {
    return heat(log2(max(count, 1.0)) / 6.0);
}

fn normal_colour(normal: vec3f) -> vec3f {
    return select(NOWHERE, 0.5 + 0.5 * normal, any(normal != vec3f(0.0)));
}

fn view_colour(p: u32) -> vec3f {
    let v = plane[p];
    switch debug.view {
        case SHOWS_LIGHT: {
            return shown_light(v.xyz);
        }
        case SHOWS_DEVIATION: {
            let deviation = sqrt(max(v.w, 0.0)) * debug.scale;
            let mean = max(luminance(v.xyz), 0.0);
            return heat(select(0.0, deviation / (deviation + mean), deviation > 0.0));
        }
        case SHOWS_COUNT: {
            return count_colour(v[debug.place]);
        }
        case SHOWS_SAMPLES: {
            return count_colour(numbers[p]);
        }
        case SHOWS_DEPTH: {
            return select(NOWHERE, vec3f(0.15 + 0.85 * fract(-log2(v.z))), v.z > 0.0);
        }
        case SHOWS_NOISE: {
            return clamp(vec3f(v.w, second[p].w, 0.0) * debug.scale * 10.0, vec3f(0.0), vec3f(1.0));
        }
        case SHOWS_COLOUR: {
            return encoded(0.5 * (v.xyz - vec3f(DIVIDED * v.w, 0.0, 0.0)));
        }
        default: {
            return normal_colour(v.xyz);
        }
    }
}

@compute @workgroup_size(8, 8)
fn show_sequence(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if all(pixel < vec2i(debug.size)) {
        let p = u32(pixel.y) * debug.size.x + u32(pixel.x);
        textureStore(target_texture, pixel, vec4f(view_colour(p), 1.0));
    }
}
