// Twin of mod.rs: the last stage.

// One term of the sum, where there is one.
fn composite_term(sum: vec3f, signal: vec3f, weight: vec3f, there: u32) -> vec3f {
    if there == 0u {
        return sum;
    }
    return sum + weight * signal;
}
