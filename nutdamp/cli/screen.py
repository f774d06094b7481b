"""Output to the terminal: results on standard output, messages on standard error, no control characters in either.

Names of files, channels or units come from elsewhere; on a terminal their control characters could clear the screen,
change its title or pass for output of this program.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from nutdamp.errors import printable

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderableType, RenderResult

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
