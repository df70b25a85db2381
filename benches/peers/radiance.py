#!/usr/bin/env python3
"""Runs Radiance's irradiance cache (one bounce, or with --bounces more) on a case of cases.json and times it.

    $PEERS_HOME/bin/python radiance.py sibenik --size 1000 --processes 2 -o OUT

Writes OUT/CASE.indirect.exr (indirect irradiance at each pixel, W/m2, from two runs of rtrace -i: with bounces minus without),
OUT/CASE.picture.exr (radiance) and prints seconds, ambient values and settings as JSON. Only the run with bounces is timed.
Radiance 6 places its values by Hessians: give --resolution (-ar) with every comparison; 0 lifts the limit.
"""
import argparse, json, os, pathlib, subprocess, sys, time

import numpy as np
import pyradiance

HERE = pathlib.Path(__file__).resolve().parent
ROOT = pathlib.Path(pyradiance.__file__).parent
ENV = dict(os.environ, PATH=f"{ROOT/'bin'}:{os.environ['PATH']}", RAYPATH=f".:{ROOT/'lib'}")


def run(args, **kw):
    return subprocess.run([str(a) for a in args], env=ENV, check=True, **kw)


def triangles(path):
    """Positions and faces of an OBJ, fanned, without degenerate triangles."""
    points, faces = [], []
    for line in open(path, errors="replace"):
        if line.startswith("v "):
            points.append([float(x) for x in line.split()[1:4]])
        elif line.startswith("f "):
            i = [int(t.split("/")[0]) for t in line.split()[1:]]
            i = [k - 1 if k > 0 else len(points) + k for k in i]
            faces += [(i[0], i[k], i[k + 1]) for k in range(1, len(i) - 1)]
    points, faces = np.array(points), np.array(faces)
    a, b, c = (points[faces[:, k]] for k in range(3))
    return points, faces[np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-9]


def octree(case, name, scenes, out):
    points, faces = triangles(scenes / case["obj"])
    with open(out / f"{name}.obj", "w") as f:
        f.write("usemtl grey\n")
        f.writelines("v %.7g %.7g %.7g\n" % tuple(p) for p in points)
        f.writelines("f %d %d %d\n" % tuple(t + 1) for t in faces)
    (out / "grey.mat").write_text("void plastic grey 0 0 5 {0} {0} {0} 0 0\n".format(case["reflectance"]))
    run(["obj2mesh", "-a", out / "grey.mat", out / f"{name}.obj", out / f"{name}.rtm"])
    radius = 0.02
    scene = (out / "grey.mat").read_text() + f"void mesh scene\n1 {name}.rtm\n0\n0\n"
    for k, light in enumerate(case["lights"]):
        rgb = [x / (np.pi * radius**2) for x in light["intensity"]]
        scene += "void light lamp{0} 0 0 3 {1} {2} {3}\nlamp{0} sphere bulb{0} 0 0 4 {4} {5} {6} {7}\n".format(k, *rgb, *light["position"], radius)
    (out / f"{name}.rad").write_text(scene)
    with open(out / f"{name}.oct", "wb") as f:
        run(["oconv", "-f", f"{name}.rad"], stdout=f, cwd=out)
    return len(faces)


def image(out, name, case, size, bounces, a, irradiance):
    c = case["camera"]
    view = ["-vtv", "-vp", *c["eye"], "-vd", *c["direction"], "-vu", *c["up"], "-vh", c["fov"], "-vv", c["fov"]]
    cache = out / f"{name}.amb"
    cache.unlink(missing_ok=True)
    options = ["-w", "-n", a.processes, "-ab", bounces, "-aa", a.accuracy or case["accuracy"], "-ad", a.samples,
               "-as", 0, "-ar", a.resolution, "-dj", 0, "-ds", 0, "-dt", 0, "-lw", 1e-6]
    options += ["-i"] if irradiance else []
    options += ["-af", cache] if bounces else []
    start = time.monotonic()
    rays = subprocess.Popen([str(x) for x in ["vwrays", "-ff", "-pj", 0, *view, "-x", size, "-y", size]], env=ENV, stdout=subprocess.PIPE)
    done = run(["rtrace", "-h", "-fff", *options, f"{name}.oct"], stdin=rays.stdout, stdout=subprocess.PIPE, cwd=out)
    seconds = time.monotonic() - start
    pixels = np.frombuffer(done.stdout, np.float32).reshape(size, size, 3)
    values = None
    if bounces:
        found = subprocess.run(["lookamb", str(cache)], env=ENV, stdout=subprocess.PIPE, check=True).stdout
        values = found.count(b"Position")
    return pixels, seconds, values


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("case")
    p.add_argument("--cases", default=HERE / "cases.json")
    p.add_argument("--scenes", type=pathlib.Path, default=os.environ.get("HEMISPLAT_SCENES", "."), help="folder of the scenes (default: $HEMISPLAT_SCENES)")
    p.add_argument("--size", type=int, default=1000)
    p.add_argument("--accuracy", type=float)
    p.add_argument("--samples", type=int, default=4096)
    p.add_argument("--resolution", type=int, default=64)
    p.add_argument("--bounces", type=int, default=1, help="-ab")
    p.add_argument("--processes", type=int, default=2)
    p.add_argument("--picture", action="store_true", help="also write the radiance image")
    p.add_argument("-o", "--out", type=pathlib.Path, required=True)
    a = p.parse_args()
    case = json.load(open(a.cases))[a.case]
    a.out.mkdir(parents=True, exist_ok=True)
    count = octree(case, a.case, a.scenes, a.out)
    import mitsuba as mi
    mi.set_variant("scalar_rgb")
    total, seconds, values = image(a.out, a.case, case, a.size, a.bounces, a, True)
    direct, _, _ = image(a.out, a.case, case, a.size, 0, a, True)
    mi.Bitmap(np.ascontiguousarray(total - direct)).write(str(a.out / f"{a.case}.indirect.exr"))
    if a.picture:
        picture, _, _ = image(a.out, a.case, case, a.size, a.bounces, a, False)
        mi.Bitmap(np.ascontiguousarray(picture)).write(str(a.out / f"{a.case}.picture.exr"))
    json.dump({"case": a.case, "triangles": count, "seconds": seconds, "values": values, "size": a.size, "accuracy": a.accuracy or case["accuracy"],
               "samples": a.samples, "resolution": a.resolution, "bounces": a.bounces, "processes": a.processes}, sys.stdout)
    print()


main()
