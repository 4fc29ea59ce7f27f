// Twin of ggx.rs: the glossy lobe without Fresnel, in the local frame.

fn ggx_distribution(alpha: f32, h: vec3f) -> f32 {
    let sin2 = h.x * h.x + h.y * h.y;
    let a2 = alpha * alpha;
    let d = a2 * h.z * h.z + sin2;
    return a2 / (PI * d * d);
}

fn ggx_smith(alpha: f32, cosine: f32) -> f32 {
    let a2 = alpha * alpha;
    return sqrt(max(a2 + (1.0 - a2) * cosine * cosine, 0.0));
}

fn ggx_lobe(alpha: f32, wo: vec3f, wi: vec3f) -> f32 {
    if wi.z <= 0.0 || wo.z <= 0.0 {
        return 0.0;
    }
    let visibility = 0.5 / (wo.z * ggx_smith(alpha, wi.z) + wi.z * ggx_smith(alpha, wo.z));
    return ggx_distribution(alpha, normalize(wo + wi)) * visibility;
}

fn ggx_reflection_reach(alpha: f32, wo: vec3f) -> f32 {
    let a2 = alpha * alpha;
    let s = 1.0 + length(wo.xy);
    return (1.0 - a2) * s * s / (s * s + a2 * wo.z * wo.z);
}

fn ggx_reflection_pdf(alpha: f32, wo: vec3f, wi: vec3f, reach: f32) -> f32 {
    let h = wo + wi;
    if wo.z <= 0.0 || h.z <= 0.0 {
        return 0.0;
    }
    return ggx_distribution(alpha, normalize(h)) * 0.5 / (reach * wo.z + ggx_smith(alpha, wo.z));
}

fn ggx_reflection_weight(alpha: f32, wo: vec3f, wi: vec3f, reach: f32) -> f32 {
    if wi.z <= 0.0 || wo.z <= 0.0 {
        return 0.0;
    }
    let smith_o = ggx_smith(alpha, wo.z);
    return wi.z * (reach * wo.z + smith_o) / (wo.z * ggx_smith(alpha, wi.z) + wi.z * smith_o);
}

fn ggx_masking(alpha: f32, cos_o: f32, cos_i: f32) -> f32 {
    return 2.0 * cos_o * cos_i / (cos_o * ggx_smith(alpha, cos_i) + cos_i * ggx_smith(alpha, cos_o));
}

fn ggx_visible_normal_pdf(alpha: f32, wo: vec3f, h: vec3f) -> f32 {
    if h.z <= 0.0 {
        return 0.0;
    }
    return ggx_distribution(alpha, h) * max(dot(wo, h), 0.0) * 2.0 / (wo.z + ggx_smith(alpha, wo.z));
}

fn ggx_sample_normal(alpha: f32, wo: vec3f, u: vec2f, reach: f32) -> vec3f {
    let stretched = normalize(vec3f(alpha * wo.x, alpha * wo.y, wo.z));
    let phi = TAU * u.x;
    let lowest = reach * stretched.z;
    let z = (1.0 - u.y) * (1.0 + lowest) - lowest;
    let sine = sqrt(max(1.0 - z * z, 0.0));
    let h = vec3f(sine * cos(phi), sine * sin(phi), z) + stretched;
    return normalize_or(vec3f(alpha * h.x, alpha * h.y, max(h.z, 0.0)), vec3f(0.0, 0.0, 1.0));
}

fn mirror(wo: vec3f, h: vec3f) -> vec3f {
    return 2.0 * dot(wo, h) * h - wo;
}
