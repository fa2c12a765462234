"""The wheel on a machine that has Python only: no Rust, no compiler, no settings of ours."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import holodrive as hd
import pytest
from conftest import ROOT


def wheel() -> Path:
    """The wheel that tests/run has packed."""
    named = os.environ.get("HOLODRIVE_WHEEL")
    if not named:
        pytest.skip("HOLODRIVE_WHEEL does not name the wheel; tests/run does")
    return Path(named)


def test_the_wheel_is_installed_and_the_notebook_runs_where_there_is_python_only(tmp_path: Path) -> None:
    packed = wheel()
    own = tmp_path / "venv"
    programs = own / ("Scripts" if sys.platform == "win32" else "bin")
    # Nothing but the new environment's programs can be found, and no home of ours.
    bare = {"PATH": str(programs), "HOME": str(tmp_path), "TMPDIR": str(tmp_path)}
    for kept in ("SYSTEMROOT", "PIP_INDEX_URL", "PIP_CONFIG_FILE", "SSL_CERT_FILE", "HTTPS_PROXY", "https_proxy"):
        if kept in os.environ:
            bare[kept] = os.environ[kept]
    for tool in ("cargo", "rustc", "cc", "gcc", "maturin"):
        assert shutil.which(tool, path=bare["PATH"]) is None

    def run(*command: object) -> "subprocess.CompletedProcess[str]":
        return subprocess.run(list(map(str, command)), env=bare, cwd=tmp_path, capture_output=True, text=True)

    made = run(sys.executable, "-I", "-m", "venv", own)
    if made.returncode != 0:
        pytest.skip(f"this Python makes no environments: {made.stderr.strip()}")
    pip = (programs / "python", "-m", "pip", "install", "-q", "--disable-pip-version-check", "--retries", "1", "--timeout", "20")
    needs = run(*pip, "--only-binary", ":all:", "numpy")
    if needs.returncode != 0:
        pytest.skip(f"NumPy cannot be had from PyPI: {needs.stderr.strip().splitlines()[-1:]}")
    installed = run(*pip, "--no-index", packed)
    assert installed.returncode == 0, installed.stderr

    program = run(programs / "holodrive", "--version")
    assert program.stdout.strip() == f"holodrive {hd.__version__}", program.stderr
    # The program's own scenes and panels come with it.
    shown = run(programs / "holodrive", "points", "cornell", "--rays", "20x20", "-o", "few.ply")
    assert shown.returncode == 0 and (tmp_path / "few.ply").exists(), shown.stderr
    shutil.copytree(ROOT / "scenes", tmp_path / "scenes")
    here = Path(__file__).parent
    book = run(programs / "python", "-I", here / "run_notebook.py", here / "first_light.ipynb")
    assert book.returncode == 0, book.stderr
    cells, pictures = map(int, book.stdout.split())
    assert cells >= 5 and pictures >= 3
