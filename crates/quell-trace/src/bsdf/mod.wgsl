// Twin of mod.rs: a surface point seen from one direction.

struct Bsdf {
    tangent: vec3f,
    bitangent: vec3f,
    normal: vec3f,
    geometric_normal: vec3f,
    wo: vec3f,
    wo_local: vec3f,
    alpha: f32,
    reflection_reach: f32,
    fresnel: Fresnel,
    fresnel_mirror: vec3f,
    matte_albedo: vec3f,
    transmission_tint: vec3f,
    eta: f32,
    thin_walled: bool,
    smooth_: bool,
    matte_probability: f32,
}

// A direction of the glossy lobe; a density of 0: there is none.
struct GlossySample {
    wi: vec3f,
    weight: f32,
    pdf: f32,
    delta: bool,
}

// A direction through the surface; a density of 0: there is none.
struct TransmissionSample {
    wi: vec3f,
    weight: vec3f,
    pdf: f32,
    delta: bool,
}

// A direction of all lobes together; a density of 0: absorbed.
struct BsdfSample {
    wi: vec3f,
    value_times_cos_over_pdf: vec3f,
    pdf: f32,
    delta: bool,
    transmitted: bool,
    lobe_roughness: f32,
}

const ABSORBED = BsdfSample(vec3f(), vec3f(), 0.0, false, false, 0.0);

fn bsdf_new(
    m: Material, shading_normal: vec3f, true_normal: vec3f, towards_viewer: vec3f, inside: bool,
) -> Bsdf {
    var b: Bsdf;
    b.wo = normalize_or(towards_viewer, vec3f(0.0, 0.0, 1.0));
    let ng = normalize_or(true_normal, b.wo);
    b.geometric_normal = select(ng, -ng, dot(ng, b.wo) < 0.0);
    b.normal = viewer_side_normal(shading_normal, b.geometric_normal, b.wo);
    let pair = orthonormal_pair(b.normal);
    b.tangent = pair[0];
    b.bitangent = pair[1];
    let local = bsdf_local(b, b.wo);
    b.wo_local = normalize(vec3f(local.xy, max(local.z, MIN_VIEW_COS)));

    let base_color = saturate(m.base_color);
    let metallic = saturate(m.metallic);
    let transmission = select(0.0, saturate(m.transmission), TRANSMISSIVE);
    let roughness = saturate(m.roughness);
    let specular = saturate(m.specular);
    let ior = select(1.0, min(m.ior, MAX_IOR), m.ior > 1.0);
    b.eta = 1.0;
    if transmission > 0.0 && metallic < 1.0 && !m.thin_walled {
        b.eta = select(ior, 1.0 / ior, inside);
    }
    let r = (ior - 1.0) / (ior + 1.0);
    let reflectance = select(r * r, 1.0, m.ior == 0.0);
    let dielectric_f0 = saturate(reflectance * m.specular_color) * specular;
    let f0 = dielectric_f0 + (base_color - dielectric_f0) * metallic;
    let f90 = vec3f(specular + (1.0 - specular) * metallic);
    b.fresnel = fresnel_new(f0, f90, b.eta, roughness);
    b.fresnel_mirror = fresnel_at(b.fresnel, b.wo_local.z);
    b.smooth_ = roughness < MIRROR_ROUGHNESS;
    b.matte_albedo = base_color * (1.0 - metallic) * (1.0 - transmission);
    b.transmission_tint = base_color * (1.0 - metallic) * transmission;
    b.alpha = max(roughness * roughness, MIRROR_ROUGHNESS * MIRROR_ROUGHNESS);
    b.reflection_reach = ggx_reflection_reach(b.alpha, b.wo_local);
    b.thin_walled = m.thin_walled;
    b.matte_probability = choose_matte_probability(b);
    return b;
}

fn viewer_side_normal(shading: vec3f, geometric: vec3f, wo: vec3f) -> vec3f {
    var n = normalize_or(shading, geometric);
    n = select(n, -n, dot(n, geometric) < 0.0);
    let cosine = dot(n, wo);
    if cosine >= MIN_VIEW_COS {
        return n;
    }
    return normalize_or(n + wo * (MIN_VIEW_COS - cosine), geometric);
}

fn choose_matte_probability(b: Bsdf) -> f32 {
    let full = channel_mean(b.matte_albedo);
    if full <= 0.0 {
        return 0.0;
    }
    let typical_half_cos = sqrt(0.5 * (1.0 + b.wo_local.z));
    let passed = 1.0 - fresnel_at(b.fresnel, typical_half_cos);
    let matte = max(channel_mean(b.matte_albedo * passed * passed), MIN_LOBE_SHARE * full);
    let reflected = channel_mean(b.fresnel_mirror);
    let transmitted = channel_mean(b.transmission_tint * (1.0 - b.fresnel_mirror));
    let interface_ = max(reflected + transmitted, MIN_LOBE_SHARE);
    return matte / (matte + interface_);
}

fn bsdf_local(b: Bsdf, w: vec3f) -> vec3f {
    return vec3f(dot(w, b.tangent), dot(w, b.bitangent), dot(w, b.normal));
}

fn bsdf_world(b: Bsdf, w: vec3f) -> vec3f {
    return w.x * b.tangent + w.y * b.bitangent + w.z * b.normal;
}

fn bsdf_abs_cos(b: Bsdf, wi: vec3f) -> f32 {
    return abs(dot(b.normal, wi));
}

fn bsdf_mirror_direction(b: Bsdf) -> vec3f {
    return bsdf_world(b, mirror(b.wo_local, vec3f(0.0, 0.0, 1.0)));
}

fn bsdf_is_transmissive(b: Bsdf) -> bool {
    return TRANSMISSIVE && max_element(b.transmission_tint) > 0.0;
}

fn bsdf_is_delta_only(b: Bsdf) -> bool {
    return b.smooth_ && max_element(b.matte_albedo) <= 0.0;
}

fn bsdf_is_transmission_delta(b: Bsdf) -> bool {
    return b.smooth_ || (!b.thin_walled && abs(b.eta - 1.0) < STRAIGHT_ETA);
}

fn bsdf_is_above(b: Bsdf, wi: vec3f) -> bool {
    return dot(b.normal, wi) > 0.0 && dot(b.geometric_normal, wi) > 0.0;
}

fn bsdf_is_below(b: Bsdf, wi: vec3f) -> bool {
    return dot(b.normal, wi) < 0.0 && dot(b.geometric_normal, wi) < 0.0;
}

fn bsdf_half_cos(b: Bsdf, wi_local: vec3f) -> f32 {
    return 0.5 * length(b.wo_local + wi_local);
}

// The factored lobes of the primary surface.

fn bsdf_matte(b: Bsdf, wi: vec3f) -> vec3f {
    if !bsdf_is_above(b, wi) {
        return vec3f();
    }
    let passed = 1.0 - fresnel_at(b.fresnel, bsdf_half_cos(b, bsdf_local(b, wi)));
    return passed * passed * b.matte_albedo * (1.0 / PI);
}

fn bsdf_glossy(b: Bsdf, wi: vec3f) -> vec3f {
    if b.smooth_ || !bsdf_is_above(b, wi) {
        return vec3f();
    }
    let local = bsdf_local(b, wi);
    return ggx_lobe(b.alpha, b.wo_local, local) * fresnel_at(b.fresnel, bsdf_half_cos(b, local));
}

fn bsdf_sample_matte(b: Bsdf, u: vec2f) -> vec3f {
    return bsdf_world(b, cosine_hemisphere(u));
}

fn bsdf_matte_pdf(b: Bsdf, wi: vec3f) -> f32 {
    return cosine_hemisphere_pdf(dot(wi, b.normal));
}

fn bsdf_sample_glossy(b: Bsdf, u: vec2f) -> GlossySample {
    let none = GlossySample(vec3f(), 0.0, 0.0, false);
    if b.smooth_ {
        let wi = bsdf_mirror_direction(b);
        if !bsdf_is_above(b, wi) {
            return none;
        }
        return GlossySample(wi, 1.0, 1.0, true);
    }
    let h = ggx_sample_normal(b.alpha, b.wo_local, u, b.reflection_reach);
    let local = mirror(b.wo_local, h);
    let wi = bsdf_world(b, local);
    if local.z <= 0.0 || !bsdf_is_above(b, wi) {
        return none;
    }
    let pdf = ggx_reflection_pdf(b.alpha, b.wo_local, local, b.reflection_reach);
    let weight = min(ggx_reflection_weight(b.alpha, b.wo_local, local, b.reflection_reach), 1.0);
    return GlossySample(wi, weight, pdf, false);
}

fn bsdf_glossy_pdf(b: Bsdf, wi: vec3f) -> f32 {
    if b.smooth_ {
        return 0.0;
    }
    return ggx_reflection_pdf(b.alpha, b.wo_local, bsdf_local(b, wi), b.reflection_reach);
}

// What multiplies M: the estimators differ in the direction at which Fresnel is taken.
fn bsdf_matte_weight(b: Bsdf) -> vec3f {
    let fresnel = select(b.fresnel_mirror, fresnel_at(b.fresnel, 1.0), frame.exact != 0u);
    let passed = 1.0 - min(fresnel, vec3f(MATTE_FRESNEL_CAP));
    return passed * passed * b.matte_albedo;
}

fn bsdf_glossy_weight(b: Bsdf) -> vec3f {
    return max(b.fresnel_mirror, vec3f(GLOSSY_FRESNEL_FLOOR));
}

fn bsdf_exact_matte_ratio(b: Bsdf, wi: vec3f) -> vec3f {
    if !bsdf_is_above(b, wi) {
        return vec3f();
    }
    let passed_at_normal = 1.0 - min(fresnel_at(b.fresnel, 1.0), vec3f(MATTE_FRESNEL_CAP));
    let ratio = (1.0 - fresnel_at(b.fresnel, bsdf_half_cos(b, bsdf_local(b, wi)))) / passed_at_normal;
    return ratio * ratio;
}

fn bsdf_exact_glossy_ratio(b: Bsdf, wi: vec3f) -> vec3f {
    if !bsdf_is_above(b, wi) {
        return vec3f();
    }
    var fresnel = b.fresnel_mirror;
    if !b.smooth_ {
        fresnel = fresnel_at(b.fresnel, bsdf_half_cos(b, bsdf_local(b, wi)));
    }
    return fresnel / bsdf_glossy_weight(b);
}

// Transmission.

fn bsdf_sample_transmission(b: Bsdf, u: vec2f) -> TransmissionSample {
    let none = TransmissionSample(vec3f(), vec3f(), 0.0, false);
    if !bsdf_is_transmissive(b) {
        return none;
    }
    if bsdf_is_transmission_delta(b) {
        return bsdf_delta_transmission(b);
    }
    let local = bsdf_transmitted_at(b, ggx_sample_normal(b.alpha, b.wo_local, u, 1.0));
    if local.z >= 0.0 {
        return none;
    }
    let wi = bsdf_world(b, local);
    let rough = bsdf_rough_transmission_terms(b, wi);
    if rough.pdf <= 0.0 {
        return none;
    }
    return TransmissionSample(wi, bsdf_rough_value(b, rough) * (abs(local.z) / rough.pdf), rough.pdf, false);
}

fn bsdf_delta_transmission(b: Bsdf) -> TransmissionSample {
    var wi = -b.wo;
    var scale = 1.0;
    if !(b.thin_walled || abs(b.eta - 1.0) < STRAIGHT_ETA) {
        wi = bsdf_world(b, refracted(b.wo_local, vec3f(0.0, 0.0, 1.0), b.eta));
        scale = 1.0 / (b.eta * b.eta);
    }
    let weight = b.transmission_tint * (1.0 - b.fresnel_mirror) * scale;
    return TransmissionSample(wi, weight, select(0.0, 1.0, bsdf_is_below(b, wi)), true);
}

// The local direction in which a microfacet lets `wo` through; z is not negative where it does not.
fn bsdf_transmitted_at(b: Bsdf, h: vec3f) -> vec3f {
    if b.thin_walled {
        let mirrored = mirror(b.wo_local, h);
        return vec3f(mirrored.xy, -mirrored.z);
    }
    return refracted(b.wo_local, h, b.eta);
}

fn bsdf_rough_value(b: Bsdf, rough: RoughTransmission) -> vec3f {
    return b.transmission_tint * (1.0 - fresnel_at(b.fresnel, rough.cos_half)) * rough.value;
}

fn bsdf_rough_transmission_terms(b: Bsdf, wi: vec3f) -> RoughTransmission {
    if !bsdf_is_below(b, wi) {
        return RoughTransmission(0.0, 0.0, 0.0);
    }
    let local = bsdf_local(b, wi);
    if b.thin_walled {
        let mirrored = vec3f(local.xy, -local.z);
        let value = ggx_lobe(b.alpha, b.wo_local, mirrored);
        let pdf = ggx_reflection_pdf(b.alpha, b.wo_local, mirrored, 1.0);
        return RoughTransmission(value, pdf, bsdf_half_cos(b, mirrored));
    }
    return glass_rough_transmission(b.alpha, b.wo_local, local, b.eta);
}

// All lobes together, for later vertices.

struct BsdfValue {
    value: vec3f,
    pdf: f32,
}

// Value of all lobes that are not delta, without the cosine, and the density with which they are sampled.
fn bsdf_eval(b: Bsdf, wi: vec3f) -> BsdfValue {
    let interface_ = 1.0 - b.matte_probability;
    if dot(b.normal, wi) > 0.0 {
        let local = bsdf_local(b, wi);
        var pdf = b.matte_probability * cosine_hemisphere_pdf(local.z);
        if !b.smooth_ {
            let reflection = bsdf_reflection_probability(b, bsdf_half_cos(b, local));
            pdf += interface_ * reflection * ggx_reflection_pdf(b.alpha, b.wo_local, local, bsdf_interface_reach(b));
        }
        return BsdfValue(bsdf_matte(b, wi) + bsdf_glossy(b, wi), pdf);
    }
    if !bsdf_is_transmissive(b) || bsdf_is_transmission_delta(b) {
        return BsdfValue(vec3f(), 0.0);
    }
    let rough = bsdf_rough_transmission_terms(b, wi);
    let transmission = 1.0 - bsdf_reflection_probability(b, rough.cos_half);
    return BsdfValue(bsdf_rough_value(b, rough), interface_ * transmission * rough.pdf);
}

fn bsdf_interface_reach(b: Bsdf) -> f32 {
    return select(b.reflection_reach, 1.0, bsdf_is_transmissive(b));
}

fn bsdf_reflection_probability(b: Bsdf, cos_half: f32) -> f32 {
    if !bsdf_is_transmissive(b) {
        return 1.0;
    }
    let straight = bsdf_is_transmission_delta(b) && !b.smooth_;
    let fresnel = select(fresnel_at(b.fresnel, cos_half), b.fresnel_mirror, straight);
    let reflected = channel_mean(fresnel);
    let transmitted = channel_mean(b.transmission_tint * (1.0 - fresnel));
    let share = select(1.0, reflected / (reflected + transmitted), reflected + transmitted > 0.0);
    return select(share, clamp(share, MIN_LOBE_SHARE, 1.0 - MIN_LOBE_SHARE), straight);
}

fn bsdf_sample_full(b: Bsdf, u: vec3f) -> BsdfSample {
    var lobe_roughness = 1.0;
    var wi = vec3f();
    if u.x < b.matte_probability {
        wi = bsdf_sample_matte(b, u.yz);
    } else {
        let interface_ = 1.0 - b.matte_probability;
        let choice = (u.x - b.matte_probability) / interface_;
        lobe_roughness = select(sqrt(b.alpha), 0.0, b.smooth_);
        var h = vec3f(0.0, 0.0, 1.0);
        if !b.smooth_ {
            h = ggx_sample_normal(b.alpha, b.wo_local, u.yz, bsdf_interface_reach(b));
        }
        let reflection = bsdf_reflection_probability(b, dot(b.wo_local, h));
        if choice < reflection {
            if b.smooth_ {
                wi = bsdf_mirror_direction(b);
                let pdf = interface_ * reflection;
                if !bsdf_is_above(b, wi) {
                    return ABSORBED;
                }
                return BsdfSample(wi, b.fresnel_mirror / pdf, pdf, true, false, lobe_roughness);
            }
            let local = mirror(b.wo_local, h);
            if local.z <= 0.0 {
                return ABSORBED;
            }
            wi = bsdf_world(b, local);
        } else if bsdf_is_transmission_delta(b) {
            let through = bsdf_delta_transmission(b);
            let pdf = interface_ * (1.0 - reflection) * through.pdf;
            if pdf <= 0.0 {
                return ABSORBED;
            }
            return BsdfSample(through.wi, through.weight / pdf, pdf, true, true, lobe_roughness);
        } else {
            let local = bsdf_transmitted_at(b, h);
            if local.z >= 0.0 {
                return ABSORBED;
            }
            wi = bsdf_world(b, local);
        }
    }
    let at = bsdf_eval(b, wi);
    if !(at.pdf > 0.0 && at.pdf < INFINITE) || max_element(at.value) <= 0.0 {
        return ABSORBED;
    }
    let cosine = dot(b.normal, wi);
    return BsdfSample(wi, at.value * (abs(cosine) / at.pdf), at.pdf, false, cosine < 0.0, lobe_roughness);
}
