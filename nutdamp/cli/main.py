"""The ``nutdamp`` command: its subcommands, loaded when used, and errors as messages and exit
statuses.

No other module turns errors into exit statuses; a bug keeps its traceback.
"""

from __future__ import annotations

import gc
import io
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

import click

from nutdamp import __version__
from nutdamp.cli.screen import say
from nutdamp.errors import Infeasible, nearest

if TYPE_CHECKING:
    from nutdamp.planning.verdict import Status

DONE = 0
UNREADABLE = 1
INTERNAL = 1
BAD_INPUT = 2
INFEASIBLE = 3
REQUIREMENT_MISSED = 4
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
    except Exception as wrong:
        status = _explain(wrong)
    sys.exit(status if isinstance(status, int) else DONE)


def leave(judged: Status | None = None, *, failed: bool = False, infeasible: bool = False) -> None:
    """End with the first exit status that holds: a bug, no result, or what a verdict says."""
    status = 0 if judged is None else judged.exit_status
    if failed or infeasible or status:
        sys.exit(INTERNAL if failed else INFEASIBLE if infeasible else status)


class Interruption:
    """Request to stop a run, and the signal that made it."""

    number: int | None = None

    def __call__(self) -> bool:
        """True where a stop was requested."""
        return self.number is not None


@contextmanager
def stoppable() -> Iterator[Interruption]:
    """An `Interruption` by Ctrl-C or SIGTERM ends a run in order; a second Ctrl-C at once."""
    stop = Interruption()

    def ask(number: int, _: FrameType | None) -> None:
        if stop() and number == signal.SIGINT:
            raise KeyboardInterrupt
        stop.number = number

    before = {number: signal.signal(number, ask) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stop
    except KeyboardInterrupt:
        raise Terminated() if stop.number == signal.SIGTERM else KeyboardInterrupt from None
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _terminate(number: int, frame: FrameType | None) -> None:  # noqa: ARG001 - signature of handlers
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # a second one would interrupt the clearing up
    raise Terminated


def _silence_stdout() -> None:
    """Discard text still buffered for standard output: Python would stumble over it at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def tell(wrong: Exception) -> None:
    """Print an error on standard error, behind the name of its file or of the program."""
    from nutdamp.errors import FaultyFile

    say(str(wrong) if isinstance(wrong, FaultyFile) else f"nutdamp: {wrong}")


def _explain(wrong: Exception) -> int:
    """Print an error that the user can cure, and return its exit status; a bug is raised again."""
    from nutdamp.errors import BadRequest, FaultyFile, NutdampError

    if not isinstance(wrong, NutdampError):
        raise wrong
    tell(wrong)
    if isinstance(wrong, Infeasible):
        return INFEASIBLE
    return BAD_INPUT if isinstance(wrong, BadRequest | FaultyFile) else UNREADABLE


# the subcommands in the order of a first use, with their modules and their lines on the help page
COMMANDS = {
    "plan": ("plan", "Plan pulse schedules that damp the nutation, and compare them."),
    "simulate": ("plan", "Propagate a scheme or a schedule; cone angles and axis track."),
    "trade": ("studies", "Trade finish time against propellant."),
    "loop": ("studies", "Fire from a gyro or an accelerometer, in a closed loop."),
    "budget": ("studies", "Hold the nutation: pulses a day, propellant a year."),
    "fit": ("studies", "Estimate motion, C/A and thrust from telemetry; re-plan."),
    "disperse": ("studies", "Fly many dispersed cases; percentiles, tolerance budget."),
    "verify": ("files", "Fly a schedule by independent means; an error budget."),
    "report": ("files", "Write a report, one page of HTML."),
    "animate": ("plan", "Film the body cone rolling on the space cone."),
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
            close = nearest(name, COMMANDS)
            ctx.fail(
                f"there is no command {name!r}" + (f"; did you mean {close!r}?" if close else "")
            )
        return super().resolve_command(ctx, args)

    def invoke(self, ctx: click.Context) -> object:
        """Run the command; where nothing is feasible its JSON file says so all the same."""
        try:
            return super().invoke(ctx)
        except Infeasible as reason:
            from nutdamp.cli.job import write_infeasible

            write_infeasible(ctx, reason)
            raise

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
