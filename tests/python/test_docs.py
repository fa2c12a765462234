"""What documentation shows is so: doctests, the guide's page, the notebook."""

from __future__ import annotations

import doctest
import io
import inspect
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import holodrive as hd
import numpy as np
import pytest
from conftest import ROOT
from run_notebook import run_notebook

PUBLIC = [getattr(hd, name) for name in hd.__all__ if not name.startswith("__")]


def members() -> "list[Any]":
    """Public classes and functions, and the methods of the classes."""
    found = []
    for thing in PUBLIC:
        found.append(thing)
        if inspect.isclass(thing) and not issubclass(thing, Exception):
            own = [value for name, value in vars(thing).items() if not name.startswith("_")]
            found += [value for value in own if callable(value) or inspect.isdatadescriptor(value)]
    return found


def test_examples_in_documentation_give_what_they_say() -> None:
    np.set_printoptions(legacy=False)
    count = 0
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE)
    said = io.StringIO()
    for thing in PUBLIC:
        text = inspect.getdoc(thing) or ""
        examples = doctest.DocTestParser().get_doctest(text, {}, getattr(thing, "__name__", "?"), None, None)
        count += len(examples.examples)
        runner.run(examples, out=said.write)
    assert runner.summarize(verbose=False).failed == 0, said.getvalue()
    assert count >= 25


@pytest.mark.parametrize("thing", members(), ids=lambda thing: getattr(thing, "__qualname__", repr(thing)))
def test_everything_public_is_documented(thing: Any) -> None:
    text = inspect.getdoc(thing)
    assert text and len(text) > 8
    if inspect.isbuiltin(thing) and not inspect.isclass(thing):
        taken = [name for name in inspect.signature(thing).parameters if name not in ("self", "progress", "path")]
        missing = [name for name in taken if not re.search(rf"(:param {name}:|`{name}`)", text)]
        assert not missing, f"{thing.__name__} does not say what {missing} are"


PAGES = ["README.md", "src/guide/python.md"]


@pytest.mark.parametrize("page", PAGES)
def test_the_pages_python_runs(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copytree(ROOT / "scenes", tmp_path / "scenes")
    blocks = re.findall(r"```python library\n(.*?)```", (ROOT / page).read_text(), re.S)
    assert blocks
    names: "dict[str, Any]" = {}
    for block in blocks:
        exec(compile(block, page, "exec"), names)
    assert (tmp_path / "frame.png").exists() and (tmp_path / "near.png").exists()


def test_the_guides_commands_run(tmp_path: Path) -> None:
    page = (ROOT / "src/guide/python.md").read_text()
    commands = [line for block in re.findall(r"```sh python\n(.*?)```", page, re.S) for line in block.splitlines()]
    assert commands
    shutil.copytree(ROOT / "scenes", tmp_path / "scenes")
    for command in commands:
        # What installs the package has been done: these tests run on it.
        if "pip install" in command or command.startswith("maturin"):
            assert "src/python" in command or ".whl" in command
            continue
        program, *arguments = command.split()
        assert program == "holodrive"
        said = subprocess.run([sys.executable, "-m", "holodrive", *arguments], cwd=tmp_path, capture_output=True, text=True)
        assert said.returncode == 0, said.stderr


def test_the_notebook_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copytree(ROOT / "scenes", tmp_path / "scenes")
    cells, pictures = run_notebook(Path(__file__).parent / "first_light.ipynb")
    assert cells >= 5 and pictures >= 3, "a notebook that shows nothing"
