"""Narrow screens, where each row of a table is a block and no digit is lost; progress of long runs, how they stop."""

from __future__ import annotations

import io
import os
import re
import signal
import sys
from collections import Counter
from collections.abc import Callable
from functools import partial
from types import SimpleNamespace
from typing import Any, NamedTuple

import pytest
from rich.console import Console
from rich.table import Table
from support import places
from support.cases import spread
from support.commands import call
from support.process import Run

from nutdamp.cli import screen
from nutdamp.cli.main import stoppable
from nutdamp.cli.screen import working
from nutdamp.common import work
from nutdamp.views.tables import NARROW, columns

pytestmark = pytest.mark.usefixtures("plans_shared")

STAGE, STEERED = places.CONFIGS / "upper-stage.yaml", places.CONFIGS / "steerable-stage.yaml"
COMMANDS = [
    "plan",
    "simulate --scheme two-pulse",
    "check",
    "verify --scheme two-pulse -v",
    "disperse --scheme two-pulse --samples 1e3 --worst 2 -v",
    "trade --points 2 -v",
    f"loop {STAGE} --until 400s",
    f"budget {STAGE} --thresholds 0.5deg,0.1deg --thresholds 1deg,0.1deg",
]


def numbers(text: str) -> Counter[str]:
    """Every number of a screen, with a unit of its own line or not."""
    return Counter(re.findall(r"-?[0-9]+(?:\.[0-9]+)?(?:e-?[0-9]+)?", text))


@pytest.mark.weekly
@spread("command", COMMANDS, quick=2, deep=2, ids=lambda command: command.split()[0])
def test_no_digit_is_lost_on_a_narrow_screen(run: Run, command: str) -> None:
    """Headings stand in every block, so that a number may come more often, but none less often."""
    wide = call(run, f"{command} -q", columns=300)
    for width in (25, 59, 60, 80):
        narrow = call(run, f"{command} -q", columns=width)
        assert narrow.returncode == wide.returncode
        assert "…" not in narrow.stdout
        assert numbers(narrow.stdout) >= numbers(wide.stdout)
        assert max(map(len, narrow.stdout.splitlines())) <= width


@spread("name", sorted(path.stem for path in places.CONFIGS.glob("*.yaml")), quick=2, deep=20)
def test_default_screens_are_short_and_cut_nothing(run: Run, name: str) -> None:
    """Headline, requirement, one table, notes, next steps: 40 lines of 80 columns; a row of the table is one line."""
    commands = ["check", "simulate --samples 100", "simulate --scheme none --samples 100"]
    text = (places.CONFIGS / f"{name}.yaml").read_text(encoding="utf-8")
    commands += ["loop"] * ("\nloop:" in text) + ["budget"] * ("\nloop:" in text and "\ndissipation:" in text)
    for command in commands:
        usual, wide = (call(run, f"{command} {places.CONFIGS}/{name}.yaml", columns=width) for width in (80, 200))
        assert usual.returncode in (0, 4), usual.stderr
        lines = usual.stdout.splitlines()
        assert len(lines) <= 40
        assert max(map(len, lines)) <= 80
        assert lines[-1].startswith("-v all values")
        assert sum(line.startswith("note[") for line in lines) <= 3
        (table, *_), (whole, *_) = (tables(ended.stdout) for ended in (usual, wide))
        assert [row.split() for row in table] == [row.split() for row in whole]


def tables(shown: str) -> list[list[str]]:
    """Rows of the table of a screen, without its headings."""
    parts = (part.splitlines() for part in shown.split("\n\n")[1:2])
    return [[line for line in part if re.search("[0-9]", line)] for part in parts] or [[]]


def test_a_width_into_which_nothing_fits_hides_nothing(run: Run) -> None:
    """COLUMNS=0 printed nothing, with exit status 0."""
    none, one, seven, usual = (call(run, "plan -v -q --scheme two-pulse", columns=width) for width in (0, 1, 7, 80))
    assert none.stdout == usual.stdout
    for ended in (one, seven):
        assert ended.returncode == 0
        assert "FLY two-pulse:" in ended.stdout


def rendered(table: Table, width: int) -> list[str]:
    console = Console(width=width, color_system=None)
    with console.capture() as captured:
        console.print(table)
    return [line.rstrip() for line in captured.get().splitlines()]


def test_a_row_becomes_a_block_on_a_narrow_screen_or_where_it_does_not_fit() -> None:
    table = columns("pulse\n", "start\ns", "channel\n", text=("channel\n",))
    table.add_row("1", "0.2917", "-M1")
    table.add_row("", "12.5", "")
    lines = ["pulse   start  channel", "            s", "1      0.2917  -M1", "         12.5"]
    assert rendered(table, NARROW) == lines
    block = ["pulse 1", "  start, s  0.2917", "  channel   -M1", "  start, s  12.5"]
    assert rendered(table, NARROW - 1) == rendered(table, 20) == block
    wide = columns("number", *(f"column {number}" for number in range(6)))
    wide.add_row("1", *["0.123456"] * 6)
    assert rendered(wide, 66)[-1] == "  ".join(["1     ", *["0.123456"] * 6])
    assert rendered(wide, 65)[-1] == rendered(wide, 60)[-1] == " ".join(["1     ", *["0.123456"] * 6])
    table = columns("name", "value")
    table.add_row("a" * 50, "1.25")
    assert rendered(table, 70)[0].startswith("name  ")
    table.add_row("b" * 80, "2.5")
    text = "".join(line.strip() for line in rendered(table, 70))
    assert "b" * 80 in text
    assert "2.5" in text


def comparison(shown: str) -> list[str]:
    """The lines of the comparison of schemes, of the paragraphs of the screen of ``plan``."""
    return next(part.splitlines() for part in shown.split("\n\n") if "\nend, s" in part)


@pytest.mark.weekly
@spread("name", ["ace", "single-thruster", "steerable-stage", "magnus-a03"], quick=1, deep=1)
def test_four_or_five_schemes_fit_a_usual_screen(run: Run, name: str) -> None:
    usual = call(run, f"plan {places.CONFIGS}/{name}.yaml -v -q", columns=80).stdout
    head, *lines = comparison(usual)
    commanded = ["command-block"] if name == "ace" else []
    assert head.split() == ["one-pulse", "two-pulse", "four-pulse", *commanded, "optimal"]
    assert [line.split("  ")[0] for line in lines[:3]] == ["pulses", "end, s", "impulse, N m s"]


def test_a_scheme_without_thrusters_says_so_and_a_bound_keeps_its_sign_on_its_line(run: Run) -> None:
    """Long names of channels are broken, not "< 1e-9" after the last pulse."""
    (verdicts,) = re.findall("^verdict .*?\n\n", call(run, f"plan {STEERED} -v -q").stdout, re.MULTILINE | re.DOTALL)
    assert verdicts.split().count("no") == verdicts.split().count("thrusters") == 2
    shown = call(run, f"plan {STEERED} --scheme two-pulse -v -q").stdout
    assert re.search("  < 1e-9$", shown, re.MULTILINE)
    assert not re.search("<$", shown, re.MULTILINE)


# --- progress of long runs --------------------------------------------------------------------------------------------


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


class Clock:
    """A clock that is set by hand; its timers, in place of those of `threading`, ring as it is set."""

    def __init__(self) -> None:
        self.now, self.timers = 100.0, list[tuple[float, Callable[[], None]]]()

    def __call__(self) -> float:
        return self.now

    def set(self, now: float) -> None:
        self.now = 100.0 + now
        due = [timer for timer in self.timers if timer[0] <= self.now]
        for timer in due:
            self.timers.remove(timer)
            timer[1]()

    def Timer(self, seconds: float, ring: Callable[[], None]) -> SimpleNamespace:
        begin = partial(self.timers.append, (self.now + seconds, ring))
        return SimpleNamespace(start=begin, cancel=self.timers.clear, join=lambda: None)


class Status(NamedTuple):
    """The line of a screen, made anew whenever it is looked at."""

    text: Any
    lines: list[Any]

    def start(self) -> None:
        self.lines.append(self.text)

    def stop(self) -> None:
        self.lines.clear()


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(screen, "clock", clock)
    monkeypatch.setattr(screen, "threading", clock)
    return clock


@pytest.fixture
def lines(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    lines: list[Any] = []
    monkeypatch.setattr(Console, "status", lambda _, text: Status(text, lines))
    return lines


def test_progress_is_shown_after_a_second_and_a_time_after_a_tenth_of_the_steps(
    monkeypatch: pytest.MonkeyPatch, clock: Clock, lines: list[Any]
) -> None:
    monkeypatch.setattr(sys, "stderr", Terminal())
    seen: list[str] = []
    with working("verifying"):
        clock.set(0.9)
        assert not lines
        clock.set(1.0)
        seen.append(lines[0].__rich__())
        with work.steps(1000.0) as task:
            for done, now in ((0, 2.0), (99, 9.9), (100, 10.0), (500, 600.0), (996, 900.0), (1000, 910.0)):
                task.reach(done)
                clock.set(now)
                seen.append(lines[0].__rich__())
        with work.steps(2.0) as task, work.budget("optimal", 1.0):
            task.reach(1.0)
            for now in (1000.0, 1600.0, 1899.0, 1901.0):
                clock.set(now)
                seen.append(lines[0].__rich__())
    assert not lines
    assert seen == [
        "verifying",
        "verifying, 0 % done",
        "verifying, 9 % done",
        "verifying, 10 % done, about 90 s left",
        "verifying, 50 % done, about 10 min left",
        "verifying, 99 % done, about 4 s left",
        "verifying, 100 % done",
        "verifying: optimal, 50 % done, about 17 min left",
        "verifying: optimal, 50 % done, about 7 min left",
        "verifying: optimal, 50 % done, about 101 s left",
        "verifying: optimal, 50 % done, about 99 s left",
    ]


@pytest.mark.parametrize(("stream", "quiet"), [(io.StringIO(), False), (Terminal(), True)])
def test_no_progress_is_shown_in_a_pipe_or_where_it_is_not_wanted(
    monkeypatch: pytest.MonkeyPatch, clock: Clock, lines: list[Any], stream: io.StringIO, quiet: bool
) -> None:
    monkeypatch.setattr(sys, "stderr", stream)
    with working("planning", quiet=quiet), work.steps(2.0) as task:
        task.reach(1.0)
        clock.set(60.0)
        assert (lines, clock.timers, stream.getvalue()) == ([], [], "")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_run_is_requested_to_stop_and_a_second_ctrl_c_interrupts(number: signal.Signals) -> None:
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    with stoppable() as stopped:
        assert not stopped()
        os.kill(os.getpid(), number)
        assert stopped()
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before
