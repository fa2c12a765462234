"""Drive a holodrive panel from Python: one call puts a phase array on the panel and returns when it got there.

Start the program, which keeps the panel (``--monitor none`` instead simulates it)::

    holodrive serve --panel holoeye-pluto-2.1 --monitor HDMI-1

then, with this file beside your script or on ``PYTHONPATH`` (``holodrive serve --write-python holodrive.py`` writes it; the package
``holodrive`` holds it, too)::

    import numpy as np, holodrive

    with holodrive.SLM() as slm:
        y, x = np.indices(slm.shape)
        shown = slm.show(2 * np.pi * x / 16)       # a blazed grating, in radians
        print(shown.time, shown.number, shown.missed)

        for k in range(16):                         # in step with an experiment: frames that are ready
            slm.preload(k, 2 * np.pi * x * k / 64)
        slm.show(3)                                 # by name, within a refresh
        slm.play(range(16), rate=30)                # one after another, with the time of each
        slm.arm(range(16))                          # one at each line of text that comes on serve's --trigger port

Only Python's standard library and NumPy are used. MIT OR Apache-2.0.
"""

from __future__ import annotations

import asyncio
import glob
import json
import mmap
import os
import socket
import sys
import tempfile
import threading
from types import TracebackType
from typing import TYPE_CHECKING, Any, BinaryIO, Iterable, List, NamedTuple, Optional, Tuple, Type, Union

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["SLM", "Error", "Shown"]

if __package__:
    # In the package it is one of its errors.
    from ._errors import DisplayError as Error
else:

    class Error(RuntimeError):  # type: ignore[no-redef]
        """The program refused: its own words, which say what to change."""


class Shown(NamedTuple):
    """When and how a frame came on the panel."""

    #: Of the flip [s], on the clock of ``time.monotonic()``; NaN where programs have no clock in common (Windows, macOS).
    time: float
    #: Running number of the frame on this panel.
    number: int
    #: Refreshes beside the one that every frame waits for.
    missed: int
    #: From the request's arrival to the flip [s]; in a play from the flip that was due.
    latency: float


#: Most frames that one request of a play holds.
_MOST_PLAYED = 32768


def _folder() -> str:
    if sys.platform == "win32":
        return os.path.join(os.environ.get("LOCALAPPDATA") or tempfile.gettempdir(), "holodrive")
    runtime = os.environ.get("XDG_RUNTIME_DIR", "")
    return os.path.join(runtime, "holodrive") if os.path.isabs(runtime) else "/tmp/holodrive-%d" % os.geteuid()


#: Of sockets, and of files that tell a port.
_ENDINGS = (".sock", ".port")


def _find(name: Optional[str]) -> str:
    if name is not None:
        paths = [os.path.join(_folder(), name + ending) for ending in _ENDINGS]
        return next((path for path in paths if os.path.exists(path)), paths[sys.platform == "win32"])
    found = sorted(path for ending in _ENDINGS for path in glob.glob(os.path.join(_folder(), "*" + ending)))
    if len(found) == 1:
        return found[0]
    if not found:
        raise Error("no panel is served; start one with: holodrive serve --panel PROFILE --monitor NAME")
    names = ", ".join(os.path.splitext(os.path.basename(path))[0] for path in found)
    raise Error("more than one panel is served; name one of: " + names)


def _connect(path: str, timeout: float) -> "Tuple[socket.socket, Optional[bytes]]":
    """The connection, and what to say first: the key, where the way is a port."""
    if path.endswith(".port"):
        with open(path, encoding="utf-8") as file:
            told = json.loads(file.read(4096))
        host, _, port = str(told["address"]).rpartition(":")
        host = host.strip("[]")
        # A server that listens everywhere is reached here.
        here = {"0.0.0.0": "127.0.0.1", "::": "::1"}
        stream = socket.create_connection((here.get(host, host), int(port)), timeout)
        stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return stream, json.dumps({"key": told["key"]}).encode() + b"\n"
    if sys.platform == "win32":
        raise OSError("there are no such sockets on Windows; give serve a --local FILE.port")
    stream = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        stream.settimeout(timeout)
        stream.connect(path)
    except BaseException:
        stream.close()
        raise
    return stream, None


def _time(told: Optional[float]) -> float:
    return float("nan") if told is None else told


class SLM:
    """A panel that ``holodrive serve`` keeps. Several threads may use one: their frames are shown one after another.

    :param name: the panel's name (``--name``, else its profile's); may be left out where one panel is served.
    :param path: its socket or port's file, where ``--local`` put it elsewhere. A copy of a port's file, with its address changed to
        the server's, is the way from another machine.
    :param timeout: longest wait for an answer [s].

    Attributes: ``name``; ``shape`` as ``(rows, columns)``; ``bits`` of a level; ``modulation``, "phase" or "amplitude";
    ``pixel_pitch`` ``(x, y)`` [m]; ``wavelength`` [m]; ``settle_time`` [s] from flip to settled light;
    ``curve``, what each level does: phase [rad], or transmittance (None, where the program does not say).
    """

    name: str
    shape: Tuple[int, int]
    bits: int
    modulation: str
    pixel_pitch: Tuple[float, float]
    wavelength: float
    settle_time: float
    curve: "Optional[np.ndarray[Any, np.dtype[np.float64]]]"

    def __init__(
        self,
        name: Optional[str] = None,
        path: Optional[Union[str, os.PathLike[str]]] = None,
        timeout: float = 10.0,
    ) -> None:
        self._timeout = timeout
        self._map: Optional[mmap.mmap] = None
        self._lines: Optional[BinaryIO] = None
        # An answer is that of the request before it, and the array may lie in memory that is shared with the program: one at a time.
        self._turn = threading.RLock()
        self._socket: Optional[socket.socket] = None
        try:
            path = _find(name) if path is None else os.fspath(path)
            try:
                self._socket, key = _connect(path, timeout)
            except (OSError, ValueError, KeyError, TypeError) as error:
                raise Error("no panel is served at %s: %s" % (path, error)) from error
            self._lines = self._socket.makefile("rb")
            if key is not None:
                self._socket.sendall(key)
            about = self._answer()
            if about.get("protocol") != 1:
                raise Error("this module speaks version 1 of the protocol, the program %s" % about.get("protocol"))
            self.name = about["name"]
            self.shape = (about["height"], about["width"])
            self.bits = about["bits"]
            self.modulation = about["modulation"]
            self.pixel_pitch = tuple(about["pixel_pitch"])
            self.wavelength = about["wavelength"]
            self.settle_time = about["settle_time"]
            self.curve = np.array(about["curve"], np.float64) if "curve" in about else None
            if "buffer" in about:
                with open(about["buffer"], "r+b") as file:
                    self._map = mmap.mmap(file.fileno(), about["bytes"])
                self._ask({"mapped": True})
        except BaseException:
            self.close()
            raise

    def show(self, array: Union[ArrayLike, str, int]) -> Shown:
        """Shows an array of the panel's shape, or a frame that :meth:`preload` has made ready, and returns when it is on the panel, as
        :class:`Shown`.

        Floating-point numbers are phases in radians, of any turn (on an amplitude panel: transmittances 0 … 1); they go
        through the panel's wavefront correction and level curve. Integers are final drive levels. Text or a number by itself is the
        name of a preloaded frame.

        :raises ValueError: the array has another shape, or its levels lie outside the panel's.
        :raises Error: the program refused it, or has ended.
        """
        if isinstance(array, (str, int, np.integer)):
            return self._shown(self._ask({"recall": str(array)}))
        return self._shown(self._send(array, {}))

    def preload(self, name: Union[str, int], array: ArrayLike) -> int:
        """Makes a frame ready under a name (a number counts as its text), in place of one of that name: :meth:`show`, :meth:`play` and
        triggers then show it without delay. Frames are kept until they are forgotten or the program ends, for all clients.

        :param name: its name, up to 64 bytes.
        :param array: as for :meth:`show`.
        :return: how many frames are kept.
        :raises Error: there is no more memory for them (``serve --preload``), or the program refused it.
        """
        return int(self._send(array, {"preload": str(name)})["kept"])

    def play(self, names: Iterable[Union[str, int]], rate: Optional[float] = None) -> List[Shown]:
        """Shows preloaded frames one after another, each once, none left out, and returns when the last is on the panel.

        Other clients wait meanwhile. Ctrl-C ends the play, and this connection.

        :param names: names of the frames, in their order, each as often as it is to be shown: up to 32768.
        :param rate: frames a second; by default one at each refresh of the monitor.
        """
        asked = [str(name) for name in names]
        if not 0 < len(asked) <= _MOST_PLAYED:
            raise ValueError("%d frames to play; 1 to %d are taken" % (len(asked), _MOST_PLAYED))
        request = {"play": asked} if rate is None else {"play": asked, "rate": float(rate)}
        lasts = len(asked) * (0.1 if rate is None else 1 / max(float(rate), 1e-3))
        answer = self._ask(request, lasts)
        times, first = [_time(time) for time in answer["times"]], answer["first"]
        due = times[0]
        shown = []
        for k, (time, missed) in enumerate(zip(times, answer["missed"])):
            shown.append(Shown(time, first + k, missed, time - due))
            due = (time if missed or rate is None else due) + (0.0 if rate is None else 1 / rate)
        return shown

    def arm(self, names: Iterable[Union[str, int]]) -> None:
        """Sets the list of preloaded frames of which each line on serve's ``--trigger`` port shows the next; after the last it begins anew.

        :param names: their names; none: triggers show nothing, but by a frame's name.
        """
        self._ask({"arm": [str(name) for name in names]})

    def forget(self, *names: Union[str, int]) -> int:
        """Keeps preloaded frames no longer.

        :param names: their names; none: all.
        :return: how many are still kept.
        """
        return int(self._ask({"forget": [str(name) for name in names]})["kept"])

    def _shown(self, answer: dict[str, Any]) -> Shown:
        return Shown(_time(answer["time"]), answer["number"], answer["missed"], answer["latency"])

    def _send(self, array: Any, request: dict[str, Any]) -> dict[str, Any]:
        """Puts an array into the shared memory and asks for what is to be done with it."""
        made_for = getattr(array, "wavelength", None)
        if made_for is not None and abs(made_for - self.wavelength) > 1e-6 * self.wavelength:
            raise ValueError("the frame is for %g nm, the panel is served at %g nm" % (1e9 * made_for, 1e9 * self.wavelength))
        array = np.asarray(array)
        if array.shape != self.shape:
            raise ValueError("the array is %s, the panel %s (rows, columns)" % (array.shape, self.shape))
        if np.issubdtype(array.dtype, np.floating):
            kind, dtype = self.modulation, "float32" if array.dtype.itemsize <= 4 else "float64"
        elif np.issubdtype(array.dtype, np.integer):
            highest = 2**self.bits - 1
            if array.dtype.itemsize > 1 or array.dtype.kind == "i" or self.bits < 8:
                if array.min() < 0 or array.max() > highest:
                    raise ValueError("levels are 0 … %d, the array has %d … %d" % (highest, array.min(), array.max()))
            kind, dtype = "levels", "uint8" if highest < 256 else "uint16"
        else:
            raise ValueError("the array is of %s; give phases (float) or levels (integer)" % array.dtype)
        with self._turn:
            # It may have been closed while another thread had its turn.
            if self._closed():
                raise Error("this SLM is closed")
            request = {"show": kind, "dtype": dtype, **request}
            if self._map is not None:
                np.ndarray(self.shape, dtype, self._map)[...] = array
                return self._ask(request)
            # Through the port: when the program is ready to take it.
            self._ask(request)
            self._say(np.ascontiguousarray(array, np.dtype(dtype).newbyteorder("<")).tobytes())
            return self._answer()

    async def show_async(self, array: Union[ArrayLike, str, int]) -> Shown:
        """The same for ``await``: the event loop goes on while the frame comes on the panel."""
        return await asyncio.get_running_loop().run_in_executor(None, self.show, array)

    def close(self) -> None:
        """Ends the connection; what stays on the panel is as ``holodrive serve --on-client-gone`` says."""
        with self._turn:
            if self._lines is not None:
                self._lines.close()
            if self._socket is not None:
                self._socket.close()
            if self._map is not None:
                shared, self._map = self._map, None
                shared.close()

    def __enter__(self) -> SLM:
        return self

    def __exit__(
        self,
        kind: Optional[Type[BaseException]],
        value: Optional[BaseException],
        trace: Optional[TracebackType],
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        if self._closed():
            return "<holodrive.SLM, closed>"
        rows, columns = self.shape
        return "<holodrive.SLM %s, %d × %d px of %d bits>" % (self.name, columns, rows, self.bits)

    def _ask(self, request: dict[str, Any], lasts: float = 0.0) -> dict[str, Any]:
        with self._turn:
            if self._closed():
                raise Error("this SLM is closed")
            self._say(json.dumps(request).encode() + b"\n", lasts)
            return self._answer()

    def _closed(self) -> bool:
        return self._socket is None or self._lines is None or self._lines.closed

    def _say(self, said: bytes, lasts: float = 0.0) -> None:
        assert self._socket is not None
        try:
            self._socket.settimeout(self._timeout + lasts)
            self._socket.sendall(said)
        except OSError as error:
            self.close()
            raise Error("the program has ended: %s" % error) from error
        except BaseException:
            # Ctrl-C half way: what follows would be taken for the rest of it.
            self.close()
            raise

    def _answer(self) -> dict[str, Any]:
        assert self._lines is not None
        try:
            line = self._lines.readline(1 << 20)
        except OSError as error:
            # A late answer would be taken for that of the next request.
            self.close()
            raise Error("the program does not answer: %s" % error) from error
        except BaseException:
            # Ctrl-C: the same.
            self.close()
            raise
        if not line.endswith(b"\n"):
            self.close()
            raise Error("the program has ended")
        answer: dict[str, Any] = json.loads(line)
        if "error" in answer:
            raise Error(answer["error"])
        return answer
