// Twin of fresnel.rs: reflectance by Schlick's approximation.

struct Fresnel {
    f0: vec3f,
    rise: vec3f,
    eta: f32,
}

fn fresnel_new(f0: vec3f, f90: vec3f, eta: f32, roughness: f32) -> Fresnel {
    var damping = 1.0;
    if frame.fresnel_rough_damping != 0u {
        let s = (1.0 - roughness) * (1.0 - roughness);
        damping = s * s * s * s * s;
    }
    return Fresnel(f0, max(f90 - f0, vec3f()) * saturate(frame.fresnel_strength) * damping, eta);
}

fn fresnel_at(f: Fresnel, cosine: f32) -> vec3f {
    var c = saturate(cosine);
    if f.eta < 1.0 {
        let sin2_far = (1.0 - c * c) / (f.eta * f.eta);
        if sin2_far >= 1.0 {
            return vec3f(1.0);
        }
        c = sqrt(1.0 - sin2_far);
    }
    let grazing = 1.0 - c;
    let grazing2 = grazing * grazing;
    return f.f0 + f.rise * (grazing2 * grazing2 * grazing);
}
