"""Several panels as one bench."""

from __future__ import annotations

import re
import socket
import sys
import threading
import time
from pathlib import Path
from typing import Iterator

import holodrive as hd
import numpy as np
import pytest
from conftest import ROOT, shown_levels

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="the tests tell times by a clock that programs have in common")

#: Rows and columns of the two panels.
SIZES = {"left": (90, 160), "right": (60, 100)}


@pytest.fixture()
def two(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> "Iterator[tuple[hd.Served, hd.Served]]":
    """A panel of 8 bits and one of 10, each kept by a program of its own."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    served = []
    for (name, (rows, columns)), profile in zip(SIZES.items(), ("generic", "meadowlark-p1920-10")):
        lines = (ROOT / "calib" / f"{profile}.toml").read_text().splitlines()
        size = {"width": columns, "height": rows}
        lines = [f"{key} = {size[key]}" if (key := line.split(" =")[0]) in size else line for line in lines]
        (tmp_path / f"{name}.toml").write_text("\n".join(lines))
        served.append(hd.serve(tmp_path / f"{name}.toml", name=name, output=tmp_path / name, arguments=("--trigger", "0")))
    yield served[0], served[1]
    for one in served:
        one.stop()


def flat(level: int, name: str) -> "np.ndarray[tuple[int, int], np.dtype[np.uint16]]":
    return np.full(SIZES[name], level, np.uint16)


def test_one_call_puts_a_frame_on_each_panel(two: "tuple[hd.Served, hd.Served]", tmp_path: Path) -> None:
    with hd.Bench(*two) as bench:
        assert "left" in repr(bench) and "right" in repr(bench)
        assert bench.settle_time == max(slm.settle_time for slm in bench.slms)
        before = time.monotonic()
        together = bench.show(flat(7, "left"), flat(700, "right"))
        after = time.monotonic()
        assert all(shown is not None and before <= shown.time <= after for shown in together.shown)
        first, second = together.shown
        assert first is not None and second is not None
        assert together.skew == pytest.approx(abs(first.time - second.time), abs=1e-9)
        # One is left as it is.
        alone = bench.show(None, flat(701, "right"))
        assert alone.shown[0] is None and alone.skew == 0
        # Phases go through the curve of each panel: levels_for_2pi is 256 and 1024.
        bench.show(np.full(SIZES["left"], np.pi), np.full(SIZES["right"], np.pi))
    assert shown_levels(tmp_path / "left") == [7, 128]
    assert shown_levels(tmp_path / "right") == [700, 701, 512]


def test_where_one_panel_refuses_nothing_is_shown(two: "tuple[hd.Served, hd.Served]", tmp_path: Path) -> None:
    with hd.Bench("left", "right") as bench:
        bench.show(flat(1, "left"), flat(2, "right"))
        for left, right, words in [
            (flat(3, "left"), flat(2000, "right"), "right: levels are 0 … 1023"),
            (flat(256, "left"), flat(4, "right"), "left: levels are 0 … 255"),
            (flat(3, "left"), flat(4, "left"), "right: the array is"),
        ]:
            with pytest.raises(ValueError, match=words):
                bench.show(left, right)
        with pytest.raises(ValueError, match="1 frames for the bench's 2 panels"):
            bench.show(flat(3, "left"))
        with pytest.raises(hd.DisplayError, match="left: .*right: .*nothing was shown"):
            bench.show_ready("nothing")
        # A name that one of them knows is shown there, and the error says so.
        bench.slms[0].preload("mine", flat(9, "left"))
        with pytest.raises(hd.DisplayError, match="right: .*mine.*; the new frame is on left"):
            bench.show_ready("mine")
    assert shown_levels(tmp_path / "left") == [1, 9]
    assert shown_levels(tmp_path / "right") == [2]


def test_frames_that_are_ready_are_played_and_triggered_together(two: "tuple[hd.Served, hd.Served]", tmp_path: Path) -> None:
    with hd.Bench(*two) as bench:
        for k in range(4):
            bench.preload(k, flat(10 + k, "left"), flat(500 + k, "right"))
        assert bench.show_ready(3).skew < 1
        played = bench.play([0, 1, 2, 0], rate=20)
        assert len(played) == 4
        times = np.array([[shown.time for shown in step.shown if shown is not None] for step in played])
        assert times.shape == (4, 2)
        # Never early, on either panel.
        assert (times - times[0] > 0.05 * np.arange(4)[:, None] - 1e-3).all()
        bench.arm([2, 1])
        for served in two:
            host, _, port = str(served.about["trigger"]).rpartition(":")
            with socket.create_connection((host, int(port)), 5) as line:
                line.sendall(b"\n\n")
                answers = line.makefile("rb")
                assert [answers.readline().split()[0] for _ in range(2)] == [b"6", b"7"]
        bench.forget(0)
        with pytest.raises(hd.DisplayError):
            bench.show_ready(0)
    assert shown_levels(tmp_path / "left") == [13, 10, 11, 12, 10, 12, 11]
    assert shown_levels(tmp_path / "right") == [503, 500, 501, 502, 500, 502, 501]


def test_many_threads_and_a_program_that_ends(two: "tuple[hd.Served, hd.Served]", tmp_path: Path) -> None:
    with hd.Bench(*two) as bench:

        def work(k: int) -> None:
            for step in range(5):
                bench.show(flat(10 * k + step, "left"), flat(10 * k + step, "right"))

        threads = [threading.Thread(target=work, args=(k,)) for k in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        left, right = shown_levels(tmp_path / "left"), shown_levels(tmp_path / "right")
        # One call after the other: both panels have shown the same ones in the same order.
        assert left == right and sorted(left) == sorted(10 * k + step for k in range(4) for step in range(5))
        two[1].process.kill()
        two[1].process.wait()
        with pytest.raises(hd.DisplayError, match="right: "):
            bench.show(flat(77, "left"), flat(77, "right"))
    assert shown_levels(tmp_path / "left")[-1] != 77, "nothing is shown where one cannot be made ready"


def test_a_bench_needs_panels_each_of_its_own_name(two: "tuple[hd.Served, hd.Served]") -> None:
    with pytest.raises(hd.ParameterError, match="give the panels"):
        hd.Bench()
    with pytest.raises(hd.ParameterError, match="`left` is there twice"):
        hd.Bench("left", two[0])
    with pytest.raises(hd.DisplayError, match="no panel is served"):
        hd.Bench("nobody")


def test_the_guides_page_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    block = re.search(r"```python bench\n(.*?)```", (ROOT / "src/guide/python.md").read_text(), re.S)
    assert block is not None
    exec(compile(block[1], "python.md", "exec"), {})
