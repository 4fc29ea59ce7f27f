// Twin of glass.rs: the transmitted lobe without Fresnel and tint.

// `wo` refracted at the normal `h` on its side; 0 beyond the critical angle.
fn refracted(wo: vec3f, h: vec3f, eta: f32) -> vec3f {
    let cos_o = dot(wo, h);
    let sin2_far = max(1.0 - cos_o * cos_o, 0.0) / (eta * eta);
    if sin2_far >= 1.0 || cos_o <= 0.0 {
        return vec3f();
    }
    let cos_far = sqrt(1.0 - sin2_far);
    return normalize(-wo / eta + (cos_o / eta - cos_far) * h);
}

// Value without Fresnel, tint and cosine; density; cosine between half vector and `wo`. A density of 0: no microfacet
// refracts `wo` to `wi`.
struct RoughTransmission {
    value: f32,
    pdf: f32,
    cos_half: f32,
}

fn glass_rough_transmission(alpha: f32, wo: vec3f, wi: vec3f, eta: f32) -> RoughTransmission {
    let none = RoughTransmission(0.0, 0.0, 0.0);
    if wo.z <= 0.0 || wi.z >= 0.0 {
        return none;
    }
    var h = normalize_or(wo + eta * wi, vec3f());
    h = select(h, -h, h.z < 0.0);
    let cos_o = dot(wo, h);
    let cos_i = dot(wi, h);
    if cos_o <= 0.0 || cos_i >= 0.0 {
        return none;
    }
    let spread = cos_i + cos_o / eta;
    let half_per_wi = -cos_i / (spread * spread);
    let pdf = ggx_visible_normal_pdf(alpha, wo, h) * half_per_wi;
    let masking = ggx_masking(alpha, wo.z, -wi.z);
    let value = ggx_distribution(alpha, h) * masking * cos_o * half_per_wi / (wo.z * -wi.z * eta * eta);
    if !(pdf < INFINITE && value < INFINITE) {
        return none;
    }
    return RoughTransmission(value, pdf, cos_o);
}
