#import lib/colour
#import lib/lightmap

// What texels send out, and how near it is bounded: for gather.wgsl.

@group(0) @binding(0) var<storage, read> surfaces: array<TexelSurface>;
@group(0) @binding(1) var<storage, read> direct: array<vec4f>;
@group(0) @binding(2) var<storage, read> mean: array<vec4f>;
// What shots have brought in this iteration, and what was near the last time.
@group(0) @binding(5) var<storage, read> fresh: array<vec4f>;
@group(0) @binding(6) var<storage, read> near: array<vec4f>;
@group(0) @binding(3) var<storage, read> shots: array<Shot>;
// Radiance, and the square of the distance within which shots are bounded; less than 0 where no shot has come yet, which gathers nothing.
@group(0) @binding(4) var<storage, read_write> shine: array<vec4f>;

override SIDES: u32 = 1u;
override PLACES: u32 = 1u;
// Times what all areas are chosen by.
override REACH: f32 = 1.0;
override SHOOTERS: u32 = 1u;
override ROOT: bool = false;
// Whether what is sent out is that of the mean.
override MEAN: bool = false;

// By what all areas are chosen together: the same by each shot.
fn favours_of_all() -> f32 {
    let area = shots[0].stands_for;
    return area * favour(luminance(shots[0].flux) * f32(SHOOTERS) / max(area, 1.17549435e-38), ROOT);
}

@compute @workgroup_size(64)
fn send_out(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let place = (group.x + group.y * groups.x) * 64u + lane;
    if place >= PLACES {
        return;
    }
    let light = radiance_of_texel(direct[place], select(fresh[place] + near[place], mean[place], MEAN));
    let bound = REACH * favours_of_all() / max(favour(luminance(light), ROOT), 1.17549435e-38);
    let is_lit = any(mean[place].rgb != vec3f(0.0)) || any(fresh[place].rgb != vec3f(0.0));
    shine[place] = vec4f(light, select(-1.0, 1.0, is_lit) * max(bound, surfaces[place / SIDES].area * NEAREST_TEXEL));
}
