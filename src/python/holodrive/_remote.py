"""A bench for slmsuite's ``RemoteSLM`` and ``RemoteCamera`` (protocol of its version 0.5): one request in a connection, a line each way."""

from __future__ import annotations

import base64
import binascii
import importlib
import json
import logging
import socket
import socketserver
import threading
import time
import urllib.parse
import zlib
from types import TracebackType
from typing import Any, Callable, Dict, Mapping, Optional, Type

import numpy as np
from numpy.typing import NDArray

from ._errors import DisplayError, Error

__all__ = ["Remote"]

# slmsuite has no types. What it sends of arrays and numbers is its encoder's to say.
_Encoder: Any = importlib.import_module("slmsuite.hardware.remote")._NpEncoder

#: Who asked what, when, and how it ended: a line a request.
log = logging.getLogger("holodrive.slmsuite")

#: Bytes of a request beside its frame, connections at once, silence within a request [s], photos of one request.
_HEAD, _CONNECTIONS, _PATIENCE, _PHOTOS = 64 * 1024, 32, 5.0, 64


class _Refused(Exception):
    """Its text is the answer to a client."""


class _Tcp(socketserver.ThreadingTCPServer):
    allow_reuse_address = True
    daemon_threads = True
    remote: "Remote"


class _Handler(socketserver.StreamRequestHandler):
    timeout = _PATIENCE

    def handle(self) -> None:
        assert isinstance(self.server, _Tcp)
        self.server.remote._answer(self)


class Remote:
    """An SLM and a camera for slmsuite's clients, served by threads of this process; made by :func:`holodrive.slmsuite.serve_bench`.

    Attributes: ``host`` and ``port`` where it listens; ``served`` and ``refused``, how many requests were carried out or not.
    """

    def __init__(self, hardware: Mapping[str, Any], levels: str, host: str, port: int) -> None:
        self._hardware = dict(hardware)
        self._kinds = {name: "camera" if hasattr(one, "_get_image_hw") else "slm" for name, one in hardware.items()}
        self._levels = levels
        pixels = max((one.shape[0] * one.shape[1] for name, one in hardware.items() if self._kinds[name] == "slm"), default=0)
        # Two bytes a level, zlib's worst growth, base64, and each of its characters three when quoted.
        self._limit = _HEAD + 2 * pixels * 101 // 100 * 4
        self._turn = threading.Lock()
        self._room = threading.BoundedSemaphore(_CONNECTIONS)
        self.served = self.refused = 0
        try:
            self._server = _Tcp((host, port), _Handler)
        except (OSError, OverflowError) as error:
            raise DisplayError(f"cannot listen on {host}:{port}: {error}; give another port, or 0 for a free one") from error
        self._server.remote = self
        self.host, self.port = self._server.server_address[:2]
        self._thread = threading.Thread(target=self._server.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Ends it; what is asked just now is still answered."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()

    def __enter__(self) -> "Remote":
        return self

    def __exit__(
        self, kind: Optional[Type[BaseException]], value: Optional[BaseException], trace: Optional[TracebackType]
    ) -> None:
        self.stop()

    def _answer(self, client: _Handler) -> None:
        who, what = "{}:{}".format(*client.client_address[:2]), "nothing"
        if not self._room.acquire(blocking=False):
            self.refused += 1
            log.warning("%s refused: %d connections are open", who, _CONNECTIONS)
            return
        try:
            try:
                line = client.rfile.readline(self._limit + 1)
                if not line.endswith(b"\n"):
                    raise _Refused("The request is too long." if len(line) > self._limit else "The request has no end.")
                name, command, arguments = _request(line)
                # One line of the log, whatever they hold.
                what = f"{name[:64]!r} {command[:64]!r}"
                with self._turn:
                    reply = self._do(name, command, arguments)
                    text = json.dumps([True, reply], cls=_Encoder)
                    self.served += 1
                log.info("%s %s", who, what)
            except (_Refused, Error) as why:
                with self._turn:
                    self.refused += 1
                log.warning("%s %s refused: %s", who, what, why)
                text = json.dumps([False, str(why)])
            except Exception:
                # A client's request does not end the bench, nor is it told of this machine's files.
                with self._turn:
                    self.refused += 1
                log.exception("%s %s failed", who, what)
                text = json.dumps([False, "Server error. See the server's log for details."])
            client.wfile.write((urllib.parse.quote_plus(text) + "\n").encode())
            _read_to_the_end(client.connection)
        except OSError as error:
            log.warning("%s %s has gone: %s", who, what, error)
        finally:
            self._room.release()

    def _do(self, name: str, command: str, given: Dict[str, Any]) -> Any:
        if command == "ping":
            return self._kinds
        if name not in self._hardware:
            raise _Refused(f"Did not recognize hardware {name[:64]!r}. Options: {list(self._hardware)}.")
        one = self._hardware[name]
        if command == "pickle":
            return one.pickle(attributes=bool(given.get("attributes", True)), metadata=bool(given.get("metadata", True)))
        commands: Dict[str, Callable[[Any, Dict[str, Any]], Any]] = (
            {
                "flush": lambda camera, given: None,
                "_get_exposure_hw": lambda camera, given: camera._get_exposure_hw(),
                "_set_exposure_hw": lambda camera, given: camera._set_exposure_hw(_number(given, "exposure_s")),
                "_get_image_hw": lambda camera, given: camera._get_image_hw(0.0),
                "_get_images_hw": _photos,
            }
            if self._kinds[name] == "camera"
            else {"_set_phase_hw": self._show}
        )
        if command not in commands:
            raise _Refused(f"{name}.{command[:64]!r} not present.")
        return commands[command](one, given)

    def _show(self, slm: Any, given: Dict[str, Any]) -> None:
        # `execute=False` only waits for the frame before, which is on the panel.
        if given.get("execute") is False:
            return
        levels = _levels(given.get("display"), slm.shape, slm.bitdepth)
        if self._levels == "final":
            slm.set_phase(levels.astype(slm.dtype))
        else:
            # What slmsuite's clients make of a phase φ: round(−φ·N/2π) − 1 modulo N.
            count = 2**slm.bitdepth
            slm.set_phase((count - 1 - levels.astype(np.float64)) * (2 * np.pi / count), phase_correct=False)


def _read_to_the_end(connection: socket.socket) -> None:
    """Takes what the client still sends, for a second at most: a socket that is closed with bytes unread takes the answer with it."""
    connection.shutdown(socket.SHUT_WR)
    end = time.monotonic() + 1.0
    try:
        while (left := end - time.monotonic()) > 0:
            connection.settimeout(left)
            if not connection.recv(65536):
                return
    except socket.timeout:
        # Silent, which is its own affair.
        pass


def _request(line: bytes) -> "tuple[str, str, Dict[str, Any]]":
    try:
        request = json.loads(urllib.parse.unquote_plus(line[:-1].decode("ascii"), errors="strict"))
        name, command, given = request.get("name"), request.get("command"), request.get("kwargs") or {}
    except (ValueError, AttributeError, RecursionError) as error:
        raise _Refused(f"The request is not understood: {str(error)[:200]}.") from error
    if not isinstance(command, str) or not isinstance(given, dict) or not (name is None or isinstance(name, str)):
        raise _Refused("No command provided.")
    return name or "", command, given


def _number(given: Dict[str, Any], key: str) -> float:
    value = given.get(key)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise _Refused(f"{key} is to be a number.")
    return float(value)


def _photos(camera: Any, given: Dict[str, Any]) -> NDArray[Any]:
    count = _number(given, "image_count")
    if not (count == int(count) and 1 <= count <= _PHOTOS):
        raise _Refused(f"image_count is to be 1 to {_PHOTOS}.")
    return np.stack([camera._get_image_hw(0.0) for _ in range(int(count))])


def _levels(packed: Any, shape: "tuple[int, int]", bits: int) -> NDArray[Any]:
    """The levels of a packed array, as long as they have to be and no longer."""
    if not isinstance(packed, dict) or not isinstance(packed.get("__zlib__"), str):
        raise _Refused("_set_phase_hw carries no display.")
    if packed.get("__shape__") != list(shape):
        raise _Refused(f"The display is of shape {str(packed.get('__shape__'))[:60]}, the panel of {list(shape)}.")
    if packed.get("__dtype__") not in ("uint8", "uint16"):
        raise _Refused("The display is to be of uint8 or uint16.")
    dtype = np.dtype(packed["__dtype__"]).newbyteorder("<")
    expected = shape[0] * shape[1] * dtype.itemsize
    try:
        unfold = zlib.decompressobj()
        levels = unfold.decompress(base64.b64decode(packed["__zlib__"], validate=True), expected + 1)
    except (zlib.error, binascii.Error, ValueError) as error:
        raise _Refused(f"The display does not unfold: {error}.") from error
    if len(levels) != expected or not unfold.eof:
        raise _Refused(f"The display does not unfold to {expected} bytes.")
    array = np.frombuffer(levels, dtype).reshape(shape)
    if array.max() >= 2**bits:
        raise _Refused(f"Level {array.max()} is above {2**bits - 1}, the panel's highest.")
    return array
