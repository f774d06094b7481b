"""Screens: narrow ones, those of studies, other units; progress of long runs, how they stop."""

import io
import math
import os
import re
import signal
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import pytest
from rich.console import Console
from support import places
from support.builders import cross, spinner
from support.cases import deep, spread
from support.commands import call, printed
from support.process import Run

from nutdamp.cli import files, job, main
from nutdamp.cli.studies import stoppable
from nutdamp.common import work
from nutdamp.planning import plan as planning
from nutdamp.planning.tradeoff import Front, Point, Trade
from nutdamp.spacecraft.model import Requirement
from nutdamp.views.trade import ROWS, trade_screen

pytestmark = pytest.mark.usefixtures("plans_shared")

STAGE, STEERED = places.CONFIGS / "upper-stage.yaml", places.CONFIGS / "steerable-stage.yaml"
COMMANDS = [
    "plan -v",
    "simulate --scheme two-pulse -v",
    "check -v",
    "verify --scheme two-pulse -v",
    "disperse --scheme two-pulse --samples 1e3 --worst 2 -v",
    "trade --points 2 -v",
    f"loop {STAGE} --until 400s -v",
    f"budget {STAGE} --thresholds 0.5deg,0.1deg --thresholds 1deg,0.1deg -v",
]


def numbers(text: str) -> Counter[str]:
    """Every number of a screen, with a unit of its own line or not."""
    return Counter(re.findall(r"-?[0-9]+(?:\.[0-9]+)?(?:e-?[0-9]+)?", text))


@pytest.mark.weekly
@spread("command", COMMANDS, quick=2, deep=2, ids=lambda command: command.split()[0])
def test_no_digit_is_lost_on_a_usual_screen_and_narrow_ones_name_what_they_leave_out(
    run: Run, command: str
) -> None:
    wide = call(run, f"{command} -q", columns=300)
    for width in (25, 60, 80):
        narrow = call(run, command, columns=width, status=wide.returncode).stdout
        assert "…" not in narrow
        assert numbers(narrow) >= numbers(wide.stdout) or (width < 80 and "left out:" in narrow)
        assert max(map(len, narrow.splitlines())) <= width


def test_a_width_into_which_nothing_fits_hides_nothing(run: Run) -> None:
    """COLUMNS=0 printed nothing, with exit status 0."""
    none, one, seven, usual = (
        call(run, "plan -v -q --scheme two-pulse", columns=width) for width in (0, 1, 7, 80)
    )
    assert none.stdout == usual.stdout
    for ended in (one, seven):
        assert ended.returncode == 0
        assert "FLY two-pulse:" in ended.stdout


# --- progress of long runs
# --------------------------------------------------------------------------------------------


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


class Clock:
    """A clock that is set by hand; its timers ring, in place of those of `threading`."""

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
    monkeypatch.setattr(main, "clock", clock)
    monkeypatch.setattr(main, "threading", clock)
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
    with main.working("verifying"):
        clock.set(0.9)
        assert not lines
        clock.set(1.0)
        seen.append(lines[0].__rich__())
        with work.steps(1000.0) as task:
            for done, now in (
                (0, 2.0),
                (99, 9.9),
                (100, 10.0),
                (500, 600.0),
                (996, 900.0),
                (1000, 910.0),
            ):
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


def test_no_progress_is_shown_in_a_pipe_or_where_it_is_not_wanted(
    monkeypatch: pytest.MonkeyPatch, clock: Clock, lines: list[Any]
) -> None:
    for stream, quiet in ((io.StringIO(), False), (Terminal(), True)):
        monkeypatch.setattr(sys, "stderr", stream)
        with main.working("planning", quiet=quiet), work.steps(2.0) as task:
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


# --- default screens: one pattern, at three widths

WIDTHS = (60, 80, 120)
WIDTH = 80
CONFIG_FILES = sorted(places.CONFIGS.glob("*.yaml"))


def screens() -> Iterator[str]:
    """Every command that shows a result, with every file that it can take."""
    for path in CONFIG_FILES:
        text = path.read_text(encoding="utf-8")
        dispersed, looped = ("\ndispersions:" in text), ("\nloop:" in text)
        commands = ["check", "simulate", "simulate --scheme none", "verify", "trade --points 2"]
        commands += ["plan", *(["plan --nominal", "plan --robust"] if dispersed else [])]
        commands += ["disperse --samples 200"] if dispersed else []
        commands += ["loop"] if looped else []
        commands += ["budget"] if looped and "\ndissipation:" in text else []
        commands += ["disperse --loop --samples 9"] if looped and dispersed else []
        yield from (f"{command} {path}" for command in commands)
    for name in ("accelerometer", "axis-tumble", "gyro-misaligned"):
        yield f"fit {places.CASES}/{name}.csv {places.CASES}/{name}.yaml"


SCREENS = [*screens()]


def measured(shown: str, width: int, most: int) -> dict[str, object]:
    """What is wrong with a default screen: lines too many or too wide, cut values, rows broken, too
    many notes or notes that something else follows.
    """
    lines = shown.splitlines()
    notes = [at for at, line in enumerate(lines) if re.match(r"(note|warning)\[", line)]
    _, *tables = "\n".join(lines[: min(notes, default=-1)]).split("\n\n")
    rows = (re.sub(r"\A(?: .*\n)*.*\n", "", table) for table in tables)
    found = {
        "lines": lines if len(lines) > most else [],
        "wide": [line for line in lines if len(line) > width],
        "cut": [line for line in lines if "…" in line and "more" not in line],
        "notes": notes if len(notes) > 3 else [],
        "below": [at for at in notes[:1] if "" in lines[at:]],
        "rows": [line for each in rows for line in re.findall(r"^ +\S.*", each, re.MULTILINE)],
        "last": [line for line in lines[-1:] if not line.startswith("-v all values")],
    }
    return {name: value for name, value in found.items() if value}


@spread("command", SCREENS, quick=4, deep=len(SCREENS))
def test_default_screens_fit_their_width(
    run: Run, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    """60, 80 and 120 columns: no line too wide, no row broken or stacked, notes last; 24 lines of a
    plan (30 at 60 columns), 40 of others.
    """
    parts: list[Any] = []
    for module in (job, files):
        monkeypatch.setattr(module, "show", parts.append)
    ended = call(run, command)
    assert ended.returncode in (0, 4), ended.stderr
    assert max(map(len, ended.stderr.splitlines()), default=0) <= 80
    (screen,) = parts
    for width in WIDTHS:
        most = 40 if not command.startswith("plan") else 24 if width >= 80 else 30
        assert measured("\n".join(printed(screen, width)), width, most) == {}, width


def test_of_many_points_some_are_shown_the_first_and_the_last_among_them() -> None:
    body = replace(spinner(channels=cross(8.0)), requirement=Requirement(nutation=0.01))
    plan = planning.plan(body, "two-pulse")
    fronts = (Front(0.01 * at, (Point(plan, 60.0, "N m s"),) * 2) for at in range(50))
    traded = Trade(body, tuple(fronts))
    shown = "\n".join(printed(trade_screen(traded, verbose=False), WIDTH))
    assert measured(shown, WIDTH, 40) == {}
    rows = re.findall(r"^(\d+) .*FLY$", shown, re.MULTILINE)
    assert (len(rows), rows[0], rows[-1]) == (ROWS, "1", "99")  # equal ones are shown once
    assert f"note[trade-points]: points on this screen: {ROWS} of 100" in shown
    every = printed(trade_screen(traded, verbose=True), WIDTH)
    assert sum(bool(re.match(r"\d+ .*FLY$", line)) for line in every) == 100
    none = Trade(spinner(), (Front(0.0, (), "no channel"),))
    shown = "\n".join(printed(trade_screen(none, verbose=False), WIDTH))
    assert "NO SCHEDULE" in shown
    assert "H ends where it was – none: no channel" in shown


# --- --units us: no number stays in SI where its dimension has a US unit; files are SI all the same

PAIRS = {
    "kg m²": ("slug ft²", 1.3558179483314),
    "kg": ("lbm", 0.45359237),
    "g": ("lbm", 453.59237),
    "N m s": ("ft lbf s", 1.3558179483314),
    "N m": ("ft lbf", 1.3558179483314),
    "N s": ("lbf s", 4.4482216152605),
    "N": ("lbf", 4.4482216152605),
    "mm": ("in", 25.4),
    "m": ("ft", 0.3048),
    "bar": ("psi", 0.068947572931684),
}
"""Units of SI, those of US screens,
and how many of the former one of the latter is (NIST SP 811).
"""


def units(names: list[str]) -> re.Pattern[str]:
    """Pattern of a unit, behind a number or not: no part of a word, nor of a name as "+M1"."""
    words = "|".join(sorted(names, key=len, reverse=True))
    return re.compile(
        rf"(?:(-?[0-9.]+(?:e-?[0-9]+)?) )?(?<![\w°µ'|.+-])({words})((?:/\w+²?)?)(?![\w|²'-]| s\b)"
    )


SI_UNITS, US_UNITS = units(list(PAIRS)), units([name for name, _ in PAIRS.values()])

FILES = [path.stem for path in sorted(places.CONFIGS.glob("*.yaml"))]
LOOPED, DISPERSED = (
    [name for name in FILES if key in (places.CONFIGS / f"{name}.yaml").read_text(encoding="utf-8")]
    for key in ("\nloop:", "\ndispersions:")
)
UNITED = [  # commands with the files that they take
    *(f"{command} {places.CONFIGS}/{name}.yaml" for commands, names in (
        (("check -v", "simulate -v --scheme two-pulse --samples 100"), FILES),
        (("disperse --scheme two-pulse --case 3",
          "disperse -v --samples 500 --scheme two-pulse"), DISPERSED),
        (("plan --nominal", "plan -v --nominal", "simulate -v --scheme optimal",
          "verify -v --scheme two-pulse", "trade -v --points 2"), FILES),
        (("loop -v --until 400s", "budget -v", "disperse -v --loop --samples 50",
          "disperse --loop --samples 9 --case 3",
          "verify --loop --set limits.horizon=300s"), LOOPED),
    ) for command in commands for name in names),
    *(f"fit -v {places.CASES}/{name}.csv {places.CASES}/{name}.yaml"
      for name in ("accelerometer", "axis-tumble")),
]  # fmt: skip


@spread("command", UNITED, quick=4, deep=8)
def test_no_si_unit_with_a_us_one_is_left_on_a_screen(run: Run, command: str) -> None:
    """Each unit is replaced, and each number with one is its value in the other."""
    si, us = (call(run, f"{command} --units {name}", columns=200) for name in ("si", "us"))
    assert (us.returncode, si.stdout) == (si.returncode, call(run, command, columns=200).stdout)
    texts = [ended.stdout + ended.stderr for ended in (si, us)]
    assert not SI_UNITS.findall(texts[1])
    # "in" is a word as well.
    before = [match for match in SI_UNITS.findall(texts[0]) if match[1] != "mm"]
    after = [match for match in US_UNITS.findall(texts[1]) if match[1] != "in"]
    assert before or si.returncode == 3  # nothing is feasible
    assert len(before) == len(after)
    for (number, unit, per), (other, us_unit, us_per) in zip(before, after, strict=True):
        name, factor = PAIRS[unit]
        assert (us_unit, us_per, bool(other)) == (name, per, bool(number))
        if number:
            assert math.isclose(float(number), factor * float(other), rel_tol=6e-3, abs_tol=1e-9)


@pytest.mark.parametrize(
    "command",
    [
        "check --json FILE",
        "simulate --scheme two-pulse --csv FILE",
        "plan --scheme two-pulse --nominal --json FILE",
        deep("disperse --scheme two-pulse --samples 9 --json FILE"),
    ],
)
def test_files_are_si(run: Run, tmp_path: Path, command: str) -> None:
    for units in ("si", "us"):
        call(run, command.replace("FILE", units) + f" -q --units {units}")
    assert (tmp_path / "us").read_bytes() == (tmp_path / "si").read_bytes()
