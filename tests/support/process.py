"""What fixtures give: commands run here or apart, plans kept, and pages without pictures."""

import contextlib
import dataclasses
import io
import json
import math
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest

from nutdamp.cli.main import main
from nutdamp.common import work
from nutdamp.errors import NutdampError
from nutdamp.page import report
from nutdamp.page.document import Page, Prose
from nutdamp.planning import plan as planning
from nutdamp.planning.decision import Comparison
from nutdamp.schemes import catalogue, planner
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.schedule import Schedule

# --- running the command line: within this process, which is quick, or as a process of its own

Run = Callable[..., "subprocess.CompletedProcess[str]"]
"""``run("plan", "--json", "-", stdin=…, columns=80, status=0)`` of the fixtures."""

Status = int | tuple[int, ...] | None
"""The exit status that is right, or all of them; any where it is None."""


def environment(columns: int) -> dict[str, str]:
    """Environment of a command: a screen of ``columns`` without colours."""
    return {"COLUMNS": str(columns), "NO_COLOR": "1", "PYTHONUTF8": "1"}


def checked(
    ended: subprocess.CompletedProcess[str], status: Status
) -> subprocess.CompletedProcess[str]:
    """The command that has ended; fails where its status is not the right one."""
    right = status if isinstance(status, tuple) else (status,)
    assert status is None or ended.returncode in right, (ended.returncode, ended.stderr)
    return ended


def within(
    folder: Path,
    *arguments: str,
    stdin: str | None = None,
    columns: int = 80,
    status: Status = None,
) -> subprocess.CompletedProcess[str]:
    """Run the command line in this process, in ``folder``; a bug of nutdamp is raised."""
    out, err = (
        io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True) for _ in range(2)
    )
    given = io.TextIOWrapper(io.BytesIO((stdin or "").encode()), encoding="utf-8")
    handler = signal.getsignal(signal.SIGTERM)
    with (
        pytest.MonkeyPatch.context() as patch,
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        patch.setattr(sys, "argv", ["nutdamp", *arguments])
        patch.setattr(sys, "stdin", given)
        patch.chdir(folder)
        for name, value in environment(columns).items():
            patch.setenv(name, value)
        try:
            main()
        except SystemExit as leave:
            code = leave.code
        finally:
            signal.signal(signal.SIGTERM, handler)
    assert isinstance(code, int)
    # As a text stream of a process would give them.
    texts = [stream.buffer.getvalue().decode().replace("\r\n", "\n") for stream in (out, err)]
    return checked(subprocess.CompletedProcess(["nutdamp", *arguments], code, *texts), status)


def apart(
    folder: Path,
    *arguments: str,
    stdin: str | None = None,
    columns: int = 80,
    status: Status = None,
) -> subprocess.CompletedProcess[str]:
    """Run the command line as a process of its own in ``folder``."""
    ended = subprocess.run(
        [sys.executable, "-m", "nutdamp", *arguments],
        cwd=folder,
        env={**os.environ, **environment(columns)},
        input=stdin,
        capture_output=True,
        text=True,
        check=False,
    )
    return checked(ended, status)


# --- schedules kept from test to test: the same spacecraft has the same pulses

NOT_PLANNED_WITH = ("source", "dispersions", "with_disturbances")
"""Fields that no scheme reads: disturbances are taken from the body before a scheme sees it."""


class Planner:
    """`schemes.schedule`, which searches once for each scheme, body and options, and counts the
    work every time.

    What a budget of work has cut, or would cut, is planned anew, and so is a scheme whose module a
    test has changed.
    """

    def __init__(self) -> None:
        self.kept: dict[str, tuple[Schedule | NutdampError, float]] = {}
        self.calls = 0
        self.plain = planner.schedule

    def __call__(
        self, spacecraft: Spacecraft, name: str, options: planner.Choice = None
    ) -> planning.Plan:
        """The plan of a scheme, judged as `nutdamp.planning.plan.plan` does."""
        with patch.object(planner, "schedule", self.schedule):
            return planning.plan(spacecraft, name, options)

    def schedule(
        self, name: str, spacecraft: Spacecraft, options: planner.Choice = None
    ) -> Schedule:
        """As `schemes.schedule`."""
        self.calls += 1
        code = (
            id(import_module(catalogue.SCHEMES[name].module).schedule)
            if catalogue.SCHEMES[name].fires
            else 0
        )
        key = json.dumps([name, code, type(options).__name__, options, spacecraft], default=_plain)
        with work.budget("a schedule", math.inf) as spent:
            made, units = self.kept.get(key, (None, math.inf))
            if made is None or units >= spent.most:
                try:
                    made = self.plain(name, spacecraft, options)
                except NutdampError as reason:
                    made = reason
                if not spent.exhausted:
                    self.kept[key] = made, spent.done
            else:
                work.spend(units)
        if isinstance(made, NutdampError):
            raise made
        return made


def _plain(value: Any) -> Any:
    """What JSON does not know, in full precision: arrays as numbers, objects as fields."""
    if dataclasses.is_dataclass(value):
        names = [
            field.name for field in dataclasses.fields(value) if field.name not in NOT_PLANNED_WITH
        ]
        return {name: getattr(value, name) for name in names}
    return value.tolist() if hasattr(value, "tolist") else repr(value)


# --- pages of `report` for tests of their texts, without the pictures, which take most of the
# time


@contextmanager
def unpictured() -> Iterator[None]:
    """Pages are made without pictures."""

    def one(*_: object) -> Prose:
        return Prose("")

    with patch.multiple(
        report,
        moving_of=one,
        picture=one,
    ):
        yield


def plain_page(compared: Comparison, repeat: report.Repeat | None = None, **more: Any) -> Page:
    """The page of a comparison without pictures."""
    with unpictured():
        return report.report_page(compared, repeat or report.Repeat("", "", ""), **more)
