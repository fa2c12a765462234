"""What twenty calls cost beside the library's own work in them, at 1920 × 1080: ``python tests/python/bench_calls.py``.

Of each call the best of three is told: all of it, the library's part (the time that its work took inside of the same call), and
what remains: arguments, threads, results. Not a test: a table.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path
from typing import Any, Callable

import holodrive as hd
import numpy as np
from holodrive._holodrive import _worked

ROOT = Path(__file__).resolve().parents[2]


def best(call: "Callable[[], Any]", times: int = 3) -> "tuple[float, float]":
    """The call with the least beside the library's work: seconds of all of it, and of the work."""
    found = []
    for _ in range(times):
        work, begin = _worked(), time.perf_counter()
        call()
        took = time.perf_counter() - begin
        found.append((took, _worked() - work))
    return min(found, key=lambda one: one[0] - one[1])


def main() -> None:
    folder = Path(tempfile.mkdtemp())
    panel = hd.Panel("generic", wavelength="532nm")
    random = np.random.default_rng(1)
    places = np.c_[random.uniform(-4e-3, 4e-3, (20_000, 2)), random.uniform(-0.25, -0.2, 20_000)]
    cloud = hd.Points(places, phases=random.uniform(0, 6.28, 20_000))
    cloud.write(folder / "points.ply")
    scene = hd.Scene.load(ROOT / "scenes" / "cornell.gltf")
    (folder / "scene.gltf").write_bytes((ROOT / "scenes" / "cornell.gltf").read_bytes())
    data = (ROOT / "scenes" / "cornell.gltf").read_bytes()
    points = scene.points(panel, rays=(200, 200))
    field = hd.hologram(cloud, panel)
    array = np.array(field)
    phases = np.angle(array)
    frame = hd.encode(field, panel, encoding="double-phase")
    field.save(folder / "field.npy")
    frame.save(folder / "frame.png")
    small = hd.Panel(width=480, height=270, pitch="8um", wavelength="532nm")
    light = hd.light_field(scene, small)
    seen = hd.encode(light, small, iterations=10)
    picture = hd.reconstruct(frame, "-220mm")
    calls: "list[tuple[str, Callable[[], Any]]]" = [
        ("Scene.load", lambda: hd.Scene.load(folder / "scene.gltf")),
        ("Scene.from_bytes", lambda: hd.Scene.from_bytes(data)),
        ("Scene.points", lambda: scene.points(panel, rays=(200, 200))),
        ("Points.read", lambda: hd.Points.read(folder / "points.ply")),
        ("Points.write", lambda: cloud.write(folder / "again.ply")),
        ("hologram", lambda: hd.hologram(cloud, panel)),
        ("hologram, three lasers", lambda: hd.hologram(cloud, panel, wavelengths=("638nm", "520nm", "450nm"))),
        ("encode double-phase, Field", lambda: hd.encode(field, panel, encoding="double-phase")),
        ("encode double-phase, array", lambda: hd.encode(array, panel, encoding="double-phase")),
        ("encode error-diffusion, array", lambda: hd.encode(array, panel, encoding="error-diffusion")),
        ("encode kinoform, phases", lambda: hd.encode(phases, panel)),
        ("encode gradient, 5 steps", lambda: hd.encode(array, panel, encoding="gradient", iterations=5)),
        ("encode for an eye (small)", lambda: hd.encode(light, small, iterations=10)),
        ("light_field (small)", lambda: hd.light_field(points, small)),
        ("judge (small)", lambda: hd.judge(seen, light)),
        ("propagate", lambda: hd.propagate(field, "0.1m")),
        ("reconstruct a frame", lambda: hd.reconstruct(frame, "-220mm")),
        ("reconstruct for an eye", lambda: hd.reconstruct(frame, "-220mm", eye=(0, 0, 0.6), size=(400, 300))),
        ("Field.save", lambda: field.save(folder / "out.npy")),
        ("Field.load", lambda: hd.Field.load(folder / "field.npy")),
        ("Frame.save", lambda: frame.save(folder / "out.png")),
        ("Frame.load", lambda: hd.Frame.load(folder / "frame.png")),
        ("Picture.save", lambda: picture.save(folder / "out-picture.png")),
    ]
    print(f"{'call':32} {'all':>9}  {'library':>9}  {'beside it':>9}")
    sums = [0.0, 0.0]
    for name, call in calls:
        took, worked = best(call)
        sums = [sums[0] + took, sums[1] + worked]
        print(f"{name:32} {1e3 * took:6.1f} ms  {1e3 * worked:6.1f} ms  {1e3 * (took - worked):6.2f} ms  {100 * (took / worked - 1):+.1f} %")
    print(f"{len(calls)} calls: {sums[0]:.2f} s, the library {sums[1]:.2f} s: {100 * (sums[0] / sums[1] - 1):+.2f} %")
    quick: "list[tuple[str, Callable[[], Any]]]" = [
        ("Panel(name)", lambda: hd.Panel("generic", wavelength="532nm")),
        ("Field(array)", lambda: hd.Field(array, "8um", "532nm")),
        ("np.asarray(field)", lambda: np.asarray(field)),
        ("frame.levels", lambda: frame.levels),
        ("Frame(levels)", lambda: hd.Frame(frame.levels, panel)),
        ("Points(20,000)", lambda: hd.Points(places)),
    ]
    for name, call in quick:
        print(f"{name:32} {1e3 * best(call)[0]:6.2f} ms, none of it the library's work")


if __name__ == "__main__":
    sys.exit(main())
