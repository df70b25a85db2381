// Directions toward a triangle, spread evenly over the solid angle that it covers: as math::spherical_triangle.

struct SphericalTriangle {
    a: vec3f,
    b: vec3f,
    c: vec3f,
    // 0 for one that is too thin to be sampled.
    solid_angle: f32,
    cosine: f32,
    sine: f32,
}

const FLAT = 1e-3;

fn normalize_or(vector: vec3f, other: vec3f) -> vec3f {
    let squared = dot(vector, vector);
    return select(other, vector * inverseSqrt(max(squared, 1e-37)), squared > 1e-36);
}

fn spherical_triangle(a: vec3f, b: vec3f, c: vec3f) -> SphericalTriangle {
    var seen: SphericalTriangle;
    seen.a = normalize_or(a, vec3f(0.0));
    seen.b = normalize_or(b, vec3f(0.0));
    seen.c = normalize_or(c, vec3f(0.0));
    let volume = abs(dot(seen.a, cross(seen.b, seen.c)));
    let solid_angle = 2.0 * atan2(volume, 1.0 + dot(seen.a, seen.b) + dot(seen.b, seen.c) + dot(seen.c, seen.a));
    let ab = normalize_or(cross(seen.a, seen.b), vec3f(0.0));
    let ac = normalize_or(cross(seen.a, seen.c), vec3f(0.0));
    seen.cosine = dot(ab, ac);
    seen.sine = length(cross(ab, ac));
    seen.solid_angle = select(0.0, solid_angle, solid_angle > FLAT && seen.sine > FLAT);
    return seen;
}

// On the great circle from one unit vector toward another, where the cosine to the first is this.
fn between(start: vec3f, toward: vec3f, cosine: f32) -> vec3f {
    let aside = normalize_or(toward - start * dot(toward, start), vec3f(0.0));
    return normalize_or(start * cosine + aside * sqrt(max(1.0 - cosine * cosine, 0.0)), start);
}

fn sample_spherical_triangle(seen: SphericalTriangle, u: vec2f) -> vec3f {
    let turned = u.x * seen.solid_angle - atan2(seen.sine, seen.cosine);
    let s = sin(turned);
    let t = cos(turned);
    let x = t - seen.cosine;
    let y = s + seen.sine * dot(seen.a, seen.b);
    let share = clamp(((y * t - x * s) * seen.cosine - y) / ((y * s + x * t) * seen.sine), -1.0, 1.0);
    let across = between(seen.a, seen.c, share);
    return between(seen.b, across, 1.0 - u.y * (1.0 - dot(across, seen.b)));
}
