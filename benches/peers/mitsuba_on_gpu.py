#!/usr/bin/env python3
"""Seconds that mitsuba_denoised.py would take with an NVIDIA GPU: its paths by Mitsuba's CUDA variant, its denoiser by Open Image Denoise on CUDA.

    $PEERS_HOME/bin/python mitsuba_on_gpu.py sibenik sponza --rays 1 4 16 64 --bounces 24 -o OUT.json

Tells each case and number of rays, and each quality of the denoiser, where pyoidn is installed. Seconds are medians of --runs, after one run that compiles: the
G-buffer with the paths, and the denoiser with and without making it. They do not hold transfers between host and device, nor files. The pictures are those that
mitsuba_denoised.py makes on a processor, from the same numbers, so that its errors are theirs.
"""
import argparse, datetime, json, os, pathlib, statistics, subprocess, sys, tempfile, time, types

import mitsuba as mi

mi.set_variant("cuda_ad_rgb")
mi.set_variant = lambda *_: None  # The scripts beside this one ask for the processor's.
try:
    import pyoidn
except ImportError:
    pyoidn = None
    sys.modules["pyoidn"] = types.SimpleNamespace(OIDN_QUALITY_FAST=4, OIDN_QUALITY_BALANCED=5, OIDN_QUALITY_HIGH=6)
import mitsuba_denoised as peer
from mitsuba_denoised import dr, np, reference


def seconds(work, runs):
    """The median of some runs, after one that compiles."""
    taken = []
    for _ in range(runs + 1):
        dr.sync_thread()
        start = time.monotonic()
        work()
        dr.sync_thread()
        taken.append(time.monotonic() - start)
    return statistics.median(taken[1:])


def paths(case, scene, size, rays, bounces):
    point, normal, seen, _ = peer.gbuffer(scene, case["camera"], size, size)
    across, along = (dr.opaque(mi.UInt32, strata) for strata in peer.STRATA[rays])
    dr.eval(peer.cast(scene, point, normal, seen, case["lights"], across, along, dr.opaque(mi.UInt32, bounces)))


def made_denoiser(size, quality):
    """A filter over memory of its own on the device."""
    device = pyoidn.Device(pyoidn.OIDN_DEVICE_TYPE_CUDA)
    device.commit()
    peer.check(device)
    made = pyoidn.Filter(device, pyoidn.OIDN_FILTER_TYPE_RT)
    random = np.random.default_rng(1).random((size, size, 3), dtype=np.float32)
    buffers = [pyoidn.Buffer(device, random.nbytes) for _ in range(4)]
    for name, buffer in zip(("color", "albedo", "normal", "output"), buffers):
        buffer.write(0, random.nbytes, random)
        made.set_image(name, buffer, pyoidn.OIDN_FORMAT_FLOAT3, width=size, height=size)
    made.set_bool("cleanAux", True)
    made.set_bool("hdr", True)
    made.set_quality(peer.QUALITY[quality])
    made.commit()
    peer.check(device)
    return device, made, buffers


def denoising(size, quality, runs):
    made_in = seconds(lambda: made_denoiser(size, quality), runs)
    device, made, _buffers = made_denoiser(size, quality)
    executed = seconds(made.execute, runs)
    peer.check(device)
    return {"quality": quality, "seconds": executed, "seconds_to_make": made_in}


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("cases", nargs="*")
    p.add_argument("--scenes", type=pathlib.Path, default=os.environ.get("HEMISPLAT_SCENES", "."), help="folder of the scenes (default: $HEMISPLAT_SCENES)")
    p.add_argument("--size", type=int, default=1000)
    p.add_argument("--rays", type=int, nargs="+", default=[1, 4, 16, 64], choices=sorted(peer.STRATA))
    p.add_argument("--bounces", type=int, default=24, help="most surfaces that light touches on its way")
    p.add_argument("--runs", type=int, default=5)
    p.add_argument("-o", "--out", type=pathlib.Path, required=True)
    a = p.parse_args()
    gpu = subprocess.run(["nvidia-smi", "--query-gpu=name,driver_version", "--format=csv,noheader"], capture_output=True, text=True, check=True).stdout.strip()
    told = {"schema": 1, "date": str(datetime.datetime.now(datetime.timezone.utc).date()), "gpu": gpu, "size": a.size, "bounces": a.bounces, "paths": [], "denoising": []}
    for name in a.cases:
        case = json.load(open(reference.HERE / "cases.json"))[name]
        with tempfile.TemporaryDirectory() as folder:
            mesh = reference.ply(a.scenes / case["obj"], pathlib.Path(folder) / "mesh.ply")
            bsdf = reference.diffuse([case["reflectance"]] * 3)
            scene = mi.load_dict({"type": "scene", "mesh": {"type": "ply", "filename": str(mesh), "face_normals": True, "bsdf": bsdf}})
        for rays in a.rays:
            told["paths"].append({"case": name, "rays": rays, "seconds": seconds(lambda: paths(case, scene, a.size, rays, a.bounces), a.runs)})
    told["denoising"] = [denoising(a.size, quality, a.runs) for quality in (peer.QUALITY if pyoidn else [])]
    a.out.write_text(json.dumps(told, indent=2) + "\n")


if __name__ == "__main__":
    main()
