"""A user's script, which mypy --strict reads: what the stubs say is what the package does. It is run, too."""

from __future__ import annotations

from pathlib import Path

import holodrive as hd
import numpy as np
from numpy.typing import NDArray


def levels_for(points: NDArray[np.float64], folder: Path) -> NDArray[np.uint8] | NDArray[np.uint16]:
    panel: hd.Panel = hd.Panel(width=96, height=64, pitch=("8um", 8e-6), wavelength="532nm", bits=8)
    told: list[tuple[str, int, int]] = []

    def watch(step: str, done: int, total: int) -> None:
        told.append((step, done, total))

    field: hd.Field = hd.hologram(hd.Points(points, amplitudes=1.0), panel, progress=watch)
    if (report := field.report) is not None:
        bound: float = report["error_bound"]
        assert bound < 2e-3 and report["engine"]
    samples: NDArray[np.complex64] = field.samples
    frame: hd.Frame = hd.encode(samples, panel, encoding="double-phase")
    frame.save(folder / "frame.png")
    picture: hd.Picture = hd.reconstruct(hd.Frame.load(folder / "frame.png"), "-50mm", size=(48, 32))
    figures: dict[str, float] = hd.metrics(picture, np.asarray(picture))
    assert figures["ssim"] > 0.999
    try:
        hd.Panel("nothing of that name")
    except hd.CalibrationError as error:
        assert "no such panel" in str(error)
    return frame.levels


def frames_for_an_eye(panel: hd.Panel) -> list[hd.Frame]:
    light = hd.LightField(
        np.ones((9, 9, 8, 8)), eye=(0, 0, "600mm"), spacing="0.5mm", window=("1mm", "1mm"), depth=("-10mm", "-20mm")
    )
    one: hd.Frame = hd.encode(light, panel, iterations=2)
    assert one.shape == panel.shape
    return hd.encode(light, panel, subframes=2, iterations=2)


def drive(slm: hd.SLM, phase: NDArray[np.float32]) -> float:
    shown: hd.Shown = slm.show(phase)
    return shown.latency
