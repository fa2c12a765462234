"""Runs the code cells of a notebook in this process, as a kernel would: what a cell ends with is shown.

Alone it needs the standard library only: ``python run_notebook.py first_light.ipynb`` beside the folder ``scenes``.
"""

from __future__ import annotations

import contextlib
import io
import json
import sys
from pathlib import Path
from typing import Any


def run_notebook(path: Path) -> "tuple[int, int]":
    """The number of cells that were run, and of pictures that they showed.

    :param path: the notebook; its names are looked for in the working folder.
    """
    book = json.loads(path.read_text())
    assert book["nbformat"] == 4
    cells = ["".join(cell["source"]) for cell in book["cells"] if cell["cell_type"] == "code"]
    names: "dict[str, Any]" = {}
    shown = 0
    for number, cell in enumerate(cells):
        *before, last = cell.rstrip().split("\n")
        with contextlib.redirect_stdout(io.StringIO()):
            exec(compile("\n".join(before), f"cell {number}", "exec"), names)
            try:
                value = eval(compile(last, f"cell {number}", "eval"), names)
            except SyntaxError:
                exec(compile(last, f"cell {number}", "exec"), names)
                value = None
        if hasattr(value, "_repr_png_"):
            assert value._repr_png_().startswith(b"\x89PNG")
            shown += 1
    return len(cells), shown


if __name__ == "__main__":
    print(*run_notebook(Path(sys.argv[1])))
