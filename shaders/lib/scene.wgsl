#import lib/frame

// The scene: src/gpu/scene.rs has the same structs.

struct SceneParameters {
    environment: vec3f,
    extent: f32,
    sky_limit: f32,
    lights: u32,
    emitters: u32,
    sun_weight: f32,
    environment_size: vec2u,
    // Where the tables of the lights, the emitters and the materials start among the scene's.
    first_light: u32,
    first_emitter: u32,
    centre: vec3f,
    first_material: u32,
}

struct SceneMaterial {
    reflectance: vec3f,
    flags: u32,
    emission: vec3f,
    alpha_cutoff: f32,
    texture_start: u32,
    texture_width: u32,
    texture_height: u32,
    // 0 for none, 1 Phong, 2 Ward, 3 microfacets.
    lobe: u32,
    // Of microfacets, what a surface that is no metal has more than DIELECTRIC.
    specular: vec3f,
    metallic: f32,
    lobe_shape: vec2f,
    // Where its maps start among the tables, FACETS_MAP, NORMAL_MAP and EMISSION_MAP, then their charts and the tangents; 0 where it has none.
    maps: u32,
    normal_scale: f32,
}

struct SceneLight {
    position: vec3f,
    kind: u32,
    direction: vec3f,
    shadow_layer: u32,
    intensity: vec3f,
    cos_inner: f32,
    cos_outer: f32,
    shadow_layers: u32,
    shadow_half: vec2f,
}

struct SceneLamps {
    centre: vec3f,
    radius: f32,
    axis: vec3f,
    spread: f32,
    power: f32,
    next: u32,
    count: u32,
    padding: u32,
}

@group(1) @binding(0) var<uniform> scene_parameters: SceneParameters;
// Corner 0 with the material's index as bits, edges to corners 1 and 2 with the tints of corners 0 and 1: three a triangle.
@group(1) @binding(1) var<storage, read> scene_corners: array<vec4f>;
// Three normals, with the texture coordinates and the tint of corner 2 in the spare places: four a triangle.
@group(1) @binding(2) var<storage, read> scene_attributes: array<vec4f>;
// The hierarchy (lib/hierarchy), then lights, emitters, materials, their maps, charts and tangents: one buffer, as WebGPU promises no more than eight a stage.
@group(1) @binding(3) var<storage, read> scene_tables: array<vec4u>;
// Those of all textures, one after the other, row by row.
@group(1) @binding(4) var scene_texels: texture_2d<u32>;
@group(1) @binding(5) var scene_environment: texture_2d<f32>;
// The first lights again, where drivers that run on the CPU read a constant place once for all lanes.
@group(1) @binding(6) var<uniform> scene_first_lights: array<SceneLight, FIRST_LIGHTS>;

const FIRST_LIGHTS = 4u;
const TWO_SIDED = 1u;
const HOLES = 2u;
const TEXTURED = 4u;
// What is reflected is no base colour.
const NO_BASE = 8u;
// From this bit on, how the texture is read.
const READING = 8u;
const NO_TRIANGLE = 0xffffffffu;
const PI = 3.14159265358979;
// Distance of what lies in the sky.
const FAR_AWAY = 1e30;

// Whether the plan found textures, alpha masks, one-sided surfaces in the scene.
override TEXTURES: bool = true;
// Whether any texture has coarser levels.
override MIPMAPS: bool = true;
override NORMAL_MAPS: bool = true;
// Whether maps lie by other coordinates than the triangles' own.
override CHARTS: bool = true;
// Whether the file says how the frames of normal maps lie.
override TANGENTS: bool = true;
// Whether corners have colours.
override TINTS: bool = true;
override ALPHA_MASKS: bool = true;
override ONE_SIDED: bool = true;
// Whether any surface is seen from both sides.
override TWO_SIDES: bool = true;
// Whether a triangle's normals differ from its plane's.
override SMOOTH: bool = true;
// Whether there are no triangles at all.
override EMPTY: bool = false;
// Whether any surface has a lobe, and whether any has one that is not the same around the normal.
override GLOSSY: bool = true;
override ANISOTROPIC: bool = true;
// Whether the sky is an image, or the plan does not say. A branch by a number of a uniform has Mesa's lavapipe build a shader anew for each use.
override SKY_IMAGE: bool = true;

const PHONG = 1u;
const WARD = 2u;
const MICROFACETS = 3u;
// What a surface that is no metal reflects of light along its normal: model::DIELECTRIC.
const DIELECTRIC = 0.04;

struct Surface {
    position: vec3f,
    // Shading normal, on the side that the ray came from.
    normal: vec3f,
    // Normal of the triangle's plane, on the same side.
    face_normal: vec3f,
    // Of the diffuse part, toward the ray's origin.
    reflectance: vec3f,
    // Radiance emitted toward the ray's origin.
    emission: vec3f,
    distance: f32,
    // The lobe, as the material has it.
    lobe: u32,
    lobe_shape: vec2f,
    specular: vec3f,
    // Axes of the lobe along the surface, and the unit direction to the ray's origin in them and the normal.
    tangent: vec3f,
    bitangent: vec3f,
    outgoing: vec3f,
}

fn scene_material(index: u32) -> SceneMaterial {
    let at = scene_parameters.first_material + 5u * index;
    let a = scene_tables[at];
    let b = scene_tables[at + 1u];
    let c = scene_tables[at + 2u];
    let d = scene_tables[at + 3u];
    let e = scene_tables[at + 4u];
    return SceneMaterial(
        bitcast<vec3f>(a.xyz), a.w, bitcast<vec3f>(b.xyz), bitcast<f32>(b.w), c.x, c.y, c.z, c.w, bitcast<vec3f>(d.xyz), bitcast<f32>(d.w),
        bitcast<vec2f>(e.xy), e.z, bitcast<f32>(e.w),
    );
}

fn scene_light(index: u32) -> SceneLight {
    let at = scene_parameters.first_light + 4u * index;
    let a = scene_tables[at];
    let b = scene_tables[at + 1u];
    let c = scene_tables[at + 2u];
    let d = scene_tables[at + 3u];
    return SceneLight(
        bitcast<vec3f>(a.xyz), a.w, bitcast<vec3f>(b.xyz), b.w, bitcast<vec3f>(c.xyz), bitcast<f32>(c.w), bitcast<f32>(d.x), d.y, bitcast<vec2f>(d.zw),
    );
}

fn scene_lamps(group: u32) -> SceneLamps {
    let at = scene_parameters.first_emitter + 3u * group;
    let a = scene_tables[at];
    let b = scene_tables[at + 1u];
    let c = scene_tables[at + 2u];
    return SceneLamps(bitcast<vec3f>(a.xyz), bitcast<f32>(a.w), bitcast<vec3f>(b.xyz), bitcast<f32>(b.w), bitcast<f32>(c.x), c.y, c.z, 0u);
}

// How far rays start off a surface: as scene::surface_offset.
fn surface_offset(position: vec3f) -> f32 {
    let magnitude = abs(position);
    return 2e-6 * scene_parameters.extent + 4e-7 * max(magnitude.x, max(magnitude.y, magnitude.z));
}

fn material_of(triangle: u32) -> u32 {
    return bitcast<u32>(scene_corners[3u * triangle].w);
}

fn srgb_to_linear(value: vec3f) -> vec3f {
    return select(pow((value + 0.055) / 1.055, vec3f(2.4)), value / 12.92, value <= vec3f(0.04045));
}

// A texture: its first texel, its size, and how it is read.
struct Image {
    start: u32,
    width: u32,
    height: u32,
    reading: u32,
}

const FACETS_MAP = 0u;
const NORMAL_MAP = 1u;
const EMISSION_MAP = 2u;

// Of a reading: whether colours are numbers as they stand, then two bits each for what lies beyond the edges, across and down, whether coarser levels follow,
// and whether it is one of them.
const IS_LINEAR = 1u;
const HAS_LEVELS = 32u;
const IS_COARSE = 64u;
const MIRROR = 1u;
const CLAMP = 2u;

fn base_image(material: SceneMaterial) -> Image {
    return Image(material.texture_start, material.texture_width, material.texture_height, material.flags >> READING);
}

// A map of a material; 0 wide where it has none of the kind.
fn map_image(material: SceneMaterial, kind: u32) -> Image {
    if material.maps == 0u {
        return Image(0u, 0u, 0u, 0u);
    }
    let row = scene_tables[material.maps + kind];
    return Image(row.x, row.y, row.z, row.w);
}

fn texel(image: Image, column: u32, row: u32) -> vec4f {
    let place = image.start + row * image.width + column;
    let texels_a_row = textureDimensions(scene_texels).x;
    let bits = textureLoad(scene_texels, vec2u(place % texels_a_row, place / texels_a_row), 0).x;
    if MIPMAPS && (image.reading & IS_COARSE) != 0u {
        return vec4f(coarse_texel(bits, image.reading), 1.0);
    }
    let value = unpack4x8unorm(bits);
    if (image.reading & IS_LINEAR) != 0u {
        return value;
    }
    return vec4f(srgb_to_linear(value.rgb), value.a);
}

// As scene::mipmaps::unpacked.
fn coarse_texel(bits: u32, reading: u32) -> vec3f {
    let value = vec3f(f32(bits & 2047u), f32((bits >> 11u) & 2047u), f32(bits >> 22u)) / vec3f(2047.0, 2047.0, 1023.0);
    return select(value * value, value, (reading & IS_LINEAR) != 0u);
}

// The two texels of a line around a texture coordinate, and how far it is from the first to the second: as Wrap::nearest.
struct InLine {
    first: u32,
    second: u32,
    share: f32,
}

fn in_line(coordinate: f32, size: u32, wrap: u32) -> InLine {
    var within = fract(coordinate);
    if wrap == MIRROR {
        within = coordinate - 2.0 * floor(coordinate * 0.5);
    } else if wrap == CLAMP {
        within = saturate(coordinate);
    }
    let at = within * f32(size) - 0.5;
    let base = i32(floor(at));
    return InLine(wrapped(base, i32(size), wrap), wrapped(base + 1, i32(size), wrap), at - floor(at));
}

fn wrapped(at: i32, size: i32, wrap: u32) -> u32 {
    if wrap == MIRROR {
        let twice = ((at % (2 * size)) + 2 * size) % (2 * size);
        return u32(min(twice, 2 * size - 1 - twice));
    }
    if wrap == CLAMP {
        return u32(clamp(at, 0, size - 1));
    }
    return u32(((at % size) + size) % size);
}

// Bilinear lookup: as Texture::sample.
fn texture_at(image: Image, uv: vec2f) -> vec4f {
    let x = in_line(uv.x, image.width, (image.reading >> 1u) & 3u);
    let y = in_line(uv.y, image.height, (image.reading >> 3u) & 3u);
    let top = mix(texel(image, x.first, y.first), texel(image, x.second, y.first), x.share);
    let bottom = mix(texel(image, x.first, y.second), texel(image, x.second, y.second), x.share);
    return mix(top, bottom, y.share);
}

// The level after one of an image: as Level::next.
fn next_level(image: Image) -> Image {
    return Image(image.start + image.width * image.height, max(image.width / 2u, 1u), max(image.height / 2u, 1u), image.reading | IS_COARSE);
}

fn level_of(image: Image, number: u32) -> Image {
    var level = image;
    for (var at = 0u; at < number; at++) {
        level = next_level(level);
    }
    return level;
}

// Looks along the longer axis of a footprint at most.
const MOST_LOOKS = 8.0;

// How wide a pixel is on a texture [texels]: as scene::mipmaps::Footprint.
struct Footprint {
    width: f32,
    looks: f32,
    step: vec2f,
}

fn footprint_of(a: vec2f, b: vec2f) -> Footprint {
    let squares = a * a + b * b;
    let sum = min(squares.x + squares.y, 1e30);
    let area = min(abs(a.x * b.y - a.y * b.x), 1e30);
    let longer = 0.5 * (sqrt(sum + 2.0 * area) + sqrt(max(sum - 2.0 * area, 0.0)));
    let shorter = max(area / max(longer, 1.0), 1.0);
    let looks = clamp(floor(longer / shorter + 0.5), 1.0, MOST_LOOKS);
    let square = longer * longer;
    let mixed = a.x * a.y + b.x * b.y;
    let axis = select(vec2f(mixed, square - squares.x), vec2f(square - squares.y, mixed), squares.x >= squares.y);
    return Footprint(max(shorter, longer / looks), looks, axis / max(length(axis), 1e-37) * (longer / looks));
}

// Looks at one level or at two that follow each other, of which the second counts for a share, as many times along a line.
struct Looks {
    fine: Image,
    coarse_share: f32,
    count: u32,
    first: vec2f,
    step: vec2f,
}

// A parallelogram of these sides around a texture coordinate: as Texture::sample_over.
fn looks_over(image: Image, uv: vec2f, sides: mat2x2f) -> Looks {
    let size = vec2f(f32(image.width), f32(image.height));
    let footprint = footprint_of(sides[0] * size, sides[1] * size);
    if (image.reading & HAS_LEVELS) == 0u || !(footprint.width > 1.0 || footprint.looks > 1.0) {
        return Looks(image, 0.0, 1u, uv, vec2f(0.0));
    }
    let level = log2(footprint.width);
    let last = firstLeadingBit(max(image.width, image.height));
    if level >= f32(last) {
        return Looks(level_of(image, last), 0.0, 1u, uv, vec2f(0.0));
    }
    let step = footprint.step / size;
    return Looks(level_of(image, u32(level)), fract(level), u32(footprint.looks), uv - step * (0.5 * (footprint.looks - 1.0)), step);
}

// The mean colour of looks. Reading a texel stands here once, for compilers inline it wherever it is called.
fn texture_over(looks: Looks) -> vec3f {
    let levels = select(1u, 2u, looks.coarse_share > 0.0);
    var image = looks.fine;
    var sum = vec3f(0.0);
    for (var number = 0u; number < levels * looks.count; number++) {
        if number == looks.count {
            image = next_level(looks.fine);
        }
        let share = select(1.0 - looks.coarse_share, looks.coarse_share, number >= looks.count);
        sum += share * texture_at(image, looks.first + looks.step * f32(number % looks.count)).rgb;
    }
    return sum / f32(looks.count);
}

// Where a ray meets a triangle: barycentric weights, and what they change by over a pixel, to the right and down; zero of a single point.
struct Spot {
    barycentric: vec2f,
    sides: mat2x2f,
}

fn point_spot(barycentric: vec2f) -> Spot {
    return Spot(barycentric, mat2x2f(vec2f(0.0), vec2f(0.0)));
}

// Sides of a ray that stands for itself alone.
fn no_sides() -> mat2x3f {
    return mat2x3f(vec3f(0.0), vec3f(0.0));
}

// What an image has at a place of a triangle.
fn image_on(image: Image, triangle: u32, chart: u32, spot: Spot) -> vec3f {
    let uvs = uvs_of(triangle, chart);
    let s = uvs[1] - uvs[0];
    let t = uvs[2] - uvs[0];
    let uv = uvs[0] + s * spot.barycentric.x + t * spot.barycentric.y;
    if MIPMAPS {
        return texture_over(looks_over(image, uv, mat2x2f(s * spot.sides[0].x + t * spot.sides[0].y, s * spot.sides[1].x + t * spot.sides[1].y)));
    }
    return texture_at(image, uv).rgb;
}

// Where the chart of a material's map starts among the tables; 0 for the triangles' own coordinates.
fn chart_of(material: SceneMaterial, kind: u32) -> u32 {
    if CHARTS {
        return scene_tables[material.maps + 3u][kind];
    }
    return 0u;
}

// Texture coordinates of a triangle's corners by a chart: as Scene::uvs.
fn uvs_of(triangle: u32, chart: u32) -> mat3x2f {
    if CHARTS && chart != 0u {
        let a = bitcast<vec4f>(scene_tables[chart + 2u * triangle]);
        let b = bitcast<vec4f>(scene_tables[chart + 2u * triangle + 1u]);
        return mat3x2f(a.xy, a.zw, b.xy);
    }
    let a = scene_attributes[4u * triangle];
    let b = scene_attributes[4u * triangle + 1u];
    let c = scene_attributes[4u * triangle + 2u];
    let d = scene_attributes[4u * triangle + 3u];
    return mat3x2f(vec2f(a.w, b.w), vec2f(c.w, d.x), d.yz);
}

fn uv_at(triangle: u32, barycentric: vec2f, chart: u32) -> vec2f {
    let uvs = uvs_of(triangle, chart);
    return uvs[0] + (uvs[1] - uvs[0]) * barycentric.x + (uvs[2] - uvs[0]) * barycentric.y;
}

// What multiplies the base colour: as Triangle::tint.
fn tint_at(triangle: u32, barycentric: vec2f) -> vec3f {
    let a = tint(bitcast<u32>(scene_corners[3u * triangle + 1u].w));
    let b = tint(bitcast<u32>(scene_corners[3u * triangle + 2u].w));
    let c = tint(bitcast<u32>(scene_attributes[4u * triangle + 3u].w));
    return a + (b - a) * barycentric.x + (c - a) * barycentric.y;
}

// As Tint::colour.
fn tint(bits: u32) -> vec3f {
    let root = 1.0 - vec3f(f32(bits & 1023u), f32((bits >> 10u) & 1023u), f32((bits >> 20u) & 1023u)) / 1023.0;
    return root * root;
}

// Radiance that leaves a place of a triangle: as Scene::emission.
fn emission_at(material: SceneMaterial, triangle: u32, barycentric: vec2f) -> vec3f {
    return material.emission * map_on(material, EMISSION_MAP, triangle, point_spot(barycentric));
}

// What a map of a material has at a place of a triangle; white where it has none of the kind.
fn map_on(material: SceneMaterial, kind: u32, triangle: u32, spot: Spot) -> vec3f {
    if TEXTURES && material.maps != 0u {
        let image = map_image(material, kind);
        if image.width != 0u {
            return image_on(image, triangle, chart_of(material, kind), spot);
        }
    }
    return vec3f(1.0);
}

// A unit normal of the front, as a normal map bends it, seen from along a way of any length: as Scene::normal.
fn bent_normal(material: SceneMaterial, triangle: u32, spot: Spot, normal: vec3f, toward: vec3f) -> vec3f {
    let image = map_image(material, NORMAL_MAP);
    if image.width == 0u {
        return normal;
    }
    let chart = chart_of(material, NORMAL_MAP);
    let axes = map_axes(material, triangle, spot.barycentric, chart, normal);
    if axes.sign == 0.0 {
        return normal;
    }
    let local = (2.0 * image_on(image, triangle, chart, spot) - 1.0) * vec3f(material.normal_scale, -axes.sign * material.normal_scale, 1.0);
    let bent = axes.tangent * local.x + axes.bitangent * local.y + normal * local.z;
    let bent_length = length(bent);
    let unit_bent = select(normal, bent / max(bent_length, 1e-37), bent_length > 1e-30);
    return select(unit_bent, reflecting(unit_bent, normal, toward / max(length(toward), 1e-37)), material.lobe != 0u);
}

// As scene::surface::reflecting.
fn reflecting(bent: vec3f, plain: vec3f, toward: vec3f) -> vec3f {
    let cosine = dot(bent, toward);
    let of_plain = dot(plain, toward);
    if of_plain <= 0.0 {
        return plain;
    }
    let least = 0.5 * of_plain;
    if cosine >= least {
        return bent;
    }
    return normalize(mix(bent, plain, (least - cosine) / (of_plain - cosine)));
}

// Whether an alpha mask leaves a hole there.
fn is_hole(triangle: u32, barycentric: vec2f) -> bool {
    let material = scene_material(material_of(triangle));
    if (material.flags & HOLES) == 0u {
        return false;
    }
    return texture_at(base_image(material), uv_at(triangle, barycentric, 0u)).a < material.alpha_cutoff;
}

// Distance and barycentric weights of a ray on a triangle's plane; z of the result is 0 for a ray along the plane.
struct PlaneHit {
    distance: f32,
    barycentric: vec2f,
    // > 0 where the front is met, 0 where the ray runs along the plane.
    determinant: f32,
}

fn intersect_plane(triangle: u32, origin: vec3f, direction: vec3f) -> PlaneHit {
    let a = scene_corners[3u * triangle].xyz;
    let e1 = scene_corners[3u * triangle + 1u].xyz;
    let e2 = scene_corners[3u * triangle + 2u].xyz;
    let p = cross(direction, e2);
    let determinant = dot(e1, p);
    let inverse = select(1.0 / determinant, 0.0, determinant == 0.0);
    let s = origin - a;
    let q = cross(s, e1);
    return PlaneHit(dot(e2, q) * inverse, vec2f(dot(s, p), dot(direction, q)) * inverse, determinant);
}

// As Triangle::place: see scene/surface.rs.
const BESIDE_RAY = vec2f(5e-7, 2.5e-7);
const SLIVER = 1e-4;
const GRAZING = 1e-5;

// The part of a way along a ray.
fn along_ray(way: vec3f, direction: vec3f) -> vec3f {
    return direction * (dot(way, direction) / dot(direction, direction));
}

fn place(corner: vec3f, e1: vec3f, e2: vec3f, barycentric: vec2f, origin: vec3f, direction: vec3f) -> vec3f {
    let position = corner + e1 * barycentric.x + e2 * barycentric.y;
    let magnitude = abs(position);
    let rounding = BESIDE_RAY.x * distance(position, origin) + BESIDE_RAY.y * max(magnitude.x, max(magnitude.y, magnitude.z));
    let foot = origin + along_ray(position - origin, direction);
    if distance(position, foot) <= rounding {
        return position;
    }
    let plane = cross(e1, e2);
    let longest = max(length(e1), max(length(e2), distance(e1, e2)));
    let facing = dot(plane, direction);
    if length(plane) > SLIVER * longest * longest && abs(facing) > GRAZING * length(plane) * length(direction) {
        let way = direction * (dot(plane, position - foot) / facing);
        if length(way) <= longest {
            return foot + way;
        }
    }
    return beside_edge(corner, e1, e2, origin, direction);
}

// As Triangle::beside_edge.
fn beside_edge(corner: vec3f, e1: vec3f, e2: vec3f, origin: vec3f, direction: vec3f) -> vec3f {
    var best = nearest_of_edge(corner, e1, origin, direction);
    let second = nearest_of_edge(corner + e1, e2 - e1, origin, direction);
    best = select(best, second, second.w < best.w);
    let third = nearest_of_edge(corner + e2, -e2, origin, direction);
    best = select(best, third, third.w < best.w);
    return origin + along_ray(best.xyz - origin, direction);
}

// The point of an edge that is nearest to a ray, and its squared distance from it.
fn nearest_of_edge(corner: vec3f, edge: vec3f, origin: vec3f, direction: vec3f) -> vec4f {
    let start = corner - origin - along_ray(corner - origin, direction);
    let across = edge - along_ray(edge, direction);
    let share = clamp(-dot(start, across) / max(dot(across, across), 1e-37), 0.0, 1.0);
    let beside = start + across * share;
    return vec4f(corner + edge * share, dot(beside, beside));
}

// The surface that a ray, known to meet the triangle, sees.
fn surface_seen(triangle: u32, origin: vec3f, direction: vec3f) -> Surface {
    return surface_seen_over(triangle, origin, direction, no_sides());
}

// The same of a ray through a pixel, whose direction changes by `sides` to the next, to the right and down: maps are seen as wide as that.
fn surface_seen_over(triangle: u32, origin: vec3f, direction: vec3f, sides: mat2x3f) -> Surface {
    var surface = lit_surface_over(triangle, origin, direction, sides);
    if GLOSSY && surface.lobe == MICROFACETS {
        surface.reflectance *= facets_leave(surface.specular, surface.outgoing.z);
    }
    return surface;
}

// The same for light that arrives along the ray: the lobe takes its share of the diffuse part by where light leaves to, which is left to do. What rounding
// puts outside is moved to the edge.
fn lit_surface(triangle: u32, origin: vec3f, direction: vec3f) -> Surface {
    return lit_surface_over(triangle, origin, direction, no_sides());
}

fn lit_surface_over(triangle: u32, origin: vec3f, direction: vec3f, sides: mat2x3f) -> Surface {
    let hit = intersect_plane(triangle, origin, direction);
    var b = clamp(hit.barycentric, vec2f(0.0), vec2f(1.0));
    b = b / max(b.x + b.y, 1.0);
    let a = scene_corners[3u * triangle];
    let e1 = scene_corners[3u * triangle + 1u].xyz;
    let e2 = scene_corners[3u * triangle + 2u].xyz;
    let plane = cross(e1, e2);
    let side = select(-1.0, 1.0, dot(plane, direction) <= 0.0);
    let material = scene_material(bitcast<u32>(a.w));
    var surface: Surface;
    surface.position = place(a.xyz, e1, e2, b, origin, direction);
    surface.distance = distance(surface.position, origin) / max(length(direction), 1e-37);
    var spot = point_spot(b);
    if MIPMAPS && TEXTURES {
        spot.sides = spot_sides(e1, e2, direction, surface.distance, sides);
    }
    surface.face_normal = plane * (side / max(length(plane), 1e-37));
    surface.normal = surface.face_normal;
    if SMOOTH {
        let n0 = scene_attributes[4u * triangle].xyz;
        let n1 = scene_attributes[4u * triangle + 1u].xyz;
        let n2 = scene_attributes[4u * triangle + 2u].xyz;
        let normal = n0 + (n1 - n0) * b.x + (n2 - n0) * b.y;
        let normal_length = length(normal);
        surface.normal = select(surface.face_normal, normal * (side / max(normal_length, 1e-37)), normal_length > 1e-6);
    }
    if GLOSSY && SMOOTH && material.lobe != 0u {
        surface.normal = reflecting(surface.normal, surface.face_normal, -direction / max(length(direction), 1e-37));
    }
    if NORMAL_MAPS && material.maps != 0u {
        surface.normal = side * bent_normal(material, triangle, spot, side * surface.normal, -side * direction);
    }
    surface.reflectance = material.reflectance;
    let is_base = (material.flags & NO_BASE) == 0u;
    if TEXTURES && (material.flags & TEXTURED) != 0u {
        surface.reflectance *= image_on(base_image(material), triangle, 0u, spot);
    }
    if TINTS && is_base {
        surface.reflectance *= tint_at(triangle, b);
    }
    surface.emission = select(vec3f(0.0), material.emission * map_on(material, EMISSION_MAP, triangle, spot), side > 0.0 || (material.flags & TWO_SIDED) != 0u);
    if GLOSSY && material.lobe != 0u {
        return with_lobe(surface, material, triangle, spot, direction);
    }
    return surface;
}

// What the barycentric weights of a triangle change by where a ray's direction changes by `sides`: as Triangle::spot.
fn spot_sides(e1: vec3f, e2: vec3f, direction: vec3f, distance: f32, sides: mat2x3f) -> mat2x2f {
    let p = cross(direction, e2);
    let q = cross(e1, direction);
    let determinant = dot(e1, p);
    let scale = select(distance / determinant, 0.0, determinant == 0.0);
    return mat2x2f(scale * vec2f(dot(sides[0], p), dot(sides[0], q)), scale * vec2f(dot(sides[1], p), dot(sides[1], q)));
}

// The share of the light toward a direction of this cosine that microfacets leave to the diffuse part: as Lobe::leaves.
fn facets_leave(specular: vec3f, cosine: f32) -> vec3f {
    let aside = 1.0 - saturate(cosine);
    let squared = aside * aside;
    return (1.0 - specular) * (1.0 - squared * squared * aside);
}

// A direction in a lobe's frame, on the side of its normal: as scene::surface::facing.
fn facing(direction: vec3f) -> vec3f {
    return select(normalize(vec3f(direction.xy, 0.01)), direction, direction.z > 0.0);
}

// As Material::reflection_with.
fn with_lobe(plain: Surface, material: SceneMaterial, triangle: u32, spot: Spot, direction: vec3f) -> Surface {
    var surface = plain;
    surface.lobe = material.lobe;
    surface.lobe_shape = material.lobe_shape;
    surface.specular = material.specular;
    let axes = tangents(triangle, surface.normal);
    surface.tangent = axes[0];
    surface.bitangent = axes[1];
    let toward = -normalize(direction);
    surface.outgoing = facing(vec3f(dot(toward, axes[0]), dot(toward, axes[1]), dot(toward, surface.normal)));
    // Of microfacets roughness is multiplied by green and metallic by blue, of others the reflectance.
    let facets = map_on(material, FACETS_MAP, triangle, spot);
    if material.lobe == MICROFACETS {
        let metallic = material.metallic * facets.z;
        surface.lobe_shape = material.lobe_shape * facets.y * facets.y;
        surface.specular = mix(DIELECTRIC + material.specular, surface.reflectance, metallic);
        surface.reflectance *= 1.0 - metallic;
    } else {
        surface.specular *= facets;
    }
    return surface;
}

// Axes along a surface: the first along the texture's first coordinate, the sign of its second along the second axis; 0 where there are no coordinates.
struct TextureAxes {
    tangent: vec3f,
    bitangent: vec3f,
    sign: f32,
}

// As Triangle::texture_frame.
fn texture_axes(triangle: u32, chart: u32, normal: vec3f) -> TextureAxes {
    let uvs = uvs_of(triangle, chart);
    let s = uvs[1] - uvs[0];
    let t = uvs[2] - uvs[0];
    let turned = s.x * t.y - s.y * t.x;
    let along = (scene_corners[3u * triangle + 1u].xyz * t.y - scene_corners[3u * triangle + 2u].xyz * s.y) * sign(turned);
    let tangent = along - normal * dot(normal, along);
    if !(turned != 0.0 && dot(tangent, tangent) > 1e-12 * dot(along, along)) {
        return TextureAxes(vec3f(0.0), vec3f(0.0), 0.0);
    }
    let x = normalize(tangent);
    return TextureAxes(x, cross(normal, x), sign(turned));
}

// The axes of a map of normals at a place of a triangle, along the tangents of the file where it has any: as Scene::map_frame.
fn map_axes(material: SceneMaterial, triangle: u32, barycentric: vec2f, chart: u32, normal: vec3f) -> TextureAxes {
    let axes = texture_axes(triangle, chart, normal);
    if !TANGENTS {
        return axes;
    }
    let first = scene_tables[material.maps + 3u].w;
    if first == 0u || axes.sign == 0.0 {
        return axes;
    }
    let a = bitcast<vec3f>(scene_tables[first + 3u * triangle].xyz);
    let b = bitcast<vec3f>(scene_tables[first + 3u * triangle + 1u].xyz);
    let c = bitcast<vec3f>(scene_tables[first + 3u * triangle + 2u].xyz);
    let tangent = a + (b - a) * barycentric.x + (c - a) * barycentric.y;
    let along = tangent - normal * dot(normal, tangent);
    if dot(along, along) <= 1e-6 {
        return axes;
    }
    let x = normalize(along);
    return TextureAxes(x, cross(normal, x), axes.sign);
}

// As Triangle::tangent_frame.
fn tangents(triangle: u32, normal: vec3f) -> mat2x3f {
    if ANISOTROPIC {
        let axes = texture_axes(triangle, 0u, normal);
        if axes.sign != 0.0 {
            return mat2x3f(axes.tangent, axes.bitangent);
        }
    }
    let frame = frame_around(normal, 0.0);
    return mat2x3f(frame[0], frame[1]);
}

// The texels of the sky around a unit direction, two columns by two rows, and how far it is from the first of each to the second: as scene::lookup.
struct InImage {
    columns: vec2i,
    rows: vec2i,
    share: vec2f,
}

fn in_environment(direction: vec3f) -> InImage {
    // One of one colour has a texel of it.
    let size = vec2i(textureDimensions(scene_environment));
    let u = 0.5 + atan2(direction.x, -direction.z) / (2.0 * PI);
    let v = acos(clamp(direction.y, -1.0, 1.0)) / PI;
    let at = vec2f(u, v) * vec2f(size) - 0.5;
    let base = vec2i(floor(at));
    let columns = ((vec2i(base.x, base.x + 1) % size.x) + size.x) % size.x;
    return InImage(columns, clamp(vec2i(base.y, base.y + 1), vec2i(0), vec2i(size.y - 1)), at - floor(at));
}

// Maps 0..1 to −1..1 with density 1 − |x|.
fn tent(number: f32) -> f32 {
    return select(1.0 - sqrt(max(2.0 - 2.0 * number, 0.0)), sqrt(2.0 * number) - 1.0, number < 0.5);
}

// A direction within the tent that the lookup spreads a texel of the sky over, by two numbers of 0..1.
fn within_texel(texel: u32, place: vec2f) -> vec3f {
    let size = scene_parameters.environment_size;
    let azimuth = ((f32(texel % size.x) + 0.5 + tent(place.x)) / f32(size.x) - 0.5) * 2.0 * PI;
    // What spills over a pole comes back by reflection, as the lookup repeats the outermost row.
    let polar = (f32(texel / size.x) + 0.5 + tent(place.y)) / f32(size.y) * PI;
    let sine = abs(sin(polar));
    return vec3f(sine * sin(azimuth), cos(polar), -sine * cos(azimuth));
}

// Radiance of the sky from a unit direction: as Environment::radiance.
fn environment_radiance(direction: vec3f) -> vec3f {
    if !SKY_IMAGE {
        return scene_parameters.environment;
    }
    let at = in_environment(direction);
    let top = mix(environment_texel(at.columns.x, at.rows.x), environment_texel(at.columns.y, at.rows.x), at.share.x);
    let bottom = mix(environment_texel(at.columns.x, at.rows.y), environment_texel(at.columns.y, at.rows.y), at.share.x);
    return mix(top, bottom, at.share.y).rgb;
}

// Radiance, and the running sum of what suns have up to and including it.
fn environment_texel(column: i32, row: i32) -> vec4f {
    return textureLoad(scene_environment, vec2i(column, row), 0);
}
