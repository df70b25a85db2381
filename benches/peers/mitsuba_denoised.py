#!/usr/bin/env python3
"""A few rays a pixel by Mitsuba 3, then Intel Open Image Denoise: what one would take today instead of a cache. Timed.

    $PEERS_HOME/bin/python mitsuba_denoised.py sibenik --size 1000 --rays 16 --quality balanced -o OUT

Writes OUT/CASE.indirect.exr (indirect irradiance of one bounce, or with --bounces of more, at each pixel's centre, W/m2, denoised) and prints seconds and settings as JSON. The
quantity is that of mitsuba_reference.py. Rays are cosine-distributed and stratified, all of a pixel's in one loop of one kernel on all cores. The
denoiser is given the normals and the albedo of the same G-buffer, which have no noise, and is told so.

"seconds" holds the G-buffer, the rays, making the denoiser, and denoising. It holds neither loading the scene, nor compiling Mitsuba's kernels, which
is done beforehand on a few pixels, nor writing the picture.
"""
import argparse, json, os, pathlib, sys, time

import mitsuba_reference as reference
from mitsuba_reference import dr, mi, np
import pyoidn

STRATA = {1: (1, 1), 2: (1, 2), 4: (2, 2), 8: (2, 4), 16: (4, 4), 32: (4, 8), 64: (8, 8)}
QUALITY = {"fast": pyoidn.OIDN_QUALITY_FAST, "balanced": pyoidn.OIDN_QUALITY_BALANCED, "high": pyoidn.OIDN_QUALITY_HIGH}
EPSILON = 1e-4


def gbuffer(scene, camera, width, height):
    """Position, normal toward the eye, and whether anything is seen, at all pixels' centres; all of it within one kernel."""
    lane = dr.arange(mi.UInt32, width * height)
    d = np.array(camera["direction"], float) / np.linalg.norm(camera["direction"])
    right = np.cross(d, camera["up"])
    right /= np.linalg.norm(right)
    up = np.cross(right, d)
    opaque = lambda v: mi.Vector3f(*[dr.opaque(mi.Float, float(c)) for c in v])
    extent = dr.opaque(mi.Float, float(np.tan(np.radians(camera["fov"]) / 2)))
    x = ((mi.Float(lane % width) + 0.5) / width * 2 - 1) * extent
    y = (1 - (mi.Float(lane // width) + 0.5) / height * 2) * extent * (height / width)
    towards = dr.normalize(opaque(d) + x * opaque(right) + y * opaque(up))
    hit = scene.ray_intersect(mi.Ray3f(mi.Point3f(opaque(camera["eye"])), towards))
    seen = hit.is_valid()
    normal = dr.select(seen, reference.facing(hit.n, towards), 0)
    point = dr.select(seen, hit.p, 0)
    albedo = hit.bsdf().eval_diffuse_reflectance(hit, seen)
    dr.eval(point, normal, seen, albedo)
    return point, normal, seen, albedo


@dr.syntax
def cast(scene, point, normal, seen, lights, across, along, bounces):
    """Means over across x along stratified paths of the light that they gather."""
    random = mi.PCG32(size=dr.width(point), initstate=dr.arange(mi.UInt32, dr.width(point)))
    frame, origin = mi.Frame3f(normal), mi.Point3f(point + EPSILON * normal)
    total, k = mi.Color3f(0), mi.UInt32(0)
    while k < across * along:
        u = (mi.Float(k % across) + random.next_float32()) / mi.Float(across)
        v = (mi.Float(k // across) + random.next_float32()) * (2 * dr.pi / mi.Float(along))
        sine, cosine = dr.sincos(v)
        towards = frame.to_world(mi.Vector3f(dr.sqrt(u) * cosine, dr.sqrt(u) * sine, dr.sqrt(1 - u)))
        total += reference.gathered(scene, origin, towards, seen, lights, random, bounces, EPSILON)
        k += 1
    total /= mi.Float(across * along)
    dr.eval(total)
    return total


def array(v, width, height):
    """A drjit vector as (height, width, 3)."""
    return np.ascontiguousarray(np.array(dr.ravel(v), dtype=np.float32).reshape(height, width, 3))


def check(device):
    message = device.get_error()
    if message:
        sys.exit(f"Open Image Denoise: {message}")


def denoise(colour, albedo, normal, quality):
    """The picture without its noise. The filter and its weights are made anew, as for a single picture."""
    device = pyoidn.Device(pyoidn.OIDN_DEVICE_TYPE_CPU)
    device.set_int("numThreads", os.cpu_count())
    device.commit()
    check(device)
    made, out = pyoidn.Filter(device, pyoidn.OIDN_FILTER_TYPE_RT), np.empty_like(colour)
    for name, image in (("color", colour), ("albedo", albedo), ("normal", normal), ("output", out)):
        made.set_image(name, image, pyoidn.OIDN_FORMAT_FLOAT3)
    made.set_bool("cleanAux", True)
    made.set_bool("hdr", True)
    made.set_quality(QUALITY[quality])
    made.commit()
    check(device)
    made.execute()
    check(device)
    made.release()
    device.release()
    return out


def picture(scene, case, size, rays, quality, bounces):
    """The denoised irradiance of so many pixels [width, height], and when each part was done."""
    times = [time.monotonic()]
    point, normal, seen, albedo = gbuffer(scene, case["camera"], *size)
    aux = array(albedo, *size), array(normal, *size)
    times.append(time.monotonic())
    across, along = (dr.opaque(mi.UInt32, strata) for strata in STRATA[rays])
    noisy = array(cast(scene, point, normal, seen, case["lights"], across, along, dr.opaque(mi.UInt32, bounces)), *size)
    times.append(time.monotonic())
    out = np.maximum(denoise(noisy, *aux, quality), 0) * np.array(seen).reshape(*size[::-1], 1)
    times.append(time.monotonic())
    return out, times


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("case")
    p.add_argument("--cases", default=reference.HERE / "cases.json")
    p.add_argument("--scenes", type=pathlib.Path, default=os.environ.get("HEMISPLAT_SCENES", "."), help="folder of the scenes (default: $HEMISPLAT_SCENES)")
    p.add_argument("--size", type=int, default=1000)
    p.add_argument("--rays", type=int, default=16, choices=sorted(STRATA))
    p.add_argument("--bounces", type=int, default=1, help="most surfaces that light touches on its way")
    p.add_argument("--quality", default="balanced", choices=list(QUALITY))
    p.add_argument("-o", "--out", type=pathlib.Path, required=True)
    a = p.parse_args()
    case = json.load(open(a.cases))[a.case]
    a.out.mkdir(parents=True, exist_ok=True)
    mesh = reference.ply(a.scenes / case["obj"], a.out / f"{a.case}.ply")
    bsdf = reference.diffuse([case["reflectance"]] * 3)
    scene = mi.load_dict({"type": "scene", "mesh": {"type": "ply", "filename": str(mesh), "face_normals": True, "bsdf": bsdf}})
    picture(scene, case, [16, 16], a.rays, a.quality, a.bounces)
    out, (start, seen, cast_at, end) = picture(scene, case, [a.size, a.size], a.rays, a.quality, a.bounces)
    reference.write(a.out / f"{a.case}.indirect.exr", out, a.size, a.size)
    parts = {"gbuffer": seen - start, "rays": cast_at - seen, "denoiser": end - cast_at}
    json.dump({"case": a.case, "size": a.size, "samples": a.rays, "bounces": a.bounces, "quality": a.quality, "seconds": end - start, "parts": parts, "mean": float(out.mean())}, sys.stdout)
    print()


if __name__ == "__main__":
    main()
