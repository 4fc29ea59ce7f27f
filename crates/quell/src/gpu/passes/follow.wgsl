// What the trajectories of pixels say of their noise, one pixel an invocation.
@compute @workgroup_size(8, 8)
fn follow_pixels(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if contains(pixel) {
        let p = index_of(pixel);
        let found = followed(pixel);
        differences[p] = vec4f(found.mean, found.change);
        known[p] = vec4f(found.seen, found.outlier, silhouette(pixel));
    }
}
