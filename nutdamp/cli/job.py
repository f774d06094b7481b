"""A command from its spacecraft file to its results: input and output files, screen, progress, interruption.

No output file may take the place of an input, or of another output.
"""

from __future__ import annotations

import functools
import os
import signal
import stat
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import IO, TYPE_CHECKING, Any, NamedTuple, TypeAlias, TypeVar, cast

import click

from nutdamp.cli.options import FILE, NameType
from nutdamp.cli.screen import say, show
from nutdamp.common.work import BudgetMonitor, watched
from nutdamp.errors import Fault, FaultyFile, NutdampError, Unsuitable

if TYPE_CHECKING:
    from collections.abc import Hashable

    from matplotlib.figure import Figure
    from rich.console import RenderableType
    from rich.progress import Progress, TaskID
    from rich.status import Status

    from nutdamp.cli.options import Aim
    from nutdamp.errors import CannotWrite
    from nutdamp.files.overrides import Setting
    from nutdamp.spacecraft.model import Spacecraft


DEFAULT_FILE = "spacecraft.yaml"

FIGURES = ("overview", "motion", "sphere", "history", "timeline")
"""Pictures that ``--plot`` can draw, the default first."""

DISPERSIONS = """the spacecraft file has no dispersions: it does not say how far its values may be off. For example:

dispersions:
  A: {normal: 2 %}
  C: {normal: 2 %}
  omega0: {normal: 0.1 deg/s}
  thrust: {normal: 3 %}
  timing: {uniform: 5 ms}"""
"""Message for a file that should have dispersions."""

LOOP = """the spacecraft file has no loop: it names no sensor to fire by. For example:

loop:
  sensor: {kind: gyro, rate: 100 Hz, noise: 0.01 deg/s, delay: 20 ms}
  law: four-pulse
  start: 0.5 deg
  stop: 0.05 deg"""
"""Message for a file that should have a loop."""

Command = TypeVar("Command", bound=Callable[..., Any])

verbose_option = click.option("-v", "--verbose", is_flag=True, help="Show all values and notes.")
quiet_option = click.option("-q", "--quiet", is_flag=True, help="No remarks on standard error.")


class FileInput(NamedTuple):
    """The spacecraft that a command line names: the ``path`` of a file, and the changes of ``--set``."""

    path: str | None
    settings: tuple[Setting, ...] = ()


def _settings(ctx: click.Context, param: click.Parameter, texts: tuple[str, ...]) -> tuple[Setting, ...]:
    if not texts:
        return ()
    from nutdamp.files.overrides import parse_setting

    try:
        return tuple(parse_setting(text) for text in texts)
    except ValueError as wrong:
        raise click.BadParameter(str(wrong), ctx, param) from None


set_option = click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="KEY=VALUE",
    callback=_settings,
    help="Change a key: limits.gap=1s; repeatable.",
)


def spacecraft_argument(command: Command) -> Command:
    """The spacecraft file and ``--set``, gathered into ``spacecraft`` (`FileInput`) for `job.begin`."""

    @functools.wraps(command)
    def gathered(*args: Any, spacecraft: str | None, settings: tuple[Setting, ...], **parameters: Any) -> Any:
        given = FileInput(spacecraft, settings)
        try:
            return command(*args, spacecraft=given, **parameters)
        except Unsuitable as wrong:
            raise placed(wrong, given) from None

    argument = click.argument("spacecraft", required=False, type=FILE, metavar="[SPACECRAFT]")
    return cast(Command, argument(set_option(gathered)))


def placed(wrong: Unsuitable, given: FileInput) -> NutdampError:
    """The error as a fault with the place of the value in the spacecraft file, where it comes from one."""
    if given.path == "-" or any(wrong.where[:1] == setting.path[:1] for setting in given.settings):
        return wrong
    from nutdamp.files.yaml import dotted, read_tree

    text, name = source(given.path, lambda _: None)
    place = read_tree(text, name)[0].place_of(wrong.where)
    return FaultyFile([Fault(name, place.line, place.column, dotted(wrong.where), wrong.problem)])


def plot_options(names: tuple[str, ...]) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """``--plot FILE`` and the choice of the picture among ``names``, the default first."""
    which = click.option(
        "--figure", type=NameType(names), default=names[0], show_default=True, help="What --plot draws."
    )
    where = click.option("--plot", type=FILE, help="Draw it (.png, .svg, .pdf; needs extra plot).")
    return lambda command: where(which(command))


def parsed(
    text: tuple[str, str],
    settings: tuple[Setting, ...],
    remark: Callable[[str], None],
    aim: Aim | None = None,
    doubts: list[Fault] | None = None,
) -> Spacecraft:
    """The spacecraft in the text of `source`; ``aim`` replaces its goal, warnings are added to ``doubts``."""
    from nutdamp.files.reader import read_spacecraft

    def warn(doubt: Fault) -> None:
        say(doubt.as_warning)
        if doubts is not None:
            doubts.append(doubt)

    body = read_spacecraft(*text, settings, warn)
    return body if aim is None else aim.applied(body, remark)


def source(path: str | None, remark: Callable[[str], None]) -> tuple[str, str]:
    """The text of the spacecraft file that `load` reads, and its name."""
    from pathlib import Path

    from nutdamp.files.reader import example_text
    from nutdamp.files.yaml import read_text

    if path is None and Path(DEFAULT_FILE).exists():
        remark(f"reading {DEFAULT_FILE}")
        path = DEFAULT_FILE
    if path is not None:
        return read_text(Path(path)), path
    remark("no spacecraft file named, and no spacecraft.yaml here: using the built-in example (see `nutdamp init`)")
    return example_text(), "example.yaml"


def require_dispersions(body: Spacecraft) -> None:
    """Raise BadRequest, with an example to write, for a spacecraft without dispersions."""
    from nutdamp.errors import BadRequest

    if body.dispersions is None:
        raise BadRequest(DISPERSIONS)


def require_loop(body: Spacecraft) -> None:
    """Raise BadRequest, with an example to write, for a spacecraft without a closed loop."""
    from nutdamp.errors import BadRequest

    if body.loop is None:
        raise BadRequest(LOOP)


PATIENCE = 1.0
"""Seconds that pass before a bar appears."""

LONG = 10.0
"""Seconds after which a line gives the progress, where standard error is no terminal."""


@contextmanager
def progress(what: str, total: int, *, quiet: bool = False) -> Iterator[Callable[[int], None]]:
    """A function to be called now and then with the number done of ``total``.

    It shows a bar with rate and time left on standard error: on a terminal, only after a second, and it leaves nothing
    behind. Elsewhere one line says how far it is, after `LONG`.
    """
    shown = _Bar(what, total) if sys.stderr.isatty() else _ProgressLine(what, total)
    try:
        yield (lambda _: None) if quiet else shown.update
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
        """Do nothing: there is no bar to clear."""


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


class Interruption:
    """Request to stop a run, and the signal that made it."""

    number: int | None = None

    def __call__(self) -> bool:
        """True where a stop was requested."""
        return self.number is not None


@contextmanager
def stoppable() -> Iterator[Interruption]:
    """An `Interruption` set by Ctrl-C or SIGTERM, so that a run can end in order.

    A second Ctrl-C interrupts at once.
    """
    stop = Interruption()

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


STANDARD = "-"
"""File name that means standard input or standard output."""


def expect_outputs(*read: FileInput | str | None, **written: str | Sequence[str] | None) -> bool:
    """True where an output file is standard output, so that nothing else may go there.

    A usage error where an output, given by its option, is one of the files ``read`` or another output, under whatever
    name: relative, or through links.
    """
    outputs = [
        (f"--{option}", path)
        for option, paths in written.items()
        for path in ([paths] if isinstance(paths, str) else paths or ())
    ]
    standard = [option for option, path in outputs if path == STANDARD]
    if len(standard) > 1:
        raise click.UsageError(f"{' and '.join(standard)} cannot both go to standard output")
    taken: dict[Hashable, str] = {}
    if not standard:
        taken[_identity(STANDARD, 1)] = "standard output goes to this file"
    for given in read:
        path = _path_of(given)
        if path is not None:
            taken[_identity(path, 0)] = "this command reads this file"
    for option, path in outputs:
        identity = _identity(path, 1)
        if identity is not None and identity in taken:
            raise click.UsageError(f"{option} {path}: {taken[identity]}; name another")
        taken[identity] = f"{option} goes to this file"
    return bool(standard)


def _path_of(given: FileInput | str | None) -> str | None:
    """The file that is read, if any."""
    if not isinstance(given, FileInput):
        return given
    return DEFAULT_FILE if given.path is None and Path(DEFAULT_FILE).exists() else given.path


def _identity(path: str, standard: int) -> Hashable:
    """Identity of a file among all others; None for a terminal, /dev/null and the like.

    ``standard`` is the descriptor that ``-`` means.
    """
    try:
        status = os.fstat(standard) if path == STANDARD else Path(path).stat()
    except OSError:
        return None if path == STANDARD else os.path.realpath(path)
    return (status.st_dev, status.st_ino) if stat.S_ISREG(status.st_mode) else None


File: TypeAlias = "str | bytes | Callable[[IO[bytes]], object]"
"""Content that `write_whole` takes."""

Output = tuple[str | None, Callable[[], "File | dict[str, Any] | Figure"]]
"""Path of a file to write, if one is requested, and the function of its content: dict for JSON, figure, or text."""


UNDER_WAY = "nutdamp.cli.job"
"""Key of the JSON file and the spacecraft of the job that has begun, in the context of a command line."""


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
    given: FileInput,
    *read: str | None,
    aim: Aim | None = None,
    quiet: bool = False,
    figure: str = FIGURES[0],
    **written: str | Sequence[str] | None,
) -> Job:
    """Check the files of a command line and load its spacecraft, before any work.

    ``read``: further files to read; ``written``: by option, the files to write; ``plot`` is a picture, the ``figure``.
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
    """Write the JSON file of the job that has begun, if any: nothing is feasible, and the reason."""
    if UNDER_WAY not in context.meta:
        return
    from nutdamp.views.plan_json import infeasible_json

    path, spacecraft = context.meta[UNDER_WAY]
    deliver([(path, lambda: infeasible_json(spacecraft, str(reason)))])


def expect_picture(path: str | None, figure: str = FIGURES[0]) -> None:
    """Refuse a picture that cannot be made before the work; a usage error for a ``figure`` without file."""
    if path is None:
        if figure != FIGURES[0]:
            raise click.UsageError("--figure says what --plot draws: name a file with --plot")
        return
    from nutdamp.figures import image

    image.ending(path)


def remarks(quiet: bool) -> Callable[[str], None]:
    """Print remarks on standard error, unless ``quiet``."""
    return (lambda _: None) if quiet else say


def expect_places(*paths: str) -> None:
    """Refuse at once, not after the work, a file that cannot be written at its place."""
    from nutdamp.files.tabular import check_place

    for path in paths:
        check_place(path)


def deliver(
    outputs: Sequence[Output], *screens: Callable[[], RenderableType], unsaved: Sequence[CannotWrite] = ()
) -> None:
    """Write the files requested, and show results on standard output.

    A file that cannot be saved keeps back neither the others nor the results: it is reported at the end, together
    with those that are ``unsaved`` already. Raises CannotWrite.
    """
    failures = list(unsaved)
    # All content is made before any file is written, so that a failure leaves no file behind.
    contents = [(path, _file_of(make(), path)) for path, make in outputs if path is not None]
    results = [make() for make in screens]
    if contents:
        from nutdamp.errors import CannotWrite
        from nutdamp.files.tabular import write_whole

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
        from nutdamp.files.tabular import json_text

        return json_text(content)
    if isinstance(content, str | bytes) or callable(content):
        return content
    from nutdamp.figures.image import rendered

    return rendered(content, path)
