// An orthonormal frame around a unit normal, without a singular direction (Duff et al. 2017), its tangents turned by
// an angle: as math::frame. Columns: two tangents and the normal.
fn frame_around(normal: vec3f, turn: f32) -> mat3x3f {
    let s = select(-1.0, 1.0, normal.z >= 0.0);
    let a = -1.0 / (s + normal.z);
    let b = normal.x * normal.y * a;
    let x = vec3f(1.0 + s * normal.x * normal.x * a, s * b, -s * normal.x);
    let y = vec3f(b, s + normal.y * normal.y * a, -normal.y);
    let c = cos(turn);
    let d = sin(turn);
    return mat3x3f(x * c + y * d, y * c - x * d, normal);
}
