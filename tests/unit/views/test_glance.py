"""The default screen of `plan`: what to fire on top, in 40 lines of 80 columns."""

from __future__ import annotations

import io
import math
import re
from contextlib import nullcontext
from dataclasses import replace

import pytest
from rich.console import Console
from support import places
from support.builders import spinner
from support.cases import spread
from support.golden import check_text

import nutdamp
from nutdamp.planning.decision import Comparison
from nutdamp.spacecraft.model import Requirement, Spacecraft
from nutdamp.views.glance import glance
from nutdamp.views.parts import FEWEST, LINES, SIZES, WIDE
from nutdamp.views.tables import WIDTH
from nutdamp.views.text import short_angle
from nutdamp.views.verdict import HEADLINES

CONFIGS = sorted(path.stem for path in places.CONFIGS.glob("*.yaml"))


def screen(compared: Comparison) -> list[str]:
    console = Console(width=WIDTH, file=io.StringIO(), markup=False, emoji=False, highlight=False)
    with console.capture() as captured:
        console.print(glance(compared))
    return [line.rstrip() for line in captured.get().splitlines()]


def compared(body: Spacecraft, *names: str) -> Comparison:
    return nutdamp.compare(body, names, samples=0)


@pytest.mark.usefixtures("plans_shared")
@spread("name", CONFIGS, quick=2, deep=len(CONFIGS))
def test_a_plan_is_seen_at_a_glance(name: str) -> None:
    lines = screen(compared(nutdamp.load(places.CONFIGS / f"{name}.yaml")))
    assert len(lines) <= LINES
    assert max(map(len, lines)) <= WIDTH
    assert [line for line in lines if line.startswith((*HEADLINES.values(),))] == [lines[1]]
    assert lines[-1].startswith("-v ")
    assert lines[-1].endswith("nutdamp report")
    assert not any("…" in line and "more" not in line for line in lines)


@pytest.mark.deep
@pytest.mark.parametrize("name", ["plan-25-lines", "plan-30-lines"])
def test_a_plan_of_many_bounds_and_warnings_fits_a_terminal(name: str) -> None:
    """Where no cell is broken; of 80 columns it takes more."""
    console = Console(width=WIDE, file=io.StringIO(), markup=False, emoji=False, highlight=False)
    with pytest.warns(UserWarning, match="is read as") if "25" in name else nullcontext():
        body = nutdamp.load(places.case(f"{name}.yaml"))
    compared = nutdamp.compare(body)
    assert len(console.render_lines(glance(compared))) <= FEWEST
    assert len(screen(compared)) <= LINES


@pytest.mark.usefixtures("plans_shared")
def test_the_screen_of_the_example() -> None:
    check_text("glance.example", "\n".join(screen(compared(nutdamp.example()))))


def test_a_requirement_that_is_missed_is_never_dropped() -> None:
    weak = replace(spinner(degrees=5.0), requirement=Requirement(nutation=math.radians(1e-7), momentum_shift=1e-9))
    lines = screen(compared(weak, "one-pulse"))
    assert lines[2].startswith("NOT met")
    assert any(line.startswith("momentum shift") and line.endswith("NOT met") for line in lines)


def test_of_many_pulses_the_first_ones_and_the_last_are_shown() -> None:
    body = nutdamp.load({
        "name": "weak", "inertia": {"A": 100, "C": 80}, "state": {"spin": 3.0, "nutation": "5 deg"},
        "thrusters": [{"name": "T", "torque": [2.0, 0, 0], "max_on_time": "0.3 s"}], "limits": {"horizon": "200 s"},
    })  # fmt: skip
    plan = compared(body, "optimal")
    count = len(plan["optimal"].pulses)
    most, _ = SIZES[0]
    assert count > most + 1
    rows = screen(plan)
    start = next(index for index, line in enumerate(rows) if line.startswith("pulse"))
    first = [row.split()[0] for row in rows[start + 1 : start + most + 3]]
    shown = first.index("…")
    assert first[: shown + 2] == [*map(str, range(1, shown + 1)), "…", str(count)]
    assert f"{count - shown - 1} more" in rows[start + shown + 1]


@pytest.mark.parametrize(
    ("degrees", "largest", "text"),
    [
        (1e-4, math.inf, "0"),
        (6e-4, math.inf, "0.0006"),
        (1e-4, 1e-3, "0.0001"),
        (1.23456, 90.0, "1.23"),
        (0.0, 1.0, "0"),
    ],
)
def test_zero_is_written_one_way_below_what_matters(degrees: float, largest: float, text: str) -> None:
    assert short_angle(math.radians(degrees), math.radians(largest)) == text


def test_a_plan_that_misses_is_no_headline_to_fly_and_digits_stand_on_their_side_of_the_limit() -> None:
    body = nutdamp.example().with_(requirement={"nutation": "0.5 deg", "momentum_shift": "0.16836 deg"})
    lines = screen(compared(body, "four-pulse"))
    assert lines[1].startswith("NOT ENOUGH: four-pulse")
    (row,) = (line for line in lines if line.startswith("momentum shift"))
    most, left = (float(text) for text in re.findall(r"([0-9.]+) deg", row)[:2])
    assert row.endswith("NOT met")
    assert left > most


@pytest.mark.usefixtures("plans_shared")
def test_what_only_timed_pulses_reach_names_the_option() -> None:
    body = nutdamp.load(places.CONFIGS / "lunar-prospector.yaml")
    plans = nutdamp.compare(body, options=nutdamp.Options(max_blocks=1), samples=0)
    assert any("--timed" in line for line in screen(plans))
