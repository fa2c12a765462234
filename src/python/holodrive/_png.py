"""Pictures for notebooks."""

from __future__ import annotations

import struct
import zlib
from typing import Any

import numpy as np

__all__ = ["png"]


def png(codes: "np.ndarray[Any, np.dtype[np.uint8]]") -> bytes:
    """A gray PNG of 8-bit codes, shape (rows, columns)."""
    height, width = codes.shape
    # Each row begins with its filter: none.
    rows = np.zeros((height, width + 1), np.uint8)
    rows[:, 1:] = codes

    def chunk(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    data = zlib.compress(rows.tobytes(), 6)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", data) + chunk(b"IEND", b"")
