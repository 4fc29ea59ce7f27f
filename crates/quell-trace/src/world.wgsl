// Twin of world.rs: what a ray meets.

struct SurfacePoint {
    position: vec3f,
    geometric_normal: vec3f,
    shading_normal: vec3f,
    front: bool,
    material: Material,
    offset: f32,
    triangle: u32,
    instance: u32,
    barycentric: vec2f,
    cone: Cone,
}

fn ray_origin(point: SurfacePoint, direction: vec3f) -> vec3f {
    let side = select(-1.0, 1.0, dot(point.geometric_normal, direction) >= 0.0);
    return point.position + point.geometric_normal * (side * point.offset);
}

struct ShadowRay {
    origin: vec3f,
    direction: vec3f,
    distance: f32,
}

fn shadow_ray(point: SurfacePoint, direction: vec3f, distance: f32) -> ShadowRay {
    let origin = ray_origin(point, direction);
    if distance >= INFINITE {
        return ShadowRay(origin, direction, distance);
    }
    let to_light = point.position + direction * distance - origin;
    let l = length(to_light);
    return ShadowRay(origin, to_light / l, max(l - point.offset, 0.0));
}

// Which veils a ray of a stream meets.
fn veils_of(s: Sampler, direction: vec3f) -> Veils {
    if !HAS_COVERAGE {
        return Veils(false, vec2u());
    }
    return Veils(false, ray_seed(s, direction));
}

// Share of a point that a surface covers: below 1 only where it blends.
fn opacity_of(hit: Hit) -> f32 {
    if !HAS_COVERAGE || !has_flag(instances[triangles[hit.triangle].instance].flags, BLENDED) {
        return 1.0;
    }
    return spot_opacity(spot_new(hit.triangle, hit.barycentric));
}

fn plain_material(surface: u32) -> Material {
    var m: Material;
    m.base_color = surfaces[surface].base_color;
    m.metallic = surfaces[surface].metallic;
    m.emission = surfaces[surface].emission;
    m.roughness = surfaces[surface].roughness;
    m.attenuation_color = surfaces[surface].attenuation_color;
    m.attenuation_distance = surfaces[surface].attenuation_distance;
    m.specular_color = surfaces[surface].specular_color;
    m.specular = surfaces[surface].specular;
    m.transmission = surfaces[surface].transmission;
    m.ior = surfaces[surface].ior;
    m.two_sided_emission = has_flag(surfaces[surface].flags, TWO_SIDED_EMISSION);
    m.thin_walled = has_flag(surfaces[surface].flags, THIN_WALLED);
    return m;
}

fn between3(first: u32, corners: vec3u, weights: vec2f) -> vec3f {
    return attribute3(first, corners.x) * (1.0 - weights.x - weights.y) + attribute3(first, corners.y) * weights.x
        + attribute3(first, corners.z) * weights.y;
}

// What a ray met. `direction` is the ray's, `start` what it stands for where it starts.
fn surface_point(hit: Hit, direction: vec3f, start: Cone) -> SurfacePoint {
    var p: SurfacePoint;
    p.triangle = hit.triangle;
    p.barycentric = hit.barycentric;
    p.instance = triangles[hit.triangle].instance;
    p.cone = cone_at(start, hit.t);
    let inner_a = triangles[hit.triangle].a;
    let inner_b = triangles[hit.triangle].b;
    let inner_c = triangles[hit.triangle].c;
    let largest = max_element(max(max(abs(inner_a), abs(inner_b)), abs(inner_c)));
    p.offset = largest * OFFSET_SHARE * frame.world_from_inner;
    let a = inner_a * frame.world_from_inner;
    let b = inner_b * frame.world_from_inner;
    let c = inner_c * frame.world_from_inner;
    let weights = hit.barycentric;
    p.position = a * (1.0 - weights.x - weights.y) + b * weights.x + c * weights.y;
    let flags = instances[p.instance].flags;
    let handedness = select(1.0, -1.0, has_flag(flags, MIRRORED));
    p.geometric_normal = normalize(cross(b - a, c - a) * handedness);
    p.front = dot(p.geometric_normal, direction) < 0.0;
    let corners = corners_of(hit.triangle);
    p.shading_normal = p.geometric_normal;
    if instances[p.instance].normals != NONE {
        let mean = instances[p.instance].normal_matrix * between3(instances[p.instance].normals, corners, weights);
        let n = normalize_or(mean, p.geometric_normal);
        p.shading_normal = select(n, -n, dot(n, p.geometric_normal) < 0.0);
    }
    let surface = instances[p.instance].surface;
    p.material = plain_material(surface);
    if PAINTED && has_flag(flags, IS_PAINTED) {
        let spot = Spot(surface, p.instance, corners, weights);
        let footprint = footprint_new(p.cone, a, b, c, p.geometric_normal, direction);
        let painted = spot_paint(spot, p.material, footprint, p.cone);
        p.material = painted.material;
        if surfaces[surface].textures[NORMAL_TEXTURE].levels != NONE {
            let mapped = mapped_normal(spot, painted.mapped, p.shading_normal, a, b, c);
            let side = select(-1.0, 1.0, p.front);
            p.shading_normal = usable_normal(mapped * side, p.geometric_normal * side, -direction) * side;
        }
    }
    if PATTERNED && surfaces[surface].pattern.kind != PLAIN {
        var uv = vec2f();
        if instances[p.instance].uvs != NONE {
            let first = instances[p.instance].uvs;
            uv = attribute2(first, corners.x) * (1.0 - weights.x - weights.y) + attribute2(first, corners.y) * weights.x
                + attribute2(first, corners.z) * weights.y;
        }
        let local = between3(instances[p.instance].rest_positions, corners, weights);
        var material = p.material;
        apply_pattern(surfaces[surface].pattern, &material, uv, local);
        p.material = material;
    }
    p.material.emission *= instances[p.instance].emission_scale;
    return p;
}

// Where a point of a surface was one frame before.
fn previous_position(p: SurfacePoint) -> vec3f {
    if has_flag(instances[p.instance].flags, STILL) {
        return p.position;
    }
    let at = between3(instances[p.instance].previous_positions, corners_of(p.triangle), p.barycentric);
    return instances[p.instance].previous * vec4f(at, 1.0);
}

// A normal of a surface point, turned back to where it was one frame before: as the triangle turned.
fn previous_normal(p: SurfacePoint, normal: vec3f) -> vec3f {
    if has_flag(instances[p.instance].flags, STILL) {
        return normal;
    }
    let a = triangles[p.triangle].a * frame.world_from_inner;
    let u = triangles[p.triangle].b * frame.world_from_inner - a;
    let v = triangles[p.triangle].c * frame.world_from_inner - a;
    let n = normalize_or(cross(u, v), vec3f());
    let corners = corners_of(p.triangle);
    let first = instances[p.instance].previous_positions;
    let place = instances[p.instance].previous;
    let previous_a = place * vec4f(attribute3(first, corners.x), 1.0);
    let previous_u = place * vec4f(attribute3(first, corners.y), 1.0) - previous_a;
    let previous_v = place * vec4f(attribute3(first, corners.z), 1.0) - previous_a;
    let previous_n = normalize_or(cross(previous_u, previous_v), vec3f());
    // Normals go by the inverse transpose of the map from (u, v, n) to those of before.
    let turned = cross(previous_v, previous_n) * dot(u, normal) + cross(previous_n, previous_u) * dot(v, normal)
        + cross(previous_u, previous_v) * dot(n, normal);
    return normalize_or(turned, normal);
}

// Radiance of a point of an emissive triangle at the finest level, times the share of the point that is there.
fn radiance_of(triangle: u32, barycentrics: vec3f) -> vec3f {
    let instance = triangles[triangle].instance;
    let flags = instances[instance].flags;
    let spot = spot_new(triangle, select(barycentrics.yz, barycentrics.zy, has_flag(flags, MIRRORED)));
    var share = 1.0;
    if has_flag(flags, MASKED | BLENDED) {
        share = spot_opacity(spot);
        if has_flag(flags, MASKED) {
            share = select(0.0, 1.0, share >= instances[instance].cutoff);
        }
    }
    let nothing = Footprint(vec2f(), vec2f(), false);
    return surfaces[spot.surface].emission * instances[instance].emission_scale * spot_emission(spot, false, nothing) * share;
}
