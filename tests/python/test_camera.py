"""A camera on a bench whose faults nobody knows, by call-backs: the panel's calibration, and frames corrected by photos."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import holodrive as hd
import numpy as np
import pytest
from numpy.typing import NDArray

WIDTH, HEIGHT, PARTS = 320, 180, 3
PITCH, WAVELENGTH, LENS, CAMERA_PITCH = 8e-6, 632.8e-9, 0.05, 5.2e-6
CROSSTALK, UNMODULATED = 0.4, 0.08


class HiddenBench:
    """Panel, lens and camera in double precision: pixels cut into parts, sums of exponentials. The camera is mirrored and shifted."""

    def __init__(self) -> None:
        self.levels: "NDArray[Any]" = np.zeros((HEIGHT, WIDTH), np.uint8)
        self.count, self.random = 0, np.random.default_rng(5)
        # Share of the pixels above 85 % of full scale.
        self.overexposed = 0.001
        x = (2 * np.arange(WIDTH * PARTS) + 1) / (WIDTH * PARTS) - 1
        y = ((2 * np.arange(HEIGHT * PARTS) + 1) / (HEIGHT * PARTS) - 1)[:, None]
        bend = 0.55 * x * x - 0.024 * y * y + 0.25 * x * y + 0.12 * (x**3 - 0.6 * x)
        beam = np.exp(-((x - 0.2) ** 2 + ((y + 0.25) * HEIGHT / WIDTH) ** 2) / 1.44)
        self.wave = beam * np.exp(2j * np.pi * 1.2 * bend)
        self.x, self.y = x, y
        # Places of the camera's pixels [cycles/pixel of the panel, rows downwards].
        scale = PITCH * CAMERA_PITCH / (WAVELENGTH * LENS)
        self.across = -(np.arange(260) - 127.0) * scale
        self.down = (np.arange(250) - 128.5) * scale

    def light(self) -> "NDArray[np.complex128]":
        """Of the panel's parts."""
        level = np.repeat(np.repeat(self.levels, PARTS, 0), PARTS, 1) / 255.0
        turn = 2.2 * np.pi * (1 + 0.05 * self.x - 0.04 * self.y)
        phase = turn * (level + 0.045 * np.sin(2 * np.pi * level) - 0.06 * level * (1 - level))
        sigma = CROSSTALK * PARTS
        reach = int(5 * sigma) + 1
        weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
        weights /= weights.sum()
        for axis in (0, 1):
            wide = np.pad(phase, [(reach, reach) if axis == a else (0, 0) for a in (0, 1)], mode="edge")
            length = phase.shape[axis]
            phase = np.sum([w * np.take(wide, np.arange(k, k + length), axis) for k, w in enumerate(weights)], axis=0)
        still = np.sqrt(UNMODULATED) * np.exp(0.7j)
        return np.asarray(self.wave * (np.sqrt(1 - UNMODULATED) * np.exp(1j * phase) + still))

    def seen(self, across: "NDArray[np.float64]", down: "NDArray[np.float64]") -> "NDArray[np.float64]":
        """Intensity at frequencies along columns and rows."""

        def waves(nu: "NDArray[np.float64]", count: int) -> "NDArray[np.complex128]":
            place = (np.arange(count * PARTS) + 0.5) / PARTS - 0.5 * count
            return np.exp(-2j * np.pi * nu[:, None] * place)

        return np.asarray(np.abs(waves(down, HEIGHT) @ self.light() @ waves(across, WIDTH).T) ** 2)

    def show(self, levels: "NDArray[Any]") -> None:
        assert levels.shape == (HEIGHT, WIDTH) and levels.dtype == np.uint8
        self.levels = levels

    def clean(self) -> "NDArray[np.float64]":
        """Light on the camera's pixels."""
        step = self.down[1] - self.down[0]
        parts = [(i * step, j * step) for i in (-0.25, 0.25) for j in (-0.25, 0.25)]
        return np.asarray(np.mean([self.seen(self.across + i, self.down + j) for i, j in parts], axis=0))

    def photograph(self) -> "NDArray[np.uint8]":
        """8 bits with noise of 1 %."""
        self.count += 1
        clean = self.clean()
        photo = 0.85 * clean / np.quantile(clean, 1 - self.overexposed) + 0.012 + 0.01 * self.random.standard_normal(clean.shape)
        return np.clip(np.rint(255 * photo), 0, 255).astype(np.uint8)


def light(x: "NDArray[np.float64]", y: "NDArray[np.float64]") -> "NDArray[np.float64]":
    """Hills and a valley, smooth at the panel's own resolution of 72 × 17 spots."""
    return np.asarray(0.5 + 0.25 * np.cos(2 * np.pi * x / 80) * np.cos(2 * np.pi * y / 66) + 0.2 * np.sin(2 * np.pi * (x + y) / 120))


def picture() -> "NDArray[np.float64]":
    """The same as 240 × 100 pixels."""
    y, x = np.mgrid[0:100, 0:240] + 0.5
    return light(x, y)


def judged(bench: HiddenBench, levels: "NDArray[Any]", camera: Path) -> float:
    """PSNR [dB] of the amplitudes on the camera's own pixels within the picture, without noise and bits."""
    told = json.loads(camera.read_text())
    h, size, half = told["mapping"], told["size"], told["half_window"]
    j, i = np.mgrid[0 : size[1], 0 : size[0]]
    q = np.stack([i + 0.5 - size[0] / 2, j + 0.5 - size[1] / 2]) / (size[0] / 2)
    u, v = q * (1 + h[8] * (q[0] ** 2 + q[1] ** 2))
    d = 1 + h[6] * u + h[7] * v
    # Shares of the picture's room: right, and down from its top.
    x = ((h[0] * u + h[1] * v + h[2]) / d / half + 0.9) / 1.8
    y = ((h[3] * u + h[4] * v + h[5]) / d / half + 0.9) / 0.75
    inside = (x > 0.02) & (x < 0.98) & (y > 0.05) & (y < 0.95)
    bench.show(levels)
    seen = np.sqrt(bench.clean()[inside])
    wanted = np.sqrt(light(240 * x[inside], 100 * y[inside]))
    assert inside.sum() > 3000
    scale = np.sum(seen * wanted) / np.sum(seen**2)
    return float(10 * np.log10(np.max(wanted) ** 2 / np.mean((scale * seen - wanted) ** 2)))


@pytest.fixture(scope="module")
def bench() -> HiddenBench:
    return HiddenBench()


@pytest.fixture(scope="module")
def plain() -> hd.Panel:
    return hd.Panel(width=WIDTH, height=HEIGHT, pitch=PITCH, wavelength=WAVELENGTH)


@pytest.fixture(scope="module")
def calibrated(bench: HiddenBench, plain: hd.Panel, tmp_path_factory: pytest.TempPathFactory) -> "tuple[dict[str, Any], Path]":
    path = tmp_path_factory.mktemp("lab") / "lab.toml"
    found = hd.calibrate_camera(bench.show, bench.photograph, plain, lens=LENS, camera_pitch="5.2um", output=path)
    assert bench.count == 11
    return found, path


def test_a_bench_is_calibrated_by_call_backs(calibrated: "tuple[dict[str, Any], Path]") -> None:
    found, path = calibrated
    print({name: found[name] for name in found if "uncertainty" in name or name in ("crosstalk", "unmodulated", "misfit", "dots")})
    assert abs(found["crosstalk"] - CROSSTALK) < 0.03 and 0 < found["crosstalk_uncertainty"] < 0.03
    assert abs(found["unmodulated"] - UNMODULATED) < 0.01 and 0 < found["unmodulated_uncertainty"] < 0.01
    assert 0 < found["wavefront_uncertainty"] < 0.01 and 0 < found["curve_uncertainty"] < 0.03
    assert abs(found["range"] - 2.2 * np.pi) < 0.05 and found["misfit"] < 2
    lab = hd.Panel(path)
    assert abs(lab.crosstalk - CROSSTALK) < 0.03 and abs(lab.curve[-1] - lab.curve[0] - 2.2 * np.pi) < 0.05
    assert {one.name for one in path.parent.iterdir()} >= {"lab-correction.npy", "lab-beam.npy", "lab-camera.json"}


@pytest.mark.parametrize("profile, better", [("corrected only", 0.6), ("calibrated", 0.4)])
def test_photos_correct_a_picture(
    profile: str, better: float, bench: HiddenBench, calibrated: "tuple[dict[str, Any], Path]"
) -> None:
    """From all that was calibrated, and where of it only the wavefront's correction is known."""
    correction = calibrated[1].with_name("lab-correction.npy")
    partly = hd.Panel(width=WIDTH, height=HEIGHT, pitch=PITCH, wavelength=WAVELENGTH, correction=correction)
    panel = hd.Panel(calibrated[1]) if profile == "calibrated" else partly
    # The zero order is overexposed, the picture is not.
    bench.overexposed = 0.03
    camera = calibrated[1].with_name("lab-camera.json")
    shown: "list[NDArray[Any]]" = []

    def show(levels: "NDArray[Any]") -> None:
        shown.append(levels)
        bench.show(levels)

    frame = hd.encode_in_the_loop(picture(), panel, camera, show, bench.photograph, photos=16, step=0.02)
    told = frame.metadata["encoding"]["parameters"]
    before, after = judged(bench, shown[0], camera), judged(bench, frame.levels, camera)
    print(f"{profile}: model {told['model_psnr']:.1f}, photos {told['photo_psnr'][0]:.1f} → {max(told['photo_psnr']):.1f} dB")
    print(f"{profile}: on the camera without noise {before:.1f} → {after:.1f} dB")
    # The first is photographed twice, for the camera's noise.
    assert len(shown) == 17 and len(told["photo_psnr"]) == 16 and np.array_equal(shown[0], shown[1])
    assert any(np.array_equal(frame.levels, levels) for levels in shown)
    assert max(told["photo_psnr"]) > told["photo_psnr"][0] + 0.6 and after > before + better


def test_underexposed_photos_are_refused(bench: HiddenBench, calibrated: "tuple[dict[str, Any], Path]") -> None:
    """Exposed for the zero order: a frame by such photos was 0.6 dB worse than without them."""
    bench.overexposed = 0.001
    with pytest.raises(hd.ParameterError, match="expose for the picture"):
        hd.encode_in_the_loop(
            picture(), hd.Panel(calibrated[1]), calibrated[1].with_name("lab-camera.json"), bench.show, bench.photograph, photos=2
        )


def test_call_backs_that_fail_are_raised(bench: HiddenBench, plain: hd.Panel, calibrated: "tuple[dict[str, Any], Path]", tmp_path: Path) -> None:
    camera = calibrated[1].with_name("lab-camera.json")

    def broken() -> "NDArray[np.float64]":
        raise OSError("the camera is unplugged")

    with pytest.raises(OSError, match="unplugged"):
        hd.calibrate_camera(bench.show, broken, plain, lens=LENS, camera_pitch=CAMERA_PITCH)
    with pytest.raises(OSError, match="unplugged"):
        hd.encode_in_the_loop(picture(), plain, camera, bench.show, broken, iterations=2)
    with pytest.raises(hd.ParameterError, match="not like what the panel should show"):
        noise = np.random.default_rng(1).random((250, 260))
        hd.encode_in_the_loop(picture(), plain, camera, bench.show, lambda: noise, iterations=2)
    with pytest.raises(hd.ParameterError, match="calibrated with 260×250"):
        hd.encode_in_the_loop(picture(), plain, camera, bench.show, lambda: np.eye(64), iterations=2)
    with pytest.raises(hd.OutOfRangeError, match="room"):
        hd.encode_in_the_loop(picture(), plain, camera, bench.show, bench.photograph, room=(0, 0, 0, 1))
    with pytest.raises(hd.InputError, match="calibrate camera"):
        hd.encode_in_the_loop(picture(), plain, calibrated[1], bench.show, bench.photograph)
    with pytest.raises(hd.ParameterError, match=".toml"):
        hd.calibrate_camera(bench.show, bench.photograph, plain, lens=LENS, camera_pitch=CAMERA_PITCH, output=tmp_path / "lab.json")
    with pytest.raises(hd.ParameterError, match="dots"):
        hd.calibrate_camera(bench.show, lambda: np.random.default_rng(2).random((250, 260)), plain, lens=LENS, camera_pitch=CAMERA_PITCH)
