"""Arrays of other libraries as NumPy's."""

from __future__ import annotations

from typing import Any

import numpy as np

__all__ = ["as_array"]


def as_array(value: Any) -> "np.ndarray[Any, Any]":
    """The NumPy array of a torch, cupy, jax … array, a :class:`~holodrive.Field`, or a list: without a copy where its memory can be
    looked at, by way of this machine's memory where it lies on a graphics processor.
    """
    if hasattr(value, "detach") and getattr(value, "requires_grad", False):
        # A tensor with a gradient is not lent by torch until it is detached.
        value = value.detach()
    if hasattr(value, "__dlpack__") and hasattr(value, "__dlpack_device__"):
        try:
            return np.from_dlpack(value)
        except (BufferError, RuntimeError, TypeError, ValueError):
            pass
        try:
            # NumPy 2.1 on: the owner copies it to this machine's memory.
            return np.from_dlpack(value, device="cpu")
        except (BufferError, RuntimeError, TypeError, ValueError):
            pass
    for to_host in ("get", "cpu"):
        if not hasattr(value, "__array__") and callable(getattr(value, to_host, None)):
            # cupy's `get`, torch's `cpu`.
            value = getattr(value, to_host)()
    return np.asarray(value)
