"""``holodrive serve`` in the background."""

from __future__ import annotations

import json
import os
import queue
import signal
import subprocess
import sys
import threading
import weakref
from types import TracebackType
from typing import IO, Any, Callable, Optional, Sequence, Type, Union

from ._errors import DisplayError
from .slm import SLM

__all__ = ["Served", "serve"]

_Path = Union[str, "os.PathLike[str]"]


def _read(pipe: IO[str], tell: "Callable[[Optional[str]], None]") -> None:
    """Tells each line of a pipe, and None at its end. No method: a thread must not keep alive what ends the program."""
    for line in pipe:
        tell(line)
    tell(None)


def _ended(process: "subprocess.Popen[str]", timeout: float = 5.0) -> None:
    """Ends the program as Ctrl-C does, so that the panel is left dark."""
    if process.stdin is not None:
        process.stdin.close()
    if process.poll() is not None:
        return
    if sys.platform == "win32":
        # Ctrl-C there goes to all processes of a console.
        process.terminate()
    else:
        process.send_signal(signal.SIGINT)
    try:
        process.wait(timeout)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


class Served:
    """A panel that a program of its own keeps until it is stopped, or until this object or this process ends; made by :func:`serve`.

    Attributes: ``name`` by which clients ask for the panel; ``about``, a dict of what the program said: width, height, bits,
    wavelength, the addresses of its protocols; ``process``.
    """

    def __init__(self, command: Sequence[str], timeout: float) -> None:
        # In a session (on Windows a group) of its own, so that a Ctrl-C that ends a loop here leaves the panel as it is.
        self.process: "subprocess.Popen[str]" = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
            creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
        )
        # Without a `stop` it ends with this object, at the latest when this process has gone and its end of the pipe with it.
        self._end = weakref.finalize(self, _ended, self.process)
        assert self.process.stdout is not None and self.process.stderr is not None
        self._said: "queue.Queue[Optional[str]]" = queue.Queue()
        self._errors: "list[Optional[str]]" = []
        self._report: "dict[str, Any]" = {}
        # Both pipes are read to their ends, so that the program never waits for a reader.
        self._readers = [
            threading.Thread(target=_read, args=(self.process.stdout, self._said.put), daemon=True),
            threading.Thread(target=_read, args=(self.process.stderr, self._errors.append), daemon=True),
        ]
        for reader in self._readers:
            reader.start()
        try:
            first = self._said.get(timeout=timeout)
        except queue.Empty:
            self.stop()
            raise DisplayError(f"the program did not say within {timeout:g} s that it serves the panel") from None
        except BaseException:
            self.stop()
            raise
        if first is None:
            self._readers[1].join(1.0)
            self.process.wait()
            self._end()
            raise DisplayError("".join(line or "" for line in self._errors).strip() or "the program ended before it served the panel")
        self.about: "dict[str, Any]" = json.loads(first)["serving"]
        self.name: str = self.about["name"]

    def slm(self, timeout: float = 10.0) -> SLM:
        """Connects to the panel.

        :param timeout: longest wait for an answer [s].
        """
        local = self.about.get("local")
        return SLM(self.name, path=local, timeout=timeout)

    @property
    def running(self) -> bool:
        """Whether the program still keeps the panel."""
        return self.process.poll() is None

    def stop(self, timeout: float = 10.0) -> "dict[str, Any]":
        """Ends the program as Ctrl-C does, and returns its report: frames shown, refused and missed, latency.

        :param timeout: longest wait for its end [s]; then it is killed.
        """
        self._end.detach()
        _ended(self.process, timeout)
        for reader in self._readers:
            reader.join(timeout)
        said = ""
        while not self._said.empty():
            said += self._said.get() or ""
        try:
            self._report = json.loads(said)
        except ValueError:
            # A program that was killed says nothing.
            pass
        return self._report

    def __enter__(self) -> "Served":
        return self

    def __exit__(
        self,
        kind: Optional[Type[BaseException]],
        value: Optional[BaseException],
        trace: Optional[TracebackType],
    ) -> None:
        self.stop()

    def __repr__(self) -> str:
        state = "" if self.running else ", ended"
        return f"<holodrive.Served {self.name}, {self.about['width']} × {self.about['height']} px{state}>"


def serve(
    panel: _Path = "generic",
    monitor: str = "none",
    *,
    name: Optional[str] = None,
    wavelength: "Union[str, float, None]" = None,
    output: Optional[_Path] = None,
    arguments: Sequence[str] = (),
    timeout: float = 20.0,
) -> Served:
    """Keeps a panel in the background, by the program ``holodrive serve`` in a process of its own.

    ::

        with holodrive.serve("holoeye-pluto-2.1", "HDMI-1") as served, served.slm() as slm:
            slm.show(phase)

    :param panel: name of a profile, or its .toml file.
    :param monitor: the panel's monitor (see ``holodrive monitors``), or "none" for the simulated panel.
    :param name: the name by which clients ask for it; by default the profile's.
    :param wavelength: vacuum wavelength of the laser, text with a unit or in metres; by default the profile's first.
    :param output: with monitor "none": a folder into which each frame is written.
    :param arguments: further arguments of ``holodrive serve``, such as ("--slmsuite", "5025").
    :param timeout: longest wait until it serves [s].
    :raises DisplayError: the program's own words, where it could not.
    """
    command = [sys.executable, "-m", "holodrive", "serve", "--json", "--until-stdin-closes"]
    command += ["--panel", os.fspath(panel), "--monitor", monitor]
    if not any(protocol in arguments for protocol in ("--slmsuite", "--slmpy", "--local")):
        command += ["--local"]
    light = wavelength if wavelength is None or isinstance(wavelength, str) else f"{float(wavelength)!r}m"
    for flag, value in (("--name", name), ("--wavelength", light), ("--output", output)):
        if value is not None:
            command += [flag, os.fspath(value)]
    return Served([*command, *arguments], timeout)
