"""Narrow screens: below 60 characters each row of a table is a block, and no digit is lost at any width."""

from __future__ import annotations

import re
from collections import Counter

import pytest
from rich.console import Console
from support import places
from support.cases import spread
from support.process import Run

from nutdamp.presentation.layout import NARROW, columns

pytestmark = pytest.mark.usefixtures("plans_shared")

CONFIGS = places.CONFIGS

COMMANDS = [
    ("plan",),
    ("simulate", "--scheme", "two-pulse"),
    ("check",),
    ("verify", "--scheme", "two-pulse"),
    ("disperse", "--scheme", "two-pulse", "--samples", "1e3", "--worst", "2"),
    ("trade", "--points", "2"),
    ("loop", str(CONFIGS / "upper-stage.yaml"), "--until", "400s"),
    ("budget", str(CONFIGS / "upper-stage.yaml"), "--thresholds", "0.5deg,0.1deg", "--thresholds", "1deg,0.1deg"),
]


def numbers(text: str) -> list[str]:
    """Every number of a screen, with a unit of its own line or not."""
    return re.findall(r"-?[0-9]+(?:\.[0-9]+)?(?:e-?[0-9]+)?", text)


@pytest.mark.weekly
@spread("command", COMMANDS, quick=2, deep=2, ids=lambda command: command[0])
def test_no_digit_is_lost_on_a_narrow_screen(run: Run, command: tuple[str, ...]) -> None:
    wide = run(*command, "--quiet", columns=300)
    for width in (25, 59, 60, 80):
        narrow = run(*command, "--quiet", columns=width)
        assert narrow.returncode == wide.returncode
        assert "…" not in narrow.stdout
        # Headings stand in every block, so that a number may come more often, but none less often.
        assert Counter(numbers(narrow.stdout)) >= Counter(numbers(wide.stdout))
        assert max(map(len, narrow.stdout.splitlines())) <= width


@pytest.mark.parametrize("width", [0, 1, 7])
def test_a_width_into_which_nothing_fits_hides_nothing(run: Run, width: int) -> None:
    """COLUMNS=0 printed nothing, with exit status 0."""
    done = run("plan", "--quiet", columns=width)
    assert done.returncode == 0
    assert "Recommended" in done.stdout
    if width == 0:
        assert done.stdout == run("plan", "--quiet", columns=80).stdout


def rendered(width: int) -> list[str]:
    table = columns("pulse\n", "start\ns", "channel\n", text=("channel\n",))
    table.add_row("1", "0.2917", "-M1")
    table.add_row("", "12.5", "")
    console = Console(width=width, color_system=None)
    with console.capture() as captured:
        console.print(table)
    return [line.rstrip() for line in captured.get().splitlines()]


def test_a_row_becomes_a_block() -> None:
    assert rendered(NARROW) == ["pulse   start  channel", "            s", "1      0.2917  -M1", "         12.5"]
    block = ["pulse 1", "  start, s  0.2917", "  channel   -M1", "  start, s  12.5"]
    assert rendered(NARROW - 1) == block
    assert rendered(20) == block


def test_a_table_that_does_not_fit_stands_as_blocks_on_wide_screens_too() -> None:
    table = columns("name", "value")
    table.add_row("a" * 50, "1.25")
    console = Console(width=70, color_system=None)
    with console.capture() as captured:
        console.print(table)
    assert captured.get().splitlines()[0].startswith("name  ")
    table.add_row("b" * 80, "2.5")
    with console.capture() as captured:
        console.print(table)
    text = "".join(line.strip() for line in captured.get().splitlines())
    assert "b" * 80 in text
    assert "2.5" in text


@pytest.mark.weekly
@spread("name", ["ace", "single-thruster", "steerable-stage", "magnus-a03"], quick=1, deep=1)
def test_four_or_five_schemes_fit_a_usual_screen(run: Run, name: str) -> None:
    """Each row of the comparison is one line, for units stand with the names of the rows."""
    done = run("plan", str(CONFIGS / f"{name}.yaml"), "--quiet", columns=80)
    wide = run("plan", str(CONFIGS / f"{name}.yaml"), "--quiet", columns=300)
    head, *rows = _comparison(done.stdout)
    commanded = ["command-block"] if name == "ace" else []
    assert head.split() == ["one-pulse", "two-pulse", "four-pulse", *commanded, "optimal"]
    assert [row.split("  ")[0] for row in rows[:3]] == ["pulses", "ends at, s", "impulse, N m s"]
    assert len(rows) == len(_comparison(wide.stdout)) - 1


def _comparison(shown: str) -> list[str]:
    """The lines of the comparison of schemes, of the paragraphs of the screen of ``plan``."""
    return next(part.splitlines() for part in shown.split("\n\n") if "\nends at, s" in part)


def test_a_scheme_without_thrusters_says_so_in_its_column(run: Run) -> None:
    done = run("plan", str(CONFIGS / "steerable-stage.yaml"), "--quiet", columns=80)
    (row,) = (row for row in done.stdout.splitlines() if row.startswith("pulses"))
    assert re.split(r"  +", row) == ["pulses", "1", "2", "no thrusters", "no thrusters"]


def test_a_bound_keeps_its_sign_on_the_same_line(run: Run) -> None:
    """Long names of channels are broken, not "< 1e-9" after the last pulse."""
    shown = run("plan", str(CONFIGS / "steerable-stage.yaml"), "--scheme", "two-pulse", "--quiet").stdout
    assert any(line.endswith("  < 1e-9") for line in shown.splitlines())
    assert not any(line.endswith("<") for line in shown.splitlines())
