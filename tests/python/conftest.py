"""What the tests of the Python package share. They run on the installed wheel: tests/run installs it."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Iterator

import holodrive as hd
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session", autouse=True)
def the_wheel_and_no_other_module_is_tested() -> None:
    # `src/serve/holodrive.py` has the same name, and tests of the program put it on PYTHONPATH.
    assert hd.__file__ is not None and hd.__file__.endswith(os.path.join("holodrive", "__init__.py"))


@pytest.fixture(scope="session")
def panel() -> hd.Panel:
    """64 × 48 pixels of 8 µm in green light: 0.5 mm wide, so that the cones of points 0.1 m away cover all of it."""
    return hd.Panel(width=64, height=48, pitch="8um", wavelength="532nm")


@pytest.fixture(scope="session")
def wide() -> hd.Panel:
    """480 × 270 pixels of 8 µm, for eyes."""
    return hd.Panel(width=480, height=270, pitch="8um", wavelength="632.8nm")


@pytest.fixture(scope="session")
def room() -> hd.Scene:
    return hd.Scene.load(ROOT / "scenes" / "cornell.gltf")


@pytest.fixture(params=["socket", "port"])
def served(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> "Iterator[hd.Served]":
    """A panel of 320 × 200 pixels by either way of the local protocol."""
    if sys.platform == "win32":
        pytest.skip("the tests tell times by a clock that programs have in common")
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    profile = (ROOT / "calib" / "generic.toml").read_text()
    profile = profile.replace("width = 1920", "width = 320").replace("height = 1080", "height = 200")
    (tmp_path / "small.toml").write_text(profile)
    (tmp_path / "holodrive").mkdir(mode=0o700)
    way = ("--local", str(tmp_path / "holodrive" / "bench.port")) if request.param == "port" else ("--local",)
    arguments = (*way, "--trigger", "0")
    with hd.serve(tmp_path / "small.toml", name="bench", output=tmp_path / "frames", arguments=arguments) as running:
        yield running


def shown_levels(folder: Path) -> "list[int]":
    """The level of each frame that the simulated panel has shown, after the idle one; all of its pixels have it."""
    levels = []
    for path in sorted(folder.glob("frame-*.png"))[1:]:
        frame = hd.Frame.load(path).levels
        assert (frame == frame[0, 0]).all()
        levels.append(int(frame[0, 0]))
    return levels


def sphere(
    panel: hd.Panel, place: "tuple[float, float, float]", wavelength: float
) -> "np.ndarray[tuple[int, int], np.dtype[np.complex128]]":
    """The wave of a point: exp(+ikr)/r from behind the panel, exp(-ikr)/r towards a point before it."""
    x, y = np.meshgrid(panel.x, panel.y)
    r = np.sqrt((x - place[0]) ** 2 + (y - place[1]) ** 2 + place[2] ** 2)
    sign = 1 if place[2] < 0 else -1
    return np.asarray(np.exp(sign * 2j * np.pi * r / wavelength) / r)


def distance(a: object, b: object) -> float:
    """Relative L2 distance of complex fields."""
    a, b = np.asarray(a, np.complex128), np.asarray(b, np.complex128)
    return float(np.linalg.norm(a - b) / np.linalg.norm(b))
