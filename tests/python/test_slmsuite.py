"""holodrive's panels as SLMs of an unmodified slmsuite: levels, the local path, the bench over slmsuite's own protocol."""

from __future__ import annotations

import json
import logging
import socket
import subprocess
import sys
import urllib.parse
from pathlib import Path
from typing import Any, Iterator

import holodrive as hd
import numpy as np
import pytest
from conftest import ROOT

pytest.importorskip("slmsuite", reason="slmsuite 0.5 is not installed: its SLM and camera are not tested")
from holodrive.slmsuite import Holodrive, SimulatedCamera, serve_bench  # noqa: E402

pytestmark = pytest.mark.filterwarnings("ignore:cupy is not installed")


def turned(phase: Any) -> Any:
    """Into ±π."""
    return np.angle(np.exp(1j * phase))


def profile(folder: Path, name: str, width: int = 160, height: int = 120) -> Path:
    """One of the known profiles, smaller."""
    lines = (ROOT / "calib" / f"{name}.toml").read_text().splitlines()
    size = {"width": width, "height": height}
    changed = [f"{key} = {size[key]}" if (key := line.split(" =")[0]) in size else line for line in lines]
    path = folder / "panel.toml"
    path.write_text("\n".join(changed))
    return path


def curved(bits: int = 8) -> hd.Panel:
    """A panel whose phase goes through 2.2π in a bow; given by numbers it has 8 bits at most."""
    x = np.linspace(0, 1, 2**bits)
    return hd.Panel(width=160, height=120, pitch="8um", wavelength="532nm", bits=bits, curve=2.2 * np.pi * (0.7 * x + 0.3 * x**2))


def test_slmsuite_is_needed_by_its_module_alone() -> None:
    told = subprocess.run(
        [sys.executable, "-c", "import sys, holodrive\nassert not {'slmsuite', 'scipy'} & set(sys.modules)"], capture_output=True, text=True
    )
    assert told.returncode == 0, told.stderr
    told = subprocess.run(
        [sys.executable, "-c", "import sys\nsys.modules['slmsuite'] = None\nimport holodrive.slmsuite"], capture_output=True, text=True
    )
    last = told.stderr.strip().splitlines()[-1]
    assert last.startswith("ImportError: holodrive.slmsuite needs slmsuite 0.5: pip install slmsuite (")


@pytest.mark.parametrize("panel", [hd.Panel(width=160, height=120, pitch="8um", wavelength="532nm"), curved(), curved(6)])
def test_a_phase_becomes_the_nearest_level_of_the_panels_own_curve(panel: hd.Panel) -> None:
    slm = Holodrive(panel)
    assert slm.shape == (120, 160) and slm.bitdepth == panel.bits and slm.phase_scaling == 1
    assert slm.wav_um == pytest.approx(0.532) and tuple(slm.pitch_um) == pytest.approx((8, 8))
    # A level's own phase, some turns on, is that level, or one of the same phase.
    levels = np.resize(np.arange(panel.levels), slm.shape)
    shown = slm.set_phase(panel.curve[levels] + 2 * np.pi * np.random.default_rng(1).integers(-3, 4, slm.shape))
    assert np.abs(turned(panel.curve[shown] - panel.curve[levels])).max() < 2e-4
    wanted = np.random.default_rng(2).uniform(-20, 20, slm.shape)
    shown = slm.set_phase(wanted)
    nearest = np.abs(turned(panel.curve[:, None, None] - wanted)).min(axis=0)
    # slmsuite's table has 65536 phases.
    assert (np.abs(turned(panel.curve[shown] - wanted)) - nearest).max() < 2e-4
    assert np.abs(turned(slm.get_realized_phase() - panel.curve[shown])).max() < 1e-5
    # Integers are levels.
    given = np.random.default_rng(3).integers(0, panel.levels, slm.shape).astype(np.uint8)
    assert np.array_equal(slm.set_phase(given), given)


def test_without_the_curve_levels_are_those_of_an_ideal_panel() -> None:
    slm = Holodrive(hd.Panel(width=160, height=120, pitch="8um", wavelength="532nm"))
    phase = np.random.default_rng(1).uniform(-9, 9, slm.shape)
    by_curve = slm.set_phase(phase).copy()
    slm.set_gamma(None)
    by_formula = slm.set_phase(phase).copy()
    # slmsuite puts phase 0 on the highest level: all levels are one lower; a phase between two may go to either.
    steps = (by_curve.astype(int) - by_formula) % 256
    assert set(np.unique(steps)) <= {0, 1, 2} and (steps == 1).mean() > 0.99


@pytest.mark.parametrize("name, dtype", [("generic", np.uint8), ("santec-slm-200", np.uint16)])
def test_frames_go_the_local_path_level_by_level(tmp_path: Path, name: str, dtype: Any) -> None:
    path = profile(tmp_path, name)
    slm = Holodrive(path, wavelength="532nm", output=tmp_path / "frames")
    try:
        known = hd.Panel(path, wavelength="532nm")
        assert slm.bitdepth == known.bits and slm.dtype == dtype and np.allclose(slm.curve, known.curve, atol=1e-6)
        assert slm.fill_factor == known.fill_factor and slm.wav_um == pytest.approx(0.532)
        phase = np.random.default_rng(1).uniform(-9, 9, slm.shape)
        shown = slm.set_phase(phase).copy()
        assert slm.shown is not None and slm.shown.number >= 1
        first = sorted((tmp_path / "frames").glob("*.png"))[-1]
        assert np.array_equal(hd.Frame.load(first, known).levels, shown)
        # What holodrive's own drive makes of the phases.
        assert slm._client is not None
        slm._client.show(phase)
        second = sorted((tmp_path / "frames").glob("*.png"))[-1]
        driven = hd.Frame.load(second, known).levels
        assert first != second and (driven != shown).mean() < 0.02
        assert np.abs(turned(known.curve[driven] - known.curve[shown])).max() < 1.01 * np.abs(np.diff(known.curve)).max()
    finally:
        slm.close()
    slm.close()


def test_a_panel_that_is_served_already_stays(tmp_path: Path) -> None:
    path = profile(tmp_path, "generic")
    with hd.serve(path, arguments=("--local", str(tmp_path / "s.sock"))) as served:
        slm = Holodrive(served)
        known = hd.Panel(path)
        assert np.allclose(slm.curve, known.curve, atol=1e-6) and slm.wav_um == pytest.approx(0.6328)
        slm.set_phase(np.ones(slm.shape))
        slm.close()
        assert served.running
        with served.slm() as client:
            Holodrive(client).set_phase(None)
            assert client.show(np.zeros(client.shape)).number >= 3


def test_profiles_are_named() -> None:
    assert Holodrive.info(verbose=False) == hd.panels()


@pytest.mark.parametrize(
    "arguments, words",
    [
        (dict(panel=hd.Panel(width=160, height=120, pitch="8um", wavelength="532nm", modulation="amplitude")), "modulates amplitude"),
        (dict(panel=curved(), monitor="HDMI-1"), "for a profile"),
        (dict(panel=curved(), output="frames"), "for a profile"),
        (dict(panel="nothing of that name"), "no such panel"),
    ],
)
def test_panels_that_cannot_be_are_refused(arguments: Any, words: str) -> None:
    with pytest.raises(hd.Error, match=words):
        Holodrive(**arguments)


@pytest.fixture(scope="module")
def bench() -> Iterator[Any]:
    slm = Holodrive(curved(), name="panel")
    camera = SimulatedCamera(
        slm, (120, 100), focal_length="30mm", shot_noise=False, read_noise=0, power=1e8, name="camera"
    )
    with serve_bench(slm, camera, port=0) as served:
        yield slm, camera, served


def test_the_bench_is_reached_by_slmsuites_remote_clients(bench: Any) -> None:
    from slmsuite.hardware.cameras.remote import RemoteCamera
    from slmsuite.hardware.slms.remote import RemoteSLM

    slm, camera, served = bench
    assert served.host == "127.0.0.1"
    far = RemoteSLM("panel", port=served.port)
    eye = RemoteCamera("camera", port=served.port)
    assert far.shape == slm.shape and eye.shape == camera.shape and far.wav_um == slm.wav_um
    phase = np.random.default_rng(4).uniform(0, 6, slm.shape)
    far.set_phase(phase)
    # Half a level of the client's, half a one of the panel's.
    assert np.abs(turned(slm.curve[slm.display] - phase)).max() < 0.5 * 2 * np.pi / 256 + 0.51 * np.diff(slm.curve).max()
    eye.set_exposure(0.02)
    assert camera.get_exposure() == 0.02
    photo = eye.get_image()
    assert photo.dtype == np.uint16 and photo.max() > 20 and np.array_equal(photo, camera.get_image())
    assert np.array_equal(eye.get_images(2), [photo, photo])
    eye.flush()


def ask(port: int, line: bytes) -> Any:
    with socket.create_connection(("127.0.0.1", port), timeout=20) as connection:
        connection.sendall(line)
        connection.shutdown(socket.SHUT_WR)
        said = b"".join(iter(lambda: connection.recv(65536), b""))
    return json.loads(urllib.parse.unquote_plus(said.decode()))


def request(name: str, command: str, **given: Any) -> bytes:
    return (urllib.parse.quote_plus(json.dumps({"name": name, "command": command, "args": [], "kwargs": given})) + "\n").encode()


def packed(text: str, shape: Any = (120, 160), dtype: str = "uint8") -> Any:
    return {"__zlib__": text, "__shape__": shape, "__dtype__": dtype}




@pytest.mark.parametrize(
    "line, words",
    [
        (b"\n", "not understood"),
        (b"%7B\n", "not understood"),
        (b"\xff\xfe\n", "not understood"),
        (b"[" * 100_000 + b"\n", "."),
        (b"{}\n", "No command"),
        (b"%22text%22\n", "not understood"),
        (b"ping", "no end"),
        (b"x" * 1_000_000, "too long"),
        (request("nobody", "pickle"), "Did not recognize"),
        (request("panel", "close"), "not present"),
        (request("camera", "_set_phase_hw"), "not present"),
        (request("camera", "_set_exposure_hw", exposure_s="1"), "number"),
        (request("camera", "_set_exposure_hw", exposure_s=-1), "domain"),
        (request("camera", "_get_images_hw", image_count=10**9), "1 to 64"),
        (request("panel", "_set_phase_hw"), "no display"),
        (request("panel", "_set_phase_hw", display=packed("!!")), "unfold"),
        (request("panel", "_set_phase_hw", display=packed("eJwDAAAAAAE=")), "unfold"),
        (request("panel", "_set_phase_hw", display=packed("", (120, 160), "object")), "uint8"),
        (request("panel", "_set_phase_hw", display=packed("", (10**9, 10**9))), "shape"),
    ],
)
def test_requests_that_are_none_are_refused_counted_and_logged(
    bench: Any, line: bytes, words: str, caplog: pytest.LogCaptureFixture
) -> None:
    slm, _, served = bench
    before, shown = served.refused, slm.display.copy()
    with caplog.at_level(logging.INFO, "holodrive.slmsuite"):
        done, why = ask(served.port, line)
    assert done is False and words in why and "\n" not in why
    assert served.refused == before + 1 and np.array_equal(slm.display, shown)
    assert len(caplog.records) == 1 and "127.0.0.1:" in caplog.text and "refused: " in caplog.text
    assert ask(served.port, request("", "ping")) == [True, {"panel": "slm", "camera": "camera"}]


def test_frames_that_unfold_to_more_are_refused(bench: Any) -> None:
    import base64
    import zlib

    port = bench[2].port
    bomb = base64.b64encode(zlib.compress(bytes(10_000_000))).decode()
    done, why = ask(port, request("panel", "_set_phase_hw", display=packed(bomb)))
    assert done is False and "unfold" in why
    right = base64.b64encode(zlib.compress(bytes(120 * 160))).decode()
    assert ask(port, request("panel", "_set_phase_hw", display=packed(right), block=True)) == [True, None]


def test_a_bench_that_cannot_be_served_is_refused(bench: Any) -> None:
    slm, camera, served = bench
    with pytest.raises(hd.DisplayError, match="cannot listen"):
        serve_bench(slm, port=served.port)
    for arguments, words in (((), "each of another name"), ((slm, slm), "each of another name")):
        with pytest.raises(hd.ParameterError, match=words):
            serve_bench(*arguments, port=0)
    with pytest.raises(hd.ParameterError, match="there is no `best`"):
        serve_bench(slm, port=0, levels="best")


def test_a_users_script_is_clean_under_mypy_strict_and_runs() -> None:
    from test_types import HERE, mypy

    assert mypy(HERE / "user_bench.py") == ""
    import user_bench

    assert user_bench.picture(np.zeros((120, 160))).shape == (48, 64)


def test_everything_public_is_documented() -> None:
    import inspect

    import holodrive.slmsuite as module

    for name in module.__all__:
        thing = getattr(module, name)
        text = inspect.getdoc(thing) or ""
        taken = set(inspect.signature(thing).parameters) - {"kwargs", "hardware"} if name != "Remote" else set()
        assert len(text) > 100 and not [one for one in taken if one not in text], (name, taken)
        own = [value for key, value in vars(thing).items() if not key.startswith("_")] if inspect.isclass(thing) else []
        assert all(len(inspect.getdoc(value) or "") > 8 for value in own if callable(value))
