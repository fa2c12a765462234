"""holodrive's panels as an SLM of Micro-Manager, by way of pymmcore-plus: acquisitions that show a frame at each event.

::

    from pymmcore_plus.experimental.unicore import UniMMCore
    from holodrive.micromanager import Holodrive

    core = UniMMCore()
    core.loadPyDevice("SLM", Holodrive("holoeye-pluto-2.1", "HDMI-1"))  # Holodrive("generic") is simulated
    core.initializeDevice("SLM")
    core.setSLMDevice("SLM")
    core.setSLMImage("SLM", levels)                                      # final drive levels, of the panel's shape
    core.displaySLMImage("SLM")                                          # returns when they are on the panel

Needs pymmcore-plus 0.18 or newer (``pip install pymmcore-plus``, or the extra ``holodrive[micromanager]``); ``import holodrive`` does not.
Micro-Manager knows levels, no phases: ``Panel.curve`` tells what each level does, and ``encode`` makes levels of fields and phases.
"""

from __future__ import annotations

import importlib
import os
from typing import Any, Optional, Sequence, Union

import numpy as np
from numpy.typing import NDArray

from ._errors import refused
from ._holodrive import Panel
from ._serve import Served, serve
from .slm import SLM, Shown

try:
    # Its types are not at hand where it is not installed.
    _Device: Any = importlib.import_module("pymmcore_plus.experimental.unicore").SLMDevice
except (ImportError, AttributeError) as error:
    raise ImportError(f"holodrive.micromanager needs pymmcore-plus 0.18 or newer: pip install pymmcore-plus ({error})") from error

__all__ = ["Holodrive"]

_Path = Union[str, "os.PathLike[str]"]

#: Memory for a sequence's frames [bytes], what ``holodrive serve`` keeps by default (``--preload``), and what it counts for a pixel.
_SEQUENCE_MEMORY = 2_000_000_000
_BYTES_A_PIXEL = 4


class Holodrive(_Device):  # type: ignore[misc]
    """A panel that holodrive drives, as an SLM of Micro-Manager: images are final drive levels, of one byte, or two where the panel has more
    than 8 bits.

    A sequence (``loadSLMSequence``, and an acquisition whose events follow a trigger) is kept ready by the program, and each line of
    text on its trigger port shows the next: it needs ``arguments=("--trigger", PORT)``.

    A panel stays as it is until the next image: there is no exposure after which it would go dark. ``setSLMExposure`` takes 0 alone.

    :param panel: name of a profile or its .toml file, for which ``holodrive serve`` is started when the device is initialised and ended
        when it is unloaded; or a panel that is served already, :class:`holodrive.SLM` or :class:`holodrive.Served`, which stays.
    :param monitor: the panel's monitor (see ``holodrive monitors``), or "none" for the simulated panel.
    :param wavelength: of the laser [m], or text with a unit; by default the profile's first.
    :param output: with a profile and monitor "none": a folder into which each frame is written.
    :param arguments: further arguments of ``holodrive serve``.
    :raises ParameterError: arguments contradict each other.

    Attributes: ``slm``, the connection, while the device is initialised; ``shown``, when and how the last image came on the panel.
    """

    slm: Optional[SLM]
    shown: Optional[Shown]

    def __init__(
        self,
        panel: Union[_Path, SLM, Served] = "generic",
        monitor: str = "none",
        *,
        wavelength: "Union[str, float, None]" = None,
        output: Optional[_Path] = None,
        arguments: Sequence[str] = (),
    ) -> None:
        super().__init__()
        if isinstance(panel, (SLM, Served)):
            if monitor != "none" or wavelength is not None or output is not None or arguments:
                raise refused("panel", "monitor, wavelength, output and arguments are for a profile, which is then served")
        else:
            # Refused here rather than by the core's first call.
            Panel(panel, wavelength=wavelength)
        self._panel = panel
        self._settings: "dict[str, Any]" = {"monitor": monitor, "wavelength": wavelength, "output": output, "arguments": arguments}
        self._program: Optional[Served] = None
        self._loaded: "Optional[NDArray[Any]]" = None
        self._sequence: "list[str]" = []
        self.slm = None
        self.shown = None
        has_trigger = isinstance(panel, (SLM, Served)) or "--trigger" in arguments
        self._sequence_memory = _SEQUENCE_MEMORY if has_trigger else 0

    def initialize(self) -> None:
        """Serves the panel, or connects to it.

        :raises DisplayError: the program's own words, where it could not.
        """
        if isinstance(self._panel, SLM):
            self.slm = self._panel
        elif isinstance(self._panel, Served):
            self.slm = self._panel.slm()
        else:
            self._program = serve(self._panel, **self._settings)
            self.slm = self._program.slm()

    def shutdown(self) -> None:
        """Ends the connection and the program, where they are this device's own."""
        if self.slm is not None and self.slm is not self._panel:
            self.slm.close()
        self.slm = None
        if self._program is not None:
            self._program.stop()
            self._program = None

    def _connected(self) -> SLM:
        if self.slm is None:
            raise refused("device", "it is not initialised: initializeDevice comes first")
        return self.slm

    def shape(self) -> "tuple[int, ...]":
        """Rows and columns."""
        return self._connected().shape

    def dtype(self) -> "type[np.uint8] | type[np.uint16]":
        """Of a level."""
        return np.uint8 if self._connected().bits <= 8 else np.uint16

    def set_image(self, pixels: "NDArray[Any]") -> None:
        """Keeps an image for the next ``display_image``."""
        self._loaded = np.array(pixels)

    def get_image(self) -> "NDArray[Any]":
        """The image of the last ``set_image``; levels of 0 before the first."""
        return np.zeros(self.shape(), self.dtype()) if self._loaded is None else self._loaded

    def display_image(self) -> None:
        """Shows it and returns when it is on the panel.

        :raises ValueError: its levels lie outside the panel's.
        :raises DisplayError: the program refused it, or has ended.
        """
        self.shown = self._connected().show(self.get_image())

    def set_exposure(self, interval_ms: float) -> None:
        """Takes 0 alone: the panel stays as it is.

        :raises OutOfRangeError: another time.
        """
        if interval_ms != 0:
            raise refused("exposure", "a panel stays as it is until the next image; a shutter ends the light. It takes 0")

    def get_exposure(self) -> float:
        """0: the panel stays as it is."""
        return 0.0

    def get_sequence_max_length(self) -> int:
        """Frames that fit into the program's memory; 0 without a trigger port."""
        rows, columns = self.shape()
        return self._sequence_memory // (rows * columns * _BYTES_A_PIXEL)

    def send_sequence(self, sequence: "Sequence[NDArray[Any]]") -> None:
        """Makes the frames ready, in place of those of the sequence before."""
        slm = self._connected()
        if self._sequence:
            slm.forget(*self._sequence)
        self._sequence = [f"sequence {k}" for k in range(len(sequence))]
        for name, levels in zip(self._sequence, sequence):
            slm.preload(name, levels)

    def start_sequence(self) -> None:
        """From now on each line of text on the trigger port shows the next frame; after the last it begins anew."""
        self._connected().arm(self._sequence)

    def stop_sequence(self) -> None:
        """Triggers show nothing any more; the frame that is on the panel stays."""
        self._connected().arm([])
