"""Narrow screens, where each row of a table is a block and no digit is lost; the bar of long runs, how they stop."""

from __future__ import annotations

import io
import os
import re
import signal
import sys
import time
from collections import Counter

import pytest
from rich.console import Console
from rich.table import Table
from support import places
from support.cases import spread
from support.commands import call
from support.process import Run

from nutdamp.cli import screen
from nutdamp.cli.main import stoppable
from nutdamp.cli.screen import progress, working
from nutdamp.views.layout import NARROW, columns

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
        usual, wide = (call(run, f"{command} {places.CONFIGS}/{name}.yaml -q", columns=width) for width in (80, 200))
        assert usual.returncode in (0, 4), usual.stderr
        lines = usual.stdout.splitlines()
        assert len(lines) <= 40
        assert max(map(len, lines)) <= 80
        assert lines[-1].startswith("-v all values")
        assert sum(line.startswith("note: ") for line in lines) <= 3
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
        assert "Recommended" in ended.stdout


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
    table = columns("name", "value")
    table.add_row("a" * 50, "1.25")
    assert rendered(table, 70)[0].startswith("name  ")
    table.add_row("b" * 80, "2.5")
    text = "".join(line.strip() for line in rendered(table, 70))
    assert "b" * 80 in text
    assert "2.5" in text


def comparison(shown: str) -> list[str]:
    """The lines of the comparison of schemes, of the paragraphs of the screen of ``plan``."""
    return next(part.splitlines() for part in shown.split("\n\n") if "\nends at, s" in part)


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
    (line,) = re.findall("^verdict .*\n.*thrusters", call(run, f"plan {STEERED} -v -q").stdout, re.MULTILINE)
    assert line.split()[-4:] == ["no", "no", "thrusters", "thrusters"]
    shown = call(run, f"plan {STEERED} --scheme two-pulse -v -q").stdout
    assert re.search("  < 1e-9$", shown, re.MULTILINE)
    assert not re.search("<$", shown, re.MULTILINE)


# --- the bar of long runs ---------------------------------------------------------------------------------------------


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def shown(monkeypatch: pytest.MonkeyPatch, stream: io.StringIO, patience: float, *, quiet: bool = False) -> str:
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr(screen, "PATIENCE", patience)
    monkeypatch.setenv("TERM", "xterm")
    with progress("flying", quiet=quiet) as tell:
        for count in (200, 500, 900):
            tell(count, 1_000)
    return stream.getvalue()


def test_a_terminal_is_shown_share_rate_and_time_left_of_a_long_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where it is wanted."""
    text = shown(monkeypatch, Terminal(), 0.0)
    assert all(part in text for part in ("flying", "90%", "/s", "0:00:"))
    assert shown(monkeypatch, Terminal(), 60.0) == shown(monkeypatch, Terminal(), 0.0, quiet=True) == ""


@pytest.mark.parametrize(("long", "quiet", "lines"), [(0.0, False, 1), (60.0, False, 0), (0.0, True, 0)])
def test_elsewhere_one_line_says_how_far_long_work_is(
    monkeypatch: pytest.MonkeyPatch, long: float, quiet: bool, lines: int
) -> None:
    monkeypatch.setattr(screen, "LONG", long)
    text = shown(monkeypatch, io.StringIO(), 0.0, quiet=quiet)
    assert text.count("\n") == lines
    assert not lines or text.startswith("flying: 200 of 1,000 done after 0 s, about 0 s left")


@pytest.mark.parametrize(
    ("stream", "patience", "quiet", "seen"),
    [(Terminal, 0.0, False, True), (Terminal, 60.0, False, False), (Terminal, 0.0, True, False),
     (io.StringIO, 0.0, False, False)],
)  # fmt: skip
def test_work_of_unknown_length_says_what_is_done_once_it_takes_long(
    monkeypatch: pytest.MonkeyPatch, stream: type[io.StringIO], patience: float, quiet: bool, seen: bool
) -> None:
    err = stream()
    monkeypatch.setattr(sys, "stderr", err)
    monkeypatch.setattr(screen, "PATIENCE", patience)
    monkeypatch.setenv("TERM", "xterm")
    with working("planning", quiet=quiet):
        while seen and "planning" not in err.getvalue():  # until the timer has had its turn
            time.sleep(0.01)
    assert ("planning" in err.getvalue()) is seen


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
