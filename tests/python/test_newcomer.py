"""What newcomers stumbled over."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import holodrive as hd
import numpy as np
import pytest


def _works(_: int) -> str:
    try:
        hd.propagate(hd.Field(np.ones((16, 16), np.complex64), "8um", "532nm"), "1mm")
    except hd.UnsupportedError as error:
        return str(error)
    return "done"


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no fork")
def test_a_forked_process_is_told_to_be_spawned() -> None:
    assert _works(0) == "done"
    with multiprocessing.get_context("fork").Pool(1) as pool:
        assert "spawn" in pool.map_async(_works, [1]).get(timeout=30)[0]


def test_a_field_elsewhere_is_not_encoded_as_if_it_stood_on_the_panel(panel: hd.Panel) -> None:
    wave = hd.Field(np.ones(panel.shape, np.complex64), panel.pitch, panel.wavelength, z=-0.1)
    with pytest.raises(hd.ParameterError, match="propagate it by 100mm"):
        hd.encode(wave, panel)
    hd.encode(hd.propagate(wave, "100mm"), panel)


def test_places_and_lasers_are_any_sequence(panel: hd.Panel) -> None:
    frame = hd.encode(np.zeros(panel.shape), panel)
    seen = [np.asarray(hd.reconstruct(frame, -0.1, eye=eye)) for eye in ((0, 0, 0.6), [0, "0m", "600mm"], np.array([0, 0, 0.6]))]
    assert all((one == seen[0]).all() for one in seen)
    with pytest.raises(TypeError, match="2 lengths where 3 are due"):
        hd.reconstruct(frame, -0.1, eye=(0, 0.6))  # type: ignore[arg-type]
    assert len(hd.hologram(hd.Points([[0.0, 0.0, -0.1]]), panel, wavelengths=["638nm", 520e-9, "450nm"])) == 3


def test_slips_of_the_unit_are_refused() -> None:
    with pytest.raises(hd.Error, match="wavelength"):
        hd.Panel(width=64, height=48, pitch="8um", wavelength="532mm")
    with pytest.raises(hd.Error, match="pitch"):
        hd.Panel(width=64, height=48, pitch="8mm", wavelength="532nm")
    with pytest.raises(hd.Error, match="pixels in all"):
        hd.Panel(width=65536, height=65536, pitch="8um", wavelength="532nm")


def test_sizes_beyond_the_memory_are_an_error_and_no_abort(panel: hd.Panel) -> None:
    frame = hd.encode(np.zeros(panel.shape), panel)
    with pytest.raises(hd.OutOfRangeError, match="size"):
        hd.reconstruct(frame, -0.1, size=(10**5, 10**5))


def test_pictures_have_square_pixels(panel: hd.Panel) -> None:
    picture = hd.reconstruct(hd.encode(np.zeros(panel.shape), panel), -0.1, size=(20, 20))
    width, height = picture.window
    assert width == pytest.approx(height) and height == pytest.approx(panel.shape[0] * 8e-6)


def test_files_are_what_their_endings_say(panel: hd.Panel, tmp_path: Path) -> None:
    frame = hd.encode(np.zeros(panel.shape), panel)
    points = hd.Points([[0.0, 0.0, -0.1]])
    for write in (frame.save, hd.reconstruct(frame, -0.1).save):
        with pytest.raises(hd.InputError, match=r"\.png"):
            write(tmp_path / "picture.jpg")
    with pytest.raises(hd.InputError, match=r"\.ply"):
        points.write(tmp_path / "points.csv")
    assert list(tmp_path.iterdir()) == []


def test_white_and_looks_have_their_domains(panel: hd.Panel) -> None:
    picture = hd.reconstruct(hd.encode(np.zeros(panel.shape), panel), -0.1)
    for white in (0.0, -1.0, float("nan")):
        with pytest.raises(hd.ParameterError, match="white"):
            picture.coded(white)


def test_a_picture_is_said_to_be_none_of_levels(panel: hd.Panel, tmp_path: Path) -> None:
    hd.reconstruct(hd.encode(np.zeros(panel.shape), panel), -0.1).save(tmp_path / "seen.png")
    with pytest.raises(hd.InputError, match="not a frame of levels"):
        hd.Frame.load(tmp_path / "seen.png", panel)


def test_a_bar_begins_anew_with_each_step_and_false_is_no_bar(panel: hd.Panel) -> None:
    tqdm = pytest.importorskip("tqdm")
    field = hd.hologram(hd.Points([[0.0, 0.0, -0.1]]), panel)
    with tqdm.tqdm(file=open(os.devnull, "w")) as bar:
        hd.encode(field, panel, encoding="gerchberg-saxton", depths=["-100mm"], iterations=5, progress=bar)
        assert bar.n <= bar.total
    hd.encode(field, panel, encoding="gerchberg-saxton", depths=["-100mm"], iterations=2, progress=False)


_KEPT = """
import sys, holodrive as hd
served = hd.serve("generic", name="kept", arguments=("--local", sys.argv[1]))
print(served.process.pid, flush=True)
input()
"""


def _is_gone(pid: int) -> bool:
    for _ in range(100):
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return True
        # One that has ended and that nobody has waited for.
        state = Path(f"/proc/{pid}/stat")
        if state.exists() and state.read_text().rsplit(")", 1)[1].split()[0] == "Z":
            return True
        time.sleep(0.1)
    return False


@pytest.mark.skipif(sys.platform == "win32", reason="processes are looked for as POSIX has them")
@pytest.mark.parametrize("end", ["line", "kill"])
def test_what_is_served_ends_with_the_process_that_asked_for_it(end: str, tmp_path: Path) -> None:
    command = [sys.executable, "-c", _KEPT, str(tmp_path / "kept.sock")]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdin is not None and process.stdout is not None
    pid = int(process.stdout.readline())
    os.kill(pid, 0)
    if end == "kill":
        process.kill()
    process.communicate("\n" if end == "line" else None, timeout=30)
    assert _is_gone(pid)


@pytest.mark.skipif(sys.platform == "win32", reason="Ctrl-C there goes to all processes of a console")
def test_an_interrupt_here_leaves_the_panel(served: hd.Served) -> None:
    with served.slm() as slm:
        slm.show(np.zeros(slm.shape, np.uint8))
        with pytest.raises(KeyboardInterrupt):
            # As a terminal does: to all processes of the group.
            os.killpg(os.getpgrp(), signal.SIGINT) if os.getpgrp() == os.getpid() else os.kill(os.getpid(), signal.SIGINT)
            time.sleep(5)
        assert os.getpgid(served.process.pid) != os.getpgrp()
        assert served.running and slm.show(np.ones(slm.shape, np.uint8)).number == 2


def test_a_frame_of_another_laser_is_not_shown(served: hd.Served) -> None:
    with served.slm() as slm:
        panel = hd.Panel(width=slm.shape[1], height=slm.shape[0], pitch="8um", wavelength="532nm")
        with pytest.raises(ValueError, match="532 nm.*632.8 nm"):
            slm.show(hd.encode(np.zeros(panel.shape), panel))
