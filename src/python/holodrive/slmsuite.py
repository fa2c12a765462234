"""holodrive's panels as slmsuite's SLM, and a simulated bench as its camera: its calibrations and feedback without hardware.

::

    import numpy as np
    from slmsuite.hardware.cameraslms import FourierSLM
    from holodrive.slmsuite import Holodrive, SimulatedCamera

    slm = Holodrive("holoeye-pluto-2.1", "HDMI-1")     # a panel on a monitor; Holodrive("generic") is simulated
    slm.set_phase(phase)                                # returns when it is on the panel

    slm = Holodrive("generic", wavelength="532nm")
    camera = SimulatedCamera(slm, focal_length="200mm", rotation=0.03)
    bench = FourierSLM(camera, slm)
    bench.fourier_calibrate(array_shape=[12, 10], array_pitch=16, autoexpose=True)

Needs slmsuite 0.5 (``pip install slmsuite``, or the extra ``holodrive[slmsuite]``); ``import holodrive`` does not. Lengths are metres, or
text with a unit, as everywhere in holodrive; what slmsuite names ``…_um`` or ``…_s`` is in micrometres and seconds.
"""

from __future__ import annotations

import importlib
import os
import weakref
from typing import Any, List, NamedTuple, Optional, Sequence, Tuple, Union

import numpy as np
from numpy.typing import NDArray

from ._arrays import as_array
from ._errors import refused
from ._holodrive import Panel, panels
from ._serve import Served, serve
from .slm import SLM, Shown

try:
    # slmsuite has no types.
    _Slm: Any = importlib.import_module("slmsuite.hardware.slms.slm").SLM
except ImportError as error:
    raise ImportError(f"holodrive.slmsuite needs slmsuite 0.5: pip install slmsuite ({error})") from error

# They need it, too.
from ._camera import SimulatedCamera
from ._remote import Remote

__all__ = ["Holodrive", "Remote", "SimulatedCamera", "serve_bench"]

_Path = Union[str, "os.PathLike[str]"]
_Length = Union[float, str]


class _Facts(NamedTuple):
    """What slmsuite, or a bench, is to know of a panel."""

    name: str
    shape: Tuple[int, int]
    bits: int
    wavelength: float
    pitch: Tuple[float, float]
    settle_time: Optional[float]
    curve: NDArray[np.float64]
    fill_factor: float
    dead_space: float
    crosstalk: float

    @classmethod
    def of(cls, panel: Union[Panel, SLM]) -> "_Facts":
        if panel.modulation != "phase":
            raise refused("panel", f"{panel.name} modulates {panel.modulation}; slmsuite's SLMs modulate phase")
        same = (panel.name, panel.shape, panel.bits, panel.wavelength)
        if isinstance(panel, Panel):
            faults = (panel.fill_factor, panel.dead_space, panel.crosstalk)
            return cls(*same, panel.pitch, panel.settle_time, panel.curve, *faults)
        if panel.curve is None:
            raise refused("panel", "the program that serves it does not tell its curve; start one of this version")
        return cls(*same, panel.pixel_pitch, panel.settle_time, panel.curve, 1.0, 0.0, 0.0)


class Holodrive(_Slm):  # type: ignore[misc]
    """A panel that holodrive drives, as slmsuite's SLM: ``set_phase`` returns when the frame is on the panel.

    Levels are final when they leave slmsuite, and they are the panel's own: its level curve is given to slmsuite as its ``gamma``
    (:meth:`set_gamma`), so that ``display``, ``phase`` and ``get_realized_phase`` are true of the panel, and a phase becomes the level
    whose phase is nearest on the circle, as holodrive's own drive finds it (to the 65536 steps of slmsuite's table). More level is more
    phase on holodrive's panels, where the curve does not say otherwise; slmsuite's other SLMs go down. A wavefront correction is slmsuite's
    own, ``source["phase"]``: the profile's is not added. ``set_gamma(None)`` is the ideal panel of 2π over all levels, and a
    ``pixel_calibrate`` of slmsuite's takes the curve's place.

    :param panel: name of a profile or its .toml file, for which ``holodrive serve`` is started in the background and ended by
        :meth:`close`; or a panel that is served already, :class:`holodrive.SLM` or :class:`holodrive.Served`, which stays; or a
        :class:`holodrive.Panel`, whose frames stay in this process, for a simulated bench.
    :param monitor: the panel's monitor (see ``holodrive monitors``), or "none" for the simulated panel.
    :param wavelength: of the laser [m], or text with a unit; by default the profile's first, or the served panel's.
    :param settle_time_s: from flip to settled light [s]; by default the profile's; where it says none slmsuite's 0.3 s, of a simulated
        panel 0.
    :param name: by default the panel's.
    :param output: with a profile and monitor "none": a folder into which each frame is written.
    :param arguments: further arguments of ``holodrive serve``.
    :param gpu: see slmsuite's SLM.
    :raises ParameterError: the panel does not modulate phase, or arguments contradict each other.
    :raises DisplayError: the panel cannot be served or reached, in the program's words.

    Attributes beside slmsuite's: ``curve``, the phase of each level [rad]; ``fill_factor``, ``dead_space``, ``crosstalk`` of the panel
    (of one served elsewhere 1, 0 and 0: it does not tell them); ``shown``, when and how the last frame came on the panel.
    """

    # holodrive's phases rise with the level, and its curves bear their sign.
    _gamma_sign = +1

    curve: NDArray[np.float64]
    fill_factor: float
    dead_space: float
    crosstalk: float
    shown: Optional[Shown]

    def __init__(
        self,
        panel: Union[_Path, Panel, SLM, Served] = "generic",
        monitor: str = "none",
        *,
        wavelength: Optional[_Length] = None,
        settle_time_s: Optional[float] = None,
        name: str = "",
        output: Optional[_Path] = None,
        arguments: Sequence[str] = (),
        gpu: Optional[bool] = False,
    ) -> None:
        # The connection that shows frames; the same where it is this SLM's to close; what ends the program.
        self._client: Optional[SLM] = None
        self._own: Optional[SLM] = None
        self._end: Optional[weakref.finalize[..., Any]] = None
        self.shown = None
        if isinstance(panel, (Panel, SLM, Served)) and (monitor != "none" or output is not None or arguments):
            raise refused("panel", "monitor, output and arguments are for a profile, which is then served")
        if wavelength is not None and isinstance(panel, (SLM, Served)):
            raise refused("wavelength", "the served panel has one already")
        try:
            if isinstance(panel, SLM):
                self._client = panel
                about = _Facts.of(panel)
            elif isinstance(panel, Served):
                self._client = self._own = panel.slm()
                about = _Facts.of(self._client)
            elif isinstance(panel, Panel):
                about = _Facts.of(panel if wavelength is None else panel.at(wavelength))
            else:
                known = Panel(panel, wavelength=wavelength)
                about = _Facts.of(known)
                light = f"{known.wavelength!r}m"
                program = serve(panel, monitor, name=name or None, wavelength=light, output=output, arguments=arguments)
                # When this SLM is forgotten, and when Python ends.
                self._end = weakref.finalize(self, program.stop)
                self._client = self._own = program.slm()
            self.curve = about.curve
            self.fill_factor, self.dead_space, self.crosstalk = about.fill_factor, about.dead_space, about.crosstalk
            if settle_time_s is None:
                is_simulated = monitor == "none" and not isinstance(panel, (SLM, Served))
                settle_time_s = about.settle_time or (0.0 if is_simulated else 0.3)
            super().__init__(
                resolution=about.shape[::-1],
                bitdepth=about.bits,
                name=name or about.name,
                wav_um=about.wavelength * 1e6,
                pitch_um=(about.pitch[0] * 1e6, about.pitch[1] * 1e6),
                settle_time_s=settle_time_s,
                gpu=gpu,
            )
            self.set_gamma(self.curve / (2 * np.pi))
            self.set_phase(None)
        except BaseException:
            self.close()
            raise

    def _set_phase_hw(self, display: Any) -> None:
        """Shows final levels and returns when they are on the panel."""
        if self._client is not None:
            self.shown = self._client.show(as_array(display))

    def close(self) -> None:
        """Ends the connection and the program that serves the panel, where they are this SLM's own."""
        own, self._own = getattr(self, "_own", None), None
        if own is not None:
            own.close()
        end, self._end = getattr(self, "_end", None), None
        if end is not None:
            end()

    @staticmethod
    def info(verbose: bool = True) -> List[str]:
        """The names of the profiles that holodrive knows; it prints them where asked to."""
        known = panels()
        if verbose:
            print("\n".join(known))
        return known


def serve_bench(
    *hardware: Union[Holodrive, SimulatedCamera],
    port: int = 5025,
    host: str = "127.0.0.1",
    levels: str = "phase",
) -> Remote:
    """Serves a bench to slmsuite's ``RemoteSLM`` and ``RemoteCamera`` in other processes, until it is stopped.

    ::

        with serve_bench(slm, camera, port=5025):
            input("Enter ends it")

    and elsewhere ``RemoteSLM(slm.name)``, ``RemoteCamera(camera.name)``. Each request is a line of the log ``holodrive.slmsuite``: who, what,
    and why not, where it was refused. The protocol is neither encrypted nor authenticated: any other host than the loopback lets the
    whole network at the bench. Lengths of requests, photos and connections are bounded.

    :param hardware: SLMs and cameras, each of another name.
    :param port: 0 for a free one; see ``port`` of what is returned.
    :param levels: what a RemoteSLM's levels are: "phase", as that client makes them of phases for a linear panel, brought back to these and
        to the panel's own levels; or "final".
    :raises DisplayError: it cannot listen there.
    """
    if levels not in ("phase", "final"):
        raise refused("levels", f"there is no `{levels}`; one of phase, final")
    named = {one.name: one for one in hardware}
    if not hardware or len(named) != len(hardware):
        raise refused("hardware", "give SLMs and cameras, each of another name")
    return Remote(named, levels, host, port)
