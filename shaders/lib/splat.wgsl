#import lib/camera
#import lib/record
#import CONTRIBUTION

// What every way of splatting on the device shares: the screen rectangle of a record. `contribution` is what it adds to a pixel.

// Range of x/z over a disc in the plane of one picture axis and the view axis, within ±half: ±1 is the picture's edge.
// math::projection is the twin.
fn extent_along(lateral: f32, depth: f32, radius: f32, half: f32) -> vec2f {
    let squared = lateral * lateral + depth * depth - radius * radius;
    if squared <= 0.0 {
        return vec2f(-1.0, 1.0);
    }
    let tangent = sqrt(squared);
    // Directions of the two tangents through the eye; one that points behind the eye leaves that side open.
    let low = vec2f(lateral * tangent - depth * radius, depth * tangent + lateral * radius);
    let high = vec2f(lateral * tangent + depth * radius, depth * tangent - lateral * radius);
    let a = select(-1.0, low.x / (low.y * half), low.y > 1e-6 * tangent * tangent);
    let b = select(1.0, high.x / (high.y * half), high.y > 1e-6 * tangent * tangent);
    return clamp(vec2f(a, b), vec2f(-1.0), vec2f(1.0));
}

struct Rectangle {
    // In clip space, y up.
    low: vec2f,
    high: vec2f,
    // Whether no point of the record is before the eye.
    behind: bool,
}

// Bounds the sphere that a record reaches, half a pixel wider: a pixel is covered where its centre is.
fn rectangle_of(record: Record, weighting: Weighting) -> Rectangle {
    let radius = longest_validity_radius(record, weighting) * 1.0001;
    let d = record.position - camera.eye;
    let depth = dot(d, camera.forward);
    let x = extent_along(dot(d, camera.right), depth, radius, camera.half_width);
    let y = extent_along(dot(d, camera.up), depth, radius, camera.half_height);
    let margin = 1.0 / vec2f(camera.size);
    return Rectangle(vec2f(x.x, y.x) - margin, vec2f(x.y, y.y) + margin, depth + radius <= 0.0);
}
