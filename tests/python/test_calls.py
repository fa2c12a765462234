"""Long calls: others go on, Ctrl-C is heard, progress is told, and little is added."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from typing import Any, Callable

import holodrive as hd
import numpy as np
import pytest


@pytest.fixture(scope="module")
def long_call() -> "Callable[..., hd.Field]":
    """A call that takes about ten seconds: 300,000 points on a quarter of a million pixels, point by point."""
    panel = hd.Panel(width=640, height=400, pitch="8um", wavelength="532nm")
    random = np.random.default_rng(1)
    places = np.c_[random.uniform(-1e-3, 1e-3, (300_000, 2)), random.uniform(-0.12, -0.1, 300_000)]
    points = hd.Points(places)
    return lambda **more: hd.hologram(points, panel, engine="direct", **more)


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no timer that signals")
@pytest.mark.parametrize("watched", [False, True])
def test_ctrl_c_ends_a_long_call_within_a_fifth_of_a_second(long_call: Any, watched: bool) -> None:
    sent = [0.0]

    def press() -> None:
        sent[0] = time.monotonic()
        os.kill(os.getpid(), signal.SIGINT)

    timer = threading.Timer(0.4, press)
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        long_call(progress=(lambda step, done, total: None) if watched else None)
    heard = time.monotonic() - sent[0]
    timer.join()
    print(f"heard after {1e3 * heard:.0f} ms")
    assert sent[0] > 0 and heard < 0.2


def test_a_handler_of_ones_own_is_asked(long_call: Any) -> None:
    class Enough(Exception):
        pass

    def enough(*_: Any) -> None:
        raise Enough

    before = signal.signal(signal.SIGINT, enough)
    try:
        threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT)).start()
        with pytest.raises(Enough):
            long_call()
    finally:
        signal.signal(signal.SIGINT, before)


def test_other_threads_run_during_a_call(long_call: Any) -> None:
    class Enough(Exception):
        pass

    turns, ended = [0], threading.Event()

    def other() -> None:
        while not ended.is_set():
            turns[0] += 1
            time.sleep(0.005)

    begin = time.monotonic()

    def watch(step: str, done: int, total: int) -> None:
        if time.monotonic() - begin > 0.6:
            raise Enough

    thread = threading.Thread(target=other)
    thread.start()
    try:
        with pytest.raises(Enough):
            long_call(progress=watch)
    finally:
        ended.set()
        thread.join()
    assert turns[0] > 20


def test_calls_run_beside_each_other(panel: hd.Panel) -> None:
    points = hd.Points([[0, 0, -0.1], [1e-4, 0, -0.12]])
    alone = np.asarray(hd.hologram(points, panel))
    found: "list[Any]" = [None] * 8

    def work(index: int) -> None:
        found[index] = np.asarray(hd.hologram(points, panel))

    threads = [threading.Thread(target=work, args=(index,)) for index in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(np.array_equal(field, alone) for field in found)


def test_progress_is_told_by_step_done_and_total(long_call: Any) -> None:
    class Enough(Exception):
        pass

    told: "list[tuple[str, int, int]]" = []

    def watch(step: str, done: int, total: int) -> None:
        told.append((step, done, total))
        if len(told) >= 4 and done > 0:
            raise Enough

    with pytest.raises(Enough):
        long_call(progress=watch)
    assert all(isinstance(step, str) and 0 <= done <= total for step, done, total in told)
    amounts = [done for _, done, _ in told]
    assert amounts == sorted(amounts) and amounts[-1] > amounts[0]


def test_the_end_is_told_of_short_calls_too(panel: hd.Panel) -> None:
    told: "list[tuple[str, int, int]]" = []
    hd.hologram(hd.Points([[0, 0, -0.1]]), panel, progress=lambda *all: told.append(all))
    step, done, total = told[-1]
    assert step and done == total


def test_progress_goes_to_a_bar_of_tqdms(panel: hd.Panel) -> None:
    tqdm = pytest.importorskip("tqdm")
    with open(os.devnull, "w") as nowhere, tqdm.tqdm(file=nowhere) as bar:
        hd.encode(np.ones((48, 64), np.complex64), panel, encoding="gradient", iterations=3, progress=bar)
        assert bar.total and bar.n == bar.total and bar.desc
    hd.encode(np.ones((48, 64), np.complex64), panel, progress=True)


def test_what_tells_no_progress_is_refused(panel: hd.Panel) -> None:
    with pytest.raises(TypeError, match=r"progress is int: give callable\(step, done, total\)"):
        hd.hologram(hd.Points([[0, 0, -0.1]]), panel, progress=3)  # type: ignore[arg-type]


def test_results_do_not_depend_on_watching(panel: hd.Panel) -> None:
    field = np.exp(1j * np.arange(48 * 64) / 31).reshape(48, 64).astype(np.complex64)
    a = hd.encode(field, panel, encoding="gradient", iterations=5)
    b = hd.encode(field, panel, encoding="gradient", iterations=5, progress=lambda *_: None)
    assert np.array_equal(a.levels, b.levels)


@pytest.mark.skipif(sys.platform == "win32", reason="fork")
def test_small_calls_are_quick(panel: hd.Panel) -> None:
    a = np.ones((48, 64), np.float32)
    hd.encode(a, panel)
    times = []
    for _ in range(50):
        begin = time.perf_counter()
        hd.encode(a, panel)
        times.append(time.perf_counter() - begin)
    print(f"encode of 64 × 48 px in {1e6 * min(times):.0f} us")
    assert min(times) < 20e-3
