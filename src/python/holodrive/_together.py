"""Several panels as one bench: one call puts a frame on each."""

from __future__ import annotations

import os
import threading
from concurrent.futures import Future, ThreadPoolExecutor
from types import TracebackType
from typing import TYPE_CHECKING, Any, Callable, Iterable, List, NamedTuple, Optional, Sequence, Tuple, Type, Union

import numpy as np

from ._errors import DisplayError, refused
from ._serve import Served
from .slm import SLM, Shown

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["Bench", "Together"]


class Together(NamedTuple):
    """When and how frames came on the panels of a :class:`Bench`."""

    #: Of each panel in the bench's order; None where it was left as it was.
    shown: "Tuple[Optional[Shown], ...]"
    #: From the first panel's flip to the last one's [s]; NaN where programs have no clock in common (Windows, macOS).
    skew: float


class Bench:
    """Panels that are shown on together: an amplitude and a phase panel behind each other, two arms of an interferometer, a panel for each
    laser. Several threads may use one: their frames are shown one call after another.

    ::

        with hd.serve("holoeye-pluto-2.1", "HDMI-1") as a, hd.serve("meadowlark-p1920", "HDMI-2") as b, hd.Bench(a, b) as bench:
            together = bench.show(phase_a, phase_b)
            print(together.skew, bench.settle_time)

    All or none: each array is first made ready by the program that keeps its panel, and only when none is refused are all of them shown. Monitors refresh each by its own clock unless the graphics card locks them, so flips lie up to a refresh apart: ``skew`` tells
    by how much, and :attr:`settle_time` how long the slowest panel needs after its flip.

    :param panels: panels that are served: :class:`SLM`, :class:`Served`, or their names; each once.
    :raises ParameterError: none, or one twice.
    :raises DisplayError: one is not served.

    Attributes: ``slms``, the connections in this order; ``settle_time``, the longest of the panels' [s].
    """

    slms: "Tuple[SLM, ...]"
    settle_time: float

    def __init__(self, *panels: Union[str, SLM, Served]) -> None:
        if not panels:
            raise refused("panels", "give the panels of the bench")
        own: "List[SLM]" = []
        try:
            slms: "List[SLM]" = []
            for panel in panels:
                slm = panel if isinstance(panel, SLM) else panel.slm() if isinstance(panel, Served) else SLM(panel)
                if slm is not panel:
                    own.append(slm)
                slms.append(slm)
            names = [slm.name for slm in slms]
            twice = next((name for name in names if names.count(name) > 1), None)
            if twice is not None:
                raise refused("panels", f"`{twice}` is there twice; panels of one profile are served under other names (serve --name)")
        except BaseException:
            for slm in own:
                slm.close()
            raise
        self.slms = tuple(slms)
        self.settle_time = max(slm.settle_time for slm in slms)
        self._own = own
        self._ready = f"bench {os.getpid()} {id(self):x}"
        # Several threads may use one bench: what stands under its name, and the order of frames, are one call's at a time.
        self._turn = threading.Lock()
        # A thread for each panel, which is there before it is needed: all requests leave within some 0.1 ms.
        self._threads = ThreadPoolExecutor(len(slms), "holodrive-bench")

    def show(self, *frames: "Union[ArrayLike, str, int, None]") -> Together:
        """Shows a frame on each panel, and returns when all of them are there.

        :param frames: one for each panel, as for :meth:`SLM.show`: an array, or the name of a preloaded frame; None leaves that panel as
            it is.
        :raises ValueError: another number of frames, or one of another shape or with levels outside its panel's: nothing was shown.
        :raises DisplayError: a frame was refused, and nothing was shown; or a program ended meanwhile, and the text says where the new
            frames are.
        """
        self._one_each(frames)

        def ready(slm: SLM, frame: Any) -> "Optional[Union[str, int]]":
            if isinstance(frame, np.integer):
                return int(frame)
            if frame is None or isinstance(frame, (str, int)):
                return frame
            slm.preload(self._ready, frame)
            return self._ready

        with self._turn:
            return self._recalled(self._each(ready, frames))

    def preload(self, name: Union[str, int], *frames: "ArrayLike") -> None:
        """Makes a frame ready on each panel under one name, for :meth:`show_ready`, :meth:`play` and triggers.

        :param name: the name, as for :meth:`SLM.preload`.
        :param frames: one for each panel.
        """
        self._one_each(frames)
        self._each(lambda slm, frame: slm.preload(name, frame), frames)

    def show_ready(self, name: Union[str, int]) -> Together:
        """Shows the frames of this name that :meth:`preload` has made ready.

        :param name: the frames' name.
        """
        with self._turn:
            return self._recalled([name] * len(self.slms))

    def play(self, names: Iterable[Union[str, int]], rate: float) -> "List[Together]":
        """Shows preloaded frames one after another on all panels, and returns when the last are there.

        :param names: names of the frames in their order, each as often as it is to be shown.
        :param rate: frames a second: panels keep in step by it, not by their own refreshes.
        """
        asked = list(names)
        with self._turn:
            played = self._each(lambda slm, _: slm.play(asked, rate), [None] * len(self.slms))
        return [_together(step) for step in zip(*played)]

    def arm(self, names: Iterable[Union[str, int]]) -> None:
        """Sets the list of preloaded frames that triggers go through, on each panel; the trigger goes to the port of each.

        :param names: their names; none: triggers show nothing, but by a frame's name.
        """
        asked = list(names)
        self._each(lambda slm, _: slm.arm(asked), [None] * len(self.slms))

    def forget(self, *names: Union[str, int]) -> None:
        """Keeps preloaded frames no longer.

        :param names: their names; none: all.
        """
        self._each(lambda slm, _: slm.forget(*names), [None] * len(self.slms))

    def _one_each(self, frames: "Sequence[Any]") -> None:
        if len(frames) != len(self.slms):
            raise ValueError(f"{len(frames)} frames for the bench's {len(self.slms)} panels; give one for each, None to leave one as it is")

    def _each(self, ask: "Callable[[SLM, Any], Any]", what: "Sequence[Any]") -> "List[Any]":
        """Asks all panels at once; raises the first refusal when all have answered, with the panel's name before it."""
        asked: "List[Future[Any]]" = [self._threads.submit(ask, slm, one) for slm, one in zip(self.slms, what)]
        failed = [(slm, one.exception()) for slm, one in zip(self.slms, asked)]
        for slm, error in failed:
            if isinstance(error, (DisplayError, ValueError)):
                raise type(error)(f"{slm.name}: {error}") from error
            if error is not None:
                raise error
        return [one.result() for one in asked]

    def _recalled(self, names: "Sequence[Union[str, int, None]]") -> Together:
        """Shows frames that are ready on all panels at once."""

        def recall(slm: SLM, name: "Union[str, int, None]") -> "Union[Shown, Exception, None]":
            try:
                return None if name is None else slm.show(name)
            except DisplayError as error:
                return error

        answers = self._each(recall, names)
        failed = [(slm.name, answer) for slm, answer in zip(self.slms, answers) if isinstance(answer, Exception)]
        if failed:
            changed = [slm.name for slm, answer in zip(self.slms, answers) if isinstance(answer, Shown)]
            where = f"; the new frame is on {', '.join(changed)}" if changed else "; nothing was shown"
            raise DisplayError("; ".join(f"{name}: {error}" for name, error in failed) + where)
        return _together(answers)

    def close(self) -> None:
        """Ends the connections that the bench has opened; what is on the panels stays as each program was told."""
        self._threads.shutdown()
        for slm in self.slms:
            try:
                slm.forget(self._ready)
            except DisplayError:
                # Nothing was shown by way of it, or the program has ended.
                pass
        for slm in self._own:
            slm.close()

    def __enter__(self) -> "Bench":
        return self

    def __exit__(
        self,
        kind: Optional[Type[BaseException]],
        value: Optional[BaseException],
        trace: Optional[TracebackType],
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<holodrive.Bench of {', '.join(slm.name for slm in self.slms)}>"


def _together(answers: "Sequence[Optional[Shown]]") -> Together:
    times = [shown.time for shown in answers if shown is not None]
    return Together(tuple(answers), max(times) - min(times) if times else 0.0)
