#!/usr/bin/env python3
"""Mitsuba 3's ray casting of a case of cases.json as fast as it goes: the same quantity as mitsuba_reference.py at every pixel, timed.

    $PEERS_HOME/bin/python mitsuba_cast.py sibenik --size 1000 --strata 12 -o OUT

Writes OUT/CASE.indirect.exr (indirect irradiance of one bounce, or with --bounces of more, at each pixel's centre, W/m2) and prints seconds and settings as JSON. Each pixel
casts strata x strata rays, cosine-distributed and stratified. All work is one kernel a chunk on all cores, random numbers included. Compiling
it is done beforehand on a few pixels, and is not in the seconds; neither is loading the scene.
"""
import argparse, json, os, pathlib, sys, time

import mitsuba_reference as reference
from mitsuba_reference import dr, mi, np


def cast(scene, eye, rays, lights, strata, epsilon, bounces):
    """Indirect irradiance where each ray first hits: (n, 3)."""
    n, each = len(rays), strata * strata
    origin = reference.vector(np.broadcast_to(np.array(eye, float), (n, 3)))
    hit = scene.ray_intersect(mi.Ray3f(origin, reference.vector(rays)))
    normal = reference.facing(hit.n, reference.vector(rays))
    found = dr.compress(hit.is_valid())
    start = hit.p + epsilon * normal
    dr.eval(start, normal, found)
    mean = np.zeros((n, 3))
    pixels_at_once = max(1, reference.CHUNK // each)
    for first in range(0, len(found), pixels_at_once):
        count = min(pixels_at_once, len(found) - first)
        pixel = dr.gather(mi.UInt32, found, first + dr.arange(mi.UInt32, count))
        mean[np.array(pixel)] = gathered(scene, start, normal, dr.repeat(pixel, each), lights, strata, epsilon, bounces)
    return mean


def gathered(scene, start, normal, pixel, lights, strata, epsilon, bounces):
    """Means over runs of strata x strata rays, each of the pixel that it says: (pixels, 3)."""
    each = strata * strata
    lane = dr.arange(mi.UInt32, len(pixel))
    random = mi.PCG32(size=len(pixel), initstate=pixel * each + lane % each)
    u = (mi.Float(lane % strata) + random.next_float32()) / strata
    v = (mi.Float(lane // strata % strata) + random.next_float32()) * (2 * np.pi / strata)
    sine, cosine = dr.sincos(v)
    origin, up = (mi.Vector3f(*[dr.gather(mi.Float, one, pixel) for one in (of.x, of.y, of.z)]) for of in (start, normal))
    towards = mi.Frame3f(up).to_world(mi.Vector3f(dr.sqrt(u) * cosine, dr.sqrt(u) * sine, dr.sqrt(1 - u)))
    light = reference.gathered(scene, origin, towards, mi.Bool(True), lights, random, dr.opaque(mi.UInt32, bounces), epsilon)
    dr.eval(light)  # all channels together: each alone would cast all rays again
    return np.stack([np.array(dr.block_reduce(dr.ReduceOp.Add, one, each)) for one in (light.x, light.y, light.z)], 1) / each


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("case")
    p.add_argument("--cases", default=reference.HERE / "cases.json")
    p.add_argument("--scenes", type=pathlib.Path, default=os.environ.get("HEMISPLAT_SCENES", "."), help="folder of the scenes (default: $HEMISPLAT_SCENES)")
    p.add_argument("--size", type=int, default=1000)
    p.add_argument("--strata", type=int, default=12, help="strata along each side of the hemisphere's square")
    p.add_argument("--bounces", type=int, default=1, help="most surfaces that light touches on its way")
    p.add_argument("-o", "--out", type=pathlib.Path, required=True)
    a = p.parse_args()
    case = json.load(open(a.cases))[a.case]
    a.out.mkdir(parents=True, exist_ok=True)
    mesh = reference.ply(a.scenes / case["obj"], a.out / f"{a.case}.ply")
    bsdf = reference.diffuse([case["reflectance"]] * 3)
    scene = mi.load_dict({"type": "scene", "mesh": {"type": "ply", "filename": str(mesh), "face_normals": True, "bsdf": bsdf}})
    view = lambda size: (scene, case["camera"]["eye"], reference.pixel_rays(case["camera"], size, size), case["lights"], a.strata, 1e-4, a.bounces)
    cast(*view(8))
    start = time.monotonic()
    mean = cast(*view(a.size))
    seconds = time.monotonic() - start
    reference.write(a.out / f"{a.case}.indirect.exr", mean, a.size, a.size)
    json.dump({"case": a.case, "size": a.size, "samples": a.strata**2, "bounces": a.bounces, "seconds": seconds, "mean": float(mean.mean())}, sys.stdout)
    print()


if __name__ == "__main__":
    main()
