// Twin of material.rs: what a surface is made of at a point.

struct Material {
    base_color: vec3f,
    metallic: f32,
    emission: vec3f,
    roughness: f32,
    attenuation_color: vec3f,
    // 0: the inside is clear.
    attenuation_distance: f32,
    specular_color: vec3f,
    specular: f32,
    transmission: f32,
    ior: f32,
    two_sided_emission: bool,
    thin_walled: bool,
}

fn is_transmissive_material(m: Material) -> bool {
    return TRANSMISSIVE && m.transmission > 0.0 && m.metallic < 1.0;
}

fn emitted(m: Material, front: bool) -> vec3f {
    return select(vec3f(), m.emission, front || m.two_sided_emission);
}

fn transmittance(m: Material, distance: f32) -> vec3f {
    if m.thin_walled || m.attenuation_distance <= 0.0 || distance <= 0.0 {
        return vec3f(1.0);
    }
    return pow(saturate(m.attenuation_color), vec3f(distance / m.attenuation_distance));
}
