"""The simulated bench against sums by definition and closed forms, and slmsuite's own calibrations and feedback on it, unmodified."""

from __future__ import annotations

import re
import time
from typing import Any

import holodrive as hd
import numpy as np
import pytest

pytest.importorskip("slmsuite", reason="slmsuite 0.5 is not installed: its calibrations are not tested")
import matplotlib  # noqa: E402

matplotlib.use("Agg")
from holodrive.slmsuite import Holodrive, SimulatedCamera  # noqa: E402
from conftest import ROOT  # noqa: E402
from slmsuite.hardware.cameraslms import FourierSLM  # noqa: E402
from slmsuite.holography.algorithms import FeedbackHologram, SpotHologram  # noqa: E402

pytestmark = pytest.mark.filterwarnings("ignore")

WAVELENGTH, PITCH = 532e-9, 8e-6


def panel(width: int = 320, height: int = 240, fill_factor: float = 0.93) -> Holodrive:
    return Holodrive(hd.Panel(width=width, height=height, pitch=PITCH, wavelength=WAVELENGTH, fill_factor=fill_factor))


def over(slm: Holodrive) -> Any:
    """Columns and rows from the middle [half a width]."""
    y, x = np.indices(slm.shape)
    return (x - (slm.shape[1] - 1) / 2) / (slm.shape[1] / 2), (y - (slm.shape[0] - 1) / 2) / (slm.shape[1] / 2)


def by_definition(slm: Holodrive, camera: SimulatedCamera, pixels: Any, source: Any = 1.0, dead: float = 1.0) -> Any:
    """The share of the light in pixels (i, j), from sums over the panel's pixels and the rectangles of their areas."""
    rows, columns = slm.shape
    x, y = (np.arange(columns) - (columns - 1) / 2) * PITCH, (np.arange(rows) - (rows - 1) / 2) * PITCH
    blaze = np.linalg.inv(camera.M) @ (np.asarray(pixels, float).T - camera.b)
    fx, fy = blaze / WAVELENGTH
    source = np.broadcast_to(source, slm.shape)
    left, right = np.exp(-2j * np.pi * np.outer(fy, y)), np.exp(-2j * np.pi * np.outer(fx, x))
    modulated, plain = (
        np.einsum("pr,rc,pc->p", left, light, right, optimize=True) for light in (source * np.exp(1j * slm.curve[slm.display]), source)
    )

    def square(side: float) -> Any:
        return side**2 * np.sinc(side * fx) * np.sinc(side * fy)

    active = square(PITCH * np.sqrt(slm.fill_factor))
    wave = active * modulated + dead * (square(PITCH) - active) * plain
    # Parseval over the panel's whole area; (fx, fy) of a pixel of the camera.
    area = abs(np.linalg.det(camera.M)) ** -1 / WAVELENGTH**2
    return np.abs(wave) ** 2 * area / (np.sum(np.abs(source) ** 2) * PITCH**2)


@pytest.mark.parametrize("rotation, focal_length", [(0.0, "100mm"), (0.08, "100mm"), (-0.9, "20mm"), (1.6, "20mm"), (3.0, "20mm")])
def test_photos_through_a_lens_are_the_sums_of_the_definition(rotation: float, focal_length: str) -> None:
    slm = panel(96, 64, 0.8)
    x, y = over(slm)
    slm.set_phase(np.random.default_rng(1).uniform(0, 6.28, slm.shape))
    amplitude, error = np.exp(-(x**2)), 3 * x**3 + y
    camera = SimulatedCamera(
        slm,
        (150, 120),
        (3e-6, "4um"),
        focal_length=focal_length,
        rotation=rotation,
        shear=(0.1, -0.05),
        offset=(70, 90),
        amplitude=amplitude,
        wavefront_error=error,
        subsamples=1,
    )
    pixels = [(i, j) for i in range(0, 150, 7) for j in range(0, 120, 7)]
    seen = camera.render()
    wanted = by_definition(slm, camera, pixels, amplitude * np.exp(1j * error))
    # Amplitudes err by 1e-6 of √Σ|s|², which is √(share) of one part in the number of resolvable spots.
    assert np.abs(np.sqrt(seen[[j for _, j in pixels], [i for i, _ in pixels]]) - np.sqrt(wanted)).max() < 2e-6
    assert seen.max() > 1e-5


def test_a_pixel_is_the_mean_over_its_area() -> None:
    slm = panel(96, 64)
    slm.set_phase(np.random.default_rng(1).uniform(0, 6.28, slm.shape))
    # Pixel 0 of the coarse one is pixels 0 to 3 of the fine one, whose middle is 1.5.
    coarse, fine = (
        SimulatedCamera(slm, (40 * n, 30 * n), 12e-6 / n, focal_length="30mm", rotation=0.2, offset=middle, subsamples=4 // n)
        for n, middle in ((1, (20, 10)), (4, (81.5, 41.5)))
    )
    assert np.allclose(coarse.render(), fine.render().reshape(30, 4, 40, 4).sum((1, 3)), rtol=1e-3, atol=1e-9)


def test_no_light_is_lost_or_won() -> None:
    # Smooth light within the first order, all of which is on the sensor; a tenth of the amplitude is dead space.
    slm = panel(160, 120, 1.0)
    x, y = over(slm)
    slm.set_phase(30 * (x**2 + y**2))
    camera = SimulatedCamera(slm, (400, 400), 9e-6, focal_length="50mm", amplitude=np.exp(-3 * (x**2 + y**2)))
    assert camera.render().sum() == pytest.approx(1, abs=0.02)
    assert SimulatedCamera(slm, (400, 400), 9e-6, focal_length="50mm", fill_factor=0.5, dead_space=0).render().sum() < 0.5


def test_defocus_moves_the_focus_of_a_lens_on_the_panel() -> None:
    slm = panel(160, 120, 1.0)
    x, y = over(slm)
    radius = 80 * PITCH
    focal, behind = 0.1, 0.004
    # The wave that converges `behind` the focal plane.
    slm.set_phase(np.pi * behind * ((x * radius) ** 2 + (y * radius) ** 2) / (WAVELENGTH * focal**2))
    peaks = [
        SimulatedCamera(slm, (64, 64), focal_length=focal, defocus=d, amplitude=np.exp(-3 * (x**2 + y**2))).render().max()
        for d in (0, "4mm", -0.004)
    ]
    assert peaks[1] > 1.05 * peaks[0] and peaks[0] > 1.05 * peaks[2]


@pytest.mark.parametrize("z", [0.05, 0.3, -0.1])
def test_a_plane_without_a_lens_has_the_gaussian_beam(z: float) -> None:
    slm = panel(400, 300, 1.0)
    x, y = over(slm)
    x, y = x * 200 * PITCH, y * 200 * PITCH
    waist, tilt = 0.25e-3, 0.002
    # Steered by a blaze; its width grows as √(1 + (z/z_R)²).
    slm.set_phase(2 * np.pi * tilt * x / WAVELENGTH)
    camera = SimulatedCamera(
        slm, (240, 200), "8um", z=z, rotation=0.3, offset=(110, 85), amplitude=np.exp(-(x**2 + y**2) / waist**2)
    )
    j, i = np.indices(camera.shape)
    at = np.einsum("ab,bji->aji", np.linalg.inv(camera.M), np.stack([i, j]) - camera.b[:, :, None])
    width = waist * np.hypot(1, z * WAVELENGTH / (np.pi * waist**2))
    wanted = np.exp(-2 * ((at[0] - z * tilt) ** 2 + at[1] ** 2) / width**2) * 2 / (np.pi * width**2) * (8e-6) ** 2
    # Square pixels send so much of a blaze into its first order.
    wanted *= np.sinc(tilt * PITCH / WAVELENGTH) ** 2
    seen = camera.render()
    assert wanted[20:-20, 20:-20].max() == wanted.max()
    # Levels of 2π/256 send a part in 10⁵ of the light elsewhere, whose wave beats with the beam's.
    assert np.abs(seen - wanted).max() < 0.01 * wanted.max()


def test_noise_saturation_and_exposure_are_a_sensors() -> None:
    slm = panel(96, 64)
    x, y = over(slm)
    slm.set_phase(40 * (x**2 + y**2))
    usual: Any = dict(focal_length="20mm", power=1e8, full_well=8000, bitdepth=10, black_level=20)
    photos = SimulatedCamera(slm, (60, 50), read_noise=12, seed=3, **usual)
    photos.set_exposure(1.2)
    electrons = 1.2e8 * photos.render()
    taken = np.stack([photos.get_image() for _ in range(400)]).astype(float)
    assert photos.get_image().dtype == np.uint16
    gain = (1023 - 20) / 8000
    wanted = electrons * gain + 20
    inside = (wanted > 40) & (wanted < 900)
    assert inside.sum() > 200
    assert np.abs(taken.mean(0) - wanted)[inside].max() < 5 * np.sqrt((electrons + 144)[inside].max() / 400) * gain + 0.1
    # Photon transfer: variance = gain²·(electrons + read²) + 1/12 of rounding.
    variance = gain**2 * (electrons + 144) + 1 / 12
    assert (taken.var(0) / variance)[inside].mean() == pytest.approx(1, abs=0.02)
    photos.set_exposure(100)
    assert photos.get_image().max() == 1023
    # The same seed, the same photo.
    one, two, other = (SimulatedCamera(slm, (60, 50), seed=seed, **usual).get_image() for seed in (3, 3, 4))
    assert np.array_equal(one, two) and not np.array_equal(one, other)


def test_crosstalk_dims_a_steep_grating() -> None:
    slm = panel(160, 120, 1.0)
    slm.set_phase(np.pi * (np.indices(slm.shape)[1] % 4 // 2))
    clean, blurred = (
        SimulatedCamera(slm, (240, 60), focal_length="10mm", crosstalk=c, subsamples=2).render().max() for c in (0, 0.5)
    )
    assert blurred < 0.95 * clean


@pytest.mark.parametrize(
    "arguments, words",
    [
        (dict(), "give it for a lens"),
        (dict(focal_length="1m", z="1m"), "give it for a lens"),
        (dict(focal_length=0), "focal_length: 0"),
        (dict(focal_length="8"), "unit"),
        (dict(z="1m", defocus="1mm"), "for a lens"),
        (dict(focal_length="1m", pitch=0), "pitch"),
        (dict(focal_length="1m", full_well=-1), "full_well"),
        (dict(focal_length="1m", crosstalk=-1), "crosstalk"),
        (dict(focal_length="1m", bitdepth=17), "bitdepth"),
        (dict(focal_length="1m", amplitude=np.zeros((64, 96))), "no light"),
        (dict(focal_length="1m", wavefront_error=np.zeros((96, 64))), "shape"),
        (dict(focal_length="1m", wavefront_error=np.full((64, 96), np.nan)), "finite"),
    ],
)
def test_cameras_that_cannot_be_are_refused(arguments: Any, words: str) -> None:
    with pytest.raises(hd.Error, match=words):
        SimulatedCamera(panel(96, 64), **arguments)


def calibrated(camera: SimulatedCamera, slm: Holodrive, **grid: Any) -> Any:
    bench = FourierSLM(camera, slm)
    camera.set_exposure(0.003)
    # slmsuite begins with random phases.
    np.random.seed(1)
    bench.fourier_calibrate(**{"array_shape": (10, 8), "array_pitch": 16, "autoexpose": True, "verbose": False, **grid})
    return bench


def misplaced(bench: Any, camera: SimulatedCamera) -> float:
    """The largest error of a Fourier calibration over the sensor [pixels]."""
    i, j = np.meshgrid(np.linspace(0, camera.shape[1] - 1, 9), np.linspace(0, camera.shape[0] - 1, 7))
    blaze = np.linalg.inv(camera.M) @ (np.stack([i.ravel(), j.ravel()]) - camera.b)
    return float(np.abs(bench.kxyslm_to_ijcam(blaze) - (camera.M @ blaze + camera.b)).max())


@pytest.fixture(scope="module")
def bench() -> Any:
    """A camera turned, sheared and off the axis, whose place a Fourier calibration has found."""
    slm = panel()
    x, y = over(slm)
    camera = SimulatedCamera(
        slm,
        (400, 320),
        focal_length="36mm",
        rotation=0.05,
        shear=0.01,
        offset=(195, 150),
        amplitude=np.exp(-(x**2 + y**2)),
    )
    return calibrated(camera, slm)


def test_fourier_calibration_finds_the_camera(bench: Any) -> None:
    assert misplaced(bench, bench.cam) < 0.2


def test_feedback_makes_spots_even(bench: Any) -> None:
    slm, camera = bench.slm, bench.cam
    x, y = np.meshgrid(np.linspace(60, 340, 7), np.linspace(50, 260, 5))
    spots = np.stack([x.ravel(), y.ravel()])
    # Not on the light that is not modulated.
    spots = spots[:, np.hypot(*(spots - camera.b)) > 20]
    np.random.seed(1)
    hologram = SpotHologram((512, 512), spots, basis="ij", cameraslm=bench)
    hologram.optimize("WGS-Kim", maxiter=15, verbose=False, feedback="computational_spot")
    slm.set_phase(hologram.get_phase())
    camera.autoexpose(set_fraction=0.6)

    def evenness(photo: Any) -> float:
        power = [photo[round(j) - 6 : round(j) + 7, round(i) - 6 : round(i) + 7].sum(dtype=float) for i, j in spots.T]
        return 1 - (max(power) - min(power)) / (max(power) + min(power))

    before = evenness(camera.render())
    hologram.optimize("WGS-Kim", maxiter=25, verbose=False, feedback="experimental_spot")
    slm.set_phase(hologram.get_phase())
    assert before < 0.96
    # Eight photos: one's own noise is 1 %.
    assert evenness(camera.get_image(averaging=8)) > 0.98 and evenness(camera.render()) > 0.98
    # The light itself, without the bench's own transform.
    near = [(i + round(a), j + round(b)) for a, b in spots.T for j in range(-6, 7) for i in range(-6, 7)]
    slm_x, slm_y = over(slm)
    power = by_definition(slm, camera, near, np.exp(-(slm_x**2 + slm_y**2))).reshape(-1, 169).sum(1)
    assert 1 - np.ptp(power) / (power.max() + power.min()) > 0.98
    assert power.sum() > 0.5


def test_feedback_of_the_camera_betters_a_picture(bench: Any) -> None:
    slm, camera = bench.slm, bench.cam
    # A ring, a disk and a bar, soft at their edges, in a dark frame; elsewhere light may go.
    j, i = np.indices((90, 120))
    ring, disk = np.hypot(i - 35, j - 45), np.hypot(i - 85, j - 30)

    def soft(inside: Any) -> Any:
        return 1 / (1 + np.exp(-inside / 1.5))

    bar = np.minimum(np.minimum(i - 65, 105 - i), np.minimum(j - 55, 70 - j))
    wanted = np.clip(soft(6 - np.abs(ring - 20)) + 0.7 * soft(14 - disk) + 0.9 * soft(bar), 0, 1)
    target = np.full(camera.shape, np.nan)
    place = (slice(20, 110), slice(40, 160))
    target[place] = wanted
    light = wanted**2 / np.sum(wanted**2)

    def error(photo: Any) -> float:
        seen = photo[place].astype(float)
        return float(np.linalg.norm(seen * (seen * light).sum() / (seen**2).sum() - light) / np.linalg.norm(light))

    hologram = FeedbackHologram((512, 512), target_ij=target, cameraslm=bench)
    # A smooth start: no vortices.
    hologram.reset_phase(random_phase=0.0, quadratic_phase=1.0)
    hologram.optimize("WGS-Leonardo", maxiter=30, verbose=False, feedback="computational")
    slm.set_phase(hologram.get_phase())
    camera.autoexpose(set_fraction=0.6)
    before = error(camera.render())
    hologram.optimize("WGS-Leonardo", maxiter=15, verbose=False, feedback="experimental")
    slm.set_phase(hologram.get_phase())
    after = error(camera.render()), error(camera.get_image())
    assert max(after) < 0.6 * before, (before, after)


def test_wavefront_calibration_finds_what_is_hidden() -> None:
    slm = panel()
    x, y = over(slm)
    r2 = x**2 + y**2
    # Defocus, astigmatism and coma: 0.16 waves rms over a Gaussian beam.
    hidden = 2 * (2 * r2 - 1) + 1.5 * 2 * x * y + 1.2 * (3 * r2 - 2) * x
    amplitude = np.exp(-r2 / 1.2)
    camera = SimulatedCamera(
        slm, (400, 320), focal_length="36mm", rotation=0.05, offset=(150, 190), amplitude=amplitude, wavefront_error=hidden
    )
    bench = calibrated(camera, slm)
    bench.wavefront_calibrate_superpixel(calibration_points=[[300], [100]], superpixel_size=40, plot=-1)
    bench.wavefront_calibration_superpixel_process(plot=False)

    def waves(phase: Any) -> float:
        """Rms over the beam, less piston and tilt, which move the picture as a whole [waves]."""
        light = amplitude**2 / np.sum(amplitude**2)
        planes = np.stack([np.ones(x.size), x.ravel(), y.ravel()], 1) * np.sqrt(light.ravel())[:, None]
        wave = np.exp(1j * phase)
        for _ in range(8):
            rest = np.angle(wave * np.exp(-1j * np.angle(np.sum(light * wave))))
            fit = np.linalg.lstsq(planes, (rest * np.sqrt(light)).ravel(), rcond=None)[0]
            wave = wave * np.exp(-1j * (fit[0] + fit[1] * x + fit[2] * y))
        rest = np.angle(wave * np.exp(-1j * np.angle(np.sum(light * wave))))
        return float(np.sqrt(np.sum(light * rest**2)) / (2 * np.pi))

    assert waves(hidden) > 0.1
    assert waves(hidden + slm.source["phase"]) < 0.05
    assert np.corrcoef(slm.source["amplitude"].ravel(), amplitude.ravel())[0, 1] > 0.98
    # And the light agrees: a blaze is focused as it was not.
    with_it, without = (
        (slm.set_phase(2 * np.pi * 0.01 * slm.grid[0], phase_correct=correct), camera.render().max())[1] for correct in (True, False)
    )
    assert with_it > 1.3 * without


def test_a_full_panel_is_photographed_quickly_and_right() -> None:
    slm = panel(1920, 1080)
    camera = SimulatedCamera(slm, (640, 512), focal_length="200mm", rotation=0.03, offset=(300, 260))
    slm.set_phase(np.random.default_rng(1).uniform(0, 6.28, slm.shape))
    start = time.perf_counter()
    seen = camera.render()
    # A sixth of that where nothing else runs.
    assert time.perf_counter() - start < 3
    pixels = [(i, j) for i in (0, 299, 639) for j in (0, 260, 511)]
    wanted = by_definition(slm, camera, pixels)
    assert np.abs(np.sqrt(seen[[j for _, j in pixels], [i for i, _ in pixels]]) - np.sqrt(wanted)).max() < 2e-6


def test_the_guides_bench_is_calibrated() -> None:
    """1920 × 1080, over the local path."""
    block = re.search(r"```python slmsuite\n(.*?)```", (ROOT / "src/guide/python.md").read_text(), re.S)
    assert block
    # A name of its own: a panel of that name may be served on this machine.
    code = block[1].replace('"generic", ', '"generic", name="bench of the guide", ')
    names: "dict[str, Any]" = {}
    np.random.seed(1)
    exec(compile(code, "python.md", "exec"), names)
    try:
        assert misplaced(names["bench"], names["camera"]) < 0.2
    finally:
        names["slm"].close()
