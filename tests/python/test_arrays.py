"""Arrays in and out: whose memory they are, and which are refused."""

from __future__ import annotations

import gc
import subprocess
import sys
import weakref
from typing import Any

import holodrive as hd
import numpy as np
import pytest

SHAPE = (48, 64)


def ramp() -> "np.ndarray[Any, np.dtype[np.complex64]]":
    return np.exp(1j * np.arange(48 * 64) / 50).reshape(SHAPE).astype(np.complex64)


def test_a_field_of_complex64_is_the_array_itself() -> None:
    samples = ramp()
    field = hd.Field(samples, "8um", "532nm")
    assert np.shares_memory(np.asarray(field), samples)
    assert np.asarray(field) is samples


@pytest.mark.parametrize("other", [lambda a: a.astype(np.complex128), lambda a: a[:, ::-1], lambda a: np.asfortranarray(a)])
def test_what_is_no_complex64_in_rows_is_converted(other: Any) -> None:
    samples = other(ramp())
    field = hd.Field(samples, "8um", "532nm")
    assert not np.shares_memory(np.asarray(field), samples)
    assert np.allclose(field, samples)


def test_samples_of_the_library_are_seen_without_a_copy(panel: hd.Panel) -> None:
    field = hd.hologram(hd.Points([[0, 0, -0.1]]), panel)
    a, b = np.asarray(field), field.samples
    assert np.shares_memory(a, b) and a.dtype == np.complex64 and a.shape == SHAPE
    assert not a.flags.writeable and not a.flags.owndata
    with pytest.raises(ValueError, match="read-only"):
        a[0, 0] = 0
    with pytest.raises(ValueError, match="WRITEABLE"):
        a.setflags(write=True)


def test_a_view_keeps_its_field_alive(panel: hd.Panel) -> None:
    samples = hd.hologram(hd.Points([[0, 0, -0.1]]), panel).samples
    before = samples.copy()
    gc.collect()
    rubbish = [np.full(SHAPE, 7 + 7j, np.complex64) for _ in range(200)]
    assert np.array_equal(samples, before) and len(rubbish) == 200


def test_a_lent_array_is_let_go_with_its_field() -> None:
    samples = ramp()
    alive = weakref.ref(samples)
    field = hd.Field(samples, "8um", "532nm")
    del samples
    gc.collect()
    assert alive() is not None
    del field
    gc.collect()
    assert alive() is None


def test_array_protocol_copies_and_converts_when_asked() -> None:
    samples = ramp()
    field = hd.Field(samples, "8um", "532nm")
    assert not np.shares_memory(np.array(field), samples)
    wide = np.asarray(field, dtype=np.complex128)
    assert wide.dtype == np.complex128 and np.allclose(wide, samples)
    with pytest.raises(ValueError, match="by a copy only"):
        field.__array__(np.complex128, copy=False)


MEASURE = """
import resource, sys
import numpy as np, holodrive as hd
panel = hd.Panel(width=1920, height=1080, pitch="8um", wavelength="532nm")
how = sys.argv[1]
# The first frame pays for threads and tables.
hd.encode(np.ones((1080, 1920), np.float32), panel)
field = np.empty((1080, 1920), np.complex64, order="F" if how == "columns" else "C")
field[...] = np.exp(1j * np.arange(1920) / 7)
if how == "library":
    # The library's own field, and no array beside it.
    field.T[...].tofile("/dev/null")
    np.save(sys.argv[2], field)
    del field
    field = hd.Field.load(sys.argv[2], pitch="8um", wavelength="532nm")
peak = lambda: int([l for l in open("/proc/self/status") if l.startswith("VmHWM")][0].split()[1])
now = lambda: int([l for l in open("/proc/self/status") if l.startswith("VmRSS")][0].split()[1])
open("/proc/self/clear_refs", "w").write("5")
before = now()
hd.encode(field, panel, encoding="kinoform")
print(peak() - before)
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="memory is read from /proc")
def test_encoding_a_field_of_1080p_takes_no_copy_of_it(tmp_path: Any) -> None:
    def taken(how: str) -> float:
        """Memory that the call takes at its peak [MB]."""
        command = [sys.executable, "-c", MEASURE, how, str(tmp_path / "field.npy")]
        return min(int(subprocess.check_output(command, text=True)) for _ in range(2)) / 1024

    rows, columns, own = taken("rows"), taken("columns"), taken("library")
    field = 1920 * 1080 * 8 / 2**20
    print(f"encode of a 1080p field of {field:.1f} MB takes {rows:.1f} MB; copied {columns:.1f}, the library's own {own:.1f}")
    assert columns - rows > 0.7 * field, "what must be copied is seen as a copy"
    assert rows < own + 0.3 * field, "an array takes no more than the library's own field"


class Device:
    """An array of another library: NumPy's memory by DLPack alone."""

    def __init__(self, array: "np.ndarray[Any, Any]") -> None:
        self.array = array

    def __dlpack__(self, **arguments: Any) -> Any:
        return self.array.__dlpack__(**arguments)

    def __dlpack_device__(self) -> Any:
        return self.array.__dlpack_device__()


class OnlyArray:
    """An array of another library: by `__array__` alone."""

    def __init__(self, array: "np.ndarray[Any, Any]") -> None:
        self.array = array

    def __array__(self, dtype: Any = None, copy: Any = None) -> "np.ndarray[Any, Any]":
        return self.array


class OnGraphicsProcessor:
    """As cupy's: refuses `__array__` and DLPack to this machine, hands out by `get`."""

    def __init__(self, array: "np.ndarray[Any, Any]") -> None:
        self.array = array

    def __dlpack__(self, **arguments: Any) -> Any:
        raise BufferError("lies on another device")

    def __dlpack_device__(self) -> Any:
        return (2, 0)

    def get(self) -> "np.ndarray[Any, Any]":
        return self.array


def test_arrays_come_by_dlpack_without_a_copy() -> None:
    samples = ramp()
    assert np.shares_memory(np.asarray(hd.Field(Device(samples), "8um", "532nm")), samples)  # type: ignore[arg-type]


@pytest.mark.parametrize("other", [OnlyArray, OnGraphicsProcessor])
def test_arrays_come_by_other_ways(other: Any) -> None:
    samples = ramp()
    assert np.array_equal(hd.Field(other(samples), "8um", "532nm"), samples)


def test_lists_are_arrays(panel: hd.Panel) -> None:
    assert hd.encode([[0.0] * 64] * 48, panel).levels.max() == 0
    assert len(hd.Points([(0, 0, -1)] * 3, amplitudes=[1, 2, 3])) == 3


@pytest.mark.parametrize(
    "bad, words",
    [
        (np.ones((3, 4, 5), np.complex64), r"\(3, 4, 5\) is no plane"),
        (np.ones(7, np.complex64), r"\(7,\) is no plane"),
        (np.zeros((0, 4), np.complex64), r"\(0, 4\) is no plane"),
        (np.ones((4, 4)), "float64; a field is complex"),
        (np.array([["a", "b"]]), "holds no numbers"),
        (np.array([[None]]), "holds no numbers"),
        (np.ones((2, 2), bool), "holds no numbers"),
    ],
)
def test_arrays_that_are_no_fields_are_refused_in_words(bad: Any, words: str) -> None:
    with pytest.raises(hd.ParameterError, match=words):
        hd.Field(bad, "8um", "532nm")


@pytest.mark.parametrize(
    "bad, words",
    [
        (np.ones((64, 48), np.complex64), r"\(64, 48\); panel .* has \(48, 64\) \(rows, columns\)"),
        (np.full(SHAPE, np.nan, np.complex64), "column 0, row 0 is not finite"),
        (np.where(np.arange(64) == 5, np.inf, 0) * np.ones((48, 1)), "row 0, column 5 is not finite"),
        (np.zeros(SHAPE, np.complex64), "dark everywhere"),
        (np.zeros(SHAPE, np.uint8), r"Frame\(levels, panel\)"),
    ],
)
def test_what_cannot_be_encoded_is_refused_in_words(panel: hd.Panel, bad: Any, words: str) -> None:
    with pytest.raises(hd.ParameterError, match=words):
        hd.encode(bad, panel)


@pytest.mark.parametrize(
    "arguments, words",
    [
        (dict(positions=np.zeros((3, 2))), r"\(3, 2\) is not \(N, 3\)"),
        (dict(positions=np.zeros(3)), r"\(3,\) is not \(N, 3\)"),
        (dict(positions=[[0, 0, np.nan]]), "point 0 is not finite"),
        (dict(positions=[[0, 0, -1]] * 3, amplitudes=[1, 2]), r"amplitudes: shape \(2,\) for 3 points"),
        (dict(positions=[[0, 0, -1]], phases=[np.inf]), "point 0 is not finite"),
        (dict(positions=[[0, 0, -1]], rgb=[[1, 1, 1]] * 2), "2 triples for 1 points"),
        (dict(positions=[[0, 0, -1]], rgb=[[1, np.nan, 1]]), "rgb: that of point 0"),
        (dict(positions=np.ones((1, 3), complex)), "complex numbers where real"),
        (dict(positions=[[0, 0, -1]], amplitudes=1, rgb=[[1, 1, 1]]), "give one or the other"),
    ],
)
def test_points_that_are_none_are_refused_in_words(arguments: Any, words: str) -> None:
    with pytest.raises(hd.ParameterError, match=words):
        hd.Points(**arguments)


def test_metrics_want_two_of_a_kind() -> None:
    with pytest.raises(hd.ParameterError, match=r"shapes \(2, 3\) and \(3, 2\)"):
        hd.metrics(np.ones((2, 3)), np.ones((3, 2)))
    with pytest.raises(hd.ParameterError, match="one is complex"):
        hd.metrics(np.ones((2, 3), np.complex64), np.ones((2, 3)))
    with pytest.raises(hd.ParameterError, match="not finite"):
        hd.metrics(np.full((2, 3), np.nan), np.ones((2, 3)))
