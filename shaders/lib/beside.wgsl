// Which pixels show one surface: as src/math/beside.rs.

const FACING = 0.9;
const BESIDE = 0.1;

// Whether another place is on the same surface as one with a unit normal.
fn is_beside(place: vec3f, normal: vec3f, other: vec3f, other_normal: vec3f) -> bool {
    let way = other - place;
    return dot(normal, other_normal) >= FACING && abs(dot(way, normal)) <= BESIDE * length(way);
}
