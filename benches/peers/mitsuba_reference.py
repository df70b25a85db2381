#!/usr/bin/env python3
"""Truth for a case of cases.json, by Mitsuba 3's ray caster: the indirect irradiance of one bounce at each pixel's centre, or with --bounces of more.

    $PEERS_HOME/bin/python mitsuba_reference.py sibenik --size 1000 --stride 4 --samples 4096 -o OUT
    $PEERS_HOME/bin/python mitsuba_reference.py sibenik --size 1000 --windows 16 --samples 4096 -o OUT

Writes OUT/CASE.reference-indirect.exr (RGB, W/m2), OUT/CASE.reference-variance.exr (variance of those means) and
OUT/CASE.reference-direct.exr (direct irradiance). With --stride k only every k-th pixel is computed, from pixel k/2 on,
and the files are k times smaller: take the same pixels of what is compared. With --windows N only N squares of 64x64
pixels are computed (windows.py), and one file is written, OUT/CASE.reference-windows.exr: of the full size, 0 outside of the windows, with the
layers irradiance, variance, depth, normal, and the windows' corners as its attribute. Pixels that see nothing are 0. No pixel filter: compare with renderers
that sample pixel centres. Directions are cosine-distributed, stratified 16x16 a round. Paths end after --bounces surfaces, and before by chance.
"""
import argparse, json, os, pathlib, sys, time

import numpy as np

import windows

HERE = pathlib.Path(__file__).resolve().parent
for guess in ("/usr/lib/x86_64-linux-gnu/libLLVM-19.so", "/usr/lib/x86_64-linux-gnu/libLLVM.so.19.1", "/usr/lib/llvm-19/lib/libLLVM.so.1"):
    if os.path.exists(guess):
        os.environ.setdefault("DRJIT_LIBLLVM_PATH", guess)
import drjit as dr
import mitsuba as mi

mi.set_variant("llvm_ad_rgb")
CHUNK = 4_000_000
# Paths end by chance from this surface on, as those of Mitsuba's integrator do. From 1, 2, 3 and 8 on it takes 33, 18, 17 and 6 % longer to be as exact.
ROULETTE_FROM = 5


def ply(path, out):
    """An OBJ's triangles as PLY without normals: some OBJ files carry zero normals, which Mitsuba refuses."""
    points, faces = [], []
    for line in open(path, errors="replace"):
        if line.startswith("v "):
            points.append([float(x) for x in line.split()[1:4]])
        elif line.startswith("f "):
            i = [int(t.split("/")[0]) for t in line.split()[1:]]
            i = [k - 1 if k > 0 else len(points) + k for k in i]
            faces += [(i[0], i[k], i[k + 1]) for k in range(1, len(i) - 1)]
    points, faces = np.array(points, "<f4"), np.array(faces, "<i4")
    with open(out, "wb") as f:
        f.write(f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\nproperty float x\nproperty float y\nproperty float z\n"
                f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n".encode())
        f.write(points.tobytes())
        packed = np.empty(len(faces), dtype=[("n", "u1"), ("i", "<i4", 3)])
        packed["n"], packed["i"] = 3, faces
        f.write(packed.tobytes())
    return out


def diffuse(rgb):
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(rgb)}}}


def strided(width, height, stride=1):
    """Columns and rows of every stride-th pixel, row by row from the top left: two (n,)."""
    x, y = np.meshgrid(np.arange(stride // 2, width, stride), np.arange(stride // 2, height, stride))
    return x.ravel(), y.ravel()


def windowed(width, height, count):
    """Columns and rows of the pixels of so many windows, window by window, and the windows' corners."""
    corners = windows.spread(width, height, count)
    x, y = (a.ravel() for a in np.meshgrid(np.arange(windows.SIDE), np.arange(windows.SIDE)))
    return np.concatenate([left + x for left, _ in corners]), np.concatenate([top + y for _, top in corners]), corners


def pixel_rays(camera, width, height, stride=1):
    """Directions through the centres of every stride-th pixel, row by row from the top left: (n, 3)."""
    return rays_through(camera, width, height, *strided(width, height, stride))


def rays_through(camera, width, height, columns, rows):
    """Directions through the centres of these pixels: (n, 3)."""
    d, up = np.array(camera["direction"], float), np.array(camera["up"], float)
    d /= np.linalg.norm(d)
    right = np.cross(d, up)
    right /= np.linalg.norm(right)
    up = np.cross(right, d)
    t = np.tan(np.radians(camera["fov"]) / 2)  # horizontal
    x = ((columns + 0.5) / width * 2 - 1) * t
    y = (1 - (rows + 0.5) / height * 2) * t * height / width
    rays = d + x[:, None] * right + y[:, None] * up
    return rays / np.linalg.norm(rays, axis=1)[:, None]


def vector(a):
    return mi.Vector3f(*np.ascontiguousarray(a.T.astype(np.float32)))


def direct_irradiance(scene, point, normal, active, lights, epsilon):
    """Irradiance from point lights [W/sr] with shadows: three drjit floats."""
    origin = point + epsilon * normal
    total = [mi.Float(0)] * 3
    for light in lights:
        to = mi.Vector3f(*light["position"]) - origin
        r = dr.norm(to)
        cosine = dr.maximum(dr.dot(normal, to / r), 0)
        ray = mi.Ray3f(origin, to / r)
        ray.maxt = r * (1 - 1e-4)
        seen = active & (cosine > 0)
        seen &= ~scene.ray_test(ray, seen)
        total = [t + dr.select(seen, i * cosine / (r * r), 0) for t, i in zip(total, light["intensity"])]
    return total


def facing(normal, direction):
    return dr.select(dr.dot(normal, direction) > 0, -normal, normal)


@dr.syntax
def gathered(scene, origin, towards, active, lights, random, bounces, epsilon):
    """What rays bring of light that surfaces reflect, at most `bounces` times: reflectance x direct irradiance where they land, and where they go on to.
    From the bounce ROULETTE_FROM on they go on by chance, as probably as the surface reflects."""
    at, way, alive = mi.Point3f(origin), mi.Vector3f(towards), mi.Bool(active)
    total, weight, b = mi.Color3f(0), mi.Color3f(1), mi.UInt32(0)
    while alive:
        far = scene.ray_intersect(mi.Ray3f(at, way), alive)
        alive &= far.is_valid()
        normal = facing(far.n, way)
        weight *= dr.select(alive, far.bsdf().eval_diffuse_reflectance(far, alive), 0)
        lit = direct_irradiance(scene, far.p, normal, alive, lights, epsilon)
        total += dr.select(alive, mi.Color3f(*lit) * weight, 0)
        b += 1
        goes_on = dr.select(b < ROULETTE_FROM, mi.Float(1), dr.minimum(dr.max(weight), 1))
        alive &= (b < bounces) & (random.next_float32() < goes_on)
        weight /= dr.maximum(goes_on, 1e-6)
        u, v = random.next_float32(), random.next_float32()
        sine, cosine = dr.sincos(2 * dr.pi * v)
        way = mi.Frame3f(normal).to_world(mi.Vector3f(dr.sqrt(u) * cosine, dr.sqrt(u) * sine, dr.sqrt(1 - u)))
        at = mi.Point3f(far.p + epsilon * normal)
    return total


def truth(scene, eye, rays, lights, samples, epsilon, seed=1, note=lambda *a: None, bounces=1):
    """Direct irradiance, indirect irradiance of so many bounces, and the latter's variance, where each ray first hits: three (n, 3) arrays."""
    n = len(rays)
    hit = scene.ray_intersect(mi.Ray3f(vector(np.broadcast_to(np.array(eye, float), (n, 3))), vector(rays)))
    normal = facing(hit.n, vector(rays))
    valid = np.array(hit.is_valid())
    direct = np.stack([np.array(x) for x in direct_irradiance(scene, hit.p, normal, hit.is_valid(), lights, epsilon)], 1) * valid[:, None]
    p, nn = np.array(hit.p).T, np.array(normal).T
    helper = np.where(np.abs(nn[:, :1]) > 0.9, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]])
    t = np.cross(helper, nn)
    t /= np.maximum(np.linalg.norm(t, axis=1)[:, None], 1e-20)
    b = np.cross(nn, t)
    rng = np.random.default_rng(seed)
    index = np.flatnonzero(valid)
    mean, square = np.zeros((n, 3)), np.zeros((n, 3))
    rounds = max(2, samples // 256)
    gx, gy = np.meshgrid(np.arange(16), np.arange(16))
    for k in range(rounds):
        for s in range(0, len(index), CHUNK // 256):
            i = index[s:s + CHUNK // 256]
            u = ((gx.ravel()[None] + rng.random((len(i), 256), np.float32)) / 16)
            v = ((gy.ravel()[None] + rng.random((len(i), 256), np.float32)) / 16) * np.float32(2 * np.pi)
            r, z = np.sqrt(u), np.sqrt(1 - u)
            w = (r * np.cos(v))[..., None] * t[i][:, None] + (r * np.sin(v))[..., None] * b[i][:, None] + z[..., None] * nn[i][:, None]
            o = np.repeat(p[i] + epsilon * nn[i], 256, axis=0)
            w = vector(w.reshape(-1, 3))
            random = mi.PCG32(size=len(o), initstate=dr.arange(mi.UInt32, len(o)) + dr.opaque(mi.UInt32, (seed + k * 7919 + s) % 2**31))
            light = gathered(scene, vector(o), w, mi.Bool(True), lights, random, dr.opaque(mi.UInt32, bounces), epsilon)
            dr.eval(light)
            one = np.stack([np.array(x) for x in (light.x, light.y, light.z)], 1).reshape(len(i), 256, 3).mean(1)
            mean[i] += one
            square[i] += one**2
        note(k + 1, rounds)
    mean /= rounds
    return direct, mean, np.maximum(square / rounds - mean**2, 0) / (rounds - 1)


def geometry(scene, camera, rays):
    """Depth along the camera's axis, (n, 1), and the normal on the side seen, (n, 3), where each ray first hits; 0 where it hits nothing."""
    eye, d = np.array(camera["eye"], float), np.array(camera["direction"], float)
    hit = scene.ray_intersect(mi.Ray3f(vector(np.broadcast_to(eye, (len(rays), 3))), vector(rays)))
    valid = np.array(hit.is_valid())[:, None]
    normal = np.array(facing(hit.n, vector(rays))).T
    depth = np.array(hit.t)[:, None] * (rays @ (d / np.linalg.norm(d)))[:, None]
    return np.where(valid, depth, 0), np.where(valid, normal, 0)


def write_windows(path, size, columns, rows, corners, layers):
    """A file of the full size with these layers, each channels and (n, channels) values; pixels that are not among them are 0."""
    names = [f"{layer}.{channel}" if channel else layer for layer, (channels, _) in layers.items() for channel in channels]
    data = np.zeros((size, size, len(names)), np.float32)
    data[rows, columns] = np.concatenate([values for _, values in layers.values()], axis=1)
    bitmap = mi.Bitmap(data, pixel_format=mi.Bitmap.PixelFormat.MultiChannel, channel_names=names)
    bitmap.metadata()["windows"] = windows.text(corners)
    bitmap.write(str(path))


def write(path, data, width, height):
    mi.Bitmap(np.ascontiguousarray(data.reshape(height, width, 3).astype(np.float32))).write(str(path))


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("case")
    p.add_argument("--cases", default=HERE / "cases.json")
    p.add_argument("--scenes", type=pathlib.Path, default=os.environ.get("HEMISPLAT_SCENES", "."), help="folder of the scenes (default: $HEMISPLAT_SCENES)")
    p.add_argument("--size", type=int, default=1000)
    p.add_argument("--stride", type=int, default=4)
    p.add_argument("--windows", type=int, help="squares of 64x64 pixels, in place of every k-th pixel")
    p.add_argument("--samples", type=int, default=4096)
    p.add_argument("--bounces", type=int, default=1, help="most surfaces that light touches on its way")
    p.add_argument("-o", "--out", type=pathlib.Path, required=True)
    a = p.parse_args()
    case = json.load(open(a.cases))[a.case]
    a.out.mkdir(parents=True, exist_ok=True)
    mesh = ply(a.scenes / case["obj"], a.out / f"{a.case}.ply")
    scene = mi.load_dict({"type": "scene", "mesh": {"type": "ply", "filename": str(mesh), "face_normals": True, "bsdf": diffuse([case["reflectance"]] * 3)}})
    start = time.monotonic()
    columns, rows, corners = windowed(a.size, a.size, a.windows) if a.windows is not None else (*strided(a.size, a.size, a.stride), None)
    rays = rays_through(case["camera"], a.size, a.size, columns, rows)
    result = truth(scene, case["camera"]["eye"], rays, case["lights"], a.samples, 1e-4,
                   bounces=a.bounces, note=lambda k, n: print(f"{k}/{n} {time.monotonic() - start:.0f} s", file=sys.stderr))
    _, mean, variance = result
    if corners:
        depth, normal = geometry(scene, case["camera"], rays)
        layers = {"irradiance": ("RGB", mean), "variance": ("RGB", variance), "depth": ([""], depth), "normal": ("XYZ", normal)}
        write_windows(a.out / f"{a.case}.reference-windows.exr", a.size, columns, rows, corners, layers)
    else:
        side = len(range(a.stride // 2, a.size, a.stride))
        for label, data in zip(("direct", "indirect", "variance"), result):
            write(a.out / f"{a.case}.reference-{label}.exr", data, side, side)
    print(json.dumps({"case": a.case, "size": a.size, "stride": a.stride if not corners else None, "windows": a.windows, "samples": a.samples, "bounces": a.bounces, "seconds": time.monotonic() - start, "mean": float(mean.mean()),
                      "relative_noise": float(np.sqrt(variance).mean() / mean.mean())}))


if __name__ == "__main__":
    main()
