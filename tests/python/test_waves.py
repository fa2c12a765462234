"""Values against those of the physics, computed by NumPy."""

from __future__ import annotations

import holodrive as hd
import numpy as np
import pytest
from conftest import distance, sphere

GREEN = 532e-9


@pytest.mark.parametrize("place", [(0.0, 0.0, -0.1), (1e-4, -5e-5, -0.08), (0.0, 0.0, 0.1), (-1e-4, 8e-5, 0.12)])
def test_the_field_of_a_point_is_its_sphere(panel: hd.Panel, place: "tuple[float, float, float]") -> None:
    field = hd.hologram(hd.Points([place]), panel, error=1e-4)
    assert distance(field, sphere(panel, place, GREEN)) < 2e-4


def test_amplitude_and_phase_of_a_point_multiply_its_sphere(panel: hd.Panel) -> None:
    place = (2e-5, 1e-5, -0.09)
    field = hd.hologram(hd.Points([place], amplitudes=0.25, phases=1.2), panel, error=1e-4)
    assert distance(field, 0.25 * np.exp(1.2j) * sphere(panel, place, GREEN)) < 2e-4


def test_fields_of_points_add(panel: hd.Panel) -> None:
    random = np.random.default_rng(3)
    places = np.c_[random.uniform(-2e-4, 2e-4, (20, 2)), random.uniform(-0.12, -0.08, 20)]
    amplitudes, phases = random.uniform(0.2, 1, 20), random.uniform(0, 2 * np.pi, 20)
    field = hd.hologram(hd.Points(places, amplitudes=amplitudes, phases=phases), panel)
    one = [a * np.exp(1j * f) * sphere(panel, tuple(p), GREEN) for p, a, f in zip(places, amplitudes, phases)]
    assert field.report is not None
    assert distance(field, np.sum(one, axis=0)) < field.report["error_bound"]


@pytest.mark.parametrize("engine", ["oracle", "direct", "tiles", "planes"])
def test_each_engine_keeps_the_error_that_it_states(panel: hd.Panel, engine: str) -> None:
    places = [(1e-4, 5e-5, -0.1), (-1e-4, 0.0, -0.11), (0.0, -1e-4, -0.12)]
    field = hd.hologram(hd.Points(places), panel, engine=engine)
    assert field.report is not None and field.report["engine"] == engine
    wanted = np.sum([sphere(panel, place, GREEN) for place in places], axis=0)
    assert distance(field, wanted) <= field.report["error_bound"]


def test_a_red_laser_makes_another_wave(panel: hd.Panel) -> None:
    red = panel.at("633nm")
    place = (0.0, 0.0, -0.1)
    field = hd.hologram(hd.Points([place]), red, error=1e-4)
    assert field.wavelength == pytest.approx(633e-9)
    assert distance(field, sphere(red, place, 633e-9)) < 2e-4


def test_channels_take_their_colours_amplitudes(panel: hd.Panel) -> None:
    points = hd.Points([[0, 0, -0.1]], rgb=[[0.5, 0.25, 0.125]])
    of = {name: np.abs(np.asarray(hd.hologram(points, panel, channel=name))).mean() for name in ("red", "green", "blue")}
    assert of["red"] / of["green"] == pytest.approx(2, rel=1e-3)
    assert of["green"] / of["blue"] == pytest.approx(2, rel=1e-3)


def beam(n: int, pitch: float, waist: float) -> "np.ndarray[tuple[int, int], np.dtype[np.complex64]]":
    at = (np.arange(n) - (n - 1) / 2) * pitch
    x, y = np.meshgrid(at, -at)
    return np.asarray(np.exp(-(x**2 + y**2) / waist**2), np.complex64)


@pytest.mark.parametrize("d", [0.005, -0.003, 0.02])
def test_propagation_is_numpys_angular_spectrum(d: float) -> None:
    n, pitch = 128, 8e-6
    field = beam(n, pitch, 0.15e-3) * np.exp(1j * np.linspace(0, 3, n)).astype(np.complex64)
    frequency = np.fft.fftfreq(2 * n, pitch)
    fx, fy = np.meshgrid(frequency, frequency)
    fz = np.sqrt(1 / GREEN**2 - fx**2 - fy**2)
    wanted = np.fft.ifft2(np.fft.fft2(field, (2 * n, 2 * n)) * np.exp(2j * np.pi * fz * d))[:n, :n]
    carried = hd.propagate(hd.Field(field, pitch, GREEN), d)
    assert carried.z == d
    # What the transform of twice the size brings round from the other side is less than this for a beam in the middle.
    assert distance(carried, wanted) < 2e-4


def test_a_gaussian_beam_spreads_as_the_textbook_says() -> None:
    n, pitch, waist, d = 384, 8e-6, 0.2e-3, 0.3
    far = np.abs(np.asarray(hd.propagate(hd.Field(beam(n, pitch, waist), pitch, GREEN), d))) ** 2
    at = (np.arange(n) - (n - 1) / 2) * pitch
    width = 2 * np.sqrt((far.sum(0) * at**2).sum() / far.sum())
    assert width == pytest.approx(waist * np.sqrt(1 + (d * GREEN / (np.pi * waist**2)) ** 2), rel=2e-3)


def test_propagation_there_and_back_keeps_the_field() -> None:
    field = hd.Field(beam(128, 8e-6, 0.15e-3), "8um", GREEN)
    back = hd.propagate(hd.propagate(field, "5mm"), "-5mm")
    assert back.z == 0 and distance(back, field) < 1e-3
    assert back.energy == pytest.approx(field.energy, rel=1e-3)


def test_the_fresnel_kernel_differs_by_its_paraxial_phase() -> None:
    field = hd.Field(beam(128, 8e-6, 0.15e-3), "8um", GREEN)
    exact, paraxial = hd.propagate(field, "20mm"), hd.propagate(field, "20mm", kernel="fresnel")
    assert 0 < distance(paraxial, exact) < 1e-3


def test_a_blazed_grating_gets_its_levels_exactly(panel: hd.Panel) -> None:
    phases = np.broadcast_to(2 * np.pi * np.arange(64) / 16, (48, 64))
    frame = hd.encode(phases, panel)
    assert np.array_equal(frame.levels, np.broadcast_to(16 * (np.arange(64) % 16), (48, 64)))
    assert frame.levels.dtype == np.uint8
    assert frame.report is not None and frame.report["encoding"] == "kinoform"


def test_phases_of_any_turn_and_sign_are_the_same_levels(panel: hd.Panel) -> None:
    phases = np.random.default_rng(1).integers(0, 256, (48, 64)) * (2 * np.pi / 256)
    levels = hd.encode(phases, panel).levels
    assert np.array_equal(levels, np.rint(phases * 256 / (2 * np.pi)))
    assert np.array_equal(hd.encode(phases - 4 * np.pi, panel).levels, levels)


def test_a_curve_decides_about_levels() -> None:
    curve = np.linspace(0, 4 * np.pi, 256)
    panel = hd.Panel(width=8, height=4, pitch="8um", wavelength="532nm", curve=curve)
    assert np.allclose(panel.curve, curve)
    levels = hd.encode(np.full((4, 8), np.pi), panel).levels
    # π is level 64 or, a turn later, 191.
    shown = curve[levels] % (2 * np.pi)
    assert np.abs(shown - np.pi).max() <= 2 * np.pi / 255


@pytest.mark.parametrize("encoding", ["double-phase", "kinoform", "gradient", "error-diffusion"])
def test_a_frame_shows_a_point_where_it_stands(encoding: str) -> None:
    panel = hd.Panel(width=256, height=192, pitch="8um", wavelength=GREEN)
    place = (2.4e-4, -1.6e-4, -0.05)
    frame = hd.encode(hd.hologram(hd.Points([place]), panel), panel, encoding=encoding)
    picture = hd.reconstruct(frame, place[2])
    seen = np.asarray(picture)
    row, column = np.unravel_index(int(seen.argmax()), seen.shape)
    assert abs(picture.x[column] - place[0]) < 1.5e-5 and abs(picture.y[row] - place[1]) < 1.5e-5
    assert seen.max() > 30 * np.median(seen)


def test_an_eye_sees_a_point_where_the_ray_meets_the_depth() -> None:
    panel = hd.Panel(width=512, height=384, pitch="8um", wavelength=GREEN)
    place = (3e-4, 2e-4, -0.1)
    field = hd.hologram(hd.Points([place]), panel)
    picture = hd.reconstruct(field, place[2], eye=(0, 0, 0.3), pupil="2mm")
    seen = np.asarray(picture)
    row, column = np.unravel_index(int(seen.argmax()), seen.shape)
    # The spot of a pupil of 2 mm at 0.4 m is 0.1 mm wide.
    assert abs(picture.x[column] - place[0]) < 5e-5 and abs(picture.y[row] - place[1]) < 5e-5
    # Out of focus it spreads.
    assert np.asarray(hd.reconstruct(field, -0.3, eye=(0, 0, 0.3), pupil="2mm")).max() < 0.7 * seen.max()


def test_a_picture_of_cells_sums_the_light_of_its_samples() -> None:
    panel = hd.Panel(width=64, height=64, pitch="8um", wavelength=GREEN)
    field = hd.hologram(hd.Points([(0.0, 0.0, -0.05)]), panel)
    whole, cells = hd.reconstruct(field, "-50mm"), hd.reconstruct(field, "-50mm", size=(16, 8), window="0.512mm")
    assert cells.shape == (8, 16) and whole.shape == (64, 64)
    assert np.asarray(cells, np.float64).sum() == pytest.approx(np.asarray(whole, np.float64).sum(), rel=1e-5)
    assert cells.window == pytest.approx((64 * 8e-6,) * 2)


def test_fringes_are_of_the_reference_waves_angle() -> None:
    panel = hd.Panel(width=256, height=128, pitch="8um", wavelength=GREEN, modulation="amplitude")
    flat = np.ones((128, 256), np.complex64)
    frame = hd.encode(flat, panel, encoding="off-axis-bipolar", reference_angle=("0.8deg", "0deg"))
    spectrum = np.abs(np.fft.rfft(frame.levels[64].astype(float) - frame.levels[64].mean()))
    wanted = np.sin(np.deg2rad(0.8)) / GREEN * 256 * 8e-6
    assert abs(int(spectrum.argmax()) - wanted) <= 1


def test_a_digital_lens_focuses_behind_the_panel() -> None:
    panel = hd.Panel(width=256, height=256, pitch="8um", wavelength=GREEN)
    frame = hd.encode(np.ones((256, 256), np.complex64), panel, encoding="kinoform", lens="150mm")
    # Lit at normal incidence, whatever the encoding's own illumination would be.
    phase = frame.levels * (2 * np.pi / 256)
    at_focus = hd.reconstruct(hd.Field(np.exp(1j * phase).astype(np.complex64), "8um", GREEN), "150mm")
    seen = np.asarray(at_focus)
    row, column = np.unravel_index(int(seen.argmax()), seen.shape)
    assert abs(at_focus.x[column]) < 2e-5 and abs(at_focus.y[row]) < 2e-5
    assert seen.max() > 300 * np.median(seen)


def test_metrics_of_fields_know_a_factor_from_a_fault(panel: hd.Panel) -> None:
    wanted = sphere(panel, (0.0, 0.0, -0.1), GREEN)
    figures = hd.metrics((2j * wanted).astype(np.complex64), wanted.astype(np.complex64))
    assert figures["field_error"] < 1e-6
    assert figures["relative_error"] == pytest.approx(abs(2j - 1), rel=1e-5)


def test_psnr_is_that_of_coded_pictures() -> None:
    random = np.random.default_rng(2)
    wanted = random.uniform(0.2, 0.8, (40, 60))
    seen = wanted + random.normal(0, 0.01, wanted.shape)
    gain = (seen * wanted).sum() / (seen**2).sum()

    def coded(v: "np.ndarray[tuple[int, int], np.dtype[np.float64]]") -> "np.ndarray[tuple[int, int], np.dtype[np.float64]]":
        v = np.clip(v, 0, 1)
        return np.where(v <= 0.0031308, 12.92 * v, 1.055 * v ** (1 / 2.4) - 0.055)

    figures = hd.metrics(seen, wanted, white=1.0)
    mean = ((coded(gain * seen) - coded(wanted)) ** 2).mean()
    assert figures["gain"] == pytest.approx(gain, rel=1e-5)
    assert figures["psnr"] == pytest.approx(-10 * np.log10(mean), abs=0.01)
    assert figures["contrast"] == pytest.approx(seen.std() / seen.mean(), rel=1e-3)
