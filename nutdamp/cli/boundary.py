"""The one place that turns errors into messages and exit statuses; a real bug keeps its traceback."""

from __future__ import annotations

import io
import os
import signal
import sys
from pathlib import Path
from types import FrameType

import click

from nutdamp.cli.screen import say

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
    _open_streams()
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
        say(message.getvalue().expandtabs(2).rstrip("\n"))  # a tab would be shown as what steers a terminal
        status = BAD_INPUT
    except (click.Abort, KeyboardInterrupt):
        say("interrupted")
        status = INTERRUPTED
    except Terminated:
        say("terminated")
        status = TERMINATED
    except BrokenPipeError:
        # The reader of our output has left (`| head`): nothing more to say, and nothing to flush at exit.
        _silence_stdout()
        status = UNREADABLE
    except OSError as wrong:
        # Files name themselves and become CannotRead or CannotWrite; what has no name is standard output.
        if wrong.filename is not None:
            raise
        _silence_stdout()
        say(f"nutdamp: cannot write standard output: {wrong.strerror or wrong}")
        status = UNREADABLE
    except Exception as wrong:
        status = _explain(wrong)
    sys.exit(status if isinstance(status, int) else DONE)


def leave(*, failed: bool = False, infeasible: bool = False, missed: bool = False) -> None:
    """End with the exit status of the first that holds, if any.

    ``failed``: something has a bug or disagrees; ``infeasible``: there is no result; ``missed``: the requirement is.
    """
    for holds, status in ((failed, INTERNAL), (infeasible, INFEASIBLE), (missed, REQUIREMENT_MISSED)):
        if holds:
            sys.exit(status)


def interruption(number: int) -> BaseException:
    """What ends a run after a signal."""
    return Terminated() if number == signal.SIGTERM else KeyboardInterrupt()


def _terminate(number: int, frame: FrameType | None) -> None:  # noqa: ARG001 - signature of handlers
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # a second one would interrupt the clearing up
    raise Terminated


def _open_streams() -> None:
    """See that everything can be printed.

    A process that was started without standard output or error (`>&-`) gets some that lead nowhere; where the screen's
    encoding lacks a character, such as ω in Latin-1, it becomes a question mark.
    """
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115 - until the end
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")


def _silence_stdout() -> None:
    """Let what is still buffered for standard output go nowhere, so that Python does not stumble over it at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def tell(wrong: Exception) -> None:
    """Say on standard error what is wrong; faults of a file begin with its name, all else with that of the program."""
    from nutdamp.errors import FaultyFile

    say(str(wrong) if isinstance(wrong, FaultyFile) else f"nutdamp: {wrong}")


def _explain(wrong: Exception) -> int:
    """Say on standard error what the user can cure, and give its exit status; a bug is raised again."""
    from nutdamp import errors  # here, because a run without errors need not load it

    statuses: dict[type[errors.NutdampError], int] = {
        errors.CannotRead: UNREADABLE,
        errors.CannotWrite: UNREADABLE,
        errors.MissingExtra: UNREADABLE,
        errors.BadRequest: BAD_INPUT,
        errors.FaultyFile: BAD_INPUT,
        errors.Infeasible: INFEASIBLE,
    }
    if not isinstance(wrong, errors.NutdampError):
        raise wrong
    tell(wrong)
    return next(status for kind, status in statuses.items() if isinstance(wrong, kind))
