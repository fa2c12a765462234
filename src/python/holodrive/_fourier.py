"""The Fourier transform of an array at the points of a sheared, turned and shifted lattice, such as a camera's pixels."""

from __future__ import annotations

import importlib
import math
from typing import Any, Tuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["LatticeFourier"]

# scipy has no types. It comes with slmsuite, for which this is made.
_fft: Any = importlib.import_module("scipy.fft")
_i0: Any = importlib.import_module("scipy.special").i0

_Pair = Tuple[float, float]

#: Samples of an interpolation, and least oversampling of what is interpolated. Against direct sums the transform errs by less than
#: 1e-6·√Σ|a|², as much as single precision does.
_TAPS, _OVERSAMPLING = 8, 1.6


def _turns(turns: NDArray[np.float64]) -> NDArray[np.complex64]:
    """exp(2πi·turns), the whole turns taken off before digits are lost."""
    return np.asarray(np.exp(2j * np.pi * (turns - np.rint(turns))), np.complex64)


class LatticeFourier:
    """U[j, i] = e(i)·Σ a[r, c]·exp(−2πi(u·(c − c₀) + v·(r − r₀))) with (u, v) = ``origin`` + i·``across`` + j·``down``.

    (c₀, r₀) is the array's middle, frequencies are (along columns, along rows) in cycles a sample. The factor e(i), of modulus one, is
    left as it comes: intensities do not know it, and it is the same for all arrays of one lattice.

    Lines of constant i stay straight in the transform. On each of them the transform is sampled exactly, at rows of the FFT along
    columns of the array, by Bluestein's chirp transform along the rows (L. Bluestein, 1970), which takes any step and, for a sheared
    lattice, another offset for each row; along the line it is interpolated by a Kaiser-Bessel kernel whose own transform is divided out
    of the array before (J. Fessler and B. Sutton, 2003). Nothing is exact only on the axes: frequencies of any order may be asked for.

    :param shape: (rows, columns) of the arrays.
    :param size: (columns i, rows j) of the lattice.
    :param origin: (u, v) of i = j = 0 [cycles/sample].
    :param across: what a step of i adds.
    :param down: what a step of j adds.
    :param factor: by which each array is multiplied first: of that shape, complex.
    :raises ValueError: the lattice has no area.
    """

    def __init__(
        self,
        shape: Tuple[int, int],
        size: Tuple[int, int],
        origin: _Pair,
        across: _Pair,
        down: _Pair,
        factor: NDArray[Any],
    ) -> None:
        # Lines must be steep enough to be followed by rows: else columns and rows change places.
        self._turned = abs(down[0]) > abs(down[1])
        if self._turned:
            shape = (shape[1], shape[0])
            origin, across, down = origin[::-1], across[::-1], down[::-1]
            factor = factor.T
        rows, columns = shape
        count, lines = size
        if down[1] == 0:
            raise ValueError("the lattice's rows stand on one another")
        slope = down[0] / down[1]
        step = across[0] - slope * across[1]
        if step == 0:
            raise ValueError("the lattice's columns stand on one another")
        start = origin[0] - slope * origin[1]
        x = np.arange(columns) - 0.5 * (columns - 1)
        y = (np.arange(rows) - 0.5 * (rows - 1))[:, None]

        # Rows of the FFT that the lattice needs: its frequencies along the array's columns, finely enough for its width.
        width = rows + abs(slope) * columns
        self._length = int(_fft.next_fast_len(math.ceil(_OVERSAMPLING * width)))
        place = (origin[1] + np.arange(lines)[:, None] * down[1] + np.arange(count) * across[1]) * self._length
        first = math.floor(float(place.min())) - _TAPS // 2 + 1
        last = math.floor(float(place.max())) + _TAPS // 2
        wanted = np.arange(first, last + 1)
        self._rows = wanted % self._length
        v = (wanted / self._length)[:, None]

        oversampling = self._length / width
        beta = math.pi * math.sqrt((_TAPS / oversampling * (oversampling - 0.5)) ** 2 - 0.8)
        across_line = (y + slope * x) / self._length
        root = np.sqrt(beta**2 - (math.pi * _TAPS * across_line) ** 2)
        spectrum = _TAPS / _i0(beta) * np.sinh(root) / root
        nodes = np.arange(columns)
        self._factor = (factor / spectrum * _turns(-(start * x) - 0.5 * step * nodes**2)).astype(np.complex64)
        self._row_factor = _turns(v * (-slope * x + 0.5 * (rows - 1)))

        # Bluestein's chirp, and its length without wrapping.
        self._chirp_length = int(_fft.next_fast_len(columns + count - 1))
        chirp = np.zeros(self._chirp_length, np.complex128)
        ahead = np.arange(count)
        chirp[:count] = np.exp(2j * np.pi * ((0.5 * step * ahead**2) % 1.0))
        behind = np.arange(1, columns)
        chirp[self._chirp_length - behind] = np.exp(2j * np.pi * ((0.5 * step * behind**2) % 1.0))
        self._chirp = _fft.fft(chirp).astype(np.complex64)

        nearest = np.floor(place).astype(np.int64) - (_TAPS // 2 - 1)
        self._index = (nearest - first) * count + np.arange(count)
        offset = place - nearest
        self._weights = [
            (_i0(beta * np.sqrt(np.maximum(1 - (2 * (offset - tap) / _TAPS) ** 2, 0))) / _i0(beta)).astype(np.float32)
            for tap in range(_TAPS)
        ]
        self._count = count

    def __call__(self, array: NDArray[Any]) -> NDArray[np.complex64]:
        """The transform of an array: complex64 of shape (rows j, columns i)."""
        given = (array.T if self._turned else array) * self._factor
        columns = _fft.fft(given, self._length, axis=0, overwrite_x=True, workers=-1)[self._rows]
        columns *= self._row_factor
        rows = _fft.fft(columns, self._chirp_length, axis=1, overwrite_x=True, workers=-1)
        rows *= self._chirp
        rows = np.ascontiguousarray(_fft.ifft(rows, axis=1, overwrite_x=True, workers=-1)[:, : self._count]).ravel()
        out = np.zeros(self._index.shape, np.complex64)
        for tap, weights in enumerate(self._weights):
            out += rows[tap * self._count :].take(self._index) * weights
        return out
