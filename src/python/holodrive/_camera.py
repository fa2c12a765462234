"""The camera of the simulated bench, as slmsuite's."""

from __future__ import annotations

import importlib
from typing import Any, List, Optional, Tuple, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._arrays import as_array
from ._bench import FreeSpace, Lens, Modulator, Sensor
from ._errors import refused
from ._holodrive import length

__all__ = ["SimulatedCamera"]

# slmsuite has no types.
_Camera: Any = importlib.import_module("slmsuite.hardware.cameras.camera").Camera
_build_affine: Any = importlib.import_module("slmsuite.holography.toolbox").build_affine

_Length = Union[float, str]


class SimulatedCamera(_Camera):  # type: ignore[misc]
    """A camera of the simulated bench, which pictures what a panel of :class:`Holodrive` sends: through a lens, or on a plane.

    The light is s·exp(i(φ + w)): the phase φ of the levels on the panel, an amplitude s and a wavefront error w that calibrations may look
    for, with the panel's fill factor, its dead space's unmodulated light and its crosstalk. In the focal plane of a lens it is
    the Fourier transform at the camera's own pixels (see ``holodrive._fourier``; error below 1e-6 of √Σ|s|²), wherever these lie, in
    higher orders, too; at a distance z without a lens the band-limited angular spectrum, likewise at the pixels themselves. Then
    come exposure, shot and read noise, full well and levels. A pixel of the camera is the mean of ``subsamples``² places.

    Places are slmsuite's: pixel (i, j) = M·(kx, ky) + b for a blaze of (kx, ky); with ``z``, M is of x and y on the panel [m] in
    place of kx and ky. y and j run down.

    :param slm: the panel, a :class:`holodrive.slmsuite.Holodrive`.
    :param resolution: (columns, rows).
    :param pitch: distance of the camera's pixels [m], or (x, y), or text with a unit.
    :param focal_length: of the lens [m], the panel in its front focal plane.
    :param z: instead of a lens: distance of the camera from the panel [m]; light beyond the panel's first order is left out.
    :param defocus: distance of the camera behind the focal plane [m].
    :param rotation: of the camera [rad], as theta of slmsuite's ``build_affine``.
    :param shear: as its shear_angle [rad].
    :param offset: place of the optical axis (i, j) [pixels]; by default the middle.
    :param amplitude: s, of the panel's shape; by default 1.
    :param wavefront_error: w [rad], of the panel's shape; by default 0.
    :param power: photo-electrons a second that all the light on the panel would give.
    :param full_well: photo-electrons of the highest level.
    :param read_noise: its standard deviation [photo-electrons].
    :param dark_current: [photo-electrons a second and pixel].
    :param shot_noise: whether photo-electrons come at random.
    :param black_level: level without light.
    :param seed: of the noise.
    :param fill_factor, dead_space, crosstalk: of the panel, where they are not the profile's.
    :param subsamples: by default as many as the finest fringes of the light need, 4 at most: 1 where pixels are below λf/(1.6·width).
    :param bitdepth: of a level.
    :param kwargs: further arguments of slmsuite's Camera: name, averaging, hdr, rot, fliplr, flipud, exposure_bounds_s …
    :raises ParameterError: neither or both of focal_length and z are given; an array is of another shape; a number is out of its domain.

    Attributes beside slmsuite's: ``M`` and ``b``, where the camera really stands, for judging a calibration.
    """

    M: NDArray[np.float64]
    b: NDArray[np.float64]

    def __init__(
        self,
        slm: Any,
        resolution: Tuple[int, int] = (640, 512),
        pitch: Union[_Length, Tuple[_Length, _Length]] = "3.45um",
        *,
        focal_length: Optional[_Length] = None,
        z: Optional[_Length] = None,
        defocus: _Length = 0.0,
        rotation: float = 0.0,
        shear: Union[float, Tuple[float, float]] = 0.0,
        offset: Optional[Tuple[float, float]] = None,
        amplitude: Optional[ArrayLike] = None,
        wavefront_error: Optional[ArrayLike] = None,
        power: float = 1e9,
        full_well: float = 10000.0,
        read_noise: float = 3.0,
        dark_current: float = 0.0,
        shot_noise: bool = True,
        black_level: float = 0.0,
        seed: int = 1,
        fill_factor: Optional[float] = None,
        dead_space: Optional[float] = None,
        crosstalk: Optional[float] = None,
        subsamples: Optional[int] = None,
        bitdepth: int = 12,
        **kwargs: Any,
    ) -> None:
        if (focal_length is None) == (z is None):
            raise refused("focal_length", "give it for a lens, or z for a plane without one")
        self._slm, self._exposure, self._power = slm, 1.0, float(power)
        pair = pitch if isinstance(pitch, (tuple, list)) else (pitch, pitch)
        pitch_x, pitch_y = length(pair[0]), length(pair[1])
        if not hasattr(slm, "curve"):
            raise refused("slm", f"{type(slm).__name__} does not tell its level curve; give a holodrive.slmsuite.Holodrive")
        fill = slm.fill_factor if fill_factor is None else fill_factor
        dead = slm.dead_space if dead_space is None else dead_space
        blur = slm.crosstalk if crosstalk is None else crosstalk
        for what, value, fits in (
            ("pitch", min(pitch_x, pitch_y), min(pitch_x, pitch_y) > 0),
            ("power", power, power > 0),
            ("full_well", full_well, full_well > 0),
            ("read_noise", read_noise, read_noise >= 0),
            ("dark_current", dark_current, dark_current >= 0),
            ("black_level", black_level, 0 <= black_level < 2**bitdepth - 1),
            ("fill_factor", fill, 0 < fill <= 1),
            ("dead_space", dead, 0 <= dead <= 1),
            ("crosstalk", blur, 0 <= blur <= 8),
            ("bitdepth", bitdepth, 1 <= bitdepth <= 16),
            ("subsamples", subsamples, subsamples is None or 1 <= subsamples <= 16),
        ):
            if not fits:
                raise refused(what, f"{value} is out of its domain")

        wavelength, panel_pitch = slm.wav_um * 1e-6, (slm.pitch_um[0] * 1e-6, slm.pitch_um[1] * 1e-6)
        # Of a lens: pixels for a normalised blaze; of a plane: pixels for a metre.
        distance = 0.0 if focal_length is None else length(focal_length)
        if focal_length is not None and not distance > 0:
            raise refused("focal_length", f"{focal_length} is out of its domain")
        axis = (resolution[0] / 2, resolution[1] / 2) if offset is None else offset
        scale = distance if z is None else 1.0
        self.M, self.b = _build_affine(
            (scale / pitch_x, scale / pitch_y), units="ij", theta=rotation, shear_angle=shear, offset=axis
        )
        # The panel's cycles a pixel are a blaze times its pitch in wavelengths; on a plane its pixels are metres over its pitch.
        unit = np.array([p / wavelength if z is None else 1 / p for p in panel_pitch])[:, None]
        matrix = unit * np.linalg.inv(self.M)
        shift = (-matrix @ self.b).ravel()

        y, x = ((np.arange(n) - (n - 1) / 2) * p for n, p in zip(slm.shape, panel_pitch[::-1]))
        source = np.ones(slm.shape, np.complex128)
        for what, given in (("amplitude", amplitude), ("wavefront_error", wavefront_error)):
            if given is not None:
                array = np.asarray(as_array(given), np.float64)
                if array.shape != slm.shape or not np.isfinite(array).all():
                    raise refused(what, f"finite numbers of the panel's shape {slm.shape} are needed, not {array.shape}")
                source = source * (array if what == "amplitude" else np.exp(1j * array))
        if not np.abs(source).max() > 0:
            raise refused("amplitude", "there is no light on the panel")
        behind = length(defocus)
        if behind:
            if z is not None:
                raise refused("defocus", "it is for a lens; z says where the plane is")
            source = source * np.exp(-1j * np.pi * behind / (wavelength * distance**2) * (x**2 + y[:, None] ** 2))
        if subsamples is None:
            # Intensities through a lens hold frequencies up to the panel's width, on a plane up to a cycle a pixel of its. Of the
            # highest there is next to nothing: a quarter coarser is as good.
            widest = 2.0 * np.array(slm.shape[::-1] if z is None else (1, 1))
            subsamples = int(min(max(np.ceil((widest @ np.abs(matrix)).max() / 1.25), 1), 4))
        self._modulator = Modulator(slm.curve, blur)
        size = (int(resolution[0]), int(resolution[1]))
        self._plane: Union[Lens, FreeSpace]
        if z is None:
            self._plane = Lens(matrix, shift, size, subsamples, source, fill, dead)
        else:
            self._plane = FreeSpace(matrix, shift, size, subsamples, source, fill, dead, panel_pitch, wavelength, length(z))
        self._sensor = Sensor(bitdepth, full_well, read_noise, dark_current, shot_noise, black_level, seed)
        super().__init__(size, bitdepth=bitdepth, pitch_um=(pitch_x * 1e6, pitch_y * 1e6), **kwargs)

    def _share(self) -> NDArray[np.float32]:
        return self._plane(self._modulator(as_array(self._slm.display)))

    def render(self) -> NDArray[np.float32]:
        """The share of the light on the panel that falls into each pixel, without noise and limits, for what the panel shows now; in the
        window, binning and orientation of ``get_image``.
        """
        return np.asarray(self.transform(self._crop_to_woi(self._share())))

    def _get_image_hw(self, timeout_s: float) -> NDArray[Any]:
        return self._sensor(self._share() * np.float32(self._power), self._exposure)

    def _get_exposure_hw(self) -> float:
        return self._exposure

    def _set_exposure_hw(self, exposure_s: float) -> None:
        if not 0 <= exposure_s < float("inf"):
            raise refused("exposure_s", f"{exposure_s} s is out of its domain")
        self._exposure = float(exposure_s)

    def flush(self, timeout_s: float = 1) -> None:
        """There is nothing to flush: each photo is of what the panel shows."""

    def close(self) -> None:
        """There is nothing to close."""

    @staticmethod
    def info(verbose: bool = True) -> List[str]:
        """The one camera that there is."""
        if verbose:
            print("SimulatedCamera")
        return ["SimulatedCamera"]
