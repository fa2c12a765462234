"""The program that comes with the package, the panel that it keeps, and what calls cost beside it."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import holodrive as hd
import numpy as np
import pytest
from conftest import ROOT

PROGRAM = [sys.executable, "-m", "holodrive"]


def holodrive(*arguments: Any, cwd: "Path | None" = None) -> "subprocess.CompletedProcess[str]":
    return subprocess.run([*PROGRAM, *map(str, arguments)], capture_output=True, text=True, cwd=cwd)


def test_the_package_brings_the_program(tmp_path: Path) -> None:
    script = Path(sys.executable).parent / ("holodrive.exe" if sys.platform == "win32" else "holodrive")
    said = subprocess.run([str(script), "--version"], capture_output=True, text=True)
    assert said.returncode == 0 and said.stdout.strip() == f"holodrive {hd.__version__}"
    assert holodrive("--version").stdout == said.stdout
    help_of = holodrive("encode", "-h")
    assert help_of.returncode == 0 and "Usage: holodrive encode" in help_of.stdout


def test_the_wheel_says_what_it_is_and_needs() -> None:
    from importlib.metadata import metadata, requires, version

    assert version("holodrive") == hd.__version__
    crate = (ROOT / "Cargo.toml").read_text()
    assert f'\nversion = "{hd.__version__}"\n' in crate, "the package has another version than the library"
    assert metadata("holodrive")["Requires-Python"] == ">=3.9"
    needed = requires("holodrive") or []
    assert [one for one in needed if "extra" not in one] == ["numpy>=1.24"]


def test_the_program_refuses_in_one_line_with_its_exit_code(tmp_path: Path) -> None:
    said = holodrive("encode", "none.npy", "-o", "out.png", cwd=tmp_path)
    assert said.returncode == 2 and len(said.stderr.splitlines()) == 1 and "none.npy" in said.stderr
    said = holodrive("encode", "--lense", "1m")
    assert said.returncode == 2 and "did you mean" in said.stderr and "holodrive encode --help" in said.stderr


def test_what_the_program_computes_is_what_python_computes(panel: hd.Panel, tmp_path: Path) -> None:
    hd.Points([[1e-4, 0, -0.1], [0, 5e-5, -0.12]], phases=[0, 1]).write(tmp_path / "points.ply")
    profile = (ROOT / "calib" / "generic.toml").read_text()
    profile = profile.replace("width = 1920", "width = 64").replace("height = 1080", "height = 48")
    (tmp_path / "small.toml").write_text(profile)
    for arguments in [
        ("compute", "points.ply", "-o", "field.npy"),
        ("encode", "field.npy", "--encoding", "double-phase", "-o", "frame.png"),
    ]:
        said = holodrive(*arguments, "--panel", "small.toml", "--wavelength", "532nm", cwd=tmp_path)
        assert said.returncode == 0, said.stderr
    small = hd.Panel(tmp_path / "small.toml", wavelength="532nm")
    field = hd.hologram(hd.Points.read(tmp_path / "points.ply"), small)
    assert np.array_equal(field, np.load(tmp_path / "field.npy"))
    frame = hd.encode(field, small, encoding="double-phase")
    assert np.array_equal(frame.levels, hd.Frame.load(tmp_path / "frame.png").levels)


@pytest.mark.skipif(sys.platform == "win32", reason="SIGINT")
def test_ctrl_c_ends_the_program_at_once(tmp_path: Path) -> None:
    random = np.random.default_rng(1)
    places = np.c_[random.uniform(-1e-3, 1e-3, (300_000, 2)), random.uniform(-0.12, -0.1, 300_000)]
    hd.Points(places).write(tmp_path / "many.ply")
    command = [*PROGRAM, "compute", "many.ply", "--engine", "direct", "-o", "field.npy"]
    process = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    time.sleep(2.5)
    begin = time.monotonic()
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=20)
    assert time.monotonic() - begin < 1.5
    assert process.returncode == 130 and "interrupted" in said and "Traceback" not in said
    assert not (tmp_path / "field.npy").exists()


def test_calls_take_no_longer_than_the_program(tmp_path: Path) -> None:
    """Ten calls against the steps that the program itself times, which leave its start and its files out."""
    panel = hd.Panel("generic", wavelength="532nm")
    random = np.random.default_rng(7)
    calls, steps, own = [], [], []
    for index in range(5):
        count = 20_000 + 5_000 * index
        places = np.c_[random.uniform(-4e-3, 4e-3, (count, 2)), random.uniform(-0.25, -0.2, count)]
        points = hd.Points(places, phases=random.uniform(0, 6.28, count))
        points.write(tmp_path / "points.ply")
        points = hd.Points.read(tmp_path / "points.ply")
        best = []
        for _ in range(2):
            begin = time.perf_counter()
            field = hd.hologram(points, panel, engine="planes")
            made = time.perf_counter()
            assert field.report is not None
            report = field.report
            hd.encode(field, panel, encoding="double-phase")
            best.append((made - begin, time.perf_counter() - made))
        said = []
        for _ in range(2):
            laser = "--wavelength 532nm --json"
            computed = holodrive(*f"compute points.ply --engine planes -o field.npy {laser}".split(), cwd=tmp_path)
            encoded = holodrive(*f"encode field.npy --encoding double-phase -o frame.png {laser}".split(), cwd=tmp_path)
            assert computed.returncode == encoded.returncode == 0, computed.stderr + encoded.stderr
            said.append((json.loads(computed.stdout), json.loads(encoded.stdout)))
        calls += [min(times) for times in zip(*best)]
        steps += [min(told["field_seconds"] for told, _ in said), min(told["encode_seconds"] for _, told in said)]
        own.append((best[-1][0], report["seconds"]))
    ours, theirs = sum(calls), sum(steps)
    spent, inside = (sum(times) for times in zip(*own))
    print(f"of {spent:.2f} s of the last calls the library took {inside:.2f} s: {100 * (spent / inside - 1):+.1f} %")
    print(f"{len(calls)} calls in {ours:.2f} s, the program's steps {theirs:.2f} s: {100 * (ours / theirs - 1):+.1f} %")
    assert spent < 1.05 * inside
    # These are timed one after the other on a machine that does other things, too.
    assert ours < 1.25 * theirs


def test_a_panel_is_served_in_the_background(served: hd.Served, tmp_path: Path) -> None:
    assert served.running and served.name == "bench" and "320 × 200" in repr(served)
    with served.slm() as slm:
        assert slm.shape == (200, 320) and slm.modulation == "phase" and "320 × 200" in repr(slm)
        blaze = 2 * np.pi * np.indices(slm.shape)[1] / 16
        shown = slm.show(blaze)
        assert shown.number == slm.show(np.full(slm.shape, 7, np.uint8)).number - 1 and 0 <= shown.latency < 5
    report = served.stop()
    assert not served.running and served.process.returncode in (0, 130)
    assert report["served"]["shown"] == 2 and report["served"]["failed"] == 0
    frames = sorted((tmp_path / "frames").glob("*.png"))
    panel = hd.Panel(tmp_path / "small.toml")
    levels = [hd.Frame.load(frame, panel).levels for frame in frames]
    assert any(np.array_equal(one, hd.encode(blaze, panel).levels) for one in levels)
    assert any((one == 7).all() for one in levels)


def test_ten_threads_share_one_slm(served: hd.Served) -> None:
    numbers: "list[int]" = []
    with served.slm() as slm:

        def show(level: int) -> None:
            for _ in range(5):
                numbers.append(slm.show(np.full(slm.shape, level, np.uint8)).number)

        threads = [threading.Thread(target=show, args=(level,)) for level in range(10)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert len(set(numbers)) == 50 and max(numbers) - min(numbers) == 49
    assert served.stop()["served"]["shown"] == 50


def test_a_slm_can_be_awaited(served: hd.Served) -> None:
    async def both() -> "list[hd.Shown]":
        with served.slm() as slm:
            frames = [np.full(slm.shape, level, np.uint8) for level in (1, 2)]
            return list(await asyncio.gather(*(slm.show_async(frame) for frame in frames)))

    a, b = asyncio.run(both())
    assert abs(a.number - b.number) == 1


def test_a_slm_refuses_and_goes_on(served: hd.Served) -> None:
    with served.slm() as slm:
        with pytest.raises(ValueError, match=r"the panel \(200, 320\)"):
            slm.show(np.zeros((3, 4)))
        with pytest.raises(ValueError, match="levels are 0 … 255"):
            slm.show(np.full(slm.shape, 300))
        with pytest.raises(hd.Error):
            slm.show(np.full(slm.shape, np.nan))
        assert slm.show(np.zeros(slm.shape)).number > 0
    with pytest.raises(hd.DisplayError, match="closed"):
        slm.show(np.zeros(slm.shape))


def test_a_killed_program_is_an_error_not_a_wait(served: hd.Served) -> None:
    with served.slm(timeout=5) as slm:
        slm.show(np.zeros(slm.shape))
        served.process.kill()
        served.process.wait()
        begin = time.monotonic()
        with pytest.raises(hd.DisplayError, match="ended"):
            slm.show(np.zeros(slm.shape))
        assert time.monotonic() - begin < 1
    assert served.stop() == {}


def test_what_cannot_be_served_says_why() -> None:
    with pytest.raises(hd.DisplayError, match="no such panel"):
        hd.serve("no-such-panel")


def test_the_client_is_the_same_file_that_the_program_writes(tmp_path: Path) -> None:
    said = holodrive("serve", "--write-python", "holodrive.py", cwd=tmp_path)
    assert said.returncode == 0, said.stderr
    written = (tmp_path / "holodrive.py").read_bytes()
    assert hd.slm.__file__ is not None and Path(hd.slm.__file__).read_bytes() == written
    assert (ROOT / "src" / "serve" / "holodrive.py").read_bytes() == written
    # Alone it needs nothing of the package.
    code = "import holodrive; print(holodrive.__file__, holodrive.Error.__mro__[1].__name__)"
    alone = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env={**os.environ, "PYTHONPATH": str(tmp_path)}
    )
    assert alone.stdout.split() == [str(tmp_path / "holodrive.py"), "RuntimeError"], alone.stderr
