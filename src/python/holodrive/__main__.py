"""The program ``holodrive``: ``python -m holodrive show scenes/cornell.gltf``."""

from __future__ import annotations

import signal
import sys

from ._holodrive import program

__all__ = ["main"]


def main() -> int:
    """Runs the program with the arguments of this process and returns its exit code."""
    # Ctrl-C is the program's: Python's own handler would wait for it to end.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return program(["holodrive", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
