"""How a command begins and ends: its files checked and its spacecraft read; its results written and shown."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import IO, TYPE_CHECKING, Any, NamedTuple, TypeAlias

import click

from nutdamp.cli.common import FIGURES, Input, parsed, source
from nutdamp.cli.places import expect_outputs
from nutdamp.cli.screen import say, show

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import RenderableType

    from nutdamp.cli.scheme_options import Aim
    from nutdamp.errors import CannotWrite
    from nutdamp.spacecraft import Spacecraft

File: TypeAlias = "str | bytes | Callable[[IO[bytes]], object]"
"""What `write_whole` takes."""

Output = tuple[str | None, Callable[[], "File | dict[str, Any] | Figure"]]
"""Path of a file to write, if one is requested, and what makes its content: a dict is for JSON, a figure a picture."""


UNDER_WAY = "nutdamp.cli.job"
"""Where the context of a command line keeps the JSON file and the spacecraft of the job that has begun."""


class Job(NamedTuple):
    """The spacecraft that a command works on, text and name of its file; where remarks go; ``silent``: no screens."""

    spacecraft: Spacecraft
    source: tuple[str, str]
    remark: Callable[[str], None]
    silent: bool
    quiet: bool

    def warn(self, warnings: Iterable[str]) -> None:
        """Print warnings about results on standard error, unless quiet."""
        for warning in warnings:
            self.remark(f"warning: {warning}")

    def doubt(self, warnings: Iterable[str]) -> None:
        """Print warnings about the data on standard error, quiet or not."""
        for warning in warnings:
            say(f"warning: {warning}")

    def deliver(
        self,
        outputs: Sequence[Output],
        *screens: Callable[[], RenderableType],
        unsaved: Sequence[CannotWrite] = (),
    ) -> None:
        """`deliver`, without the screens where a file goes to standard output."""
        deliver(outputs, *screens * (not self.silent), unsaved=unsaved)


def begin(
    given: Input,
    *read: str | None,
    aim: Aim | None = None,
    quiet: bool = False,
    figure: str = FIGURES[0],
    **written: str | Sequence[str] | None,
) -> Job:
    """Check the files of a command line and load its spacecraft, before any work.

    ``read``: what is read besides; ``written``: by option, the files to write; ``plot`` is a picture, the ``figure``.
    Raises as `expect_outputs`, `expect_picture`, `parsed` and `expect_places` do.
    """
    silent = expect_outputs(given, *read, **written)
    plot = written.get("plot")
    expect_picture(plot if isinstance(plot, str) else None, figure)
    remark = remarks(quiet)
    text = source(given.path, remark)
    spacecraft = parsed(text, given.settings, remark, aim)
    expect_places(*(path for path in written.values() if isinstance(path, str)))
    context = click.get_current_context(silent=True)
    if context is not None and isinstance(written.get("json"), str):
        context.meta[UNDER_WAY] = written["json"], spacecraft
    return Job(spacecraft, text, remark, silent, quiet)


def write_infeasible(context: click.Context, reason: Exception) -> None:
    """Write the JSON file of the job that has begun, if there is one: that nothing is feasible, and why."""
    if UNDER_WAY not in context.meta:
        return
    from nutdamp.files.plan_json import infeasible_json

    path, spacecraft = context.meta[UNDER_WAY]
    deliver([(path, lambda: infeasible_json(spacecraft, str(reason)))])


def expect_picture(path: str | None, figure: str = FIGURES[0]) -> None:
    """Say at once, not after the work, that a picture cannot be made; a usage error for a ``figure`` without file."""
    if path is None:
        if figure != FIGURES[0]:
            raise click.UsageError("--figure says what --plot draws: name a file with --plot")
        return
    from nutdamp.presentation import figures

    figures.ending(path)


def remarks(quiet: bool) -> Callable[[str], None]:
    """Prints remarks on standard error, unless ``quiet``."""
    return (lambda _: None) if quiet else say


def expect_places(*paths: str) -> None:
    """Say at once, not after the work, that a file cannot be written where it is to be."""
    from nutdamp.files.output import check_place

    for path in paths:
        check_place(path)


def deliver(
    outputs: Sequence[Output], *screens: Callable[[], RenderableType], unsaved: Sequence[CannotWrite] = ()
) -> None:
    """Write the files requested, and show results on standard output.

    A file that cannot be saved keeps back neither the others nor the results: it is said at the end, together with
    those that are ``unsaved`` already. Raises CannotWrite.
    """
    failures = list(unsaved)
    # All is made before anything is written: what cannot be made leaves nothing behind.
    contents = [(path, _file_of(make(), path)) for path, make in outputs if path is not None]
    results = [make() for make in screens]
    if contents:
        from nutdamp.errors import CannotWrite
        from nutdamp.files.output import write_whole

        for path, content in contents:
            try:
                write_whole(path, content)
            except CannotWrite as wrong:
                failures.append(wrong)
    for result in results:
        show(result)
    for failure in failures[:-1]:
        say(f"nutdamp: {failure}")
    if failures:
        raise failures[-1]


def _file_of(content: File | dict[str, Any] | Figure, path: str) -> File:
    if isinstance(content, dict):
        from nutdamp.files.output import json_text

        return json_text(content)
    if isinstance(content, str | bytes) or callable(content):
        return content
    from nutdamp.presentation.figures import rendered

    return rendered(content, path)
