"""The stubs: a user's script under mypy --strict, the package's own files, and that nothing of it is missing there."""

from __future__ import annotations

import inspect
import subprocess
import sys
from pathlib import Path
from typing import Any

import holodrive as hd
import numpy as np
import pytest

HERE = Path(__file__).parent


def mypy(*arguments: Any) -> str:
    pytest.importorskip("mypy")
    command = [sys.executable, "-m", "mypy", "--strict", "--no-error-summary", "--cache-dir", "/dev/null", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, cwd=HERE).stdout


def test_a_users_script_is_clean_under_mypy_strict() -> None:
    assert mypy(HERE / "user_code.py") == ""


def test_the_package_is_clean_under_mypy_strict() -> None:
    assert mypy("-p", "holodrive") == ""


def test_slips_are_found_by_mypy(tmp_path: Path) -> None:
    slips = tmp_path / "slips.py"
    slips.write_text(
        "import holodrive as hd\n"
        "panel = hd.Panel('generic')\n"
        "hd.hologram(panel, panel)\n"
        "hd.encode([[0.0]], panel, encodin='kinoform')\n"
        "x: str = panel.wavelength\n"
    )
    found = {line.split(":")[1] for line in mypy(slips).splitlines() if ": error:" in line}
    assert found == {"3", "4", "5"}


def test_a_users_script_runs(tmp_path: Path, wide: hd.Panel) -> None:
    import user_code

    levels = user_code.levels_for(np.array([[0.0, 0.0, -0.05]]), tmp_path)
    assert levels.shape == (64, 96)
    assert len(user_code.frames_for_an_eye(wide)) == 2


def test_stubs_name_what_is_there() -> None:
    """Each class, method and argument of the compiled part stands in its stub, and none that is not there."""
    import ast

    compiled = hd._holodrive  # type: ignore[attr-defined]
    stub = ast.parse((Path(hd.__file__ or "").parent / "_holodrive.pyi").read_text())
    told: "dict[str, list[str]]" = {}
    for node in stub.body:
        if isinstance(node, ast.ClassDef) and node.name in ("Bar", "EncodeReport", "HologramReport"):
            continue  # shapes of arguments and of what is returned
        members = node.body if isinstance(node, ast.ClassDef) else [node]
        prefix = f"{node.name}." if isinstance(node, ast.ClassDef) else ""
        for member in members:
            if isinstance(member, ast.FunctionDef):
                arguments = [*member.args.posonlyargs, *member.args.args, *member.args.kwonlyargs]
                names = [argument.arg for argument in arguments if argument.arg not in ("self", "cls")]
                # Of overloads the fullest.
                before = told.get(prefix + member.name, [])
                told[prefix + member.name] = max(before, names, key=len)
    real: "dict[str, list[str]]" = {}
    for name, thing in vars(compiled).items():
        if inspect.isclass(thing):
            for own, member in vars(thing).items():
                if own in ("__array__", "__len__") or not own.startswith("__") or own == "__new__":
                    signed = thing if own == "__new__" else getattr(thing, own)
                    real[f"{name}.{own}"] = arguments_of(signed)
        elif callable(thing):
            real[name] = arguments_of(thing)
    made = {name for name in real if name.endswith(".__new__")} - {name for name in told if name.endswith(".__new__")}
    assert made <= {"Scene.__new__", "Picture.__new__"}, "classes that cannot be made need no signature"
    assert {name: set(told[name]) for name in told if name in real} == {name: set(real[name]) for name in told if name in real}
    missing = set(real) - set(told) - made - {"__version__"}
    assert not missing and not set(told) - set(real), (missing, set(told) - set(real))


def arguments_of(thing: Any) -> "list[str]":
    try:
        return [name for name in inspect.signature(thing).parameters if name != "self"]
    except (TypeError, ValueError):
        return []
