#import lib/colour
#import lib/scene

// Glossy lobes in the frame of a surface, z its normal: as math::lobe.

const LEAST_ALPHA = 1e-3;
const MOST_EXPONENT = 1e6;
const NARROW = 0.15;
const SHARP = 0.5;

struct Lobe {
    kind: u32,
    shape: vec2f,
    reflectance: vec3f,
}

fn lobe_of(surface: Surface) -> Lobe {
    let least = select(vec2f(LEAST_ALPHA), vec2f(0.0), surface.lobe == PHONG);
    return Lobe(surface.lobe, clamp(surface.lobe_shape, least, vec2f(MOST_EXPONENT)), surface.specular);
}

// As Lobe::share.
fn lobe_share(lobe: Lobe, diffuse: vec3f) -> f32 {
    let bright = luminance(lobe.reflectance);
    return clamp(bright / max(bright + luminance(diffuse), 1e-37), 0.1, 0.9);
}

// As Shape::is_narrow.
fn is_narrow(lobe: Lobe) -> bool {
    if lobe.kind == PHONG {
        return 2.0 * PI / (lobe.shape.x + 1.0) < NARROW;
    }
    return 4.0 * PI * lobe.shape.x * select(lobe.shape.x, lobe.shape.y, lobe.kind == WARD) < NARROW;
}

// As Shape::is_sharp.
fn is_sharp(lobe: Lobe) -> bool {
    if lobe.kind == PHONG {
        return is_narrow(lobe);
    }
    if lobe.kind == WARD {
        return 4.0 * PI * min(lobe.shape.x, lobe.shape.y) * sqrt(lobe.shape.x * lobe.shape.y) < SHARP;
    }
    return 4.0 * PI * lobe.shape.x * lobe.shape.x < SHARP;
}

// As Lobe::softened.
fn softened(kind: u32, shape: vec2f) -> vec2f {
    if kind == PHONG {
        return vec2f(min(shape.x, 2.0 * PI / NARROW - 1.0), shape.y);
    }
    return max(shape, vec2f(sqrt(NARROW / (4.0 * PI))));
}

// Of the cosine to the mirrored direction: 0 from 90° on, whatever the exponent, and no power of 0, which is not defined.
fn power(cosine: f32, exponent: f32) -> f32 {
    return select(0.0, pow(max(cosine, 1e-37), exponent), cosine > 0.0);
}

fn mirrored(outgoing: vec3f) -> vec3f {
    return vec3f(-outgoing.xy, outgoing.z);
}

fn slope_root(alpha: f32, direction: vec3f) -> f32 {
    let squared = alpha * alpha;
    return sqrt(squared + (1.0 - squared) * direction.z * direction.z);
}

// Density of facets that face along `half`.
fn facets(alpha: f32, half: vec3f) -> f32 {
    let squared = alpha * alpha;
    let fall = half.x * half.x + half.y * half.y + squared * half.z * half.z;
    return squared / (PI * fall * fall);
}

fn ward_fall(alpha: vec2f, half: vec3f) -> f32 {
    let slope = half.xy / (alpha * half.z);
    return exp(-dot(slope, slope));
}

// The reflectance distribution [1/sr]; 0 where a direction is below the surface.
fn lobe_value(lobe: Lobe, outgoing: vec3f, incoming: vec3f) -> vec3f {
    if outgoing.z <= 0.0 || incoming.z <= 0.0 {
        return vec3f(0.0);
    }
    let half = outgoing + incoming;
    switch lobe.kind {
        case PHONG: {
            return lobe.reflectance * ((lobe.shape.x + 2.0) / (2.0 * PI) * power(dot(mirrored(outgoing), incoming), lobe.shape.x));
        }
        case WARD: {
            let squared = half.z * half.z;
            let peak = dot(half, half) / (PI * lobe.shape.x * lobe.shape.y * squared * squared);
            return lobe.reflectance * (peak * ward_fall(lobe.shape, half));
        }
        default: {
            let facing = normalize(half);
            let aside = 1.0 - saturate(dot(outgoing, facing));
            let squared = aside * aside;
            let fresnel = lobe.reflectance + (1.0 - lobe.reflectance) * (squared * squared * aside);
            let sides = outgoing.z * slope_root(lobe.shape.x, incoming) + incoming.z * slope_root(lobe.shape.x, outgoing);
            return fresnel * (facets(lobe.shape.x, facing) * 0.5 / max(sides, 1e-37));
        }
    }
}

fn around(cosine: f32, azimuth: f32) -> vec3f {
    let sine = sqrt(max(1.0 - cosine * cosine, 0.0));
    return vec3f(sine * cos(azimuth), sine * sin(azimuth), cosine);
}

fn reflected(outgoing: vec3f, half: vec3f) -> vec3f {
    return 2.0 * dot(outgoing, half) * half - outgoing;
}

// A facet drawn among those that `outgoing` sees (Heitz 2018).
fn visible_facet(outgoing: vec3f, alpha: f32, u: vec2f) -> vec3f {
    let stretch = vec3f(alpha, alpha, 1.0);
    let seen = normalize(stretch * outgoing);
    let flat = seen.x * seen.x + seen.y * seen.y;
    let across = select(vec3f(1.0, 0.0, 0.0), vec3f(-seen.y, seen.x, 0.0) * inverseSqrt(max(flat, 1e-37)), flat > 1e-30);
    let along = cross(seen, across);
    let radius = sqrt(u.x);
    let x = radius * cos(2.0 * PI * u.y);
    let share = 0.5 * (1.0 + seen.z);
    let y = (1.0 - share) * sqrt(max(1.0 - x * x, 0.0)) + share * radius * sin(2.0 * PI * u.y);
    let z = sqrt(max(1.0 - x * x - y * y, 0.0));
    let facet = x * across + y * along + z * seen;
    return normalize(stretch * vec3f(facet.xy, max(facet.z, 1e-6)));
}

// An incoming direction for two numbers in 0..1, nearly in proportion to value · cosine; it may lie below the surface.
fn lobe_sample(lobe: Lobe, outgoing: vec3f, u: vec2f) -> vec3f {
    switch lobe.kind {
        case PHONG: {
            return frame_around(mirrored(outgoing), 0.0) * around(pow(u.x, 1.0 / (lobe.shape.x + 1.0)), 2.0 * PI * u.y);
        }
        case WARD: {
            let slope = sqrt(-log(max(1.0 - u.x, 1e-37)));
            let azimuth = 2.0 * PI * u.y;
            return reflected(outgoing, normalize(vec3f(-lobe.shape * slope * vec2f(cos(azimuth), sin(azimuth)), 1.0)));
        }
        default: {
            return reflected(outgoing, visible_facet(outgoing, lobe.shape.x, u));
        }
    }
}

// Density of `lobe_sample` [1/sr].
fn lobe_density(lobe: Lobe, outgoing: vec3f, incoming: vec3f) -> f32 {
    if lobe.kind == PHONG {
        return (lobe.shape.x + 1.0) / (2.0 * PI) * power(dot(mirrored(outgoing), incoming), lobe.shape.x);
    }
    let half = normalize(outgoing + incoming);
    if half.z <= 0.0 {
        return 0.0;
    }
    let across = 4.0 * max(abs(dot(outgoing, half)), 1e-37);
    if lobe.kind == WARD {
        return ward_fall(lobe.shape, half) / (PI * lobe.shape.x * lobe.shape.y * half.z * half.z * half.z * across);
    }
    let shown = 2.0 / max(outgoing.z + slope_root(lobe.shape.x, outgoing), 1e-37);
    return shown * facets(lobe.shape.x, half) * max(dot(outgoing, half), 0.0) / across;
}

const ALBEDO_SAMPLES = 16u;

// The share of light from all sides alike that the lobe reflects toward a direction: as Lobe::albedo.
fn lobe_albedo(lobe: Lobe, outgoing: vec3f) -> vec3f {
    var sum = vec3f(0.0);
    for (var i = 0u; i < ALBEDO_SAMPLES; i++) {
        let u = vec2f((f32(i) + 0.5) / f32(ALBEDO_SAMPLES), fract(0.618034 * f32(i) + 0.25));
        let incoming = lobe_sample(lobe, outgoing, u);
        let density = lobe_density(lobe, outgoing, incoming);
        if incoming.z > 0.0 && density > 0.0 {
            sum += lobe_value(lobe, outgoing, incoming) * (incoming.z / density);
        }
    }
    return sum / f32(ALBEDO_SAMPLES);
}
