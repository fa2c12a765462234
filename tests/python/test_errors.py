"""Errors are exceptions of the field: classes to catch, words that say what to do."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import holodrive as hd
import numpy as np
import pytest
from conftest import ROOT


def test_every_error_is_an_error() -> None:
    classes = [value for value in vars(hd).values() if isinstance(value, type) and issubclass(value, Exception)]
    assert len(classes) == 11 and all(issubclass(one, hd.Error) for one in classes)
    assert issubclass(hd.ParameterError, ValueError) and issubclass(hd.InputError, ValueError)
    assert issubclass(hd.FileError, OSError) and issubclass(hd.UnsupportedError, NotImplementedError)
    assert issubclass(hd.MemoryBudgetError, MemoryError)


def test_a_number_out_of_its_domain_names_setting_value_and_limit() -> None:
    with pytest.raises(hd.OutOfRangeError) as caught:
        hd.Panel(width=64, height=48, pitch="8um", bits=9, wavelength="532nm")
    assert (caught.value.parameter, caught.value.value) == ("panel bits", "9")
    assert "1 … 8" in caught.value.limit and "panel bits: 9" in str(caught.value)


@pytest.mark.parametrize("text", ["8", "8 parsec", "um", ""])
def test_a_length_without_a_unit_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="length|unit") as caught:
        hd.length(text)
    assert isinstance(caught.value, hd.Error)


@pytest.mark.parametrize(
    "text, metres", [("8um", 8e-6), ("632.8nm", 632.8e-9), ("0.25m", 0.25), ("-120mm", -0.12), (0.5, 0.5), (np.float32(2), 2)]
)
def test_lengths_are_metres_or_text(text: Any, metres: float) -> None:
    assert hd.length(text) == pytest.approx(metres, rel=1e-12)


def test_what_is_no_length_is_a_type_error() -> None:
    with pytest.raises(TypeError):
        hd.length([1])  # type: ignore[arg-type]


def test_a_panel_that_is_not_known_names_the_nearest() -> None:
    with pytest.raises(hd.CalibrationError, match="did you mean `holoeye-pluto-2.1`") as caught:
        hd.Panel("holoeye-pluto-2")
    assert Path(caught.value.path) == Path("holoeye-pluto-2")


def test_an_encoding_that_is_not_known_names_the_nearest(panel: hd.Panel) -> None:
    with pytest.raises(hd.ParameterError, match="did you mean `double-phase`") as caught:
        hd.encode(np.ones((48, 64), np.complex64), panel, encoding="double-phaze")
    assert caught.value.parameter == "encoding"


def test_a_file_that_is_not_there_is_an_os_error_with_its_number(tmp_path: Path) -> None:
    with pytest.raises(OSError) as caught:
        hd.Frame.load(tmp_path / "none.png")
    assert isinstance(caught.value, hd.FileError) and isinstance(caught.value, FileNotFoundError)
    assert caught.value.errno == 2 and Path(caught.value.filename) == tmp_path / "none.png"
    assert "none.png" in str(caught.value) and not str(caught.value).startswith("[Errno")


def test_a_damaged_scene_names_its_file(tmp_path: Path) -> None:
    bad = tmp_path / "bad.gltf"
    bad.write_text('{"asset": {"version": "2.0"}, "scene": 4}')
    with pytest.raises(hd.InputError, match="bad.gltf") as caught:
        hd.Scene.load(bad)
    assert Path(caught.value.path) == bad


def test_a_reference_wave_that_is_too_steep_says_by_how_much() -> None:
    panel = hd.Panel(width=64, height=48, pitch="8um", wavelength="532nm", modulation="amplitude")
    with pytest.raises(hd.UndersampledError) as caught:
        hd.encode(np.ones((48, 64), np.complex64), panel, encoding="off-axis-bipolar", reference_angle=("9deg", 0))
    assert caught.value.frequency > caught.value.limit > 0


def test_memory_beyond_the_budget_is_refused() -> None:
    panel = hd.Panel("generic", wavelength="532nm")
    places = np.random.default_rng(1).uniform(-1e-3, 1e-3, (30_000, 3)) - [0, 0, 0.1]
    with pytest.raises(hd.MemoryBudgetError, match="budget"):
        hd.hologram(hd.Points(places), panel, memory="1MB")


@pytest.mark.parametrize(
    "arguments, name",
    [
        (dict(iterations=3), "iterations"),
        (dict(depths=["-100mm"]), "depths"),
        (dict(start="random"), "start"),
        (dict(reference_angle=("1deg", 0)), "reference_angle"),
        (dict(eye=(0, 0, 1)), "eye"),
        (dict(subframes=3), "subframes"),
    ],
)
def test_a_setting_that_has_no_effect_is_named(panel: hd.Panel, arguments: Any, name: str) -> None:
    with pytest.raises(hd.ParameterError, match="double-phase has no use for it") as caught:
        hd.encode(np.ones((48, 64), np.complex64), panel, encoding="double-phase", **arguments)
    assert caught.value.parameter == name


def test_a_field_of_another_laser_is_refused_with_both_numbers(panel: hd.Panel) -> None:
    field = hd.Field(np.ones((48, 64), np.complex64), "8um", "633nm")
    with pytest.raises(hd.ParameterError, match='633nm, the panel\'s laser has 532nm: take panel.at\\("633nm"\\)'):
        hd.encode(field, panel)


def test_a_field_of_another_pitch_is_refused(panel: hd.Panel) -> None:
    with pytest.raises(hd.ParameterError, match="samples of 4um×4um; panel .* of 8um×8um"):
        hd.encode(hd.Field(np.ones((48, 64), np.complex64), "4um", "532nm"), panel)


@pytest.mark.parametrize(
    "levels, words",
    [
        (np.full((48, 64), 256), "256 at row 0, column 0; .* 0 … 255"),
        (np.full((48, 64), -1), "-1 at row 0"),
        (np.ones((48, 64)), "levels are whole numbers"),
        (np.ones((64, 48), np.uint8), r"\(64, 48\); panel"),
    ],
)
def test_levels_that_a_panel_has_not_are_refused(panel: hd.Panel, levels: Any, words: str) -> None:
    with pytest.raises(hd.ParameterError, match=words):
        hd.Frame(levels, panel)


def test_steps_in_the_wrong_order_say_what_is_missing(panel: hd.Panel) -> None:
    points = hd.Points([[0, 0, -0.1]])
    with pytest.raises(hd.ParameterError, match="hologram\\(points, panel\\) makes it"):
        hd.encode(points, panel, encoding="kinoform")
    with pytest.raises(hd.ParameterError, match="give a LightField"):
        hd.encode(np.ones((48, 64), np.complex64), panel, encoding="view")  # type: ignore[call-overload]
    with pytest.raises(hd.ParameterError, match="is neither a Frame nor a Field"):
        hd.reconstruct(points, 0.1)  # type: ignore[arg-type]
    with pytest.raises(hd.ParameterError, match="is an eye's"):
        hd.reconstruct(hd.Field(np.ones((48, 64), np.complex64), "8um", "532nm"), 0.1, pupil="4mm")


def test_an_eye_behind_the_panel_cannot_look() -> None:
    field = hd.Field(np.ones((48, 64), np.complex64), "8um", "532nm")
    with pytest.raises(hd.OutOfRangeError, match="in front of the panel"):
        hd.reconstruct(field, -0.1, eye=(0, 0, -0.3))


def test_a_profile_and_numbers_together_are_refused() -> None:
    with pytest.raises(hd.ParameterError, match="give one or the other"):
        hd.Panel("generic", width=4)
    with pytest.raises(hd.ParameterError, match="give a profile, or width, height, pitch and wavelength"):
        hd.Panel(width=4)


def test_the_library_prints_nothing(capfd: pytest.CaptureFixture[str]) -> None:
    hd.Panel("holoeye-pluto-2.1", wavelength="532nm")
    hd.Scene.load(ROOT / "scenes" / "mirror-ball.gltf", photons=0)
    with pytest.raises(hd.Error):
        hd.Panel("none")
    out, err = capfd.readouterr()
    assert (out, err) == ("", "")
