"""What is told of progress: a callable, a tqdm bar, or True for a bar that is made here."""

from __future__ import annotations

from typing import Any, Callable, Optional

__all__ = ["watcher"]

#: Called with the step's name, work done and work in all (0 where unknown); with None for a step when all is done.
Watcher = Callable[[Optional[str], int, int], None]


def watcher(given: Any) -> Watcher:
    """What the library calls for a ``progress`` argument."""
    if given is False:
        return _of_callable(lambda step, done, total: None)
    if given is True:
        from tqdm.auto import tqdm  # type: ignore[import-untyped,unused-ignore]

        return _of_bar(tqdm(leave=False), own=True)
    if callable(given):
        return _of_callable(given)
    if hasattr(given, "update") and hasattr(given, "refresh"):
        return _of_bar(given, own=False)
    raise TypeError(f"progress is {type(given).__name__}: give callable(step, done, total), a tqdm bar, or True")


def _of_callable(given: Callable[[str, int, int], Any]) -> Watcher:
    def told(step: Optional[str], done: int, total: int) -> None:
        if step is not None:
            given(step, done, total)

    return told


def _of_bar(bar: Any, own: bool) -> Watcher:
    shown: "list[Optional[str]]" = [None]

    def told(step: Optional[str], done: int, total: int) -> None:
        if step is None:
            if own:
                bar.close()
            return
        if step != shown[0]:
            shown[0] = step
            if hasattr(bar, "set_description"):
                bar.set_description(step, refresh=False)
            # Each step has its own time and rate.
            if hasattr(bar, "reset"):
                bar.reset(total or None)
            else:
                bar.n = 0
        bar.total = total or None
        done = min(done, total) if total else done
        # The bar's own `update` keeps to its `mininterval`; the last look is shown whenever it comes.
        bar.update(done - bar.n)
        if total and done == total:
            bar.refresh()

    return told
