// By what stage `stabilise` compares pixels, of the frame that is named as the window's centre.
@compute @workgroup_size(8, 8)
fn signatures(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if contains(pixel) {
        let here = frame_at(settings.centre);
        let found = signature(here, pixel);
        textureStore(signature_0, pixel, here.picture, found[0]);
        textureStore(signature_1, pixel, here.picture, found[1]);
        textureStore(signature_2, pixel, here.picture, found[2]);
        textureStore(signature_3, pixel, here.picture, found[3]);
    }
}
