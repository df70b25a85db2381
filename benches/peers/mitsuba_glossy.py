#!/usr/bin/env python3
"""Mitsuba 3's ray casting of the glossy Cornell box as fast as it goes: what the wall's lobe reflects of light that touched exactly one other surface.

    $PEERS_HOME/bin/python mitsuba_glossy.py --size 1000 --strata 32 -o OUT                            # Phong, as the scene has it
    $PEERS_HOME/bin/python mitsuba_glossy.py --metal 0.55 --size 1000 --strata 32 -o OUT               # the wall of Mitsuba's roughconductor
    $PEERS_HOME/bin/python mitsuba_glossy.py --size 1000 --stride 8 --strata 32 --rounds 32 -o OUT     # truth, with its variance

Writes OUT/NAME.exr with the layer `glossy` (W/m2/sr at each pixel's centre, 0 where nothing is glossy) and, of several rounds, `glossy_variance`, and
prints seconds and settings as JSON. Each glossy pixel casts strata x strata rays a round, drawn from the lobe, and from where each hits one to the
lamp: both stratified, the lamp's strata dealt to the lobe's anew at each pixel. Compare with `hemisplat diff`, layer `glossy`. With --stride k only
every k-th pixel is computed, from pixel k/2 on. All work is one kernel a chunk on all cores; compiling it is done beforehand on a few pixels and is
not in the seconds; neither is loading the scene.

The scene is read from the RON file. Mitsuba 3 has no Phong: its lobe is a few lines here, as (n+2)/2pi cos^n, drawn by (n+1)/2pi cos^n. --metal r is
glTF's metal of base 1 and roughness r, in Mitsuba `roughconductor`, ggx of alpha r^2, without Fresnel's term; the scene is written as
OUT/cornell-metal.ron for hemisplat. Its Smith term is taken apart for both directions, hemisplat's for both together: each has its own truth.
"""
import argparse, json, pathlib, re, sys, time

import mitsuba_reference as reference
from mitsuba_reference import dr, mi, np

SCENE = reference.HERE.parents[1] / "scenes" / "cornell-glossy.ron"
NUMBER = r"-?[\d.]+"
EPSILON = 0.01  # of millimetres


def numbers(text):
    return [float(x) for x in re.findall(NUMBER, text)]


def read(text):
    """Quads as (corners, material), materials as (kind, {name: numbers}), and the camera of a RON scene of this shape."""
    quads = [(np.array(numbers(c)).reshape(4, 3), m) for c, m in re.findall(r'Quad\(corners: (\(\(.*?\)\)), material: "(\w+)"\)', text)]
    materials = {name: (kind, {k: numbers(v) for k, v in re.findall(rf"(\w+): (\([^)]*\)|{NUMBER})", of)})
                 for name, kind, of in re.findall(r'"(\w+)": (\w+)\((.*)\),\n', text)}
    camera = dict(re.findall(rf"(eye|direction|up|fov): (\([^)]*\)|{NUMBER})", text[text.index("cameras:"):]))
    return quads, materials, {k: numbers(v) if v[0] == "(" else float(v) for k, v in camera.items()}


class Phong:
    def __init__(self, specular, exponent):
        self.specular, self.exponent = specular, exponent[0]

    def sample(self, outgoing, u, v):
        """A direction in the wall's frame and its share of the light, red, green, blue."""
        cosine = dr.power(u, 1 / (self.exponent + 1))
        sine, (s, c) = dr.sqrt(dr.maximum(1 - cosine * cosine, 0)), dr.sincos(2 * np.pi * v)
        way = mi.Frame3f(mi.Vector3f(-outgoing.x, -outgoing.y, outgoing.z)).to_world(mi.Vector3f(sine * c, sine * s, cosine))
        share = dr.maximum(way.z, 0) * ((self.exponent + 2) / (self.exponent + 1))
        return way, [share * x for x in self.specular]


class Metal:
    def __init__(self, roughness):
        self.bsdf = mi.load_dict({"type": "roughconductor", "distribution": "ggx", "alpha": roughness**2, "material": "none"})

    def sample(self, outgoing, u, v):
        si = dr.zeros(mi.SurfaceInteraction3f, dr.width(u))
        si.wi = outgoing
        drawn, share = self.bsdf.sample(mi.BSDFContext(), si, 0, mi.Point2f(u, v))
        return drawn.wo, [share.x, share.y, share.z]


def build(quads, materials):
    """All that reflects in one mesh, coloured a face, and the lamp: one kind of BSDF and one emitter need no dispatch."""
    points, colours, lamp = [], [], None
    for corners, name in quads:
        kind, of = materials[name]
        if kind == "Emitter":
            across, along = (corners[1] - corners[0]) / 2, (corners[2] - corners[1]) / 2
            normal = np.cross(across, along) / np.linalg.norm(np.cross(across, along))
            place = np.eye(4)
            place[:3] = np.stack([across, along, normal, corners.mean(0)], 1)
            lamp = {"type": "rectangle", "to_world": mi.ScalarTransform4f(place), "bsdf": reference.diffuse(of["reflectance"]),
                    "emitter": {"type": "area", "radiance": {"type": "rgb", "value": of["radiance"]}}}
        else:
            points += [corners[k] for k in (0, 1, 2, 0, 2, 3)]
            colours += [of.get("reflectance", [0, 0, 0])] * 2
    settings = mi.Properties()
    settings["mesh_bsdf"] = mi.load_dict({"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": {"type": "mesh_attribute", "name": "face_color"}}})
    settings["face_normals"] = True
    mesh = mi.Mesh("box", len(points), len(points) // 3, props=settings)
    mesh.add_attribute("face_color", 3, np.array(colours, np.float32).ravel())
    values = mi.traverse(mesh)
    values["vertex_positions"] = np.array(points, np.float32).ravel()
    values["faces"] = np.arange(len(points), dtype=np.uint32)
    values.update()
    return mi.load_dict({"type": "scene", "mesh": mesh, "lamp": lamp})


def seen(scene, wall, eye, rays):
    """Which rays meet the wall first, where, and from where in its frame."""
    n = len(rays)
    towards = reference.vector(rays)
    hit = scene.ray_intersect(mi.Ray3f(reference.vector(np.broadcast_to(np.array(eye, float), (n, 3))), towards))
    index = dr.compress(hit.is_valid() & ((hit.prim_index // 2) == wall) & (hit.shape == mi.ShapePtr(scene.shapes()[0])))
    normal = reference.facing(hit.n, towards)
    start, outgoing = hit.p + EPSILON * normal, mi.Frame3f(normal).to_local(-towards)
    dr.eval(index, start, normal, outgoing)
    return index, start, normal, outgoing


def cast(scene, wall, lobe, eye, rays, strata, seed=0):
    """What the wall's lobe reflects of indirect light at each ray: (n, 3), and how many rays meet the wall."""
    each = strata * strata
    index, *of = seen(scene, wall, eye, rays)
    mean = np.zeros((len(rays), 3))
    pixels_at_once = max(1, reference.CHUNK // each)
    for first in range(0, len(index), pixels_at_once):
        pixel = dr.gather(mi.UInt32, index, first + dr.arange(mi.UInt32, min(pixels_at_once, len(index) - first)))
        mean[np.array(pixel)] = gathered(scene, lobe, *of, dr.repeat(pixel, each), strata, seed)
    return mean, len(index)


def gathered(scene, lobe, start, normal, outgoing, pixel, strata, seed):
    """Means over runs of strata x strata rays, each of the pixel that it says: (pixels, 3)."""
    each = strata * strata
    lane = dr.arange(mi.UInt32, len(pixel))
    cell, seed = lane % each, dr.opaque(mi.UInt32, seed)
    random = mi.PCG32(size=len(pixel), initstate=pixel * each + cell, initseq=seed)

    def pair(cell):
        return [(mi.Float(k) + random.next_float32()) / strata for k in (cell % strata, cell // strata)]

    origin, up, out = (mi.Vector3f(*[dr.gather(mi.Float, one, pixel) for one in (of.x, of.y, of.z)]) for of in (start, normal, outgoing))
    way, share = lobe.sample(out, *pair(cell))
    towards = mi.Frame3f(up).to_world(way)
    far = scene.ray_intersect(mi.Ray3f(mi.Point3f(origin), towards), way.z > 0)
    # A shift at random and a step coprime to the number of strata: each of the lobe's strata gets any of the lamp's, none twice.
    dealt = (cell * step(each) + mi.sample_tea_32(pixel, seed)[0] % each) % each
    to_lamp, light = scene.sample_emitter_direction(far, mi.Point2f(*pair(dealt)), True, far.is_valid())
    cosine = dr.maximum(dr.dot(reference.facing(far.n, towards), to_lamp.d), 0) / np.pi
    albedo = far.bsdf().eval_diffuse_reflectance(far, far.is_valid())
    parts = zip(share, (albedo.x, albedo.y, albedo.z), (light.x, light.y, light.z))
    result = [dr.select(far.is_valid(), s * a * l * cosine, 0) for s, a, l in parts]
    dr.eval(result)  # together: each alone would cast all rays again
    return np.stack([np.array(dr.block_reduce(dr.ReduceOp.Add, one, each)) for one in result], 1) / each


def step(each):
    """Near the golden section of a number, and coprime to it."""
    return next((k for k in range(round(0.618 * each), each) if np.gcd(k, each) == 1), 1)


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--scene", type=pathlib.Path, default=SCENE)
    p.add_argument("--metal", type=float, metavar="ROUGHNESS", help="a metal in place of the wall's Phong")
    p.add_argument("--size", type=int, default=1000)
    p.add_argument("--stride", type=int, default=1)
    p.add_argument("--strata", type=int, default=32, help="strata along each side of the lobe's and the lamp's square")
    p.add_argument("--rounds", type=int, default=1, help="independent estimates; of several the variance is told")
    p.add_argument("--seed", type=int, default=0, help="of the first round")
    p.add_argument("--name", help="of the file that is written")
    p.add_argument("-o", "--out", type=pathlib.Path, required=True)
    a = p.parse_args()
    a.out.mkdir(parents=True, exist_ok=True)
    text = a.scene.read_text()
    if a.metal is not None:
        text = re.sub(r'"glossy": Phong\(.*\)', f'"glossy": MetallicRoughness(base: (1, 1, 1), metallic: 1, roughness: {a.metal})', text)
        (a.out / "cornell-metal.ron").write_text(text)
    quads, materials, camera = read(text)
    (kind, of), wall = materials["glossy"], [m for _, m in quads if m != "lamp"].index("glossy")
    lobe = Metal(a.metal) if kind == "MetallicRoughness" else Phong(of["specular"], of["exponent"])
    scene = build(quads, materials)
    view = lambda size, stride, seed: cast(scene, wall, lobe, camera["eye"], reference.pixel_rays(camera, size, size, stride), a.strata, seed)
    view(8, 1, 1)
    began = time.monotonic()
    mean, square = 0, 0
    for k in range(a.rounds):
        one, pixels = view(a.size, a.stride, a.seed + k)
        mean, square = mean + one / a.rounds, square + one**2 / a.rounds
    seconds = time.monotonic() - began
    side = len(range(a.stride // 2, a.size, a.stride))
    layers = {"glossy": mean}
    if a.rounds > 1:
        layers["glossy_variance"] = np.maximum(square - mean**2, 0) / (a.rounds - 1)
    data = np.concatenate([x.reshape(side, side, 3) for x in layers.values()], 2).astype(np.float32)
    channels = [f"{name}.{c}" for name in layers for c in "RGB"]
    name = a.name or f"{'metal' if a.metal is not None else 'phong'}-{a.strata**2 * a.rounds}"
    mi.Bitmap(np.ascontiguousarray(data), mi.Bitmap.PixelFormat.MultiChannel, channels).write(str(a.out / f"{name}.exr"))
    samples = a.strata**2 * a.rounds
    json.dump({"wall": kind, "size": a.size, "stride": a.stride, "samples": samples, "glossy_pixels": pixels, "seconds": seconds,
               "seconds_at_every_pixel": seconds * a.stride**2, "samples_per_second": samples * pixels / seconds,
               "mean": float(mean.sum() / 3 / pixels)}, sys.stdout)
    print()


if __name__ == "__main__":
    main()
