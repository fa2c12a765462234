"""Pictures for notebooks."""

from __future__ import annotations

import struct
import zlib
from typing import Any

import numpy as np

__all__ = ["png"]


def png(codes: "np.ndarray[Any, np.dtype[np.uint8]]") -> bytes:
    """A gray PNG of 8-bit codes, shape (rows, columns), or one in colour, (rows, columns, 3)."""
    height, width = codes.shape[:2]
    # Each row begins with its filter: none.
    rows = np.zeros((height, codes[0].size + 1), np.uint8)
    rows[:, 1:] = codes.reshape(height, -1)

    def chunk(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    head = struct.pack(">IIBBBBB", width, height, 8, 2 if codes.ndim == 3 else 0, 0, 0, 0)
    data = zlib.compress(rows.tobytes(), 6)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", data) + chunk(b"IEND", b"")
