// Weights of corners 1 and 2 at the point of a triangle that is nearest to one beside its plane.
fn nearest_weights(e1: vec3f, e2: vec3f, way: vec3f) -> vec2f {
    let ss = dot(e1, e1);
    let st = dot(e1, e2);
    let tt = dot(e2, e2);
    let sw = dot(e1, way);
    let tw = dot(e2, way);
    let determinant = ss * tt - st * st;
    if determinant <= 0.0 {
        return vec2f(0.0);
    }
    let weights = clamp(vec2f(tt * sw - st * tw, ss * tw - st * sw) / determinant, vec2f(0.0), vec2f(1.0));
    return weights / max(weights.x + weights.y, 1.0);
}

// Where the point at weights of a triangle lies in a texture, by the first six of the numbers that tell where its corners do.
fn laid_at(first: vec4f, second: vec4f, weights: vec2f) -> vec2f {
    return first.xy + (first.zw - first.xy) * weights.x + (second.xy - first.xy) * weights.y;
}
