"""Output to the terminal: results on standard output, messages and progress on standard error, no
control characters.

Names of files, channels or units come from elsewhere; on a terminal their control characters could
clear the screen, change its title or pass for output of this program.
"""

from __future__ import annotations

import math
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from time import monotonic as clock
from typing import TYPE_CHECKING

import click

from nutdamp.errors import printable
from nutdamp.units import SI, screen_units

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderableType, RenderResult
    from rich.status import Status

    from nutdamp.common.work import Monitor
    from nutdamp.planning.decision import Comparison


NARROWEST = 20  # characters of a line at least


def visible(text: str) -> str:
    """`errors.printable` of each line of a text."""
    return text if text.isprintable() else "\n".join(printable(line) for line in text.split("\n"))


def say(text: str) -> None:
    """Print a message on standard error."""
    click.echo(visible(text), err=True)


def show(renderable: RenderableType) -> None:
    """Print a result on standard output;
    in a file or a pipe without the blanks that fill up lines.
    """
    shown = console()
    renderable = _Visible(renderable)
    if shown.is_terminal:
        shown.print(renderable)
        return
    with shown.capture() as captured:
        shown.print(renderable)
    click.echo("\n".join(line.rstrip() for line in captured.get().split("\n")), nl=False)


def console() -> Console:
    """Standard output as rich sees it, at least `NARROWEST` wide; no markup and no emoji."""
    import os
    import shutil

    from rich.console import Console

    requested = os.environ.get("COLUMNS", "")
    width = None
    if requested.isdigit() and int(requested) < NARROWEST:
        width = max(shutil.get_terminal_size().columns, NARROWEST)
    return Console(highlight=False, markup=False, emoji=False, soft_wrap=False, width=width)


class _Visible:
    """Something to print, with all its text made `visible`; the codes of colours stay."""

    def __init__(self, renderable: RenderableType) -> None:
        self.renderable = renderable

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        from rich.segment import Segment

        for text, style, control in console.render(self.renderable, options):
            yield Segment(text if control else visible(text), style, control)


UNITS = "nutdamp.units"  # key of ``--units`` in the context of a command line


QUIET = "nutdamp.quiet"  # key of ``--quiet`` in the context of a command line


@contextmanager
def look_of_screen() -> Iterator[None]:
    """Context of texts for people: the units of ``--units``, no notes with ``--quiet``."""
    from nutdamp.views.text import quietly

    context = click.get_current_context(silent=True)
    meta = {} if context is None else context.meta
    with screen_units(meta.get(UNITS, SI)), quietly(meta.get(QUIET, False)):
        yield


DEBUG = "nutdamp.debug"  # key of ``--debug`` in the context of a command line


def _debugging(ctx: click.Context, _: click.Parameter, value: bool) -> None:
    ctx.meta[DEBUG] = value


debug_option = click.option(
    "--debug",
    is_flag=True,
    expose_value=False,
    callback=_debugging,
    help="Show the traceback of an internal error.",
)


def show_failures(compared: Comparison) -> bool:
    """Name the schemes that have a bug, with ``--debug`` their tracebacks; True if any has."""
    for plan in compared.failed:
        if click.get_current_context().meta.get(DEBUG):
            import traceback

            say("".join(traceback.format_exception(plan.failure)).rstrip("\n"))
        say(f"nutdamp: {plan.scheme}: {plan.refusal} (--debug shows the traceback)")
    return bool(compared.failed)


PATIENCE = 1.0  # seconds that pass before progress is shown
BELIEVED = 0.1  # share of the steps that have to be done before a time left is named


@contextmanager
def working(what: str, *, quiet: bool = False) -> Iterator[None]:
    """Show ``what`` is under way, on a terminal, after `PATIENCE`; it leaves nothing behind."""
    if quiet or not sys.stderr.isatty():
        yield
        return
    from nutdamp.common.work import watched

    shown: list[Status] = []

    def appear() -> None:
        from rich.console import Console

        shown.append(Console(stderr=True).status(_Progress(what, watch, began, began)))
        shown[0].start()

    with watched() as watch:
        began = clock()
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


@dataclass
class _Progress:
    """Text of ``what`` has gone on since it ``began``, s: share of the steps done, time left, and
    the search that runs.

    The time left goes by the last step, ``share`` at ``moment``, from `BELIEVED` on; none where a
    step takes longer.
    """

    what: str
    watch: Monitor
    began: float
    moment: float
    share: float = 0.0

    def __rich__(self) -> str:
        task, search = self.watch.task, self.watch.budget
        text = self.what if search is None else f"{self.what}: {search.what}"
        if task is None:
            return text
        now = clock()
        if task.share != self.share:
            self.share = task.share
            self.moment = now
        text = f"{text}, {math.floor(100.0 * self.share)} % done"
        if not BELIEVED <= self.share < 1.0:
            return text
        remaining = (self.moment - self.began) / self.share - (now - self.began)
        words = (
            f"{math.ceil(remaining)} s"
            if remaining < 120.0
            else f"{math.ceil(remaining / 60.0)} min"
        )
        return f"{text}, about {words} left" if remaining > 0.0 else text
