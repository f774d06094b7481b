"""The ``nutdamp`` command: subcommands, loaded when used, what it prints, errors as messages and
exit statuses.

No other module turns errors into exit statuses; a bug keeps its traceback. Results go to standard
output, messages and progress to standard error, none with control characters: names of files,
channels or units come from elsewhere; on a terminal their control characters could clear the
screen, change its title or pass for output of this program.
"""

from __future__ import annotations

import gc
import io
import math
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from time import monotonic as clock
from types import FrameType
from typing import TYPE_CHECKING, TypeVar

import click

from nutdamp import __version__
from nutdamp.errors import (
    BadRequest,
    FaultyFile,
    Infeasible,
    NutdampError,
    cure_of,
    printable,
)
from nutdamp.units import SI, screen_units

if TYPE_CHECKING:
    from rich import status
    from rich.console import Console, ConsoleOptions, RenderableType, RenderResult

    from nutdamp.common.work import Monitor
    from nutdamp.planning.decision import Comparison
    from nutdamp.planning.verdict import Status

Value = TypeVar("Value")

DONE = 0
UNREADABLE = 1
INTERNAL = 1
BAD_INPUT = 2
INFEASIBLE = 3
INTERRUPTED = 128 + signal.SIGINT
TERMINATED = 128 + signal.SIGTERM


class Terminated(BaseException):
    """SIGTERM came: the run ends in order, so that no temporary file stays behind."""


def run(group: click.Group) -> None:
    """Run ``group`` on the arguments of the process and leave with its exit status."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # without streams (`>&-`)
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115 - until the end
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # what the encoding lacks becomes ?
    if signal.getsignal(signal.SIGTERM) == signal.SIG_DFL:
        signal.signal(signal.SIGTERM, _terminate)
    try:
        status = group.main(standalone_mode=False)
        sys.stdout.flush()
    except click.exceptions.Exit as leave:
        status = leave.exit_code
    except click.ClickException as wrong:
        message = io.StringIO()
        wrong.show(file=message)
        say(
            message.getvalue().expandtabs(2).rstrip("\n")
        )  # a tab would be shown as a control character
        status = BAD_INPUT
    except (click.Abort, KeyboardInterrupt):
        say("interrupted")
        status = INTERRUPTED
    except Terminated:
        say("terminated")
        status = TERMINATED
    except BrokenPipeError:
        # The reader of our output has left (`| head`): nothing more to say, and nothing to flush at
        # exit.
        _silence_stdout()
        status = UNREADABLE
    except OSError as wrong:
        # Files name themselves and become CannotRead or CannotWrite; an error without a name is of
        # standard output.
        if wrong.filename is not None:
            raise
        _silence_stdout()
        say(f"nutdamp: cannot write standard output: {wrong.strerror or wrong}")
        status = UNREADABLE
    except NutdampError as wrong:
        tell(wrong)
        refused = BAD_INPUT if isinstance(wrong, BadRequest | FaultyFile) else UNREADABLE
        status = INFEASIBLE if isinstance(wrong, Infeasible) else refused
    sys.exit(status if isinstance(status, int) else DONE)


def leave(judged: Status | None = None, *, failed: bool = False, infeasible: bool = False) -> None:
    """End with the first exit status that holds: a bug, no result, or what a verdict says."""
    status = 0 if judged is None else judged.exit_status
    if failed or infeasible or status:
        sys.exit(INTERNAL if failed else INFEASIBLE if infeasible else status)


def _terminate(number: int, frame: FrameType | None) -> None:  # noqa: ARG001 - signature of handlers
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # a second one would interrupt the clearing up
    raise Terminated


def _silence_stdout() -> None:
    """Discard text still buffered for standard output: Python would stumble over it at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def tell(wrong: Exception) -> None:
    """Print an error on standard error, behind the name of its file or of the program."""
    say(str(wrong) if isinstance(wrong, FaultyFile) else f"nutdamp: {wrong}")


# --- what is printed

NARROWEST = 20  # characters of a line at least


def visible(text: str) -> str:
    """`errors.printable` of each line of a text."""
    return text if text.isprintable() else "\n".join(printable(line) for line in text.split("\n"))


def say(text: str) -> None:
    """Print a message on standard error."""
    click.echo(visible(text), err=True)


def wrapped(text: str) -> str:
    """A text in lines of the width of the screen, broken between words."""
    from rich.text import Text

    return "\n".join(line.plain.rstrip() for line in Text(text).wrap(console(), console().width))


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


# keys of options in the context of a command line
UNITS = "nutdamp.units"
QUIET, SPACECRAFT = "nutdamp.quiet", "nutdamp.spacecraft"
DEBUG = "nutdamp.debug"


def in_context(key: str) -> Callable[[click.Context, click.Parameter, Value], Value]:
    """Callback of an option that puts its value into the context too, behind ``key``."""

    def callback(ctx: click.Context, _: click.Parameter, value: Value) -> Value:
        ctx.meta[key] = value
        return value

    return callback


@contextmanager
def look_of_screen() -> Iterator[None]:
    """Context of texts for people: the units of ``--units``, no notes with ``--quiet``, and the
    spacecraft file in next steps.
    """
    from nutdamp.views.text import screens_of

    context = click.get_current_context(silent=True)
    meta = {} if context is None else context.meta
    screens = screens_of(meta.get(SPACECRAFT, ""), hidden=meta.get(QUIET, False))
    with screen_units(meta.get(UNITS, SI)), screens:
        yield


debug_option = click.option(
    "--debug",
    hidden=True,  # named where it helps: beside an internal error
    is_flag=True,
    expose_value=False,
    callback=in_context(DEBUG),
    help="Show the traceback of an internal error.",
)


def show_failures(compared: Comparison) -> bool:
    """Name the schemes that have a bug, with ``--debug`` their tracebacks; True if any has."""
    for plan in compared.failed:
        if click.get_current_context().meta.get(DEBUG):
            import traceback

            say("".join(traceback.format_exception(plan._failure)).rstrip("\n"))
        say(f"nutdamp: {plan.scheme}: {plan.why} (--debug shows the traceback)")
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

    shown: list[status.Status] = []

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
            for shown_status in shown:
                shown_status.stop()


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


# --- the subcommands

# the subcommands in the order of a first use, with their modules and their lines on the help page
COMMANDS = {
    "plan": ("plan", "Plan pulse schedules that damp the nutation, and compare them."),
    "simulate": ("studies", "Propagate a scheme or a schedule; cone angles and axis track."),
    "trade": ("studies", "Trade finish time against propellant."),
    "loop": ("studies", "Fire from a gyro or an accelerometer, in a closed loop."),
    "budget": ("studies", "Hold the nutation: pulses a day, propellant a year."),
    "fit": ("studies", "Estimate motion, C/A and thrust from telemetry; re-plan."),
    "disperse": ("studies", "Fly many dispersed cases; percentiles, tolerance budget."),
    "verify": ("files", "Fly a schedule by independent means; an error budget."),
    "report": ("files", "Write a report, one page of HTML."),
    "animate": ("studies", "Film the body cone rolling on the space cone."),
    "check": ("files", "Check spacecraft files: all faults, derived quantities."),
    "export": ("files", "A schedule for other tools: CCSDS, STK, Basilisk, JSON."),
    "import": ("files", "A spacecraft file from a CCSDS attitude parameter message."),
    "explain": ("files", "The schemes, the equations, the keys of the file, the units."),
    "init": ("files", "Write a commented spacecraft file to start from."),
    "schema": ("files", "JSON Schema of the spacecraft file, for editors."),
}


class _CommandGroup(click.Group):
    """Group whose subcommands are loaded when they are used, and listed in their order."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002 - signature of click
        return list(COMMANDS)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        with formatter.section("Commands"):
            formatter.write_dl([(name, line) for name, (_, line) in COMMANDS.items()])

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The command that is named; a usage error suggests the nearest name."""
        name = args[0]
        if name not in COMMANDS and not name.startswith("-"):
            cure = cure_of(name, COMMANDS, "`nutdamp -h` lists them")
            ctx.fail(f"there is no command {name!r}; {cure}")
        return super().resolve_command(ctx, args)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002
        if cmd_name not in COMMANDS:
            return None
        module = import_module(f"nutdamp.cli.{COMMANDS[cmd_name][0]}")
        command: click.Command = getattr(module, f"{cmd_name}_command")
        return command


@click.command(
    cls=_CommandGroup,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog=(
        "Exit status: 0 done; 1 could not read or write; 2 bad command line or bad file; "
        "3 no plan is feasible; 4 the plan is not shown to meet the requirement, "
        "or cannot be commanded; 130 interrupted; 143 terminated."
    ),
)
@click.version_option(__version__, prog_name="nutdamp")
def group() -> None:
    """Plan which thruster of a nutating spinner to fire, when and for how long.

    Begin with `nutdamp plan`: it plans the built-in example. `nutdamp init` writes a commented
    spacecraft file to start from.
    """


# new objects between two searches for cycles: loading modules makes many, and little garbage
RARELY = 100_000


def main() -> None:
    """Entry point: run the command line and leave with its exit status."""
    gc.set_threshold(RARELY)
    # Read when numpy is loaded. Matrices are small here, so that threads within their products cost
    # more than they save; dispersed cases have threads of their own.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    run(group)
