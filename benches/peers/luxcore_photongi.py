#!/usr/bin/env python3
"""LuxCore's path tracer with its PhotonGI cache of indirect light on a case of cases.json, timed.

    $PEERS_HOME/bin/python luxcore_photongi.py sibenik --size 1000 --radius 0.12 --photons 500000 --samples 8 -o OUT

Writes OUT/CASE.indirect.exr (indirect irradiance at each pixel's centre, W/m2: the quantity of mitsuba_reference.py with --bounces) and prints seconds and
settings as JSON. First the camera's paths leave points on what they see, then photons give those the light of discs of --radius. The picture's paths end
at the nearest point where, past the first surface, they hit something further off than a random share of --usage radii. `--photons 0` is plain path
tracing. `--denoise` ends with Open Image Denoise, as mitsuba_denoised.py does, and also writes OUT/CASE.noisy.exr, from before it.

LuxCore's layer of indirect light lacks what comes from the cache. So that light is the radiance less the layer of direct light, which is of the same paths,
times pi over the reflectance.

"seconds" holds the cache, the rendering and the denoiser. It holds neither loading the scene, nor building LuxCore's acceleration structure, nor writing the
picture. "processor_seconds" is what LuxCore's threads worked: far less than --processes times the seconds tells that other programs ran beside it.
"""
import argparse, concurrent.futures, contextlib, json, multiprocessing, os, pathlib, sys, time

import mitsuba_reference as reference
from mitsuba_reference import mi, np

# Width of the pixel filter: samples lie at the pixel's centre, as those of the truth do.
CENTRE = 1e-3
# How often to look whether the picture is done [s].
WAIT = 0.01


class Log:
    """LuxCore's messages, and when the cache's came first."""

    def __init__(self, tell):
        self.tell, self.cache_at, self.facts = tell, None, {}

    def __call__(self, message):
        if self.tell:
            print(message, file=sys.stderr)
        if "PhotonGI" in message and self.cache_at is None:
            self.cache_at = time.monotonic()
        for name, start in (("traced", "PhotonGI total photon traced: "), ("points", "PhotonGI total radiance photon stored: ")):
            if start in message:
                self.facts[name] = int(message.split(start)[1].split()[0])


def properties(values):
    props = pyluxcore.Properties()
    for key, value in values.items():
        props.Set(pyluxcore.Property(key, value))
    return props


def scene(case, mesh):
    """The case as LuxCore's scene: one matte mesh with the faces' normals, and the point lights."""
    camera = case["camera"]
    values = {
        "scene.camera.type": "perspective",
        "scene.camera.lookat.orig": camera["eye"],
        "scene.camera.lookat.target": [e + d for e, d in zip(camera["eye"], camera["direction"])],
        "scene.camera.up": camera["up"],
        "scene.camera.fieldofview": camera["fov"],
        "scene.camera.autovolume.enable": False,
        "scene.materials.grey.type": "matte",
        "scene.materials.grey.kd": [case["reflectance"]] * 3,
        "scene.shapes.mesh.type": "mesh",
        "scene.shapes.mesh.ply": str(mesh),
        "scene.objects.mesh.shape": "mesh",
        "scene.objects.mesh.material": "grey",
    }
    for k, light in enumerate(case["lights"]):
        # Without a power, a point light's intensity [W/sr] is colour x gain / 4 pi.
        values |= {
            f"scene.lights.lamp{k}.type": "point",
            f"scene.lights.lamp{k}.position": light["position"],
            f"scene.lights.lamp{k}.color": light["intensity"],
            f"scene.lights.lamp{k}.gain": [4 * np.pi] * 3,
            f"scene.lights.lamp{k}.power": 0.0,
            f"scene.lights.lamp{k}.efficency": 0.0,
        }
    made = pyluxcore.Scene()
    made.Parse(properties(values))
    return made


def settings(a, size, samples):
    """Path tracing with radiance as it is: nothing clamped, no tone mapping."""
    values = {
        "renderengine.type": "PATHCPU",
        "native.threads.count": a.processes,
        "renderengine.seed": 1,
        "sampler.type": "SOBOL",
        # As many paths for each pixel: LuxCore would count its noise while it renders, and give noisy pixels more.
        "sampler.sobol.adaptive.strength": 0.0,
        "film.noiseestimation.warmup": 2**30,
        "batch.haltspp": samples,
        # A path's last surface is not lit, and its first is not indirect.
        "path.pathdepth.total": a.bounces + 2,
        "path.pathdepth.diffuse": a.bounces + 2,
        "path.russianroulette.depth": reference.ROULETTE_FROM,
        "path.clamping.variance.maxvalue": 0.0,
        "film.width": size,
        "film.height": size,
        "film.filter.type": "BOX",
        "film.filter.width": CENTRE,
        "film.imagepipelines.0.0.type": "NOP",
        "film.outputs.0.type": "RGB",
        "film.outputs.0.filename": "radiance.exr",
        "film.outputs.1.type": "DIRECT_DIFFUSE",
        "film.outputs.1.filename": "direct.exr",
    }
    if a.photons:
        values |= {
            "path.photongi.indirect.enabled": True,
            "path.photongi.sampler.type": a.sampler,
            "path.photongi.photon.maxcount": a.photons,
            "path.photongi.photon.maxdepth": a.bounces + 1,
            "path.photongi.visibility.targethitrate": a.hit_rate,
            "path.photongi.visibility.maxsamplecount": a.visibility_samples,
            # Above 0, --photons are traced and no fewer; at 0, LuxCore would go on by 2 000 000 until points change by less than a threshold.
            "path.photongi.indirect.maxsize": 2**31 - 1,
            "path.photongi.indirect.lookup.radius": a.radius,
            "path.photongi.indirect.usagethresholdscale": a.usage,
            "path.photongi.indirect.filter.radiusscale": a.filter,
        }
    return properties(values)


def picture(made, a, log):
    """Radiance and its direct part, (size, size, 3) from the top left, when the cache was begun, done, and the picture done, and the processor's seconds in all."""
    busy = time.process_time()
    session = pyluxcore.RenderSession(pyluxcore.RenderConfig(settings(a, a.size, a.samples), made))
    session.Start()
    started = time.monotonic()
    while not session.HasDone():
        time.sleep(WAIT)
        session.UpdateStats()
    session.Stop()
    done = time.monotonic()
    busy = time.process_time() - busy
    layers = []
    for kind in (pyluxcore.FilmOutputType.RGB, pyluxcore.FilmOutputType.DIRECT_DIFFUSE):
        pixels = np.zeros((a.size, a.size, 3), np.float32)
        session.GetFilm().GetOutputFloat(kind, pixels)
        layers.append(pixels[::-1])
    return layers, log.cache_at or started, started, done, busy


def rendered(case, mesh, a):
    """Indirect irradiance, (size, size, 3), the seconds of its parts and of the processor, and what the cache holds. To be called in a process of its own: with
    LuxCore comes another allocator, in whose process Mitsuba's kernels and the denoiser crash."""
    global pyluxcore
    with contextlib.redirect_stdout(sys.stderr):  # it tells what it loads
        import pyluxcore
    log = Log(a.log)
    pyluxcore.Init(log)
    (radiance, direct), begun, started, done, busy = picture(scene(case, mesh), a, log)
    pyluxcore.SetLogHandler(None)
    return (radiance - direct) * (np.pi / case["reflectance"]), {"cache": started - begun, "rendering": done - started}, busy, log.facts


def denoised(irradiance, case, mesh, size, quality):
    """The irradiance without noise, by the denoiser of mitsuba_denoised.py and its G-buffer without noise, and the seconds of both."""
    import mitsuba_denoised as denoiser

    bsdf = reference.diffuse([case["reflectance"]] * 3)
    mitsuba_scene = mi.load_dict({"type": "scene", "mesh": {"type": "ply", "filename": str(mesh), "face_normals": True, "bsdf": bsdf}})
    denoiser.gbuffer(mitsuba_scene, case["camera"], 16)
    start = time.monotonic()
    _, normal, seen, albedo = denoiser.gbuffer(mitsuba_scene, case["camera"], size)
    out = denoiser.denoise(np.ascontiguousarray(irradiance), denoiser.array(albedo, size), denoiser.array(normal, size), quality)
    out = np.maximum(out, 0) * np.array(seen).reshape(size, size, 1)
    return out, time.monotonic() - start


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("case")
    p.add_argument("--cases", default=reference.HERE / "cases.json")
    p.add_argument("--scenes", type=pathlib.Path, default=os.environ.get("HEMISPLAT_SCENES", "."), help="folder of the scenes (default: $HEMISPLAT_SCENES)")
    p.add_argument("--size", type=int, default=1000)
    p.add_argument("--samples", type=int, default=8, help="paths a pixel")
    p.add_argument("--bounces", type=int, default=24, help="most surfaces that light touches on its way")
    p.add_argument("--photons", type=int, default=500_000, help="photons' paths; 0: no cache")
    p.add_argument("--radius", type=float, default=0.15, help="of the cache's points, in the scene's units; 0: LuxCore chooses")
    p.add_argument("--filter", type=float, default=3.0, help="points are averaged within so many radii")
    p.add_argument("--usage", type=float, default=8.0, help="the cache is used from 0 to so many radii off")
    p.add_argument("--hit-rate", type=float, default=0.99, help="share of the camera's paths' hits that find a point at which points suffice")
    p.add_argument("--visibility-samples", type=int, default=2**20, help="most of the camera's paths that look for places of points")
    p.add_argument("--sampler", default="METROPOLIS", choices=["METROPOLIS", "RANDOM"], help="of the photons")
    p.add_argument("--processes", type=int, default=os.cpu_count(), help="threads")
    p.add_argument("--denoise", choices=["fast", "balanced", "high"], help="end with Open Image Denoise of this quality")
    p.add_argument("--log", action="store_true", help="tell what LuxCore tells")
    p.add_argument("-o", "--out", type=pathlib.Path, required=True)
    a = p.parse_args()
    case = json.load(open(a.cases))[a.case]
    a.out.mkdir(parents=True, exist_ok=True)
    mesh = reference.ply(a.scenes / case["obj"], a.out / f"{a.case}.ply")
    with concurrent.futures.ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as alone:
        irradiance, parts, busy, found = alone.submit(rendered, case, mesh, a).result()
    if a.denoise:
        reference.write(a.out / f"{a.case}.noisy.exr", irradiance, a.size, a.size)
        irradiance, parts["denoiser"] = denoised(irradiance, case, mesh, a.size, a.denoise)
    reference.write(a.out / f"{a.case}.indirect.exr", irradiance, a.size, a.size)
    named = ("case", "size", "samples", "bounces", "photons", "radius", "filter", "usage", "hit_rate", "visibility_samples", "sampler", "processes", "denoise")
    facts = {name: getattr(a, name) for name in named} | found
    json.dump(facts | {"seconds": sum(parts.values()), "parts": parts, "processor_seconds": busy, "mean": float(irradiance.mean())}, sys.stdout)
    print()


if __name__ == "__main__":
    main()
