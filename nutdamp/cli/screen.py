"""Output to the terminal: results on standard output, messages and progress on standard error, no control characters.

Names of files, channels or units come from elsewhere; on a terminal their control characters could clear the screen,
change its title or pass for output of this program.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import click

from nutdamp.errors import printable

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderableType, RenderResult
    from rich.progress import Progress, TaskID
    from rich.status import Status

    from nutdamp.common.work import BudgetMonitor
    from nutdamp.planning.decision import Comparison


NARROWEST = 20
"""Characters of a line at least."""


def visible(text: str) -> str:
    """`errors.printable` of each line of a text."""
    return text if text.isprintable() else "\n".join(printable(line) for line in text.split("\n"))


def say(text: str) -> None:
    """Print a message on standard error."""
    click.echo(visible(text), err=True)


def show(renderable: RenderableType) -> None:
    """Print a result on standard output; in a file or a pipe without the blanks that fill up lines."""
    shown, renderable = console(), _Visible(renderable)
    if shown.is_terminal:
        shown.print(renderable)
        return
    with shown.capture() as captured:
        shown.print(renderable)
    click.echo("\n".join(line.rstrip() for line in captured.get().split("\n")), nl=False)


def console() -> Console:
    """Standard output as rich sees it; NO_COLOR and COLUMNS count, names such as [red] or :rocket: stay as they are.

    Fewer than `NARROWEST` characters, into which no number would fit, count as that many; COLUMNS = 0 as not set.
    """
    import os
    import shutil

    from rich.console import Console

    requested = os.environ.get("COLUMNS", "")
    width = shutil.get_terminal_size().columns if requested.isdigit() and int(requested) < NARROWEST else None
    if width is not None:
        width = max(width, NARROWEST)
    return Console(highlight=False, markup=False, emoji=False, soft_wrap=False, width=width)


class _Visible:
    """Something to print, with all its text made `visible`; the codes of colours stay."""

    def __init__(self, renderable: RenderableType) -> None:
        self.renderable = renderable

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        from rich.segment import Segment

        for text, style, control in console.render(self.renderable, options):
            yield Segment(text if control else visible(text), style, control)


DEBUG = "nutdamp.debug"
"""Key of ``--debug`` in the context of a command line."""


def _debugging(ctx: click.Context, _: click.Parameter, value: bool) -> None:
    ctx.meta[DEBUG] = value


debug_option = click.option(
    "--debug", is_flag=True, expose_value=False, callback=_debugging, help="Show the traceback of an internal error."
)


def show_failures(compared: Comparison) -> bool:
    """Name on standard error the schemes that have a bug, with ``--debug`` their tracebacks; return True if any has."""
    for plan in compared.failed:
        if click.get_current_context().meta.get(DEBUG):
            import traceback

            say("".join(traceback.format_exception(plan.failure)).rstrip("\n"))
        say(f"nutdamp: {plan.scheme}: {plan.refusal} (--debug shows the traceback)")
    return bool(compared.failed)


PATIENCE = 1.0
"""Seconds that pass before a bar appears."""

LONG = 10.0
"""Seconds after which a line gives the progress, where standard error is no terminal."""


@contextmanager
def progress(what: str, *, quiet: bool = False) -> Iterator[Callable[[int, int], None]]:
    """A function to be called now and then with the number done, and that of all.

    It shows a bar with rate and time left on standard error: on a terminal, only after a second, and it leaves nothing
    behind. Elsewhere one line says how far it is, after `LONG`.
    """
    shown = _Bar(what) if sys.stderr.isatty() else _ProgressLine(what)
    try:
        yield (lambda _done, _all: None) if quiet else shown.update
    finally:
        shown.close()


@contextmanager
def working(what: str, *, quiet: bool = False) -> Iterator[None]:
    """Show ``what`` is under way, with the search that runs and the share spent of its work budget.

    Like `progress` only on a terminal, only after a second, and it leaves nothing behind.
    """
    if quiet or not sys.stderr.isatty():
        yield
        return
    from nutdamp.common.work import watched

    shown: list[Status] = []

    def appear() -> None:
        from rich.console import Console

        shown.append(Console(stderr=True).status(_Doing(what, watch)))
        shown[0].start()

    with watched() as watch:
        timer = threading.Timer(PATIENCE, appear)
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
    """Text of ``what`` is under way, with the search that a ``watch`` sees and its progress when shown."""

    def __init__(self, what: str, watch: BudgetMonitor) -> None:
        self.what, self.watch = what, watch

    def __rich__(self) -> str:
        budget = self.watch.budget
        if budget is None:
            return self.what
        return f"{self.what}: {budget.what}, {100.0 * budget.share:.0f} % of the work that it may take"


class _ProgressLine:
    """Progress where there is no terminal: one line, once, that names the share done and the time left."""

    def __init__(self, what: str) -> None:
        self.what, self.began, self.said = what, time.monotonic(), False

    def update(self, done: int, total: int) -> None:
        passed = time.monotonic() - self.began
        if self.said or passed < LONG:
            return
        self.said = True
        left = passed * (total - done) / max(done, 1)
        rest = f", about {left:.0f} s left" if left > 0.0 else ""
        say(f"{self.what}: {min(done, total):,} of {total:,} done after {passed:.0f} s{rest}")

    def close(self) -> None:
        """Do nothing: there is no bar to clear."""


class _Bar:
    def __init__(self, what: str) -> None:
        self.what, self.began = what, time.monotonic()
        self.bar: Progress | None = None
        self.task: TaskID | None = None

    def update(self, done: int, total: int) -> None:
        passed = time.monotonic() - self.began
        if passed < PATIENCE:
            return
        if self.bar is None:
            self._open(total)
        assert self.bar is not None
        assert self.task is not None
        rate = done / passed
        self.bar.update(self.task, completed=done, rate=f"{rate:,.0f}/s" if rate >= 1.0 else "")

    def _open(self, total: int) -> None:
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
        self.task = self.bar.add_task(self.what, total=total, rate="")
        self.bar.start()

    def close(self) -> None:
        if self.bar is not None:
            self.bar.stop()
