// The camera of the frame: FrameCamera in src/gpu/scene.rs.

struct FrameCamera {
    eye: vec3f,
    near: f32,
    right: vec3f,
    half_width: f32,
    up: vec3f,
    half_height: f32,
    forward: vec3f,
    frame: u32,
    size: vec2u,
    shift: vec2f,
    sample: u32,
    // How wide the part of a pixel is that a sample stands for [pixels].
    width: f32,
    // Objects that can be moved.
    movers: u32,
    padding: u32,
    eye_before: vec3f,
    half_width_before: f32,
    right_before: vec3f,
    half_height_before: f32,
    up_before: vec3f,
    padding_a: f32,
    forward_before: vec3f,
    padding_b: f32,
}

@group(1) @binding(9) var<uniform> camera: FrameCamera;

// Direction through a pixel's centre, but for the shift [pixels]; its component along the axis is 1.
fn pixel_ray(pixel: vec2u) -> vec3f {
    let at = (vec2f(pixel) + 0.5 + camera.shift) / vec2f(camera.size) * 2.0 - 1.0;
    return camera.forward + camera.right * (at.x * camera.half_width) - camera.up * (at.y * camera.half_height);
}

// What that changes by over what a sample stands for, to the right and down.
fn pixel_sides() -> mat2x3f {
    let scale = 2.0 * camera.width / vec2f(camera.size);
    return mat2x3f(camera.right * (camera.half_width * scale.x), -camera.up * (camera.half_height * scale.y));
}

// Clip position of a point, reverse Z with the far plane at infinity.
fn project(point: vec3f) -> vec4f {
    let local = point - camera.eye;
    let x = dot(local, camera.right) / camera.half_width;
    let y = dot(local, camera.up) / camera.half_height;
    let depth = dot(local, camera.forward);
    let shift = 2.0 * camera.shift / vec2f(camera.size) * depth;
    return vec4f(x - shift.x, y + shift.y, camera.near, depth);
}
