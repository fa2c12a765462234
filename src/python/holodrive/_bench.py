"""The simulated bench: from the levels of a panel, through a lens or free space, to what a camera counts."""

from __future__ import annotations

import importlib
import math
from typing import Any, Optional, Tuple

import numpy as np
from numpy.typing import NDArray

from ._fourier import LatticeFourier

__all__ = ["FreeSpace", "Lens", "Modulator", "Sensor"]

# scipy has no types. It comes with slmsuite, for which this is made.
_fft: Any = importlib.import_module("scipy.fft")
_erf: Any = importlib.import_module("scipy.special").erf
_correlate: Any = importlib.import_module("scipy.ndimage").correlate1d

#: Above so many photo-electrons the Poisson distribution is taken for the normal one.
_MANY = 50.0


class Modulator:
    """The light that leaves a panel's active area: s·exp(i(φ + w)).

    :param curve: phase φ of each level [rad].
    :param crosstalk: standard deviation of the Gaussian that blends the phases of neighbouring pixels [pixels].
    """

    def __init__(self, curve: NDArray[np.float64], crosstalk: float) -> None:
        self._curve = np.asarray(curve, np.float32)
        self._light = np.exp(1j * np.asarray(curve, np.float64)).astype(np.complex64)
        self._kernel: Optional[NDArray[np.float32]] = None
        if crosstalk > 0:
            # The Gaussian's share of each pixel, to five standard deviations.
            reach = math.ceil(5 * crosstalk) + 1
            edges = (np.arange(-reach, reach + 2) - 0.5) / (crosstalk * math.sqrt(2))
            shares = np.diff(_erf(edges))
            self._kernel = (shares / shares.sum()).astype(np.float32)

    def __call__(self, levels: NDArray[Any]) -> NDArray[np.complex64]:
        """exp(iφ) of an array of levels."""
        if self._kernel is None:
            return np.asarray(self._light[levels])
        phase = self._curve[levels]
        for axis in (0, 1):
            phase = _correlate(phase, self._kernel, axis=axis, mode="nearest")
        return np.asarray(np.exp(1j * phase), np.complex64)


class _Plane:
    """What both planes have: places that are the means of ``subsamples``² samples of a pixel."""

    def __init__(self, matrix: NDArray[np.float64], shift: NDArray[np.float64], size: Tuple[int, int], subsamples: int) -> None:
        # Place of a pixel (i, j) in the plane: matrix·(i, j) + shift; of its samples, evenly over it.
        self._subsamples, self._size = subsamples, size
        self.across = (matrix[0, 0] / subsamples, matrix[1, 0] / subsamples)
        self.down = (matrix[0, 1] / subsamples, matrix[1, 1] / subsamples)
        back = 0.5 * (subsamples - 1)
        self.origin = (
            float(shift[0]) - back * (self.across[0] + self.down[0]),
            float(shift[1]) - back * (self.across[1] + self.down[1]),
        )
        self.samples = (size[0] * subsamples, size[1] * subsamples)

    def places(self) -> "Tuple[NDArray[np.float64], NDArray[np.float64]]":
        """Both coordinates of all samples, each of shape (rows j, columns i)."""
        i, j = np.arange(self.samples[0]), np.arange(self.samples[1])[:, None]
        x, y = (self.origin[k] + i * self.across[k] + j * self.down[k] for k in (0, 1))
        return x, y

    def pixels(self, intensity: NDArray[np.float32]) -> NDArray[np.float32]:
        """The mean over each pixel."""
        n = self._subsamples
        if n == 1:
            return intensity
        columns, rows = self._size
        return np.asarray(intensity.reshape(rows, n, columns, n).mean(axis=(1, 3), dtype=np.float32))


class Lens(_Plane):
    """The focal plane of a lens: the share of a panel's light in each pixel, |U(u, v)|²·|∂(u, v)/∂(i, j)| / Σ|s|².

    U = E·T[s·exp(i(φ + w))] + d·(sinc u·sinc v − E)·T[s·exp(iw)], with the transform T over the panel's pixels, (u, v) in cycles a pixel,
    the active area's E = F·sinc(√F·u)·sinc(√F·v) for a fill factor F, and the dead space's amplitude d. Paraxial; a defocus δ adds the
    phase −πδ(x² + y²)/(λf²).

    :param matrix: cycles a pixel of the panel for a pixel of the sensor: (u, v) = matrix·(i, j) + shift.
    :param size: columns and rows of the sensor.
    :param source: s·exp(iw), complex, of the panel's shape.
    :param fill_factor: F.
    :param dead_space: d.
    """

    def __init__(
        self,
        matrix: NDArray[np.float64],
        shift: NDArray[np.float64],
        size: Tuple[int, int],
        subsamples: int,
        source: NDArray[np.complex128],
        fill_factor: float,
        dead_space: float,
    ) -> None:
        super().__init__(matrix, shift, size, subsamples)
        self._transform = LatticeFourier(
            (source.shape[0], source.shape[1]), self.samples, self.origin, self.across, self.down, source
        )
        u, v = self.places()
        side = math.sqrt(fill_factor)
        active = fill_factor * np.sinc(side * u) * np.sinc(side * v)
        scale = math.sqrt(abs(float(np.linalg.det(matrix))) / float(np.sum(np.abs(source) ** 2)))
        self._active = (scale * active).astype(np.float32)
        self._unmodulated: Optional[NDArray[np.complex64]] = None
        if dead_space > 0 and fill_factor < 1:
            rest = scale * dead_space * (np.sinc(u) * np.sinc(v) - active)
            everything = self._transform(np.ones(source.shape, np.complex64))
            self._unmodulated = (rest * everything).astype(np.complex64)

    def __call__(self, light: NDArray[np.complex64]) -> NDArray[np.float32]:
        """Of exp(iφ): the share of the panel's light in each pixel."""
        field = self._transform(light)
        field *= self._active
        if self._unmodulated is not None:
            field += self._unmodulated
        return self.pixels(field.real**2 + field.imag**2)


class FreeSpace(_Plane):
    """The plane at a distance z from the panel, without a lens: the share of the panel's light in each pixel.

    Angular spectrum, exp(2πiz·√(1/λ² − f²)), of a padded transform, band-limited (K. Matsushima and T. Shimobaba, 2009), its
    sum taken at the pixels themselves. Each pixel of the panel sends F·sinc(√F·u)·sinc(√F·v) within |u|, |v| < ½; light beyond, of higher
    orders, is left out, as a stop in the panel's Fourier plane does it.

    :param matrix: places on the panel [its pixels, from its middle] for a pixel of the sensor.
    :param pitch: of the panel's pixels, x and y [m].
    :param distance: z [m]; negative: behind the panel.
    """

    def __init__(
        self,
        matrix: NDArray[np.float64],
        shift: NDArray[np.float64],
        size: Tuple[int, int],
        subsamples: int,
        source: NDArray[np.complex128],
        fill_factor: float,
        dead_space: float,
        pitch: Tuple[float, float],
        wavelength: float,
        distance: float,
    ) -> None:
        super().__init__(matrix, shift, size, subsamples)
        rows, columns = source.shape
        x, y = self.places()
        reach = (float(np.abs(x).max()), float(np.abs(y).max()))
        # The panel, as much beside it, and the way to the sensor's far corner.
        wide = [int(_fft.next_fast_len(math.ceil(n + 2 * max(0.5 * n, far)))) for n, far in zip((columns, rows), reach)]
        self._shape = (wide[1], wide[0])
        u, v = np.fft.fftfreq(wide[0]), np.fft.fftfreq(wide[1])[:, None]
        kx, ky = u * wavelength / pitch[0], v * wavelength / pitch[1]
        slope = np.sqrt(np.maximum(1 - kx**2 - ky**2, 0.0))
        # Less the phase of the axis, which is millions of turns.
        turns = (distance / wavelength) * -(kx**2 + ky**2) / (1 + slope)
        way = np.exp(2j * np.pi * (turns % 1.0)) / turns.size
        # Beyond these its phase is undersampled in the padded width.
        for k, n, step in ((kx, wide[0], pitch[0]), (ky, wide[1], pitch[1])):
            way = way * (np.abs(k) <= 1 / math.hypot(2 * distance / (n * step), 1.0))
        way *= math.sqrt(abs(float(np.linalg.det(matrix))) / float(np.sum(np.abs(source) ** 2)))
        side = math.sqrt(fill_factor)
        active = fill_factor * np.sinc(side * u) * np.sinc(side * v)
        self._source = source.astype(np.complex64)
        middle = ((columns - 1) / 2, (rows - 1) / 2)
        back = [-1 / n for n in wide]

        def transform(kernel: NDArray[np.complex128]) -> LatticeFourier:
            return LatticeFourier(
                self._shape,
                self.samples,
                ((self.origin[0] + middle[0]) * back[0], (self.origin[1] + middle[1]) * back[1]),
                (self.across[0] * back[0], self.across[1] * back[1]),
                (self.down[0] * back[0], self.down[1] * back[1]),
                np.fft.fftshift(kernel),
            )

        self._unmodulated: Optional[NDArray[np.complex64]] = None
        if dead_space > 0 and fill_factor < 1:
            rest = transform(way * dead_space * (np.sinc(u) * np.sinc(v) - active))
            self._unmodulated = rest(self._spectrum(self._source))
        self._transform = transform(way * active)

    def _spectrum(self, near: NDArray[np.complex64]) -> NDArray[np.complex64]:
        return np.asarray(_fft.fftshift(_fft.fft2(near, self._shape, workers=-1)))

    def __call__(self, light: NDArray[np.complex64]) -> NDArray[np.float32]:
        """Of exp(iφ): the share of the panel's light in each pixel."""
        field = self._transform(self._spectrum(self._source * light))
        if self._unmodulated is not None:
            field += self._unmodulated
        return self.pixels(field.real**2 + field.imag**2)


class Sensor:
    """Counts of a sensor that is lit: shot noise, read noise, full well, levels.

    :param full_well: photo-electrons of the highest level.
    :param read_noise: standard deviation [photo-electrons].
    :param dark_current: photo-electrons a second in a pixel without light.
    :param shot_noise: whether photo-electrons come at random.
    :param black_level: level of no light.
    :param seed: of the noise.
    """

    def __init__(
        self,
        bits: int,
        full_well: float,
        read_noise: float,
        dark_current: float,
        shot_noise: bool,
        black_level: float,
        seed: int,
    ) -> None:
        self._highest = 2**bits - 1
        self._dtype = np.uint8 if bits <= 8 else np.uint16
        self._full_well, self._read_noise, self._dark_current = full_well, read_noise, dark_current
        self._shot_noise, self._black_level = shot_noise, black_level
        self._random = np.random.default_rng(seed)

    def __call__(self, rate: NDArray[np.float32], exposure: float) -> NDArray[Any]:
        """Levels of a photo.

        :param rate: photo-electrons a second in each pixel.
        :param exposure: [s].
        """
        electrons = (rate + np.float32(self._dark_current)) * np.float32(exposure)
        variance = np.full((), self._read_noise**2, np.float32)
        if self._shot_noise:
            few = electrons < _MANY
            variance = np.where(few, variance, electrons + variance)
            # Few come one by one.
            electrons[few] = self._random.poisson(electrons[few])
        if self._shot_noise or self._read_noise > 0:
            electrons += np.sqrt(variance) * self._random.standard_normal(electrons.shape, np.float32)
        levels = electrons * np.float32((self._highest - self._black_level) / self._full_well) + np.float32(self._black_level)
        return np.asarray(np.clip(np.rint(levels), 0, self._highest), self._dtype)
