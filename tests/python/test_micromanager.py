"""holodrive's panels as an SLM of an unmodified pymmcore-plus."""

from __future__ import annotations

import re
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any, Iterator

import holodrive as hd
import numpy as np
import pytest
from conftest import ROOT

unicore = pytest.importorskip("pymmcore_plus.experimental.unicore", reason="pymmcore-plus is not installed: its SLM is not tested")
from holodrive.micromanager import Holodrive  # noqa: E402

SIZE = (48, 64)


@pytest.fixture()
def core() -> Iterator[Any]:
    core = unicore.UniMMCore()
    yield core
    core.unloadAllDevices()


def profile(folder: Path, name: str) -> Path:
    """One of the known profiles, smaller."""
    size = {"width": SIZE[1], "height": SIZE[0]}
    lines = (ROOT / "calib" / f"{name}.toml").read_text().splitlines()
    changed = [f"{key} = {size[key]}" if (key := line.split(" =")[0]) in size else line for line in lines]
    path = folder / f"{name}.toml"
    path.write_text("\n".join(changed))
    return path


def load(core: Any, device: Holodrive) -> None:
    core.loadPyDevice("SLM", device)
    core.initializeDevice("SLM")
    core.setSLMDevice("SLM")


def test_pymmcore_plus_is_needed_by_its_module_alone() -> None:
    script = "import sys\nsys.modules['pymmcore_plus'] = None\nimport holodrive\nimport holodrive.micromanager"
    told = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    last = told.stderr.strip().splitlines()[-1]
    assert last.startswith("ImportError: holodrive.micromanager needs pymmcore-plus 0.18 or newer: pip install pymmcore-plus (")


@pytest.mark.parametrize("name, size, most", [("generic", 1, 255), ("meadowlark-p1920-10", 2, 1023)])
def test_images_of_the_core_come_on_the_panel_level_by_level(core: Any, tmp_path: Path, name: str, size: int, most: int) -> None:
    device = Holodrive(profile(tmp_path, name), output=tmp_path / "frames")
    load(core, device)
    assert (core.getSLMHeight(), core.getSLMWidth()) == SIZE
    assert (core.getSLMBytesPerPixel(), core.getSLMNumberOfComponents()) == (size, 1)
    levels = np.random.default_rng(3).integers(0, most + 1, SIZE).astype(device.dtype())
    core.setSLMImage("SLM", levels)
    assert device.shown is None, "an image is shown when that is asked for"
    core.displaySLMImage("SLM")
    assert device.shown is not None and device.shown.number == 1
    assert (core.getSLMImage("SLM") == levels).all()
    core.setSLMPixelsTo("SLM", most)
    core.displaySLMImage("SLM")
    frames = [hd.Frame.load(path).levels for path in sorted((tmp_path / "frames").glob("frame-*.png"))[1:]]
    assert len(frames) == 2 and (frames[0] == levels).all() and (frames[1] == most).all()
    assert core.getSLMExposure("SLM") == 0
    with pytest.raises(hd.ParameterError, match="stays as it is"):
        core.setSLMExposure("SLM", 20.0)
    assert core.getSLMSequenceMaxLength("SLM") == 0, "there is no trigger"


def test_sequences_are_kept_ready_and_follow_the_trigger(core: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    (tmp_path / "holodrive").mkdir(mode=0o700)
    arguments = ("--local", "--trigger", "0")
    with hd.serve(profile(tmp_path, "generic"), name="mm", output=tmp_path / "frames", arguments=arguments) as served:
        load(core, Holodrive(served))
        assert core.getSLMSequenceMaxLength("SLM") == 2_000_000_000 // (4 * 48 * 64)
        for levels in ([5, 6, 7], [8, 9]):
            core.loadSLMSequence("SLM", [np.full(SIZE, level, np.uint8) for level in levels])
            core.startSLMSequence("SLM")
            host, _, port = str(served.about["trigger"]).rpartition(":")
            with socket.create_connection((host, int(port)), 5) as line:
                answers = line.makefile("rb")
                line.sendall(b"\n" * (len(levels) + 1))
                for _ in range(len(levels) + 1):
                    assert not answers.readline().startswith(b"error")
                core.stopSLMSequence("SLM")
                line.sendall(b"\n")
                assert answers.readline().startswith(b"error")
        core.unloadDevice("SLM")
        assert served.running, "a panel that is served elsewhere stays"
    shown = [int(hd.Frame.load(path).levels[0, 0]) for path in sorted((tmp_path / "frames").glob("frame-*.png"))[1:]]
    assert shown == [5, 6, 7, 5, 8, 9, 8]


def test_slips_are_told_when_the_device_is_made(tmp_path: Path) -> None:
    with pytest.raises(hd.Error, match="generic"):
        Holodrive("generik")
    with pytest.raises(hd.ParameterError, match="not initialised"):
        Holodrive(profile(tmp_path, "generic")).display_image()


def test_the_guides_page_runs() -> None:
    block = re.search(r"```python micromanager\n(.*?)```", (ROOT / "src/guide/python.md").read_text(), re.S)
    assert block is not None
    exec(compile(block[1], "python.md", "exec"), {})
