#!/usr/bin/env python3
"""A sequence by a few rays a pixel and Intel Open Image Denoise, frame by frame. Timed.

    $PEERS_HOME/bin/python mitsuba_frames.py FRAMES.json --rays 16 --quality balanced -o OUT

FRAMES.json is what `./bench frames` writes of a scene that moves: {"size": [w, h], "frames": [{"mesh": FILE, "lights": […], "camera": {…}}, …]}, lights and camera as in
cases.json. A mesh is raw: a row of twelve floats a triangle, its three corners and its reflectance. All frames have as many triangles.

Writes OUT/frame.NNNN.exr (indirect irradiance of one bounce, or with --bounces of more, at each pixel's centre, W/m2, denoised) and prints the seconds of each frame and settings
as JSON. What is done in a frame is that of mitsuba_denoised.py, and before it the mesh is brought to the frame, with the hierarchy over it. Lights are opaque to the
compiler, so that no frame but the first, which is done twice, compiles anything.
"""
import argparse, json, pathlib, sys, time

import mitsuba_denoised as denoised
import mitsuba_reference as reference
from mitsuba_reference import dr, mi, np


def triangles(path):
    """Corners and reflectances, each vertex by vertex in a row."""
    rows = np.fromfile(path, "<f4").reshape(-1, 12)
    return np.ascontiguousarray(rows[:, :9].ravel()), np.repeat(rows[:, 9:], 3, axis=0).ravel()


def make(path):
    """The scene of a frame, and what changes it."""
    corners, reflectances = triangles(path)
    count = len(corners) // 3
    bsdf = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": {"type": "mesh_attribute", "name": "vertex_color"}}}
    properties = mi.Properties()
    properties["mesh_bsdf"] = mi.load_dict(bsdf)
    mesh = mi.Mesh("mesh", count, count // 3, has_vertex_normals=False, has_vertex_texcoords=False, props=properties)
    mesh.add_attribute("vertex_color", 3, reflectances)
    values = mi.traverse(mesh)
    values["vertex_positions"] = mi.Float(corners)
    values["faces"] = mi.UInt32(np.arange(count, dtype=np.uint32))
    values.update()
    scene = mi.load_dict({"type": "scene", "mesh": mesh})
    return scene, mi.traverse(scene)


def opaque(light):
    return {key: [dr.opaque(mi.Float, value) for value in light[key]] for key in ("position", "intensity")}


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("frames", type=pathlib.Path)
    p.add_argument("--rays", type=int, default=16, choices=sorted(denoised.STRATA))
    p.add_argument("--bounces", type=int, default=1, help="most surfaces that light touches on its way")
    p.add_argument("--quality", default="balanced", choices=list(denoised.QUALITY))
    p.add_argument("-o", "--out", type=pathlib.Path, required=True)
    a = p.parse_args()
    film = json.load(open(a.frames))
    a.out.mkdir(parents=True, exist_ok=True)
    (width, height), folder = film["size"], a.frames.parent
    scene, values = make(folder / film["frames"][0]["mesh"])
    seconds = []
    for number, frame in [(0, film["frames"][0]), *enumerate(film["frames"])]:
        corners = triangles(folder / frame["mesh"])[0]
        case = {"camera": frame["camera"], "lights": [opaque(light) for light in frame["lights"]]}
        start = time.monotonic()
        values["mesh.vertex_positions"] = mi.Float(corners)
        values.update()
        out, _ = denoised.picture(scene, case, [width, height], a.rays, a.quality, a.bounces)
        seconds.append(time.monotonic() - start)
        reference.write(a.out / f"frame.{number:04}.exr", out, width, height)
    json.dump({"rays": a.rays, "quality": a.quality, "bounces": a.bounces, "seconds": seconds[1:]}, sys.stdout)
    print()


if __name__ == "__main__":
    main()
