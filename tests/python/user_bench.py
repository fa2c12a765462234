"""A user's script for slmsuite, which mypy --strict reads."""

from __future__ import annotations

import holodrive as hd
import numpy as np
from holodrive.slmsuite import Holodrive, SimulatedCamera, serve_bench
from numpy.typing import NDArray


def picture(phase: NDArray[np.float64]) -> NDArray[np.float32]:
    slm: Holodrive = Holodrive(hd.Panel(width=160, height=120, pitch="8um", wavelength="532nm"))
    slm.set_phase(phase)
    camera = SimulatedCamera(slm, (64, 48), focal_length="50mm", rotation=0.1, read_noise=2.0)
    with serve_bench(slm, camera, port=0) as served:
        assert served.port > 0 and served.refused == 0
    if (shown := slm.shown) is not None:
        late: float = shown.latency
        assert late >= 0
    curve: NDArray[np.float64] = slm.curve
    assert curve.shape == (256,) and camera.M.shape == (2, 2)
    return camera.render()
