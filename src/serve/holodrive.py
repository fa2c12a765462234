"""Drive a holodrive panel from Python: one call puts a phase array on the panel and returns when it got there.

Start the program, which keeps the panel (``--monitor none`` instead simulates it)::

    holodrive serve --panel holoeye-pluto-2.1 --monitor HDMI-1

then, with this file beside your script or on ``PYTHONPATH`` (``holodrive serve --write-python holodrive.py`` writes it)::

    import numpy as np, holodrive

    with holodrive.SLM() as slm:
        y, x = np.indices(slm.shape)
        shown = slm.show(2 * np.pi * x / 16)       # a blazed grating, in radians
        print(shown.time, shown.number, shown.missed)

Only Python's standard library and NumPy are used. MIT OR Apache-2.0.
"""

import collections
import glob
import json
import mmap
import os
import socket

import numpy as np

__all__ = ["SLM", "Error", "Shown"]

#: When and how a frame came on the panel: ``time`` of its flip [s] on the clock of ``time.monotonic()``, running ``number``
#: of the frame on this panel, ``missed`` refreshes beside the one that every frame waits for, and ``latency`` [s] from the
#: request's arrival to the flip.
Shown = collections.namedtuple("Shown", "time number missed latency")


class Error(RuntimeError):
    """The program refused: its own words, which say what to change."""


def _folder():
    runtime = os.environ.get("XDG_RUNTIME_DIR", "")
    return os.path.join(runtime, "holodrive") if os.path.isabs(runtime) else "/tmp/holodrive-%d" % os.geteuid()


def _find(name):
    if name is not None:
        return os.path.join(_folder(), name + ".sock")
    found = sorted(glob.glob(os.path.join(_folder(), "*.sock")))
    if len(found) == 1:
        return found[0]
    if not found:
        raise Error("no panel is served; start one with: holodrive serve --panel PROFILE --monitor NAME")
    names = ", ".join(os.path.basename(path)[: -len(".sock")] for path in found)
    raise Error("more than one panel is served; name one of: " + names)


class SLM:
    """A panel that ``holodrive serve`` keeps on this machine.

    :param name: the panel's name (``--name``, else its profile's); may be left out where one panel is served.
    :param path: its socket, where ``--local`` put it elsewhere.
    :param timeout: longest wait for an answer [s].

    Attributes: ``name``; ``shape`` as ``(rows, columns)``; ``bits`` of a level; ``modulation``, "phase" or "amplitude";
    ``pixel_pitch`` ``(x, y)`` [m]; ``wavelength`` [m]; ``settle_time`` [s] from flip to settled light.
    """

    def __init__(self, name=None, path=None, timeout=10.0):
        self._map = self._lines = None
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            self._socket.settimeout(timeout)
            path = _find(name) if path is None else path
            try:
                self._socket.connect(path)
            except OSError as error:
                raise Error("no panel is served at %s: %s" % (path, error)) from error
            self._lines = self._socket.makefile("rb")
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
            with open(about["buffer"], "r+b") as file:
                self._map = mmap.mmap(file.fileno(), about["bytes"])
            self._ask({"mapped": True})
        except BaseException:
            self.close()
            raise

    def show(self, array):
        """Shows an array of the panel's shape and returns when it is on the panel, as :class:`Shown`.

        Floating-point numbers are phases in radians, of any turn (on an amplitude panel: transmittances 0 … 1); they go
        through the panel's wavefront correction and level curve. Integers are final drive levels.

        :raises ValueError: the array has another shape, or its levels lie outside the panel's.
        :raises Error: the program refused it, or has ended.
        """
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
        if self._map is None:
            raise Error("this SLM is closed")
        np.ndarray(self.shape, dtype, self._map)[...] = array
        answer = self._ask({"show": kind, "dtype": dtype})
        return Shown(answer["time"], answer["number"], answer["missed"], answer["latency"])

    def close(self):
        """Ends the connection; what stays on the panel is as ``holodrive serve --on-client-gone`` says."""
        if self._lines is not None:
            self._lines.close()
        self._socket.close()
        if self._map is not None:
            self._map, shared = None, self._map
            shared.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def _ask(self, request):
        try:
            self._socket.sendall(json.dumps(request).encode() + b"\n")
        except OSError as error:
            self.close()
            raise Error("the program has ended: %s" % error) from error
        return self._answer()

    def _answer(self):
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
        answer = json.loads(line)
        if "error" in answer:
            raise Error(answer["error"])
        return answer
