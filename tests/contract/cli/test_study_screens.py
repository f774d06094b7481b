"""The default screens of ``disperse``, ``trade`` and ``verify``: one pattern, that a terminal of 80 columns holds."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest
from rich.console import Console, RenderableType
from support import places
from support.builders import cross, spinner
from support.cases import spread
from support.commands import call
from support.process import Run

from nutdamp.planning import plan as planning
from nutdamp.planning.tradeoff import Front, Point
from nutdamp.spacecraft.model import Requirement
from nutdamp.views.trade import ROWS, trade_brief, trade_screen

pytestmark = pytest.mark.usefixtures("plans_shared")

WIDTH, LINES = 80, 40
FILES = sorted(places.CONFIGS.glob("*.yaml"))
DISPERSED = [path for path in FILES if "\ndispersions:" in path.read_text(encoding="utf-8")]
COMMANDS = [
    *(f"disperse {path} --samples 200" for path in DISPERSED),
    *(f"verify {path}" for path in FILES),
    *(f"trade {path} --points 2" for path in FILES),
]


def check_screen(shown: str) -> None:
    """No more lines and columns than there are, no cut value, one table with each of its rows on a line, few notes."""
    lines = shown.splitlines()
    assert len(lines) <= LINES
    assert max(map(len, lines)) <= WIDTH
    assert "…" not in shown
    assert sum(line.startswith("note[") for line in lines) <= 3
    _, *tables, _ = shown.split("\n\n")
    assert len(tables) <= 1
    for table in tables:
        heads = re.match(r"(?: .*\n)*.*\n", table)
        assert heads is not None
        assert not re.search("^ ", table[heads.end() :], re.MULTILINE), "a row goes on in another line"
    assert lines[-1].startswith("-v all values")


@pytest.mark.parametrize(
    "command",
    [f"disperse {DISPERSED[-1]} --scheme one-pulse --samples 200", "verify --scheme two-pulse",
     "trade --points 2 --allow 0"],
)  # fmt: skip
def test_a_default_screen_fits_a_terminal(run: Run, command: str) -> None:
    check_screen(call(run, command, columns=WIDTH).stdout)


@spread("command", COMMANDS, quick=0, deep=len(COMMANDS))
def test_the_default_screen_of_every_shipped_file_fits_a_terminal(run: Run, command: str) -> None:
    check_screen(call(run, command, columns=WIDTH).stdout)


def rendered(screen: RenderableType) -> str:
    console = Console(width=WIDTH, color_system=None)
    with console.capture() as captured:
        console.print(screen)
    return "\n".join(line.rstrip() for line in captured.get().splitlines())


def test_of_many_points_some_are_shown_the_first_and_the_last_among_them() -> None:
    body = replace(spinner(channels=cross(8.0)), requirement=Requirement(nutation=0.01))
    plan = planning.plan(body, "two-pulse")
    fronts = [Front(0.01 * at, (Point(plan, 60.0, "N m s"),) * 20) for at in range(5)]
    shown = rendered(trade_brief(body, fronts))
    check_screen(shown)
    rows = re.findall(r"^(\d+) .*FLY$", shown, re.MULTILINE)
    assert (len(rows), rows[0], rows[-1]) == (ROWS, "1", "100")
    assert f"note[trade-points]: points on this screen: {ROWS} of 100" in shown
    assert len(re.findall(r"^\d+ .*FLY$", rendered(trade_screen(body, fronts)), re.MULTILINE)) == 100


def test_a_trade_without_a_schedule_says_why() -> None:
    shown = rendered(trade_brief(spinner(), [Front(0.0, (), "no channel")]))
    assert "NO SCHEDULE" in shown
    assert "H ends where it was – none: no channel" in shown
