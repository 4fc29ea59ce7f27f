// The sum, one pixel an invocation. Terms and weights that the frame lacks may be bound to anything: they do not count.
@group(0) @binding(2) var<storage, read> direct: array<vec4f>;
@group(0) @binding(3) var<storage, read> matte: array<vec4f>;
@group(0) @binding(4) var<storage, read> glossy: array<vec4f>;
@group(0) @binding(5) var<storage, read> direct_matte: array<vec4f>;
@group(0) @binding(6) var<storage, read> direct_glossy: array<vec4f>;
@group(0) @binding(7) var<storage, read> matte_weight: array<vec4f>;
@group(0) @binding(8) var<storage, read> glossy_weight: array<vec4f>;
@group(0) @binding(9) var<storage, read_write> output: array<vec4f>;

@compute @workgroup_size(8, 8)
fn composite(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2i(id.xy);
    if !contains(pixel) {
        return;
    }
    let i = index_of(pixel);
    let terms = settings.composite;
    let on_matte = select(vec3f(1.0), matte_weight[i].xyz, terms.matte_weight != 0u);
    let on_glossy = select(vec3f(1.0), glossy_weight[i].xyz, terms.glossy_weight != 0u);
    var sum = direct[i].xyz;
    sum = composite_term(sum, matte[i].xyz, on_matte, terms.matte);
    sum = composite_term(sum, glossy[i].xyz, on_glossy, terms.glossy);
    sum = composite_term(sum, direct_matte[i].xyz, on_matte, terms.direct_matte);
    sum = composite_term(sum, direct_glossy[i].xyz, on_glossy, terms.direct_glossy);
    output[i] = vec4f(sum, 0.0);
}
