"""What a long run shows while it runs, and how it is stopped."""

from __future__ import annotations

import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING

from nutdamp.cli.screen import say
from nutdamp.work import Watch, watched

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID
    from rich.status import Status

PATIENCE = 1.0
"""Seconds that pass before a bar appears."""

LONG = 10.0
"""Seconds after which a line says how far the work is, where standard error is no terminal."""


@contextmanager
def progress(what: str, total: int, *, quiet: bool = False) -> Iterator[Callable[[int], None]]:
    """A function to call now and then with how many of ``total`` are done.

    It shows a bar with rate and time left on standard error: on a terminal, only after a second, and it leaves nothing
    behind. Elsewhere one line says how far it is, after `LONG`.
    """
    shown = _Bar(what, total) if sys.stderr.isatty() else _Line(what, total)
    try:
        yield (lambda _: None) if quiet else shown.update
    finally:
        shown.close()


@contextmanager
def working(what: str, *, quiet: bool = False) -> Iterator[None]:
    """Says ``what`` is done while it is done: which search, and how much of its budget of `work` is spent.

    Like `progress` only on a terminal, only after a second, and it leaves nothing behind.
    """
    if quiet or not sys.stderr.isatty():
        yield
        return
    shown: list[Status] = []

    def show() -> None:
        from rich.console import Console

        shown.append(Console(stderr=True).status(_Doing(what, watch)))
        shown[0].start()

    with watched() as watch:
        timer = threading.Timer(PATIENCE, show)
        timer.daemon = True
        timer.start()
        try:
            yield
        finally:
            timer.cancel()
            timer.join()
            for status in shown:
                status.stop()


class _Doing:
    """``what`` is done, with the search that a ``watch`` sees and how far it is at the moment it is shown."""

    def __init__(self, what: str, watch: Watch) -> None:
        self.what, self.watch = what, watch

    def __rich__(self) -> str:
        budget = self.watch.budget
        if budget is None:
            return self.what
        return f"{self.what}: {budget.what}, {100.0 * budget.share:.0f} % of the work that it may take"


class _Line:
    """What is shown where there is no terminal: one line, once, that names the share done and the time left."""

    def __init__(self, what: str, total: int) -> None:
        self.what, self.total = what, total
        self.began, self.said = time.monotonic(), False

    def update(self, done: int) -> None:
        passed = time.monotonic() - self.began
        if self.said or passed < LONG:
            return
        self.said = True
        left = passed * (self.total - done) / max(done, 1)
        rest = f", about {left:.0f} s left" if left > 0.0 else ""
        say(f"{self.what}: {min(done, self.total):,} of {self.total:,} done after {passed:.0f} s{rest}")

    def close(self) -> None:
        """Nothing is to be cleared."""


class _Bar:
    def __init__(self, what: str, total: int) -> None:
        self.what, self.total = what, total
        self.began = time.monotonic()
        self.bar: Progress | None = None
        self.task: TaskID | None = None

    def update(self, done: int) -> None:
        passed = time.monotonic() - self.began
        if passed < PATIENCE:
            return
        if self.bar is None:
            self._open()
        assert self.bar is not None
        assert self.task is not None
        rate = done / passed
        self.bar.update(self.task, completed=done, rate=f"{rate:,.0f}/s" if rate >= 1.0 else "")

    def _open(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

        self.bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(bar_width=None),
            TaskProgressColumn(),
            TextColumn("{task.fields[rate]}"),
            TimeRemainingColumn(),
            console=Console(stderr=True),
            transient=True,
        )
        self.task = self.bar.add_task(self.what, total=self.total, rate="")
        self.bar.start()

    def close(self) -> None:
        if self.bar is not None:
            self.bar.stop()


class Stop:
    """Whether a run was requested to stop, and by which signal."""

    number: int | None = None

    def __call__(self) -> bool:
        """Whether it was."""
        return self.number is not None


@contextmanager
def stoppable() -> Iterator[Stop]:
    """Tells whether the run was requested to stop, by Ctrl-C or SIGTERM, so that it can end in order.

    A second Ctrl-C interrupts at once.
    """
    stop = Stop()

    def ask(number: int, _: FrameType | None) -> None:
        if stop() and number == signal.SIGINT:
            raise KeyboardInterrupt
        stop.number = number

    before = {number: signal.signal(number, ask) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
