// Stage `stabilise` of the sequence filter, one pixel an invocation; its statistics are those of a workgroup.
// There is none yet: the net reads no statistics of it.
fn steady_at(q: vec2i) -> vec3f {
    return picture_at(q);
}

fn signature_at(there: WindowFrame, q: vec2i) -> array<vec4f, 4> {
    return array<vec4f, 4>(
        textureLoad(signature_0, q, there.picture, 0),
        textureLoad(signature_1, q, there.picture, 0),
        textureLoad(signature_2, q, there.picture, 0),
        textureLoad(signature_3, q, there.picture, 0),
    );
}

@compute @workgroup_size(8, 8)
fn stabilise(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let pixel = vec2i(id.xy);
    let noise = means(NOISE_VALUES, pixel, local.xy, NOISE_NEAR, NOISE_WIDE);
    let apart = means(APART_VALUES, pixel, local.xy, DIFFERENCES_NEAR, DIFFERENCES_WIDE);
    let detail = means(DETAIL_VALUES, pixel, local.xy, DIFFERENCES_NEAR, DIFFERENCES_NEAR);
    let wavelet = means(WAVELET_MEAN, pixel, local.xy, NOISE_NEAR, NOISE_NEAR);
    let time = means(TIME_MEAN, pixel, local.xy, NOISE_NEAR, NOISE_NEAR);
    if !contains(pixel) {
        return;
    }
    var p: Pooled;
    p.over_time = vec2f(noise[0].x, noise[1].x);
    p.seen = vec2f(noise[0].y, noise[1].y);
    p.over_space = vec2f(noise[0].z, noise[1].z);
    p.input = vec2f(noise[0].w, noise[1].w);
    p.apart_near = apart[0].xyz;
    p.apart_wide = apart[1].xyz;
    p.detail = detail[0].xy;
    p.mean = vec3f(squared(wavelet[0].xyz), squared(wavelet[0].xyz), squared(time[0].xyz));
    p.silhouette = known_at(pixel).w;
    steady[index_of(pixel)] = stabilised(pixel, p, 1.0 / brightness_at(pixel));
}
