"""One declaration of a table gives screens, pages, CSV, JSON and arrays that agree; the default
screen of plan.
"""

import csv
import io
import math
import re
from contextlib import nullcontext
from dataclasses import replace
from operator import itemgetter
from types import SimpleNamespace as Row

import numpy as np
import pytest
from support.builders import spinner
from support.cases import spread
from support.commands import printed
from support.golden import check_text
from support.places import CONFIGS, case

import nutdamp
from nutdamp.files.schedules import BLOCKS_HEADER, EFFECTIVE, PULSES_HEADER
from nutdamp.spacecraft.model import Requirement, Spacecraft
from nutdamp.units import US, screen_units
from nutdamp.views.glance import LINES, glance
from nutdamp.views.parts import NOTES, SIZES, block_table, pulse_table
from nutdamp.views.tables import REAL, TEXT, WHOLE, WIDTH, YES_NO, Column, DataTable, angle_of
from nutdamp.views.text import short_angle, vector
from nutdamp.views.verdict import HEADLINES

NAMES = sorted(path.stem for path in CONFIGS.glob("*.yaml"))
TABLE = DataTable(
    "Things",
    (
        Column("name", "name", "", lambda row: row[0], where="screen csv json", kind=TEXT),
        Column("count", "count", "", lambda row: row[1], where="screen csv json", kind=WHOLE),
        Column("axis#_m", "", "", lambda row: row[2], where="csv json"),
        Column(
            "size_m",
            "size",
            "mm",
            lambda row: row[3],
            lambda size: f"{1e3 * size:.1f}",
            "screen csv json",
        ),
        Column(
            "good",
            "verdict",
            "",
            lambda row: row[4],
            lambda good: "met" if good else "NOT met",
            "screen csv json",
            kind=YES_NO,
            met=lambda row: row[4],
        ),
        Column(
            "never",
            "never",
            "",
            lambda row: row[99],
            where="screen csv",
            when=lambda source: source == "other",
        ),
        Column("page", "page", "", lambda row: row[0], where="page", kind=REAL),
    ),
    [
        ("one", 1, np.array([1.0, 2.0, 3.0]), 0.5, True),
        ("two", 2, None, None, None),
        ("three", 3, None, 0.25, False),
    ],
    "this",
)


def screen(table: DataTable, first: int | None = None, width: int = 80) -> list[list[str]]:
    return [line.split() for line in printed(table.screen("screen", first=first), width)]


def test_a_file_has_vectors_in_three_columns_and_unknown_values_empty() -> None:
    header, *rows = csv.reader(io.StringIO(TABLE.csv()))
    assert header == ["name", "count", "axis_1_m", "axis_2_m", "axis_3_m", "size_m", "good"]
    assert rows[0] == ["one", "1", "1.0", "2.0", "3.0", "0.5", "true"]
    assert rows[1] == ["two", "2", "", "", "", "", ""]


def test_json_has_vectors_as_lists_and_unknown_values_null() -> None:
    first, second, _ = TABLE.json()
    assert first == {
        "name": "one",
        "count": 1,
        "axis_m": [1.0, 2.0, 3.0],
        "size_m": 0.5,
        "good": True,
    }
    assert second == {"name": "two", "count": 2, "axis_m": None, "size_m": None, "good": None}


def test_a_column_has_key_and_value_by_its_name_and_words_of_a_row() -> None:
    rows = [Row(axis=Row(turn=math.pi / 6)), Row(axis=None)]
    column = Column.named("turn_deg=axis.turn", "turn", "deg", "{:.1f}".format, "json")
    assert DataTable("", [column], rows).json() == [
        {"turn_deg": pytest.approx(30.0)},
        {"turn_deg": None},
    ]
    assert [*map(column.worded, rows)] == ["30.0 deg", "–"]
    told = column._replace(words=lambda row: "free" if row.axis is None else None)
    assert [*map(told.shown, rows)] == ["–", "free"]


def test_an_array_has_the_fields_of_the_file() -> None:
    array = TABLE.array()
    assert array.dtype.names == (
        "name",
        "count",
        "axis_1_m",
        "axis_2_m",
        "axis_3_m",
        "size_m",
        "good",
    )
    assert array["name"].tolist() == ["one", "two", "three"]
    assert math.isnan(array["size_m"][1])


def test_a_screen_shows_texts_and_a_dash_for_the_unknown() -> None:
    heads, *rows = screen(TABLE)
    assert heads == ["name", "count", "size", "mm", "verdict"]
    assert rows == [
        ["one", "1", "500.0", "met"],
        ["two", "2", "–", "–"],
        ["three", "3", "250.0", "NOT", "met"],
    ]


RANKED = DataTable(
    "",
    [
        Column("", name, "", itemgetter(at), kind=TEXT, where="screen", rank=rank)
        for at, (name, rank) in enumerate(
            [("scheme", 0), ("pulses", 3), ("end s", 1), ("nutation left", 0), ("shift", 2)]
        )
    ],
    [("one-pulse", "2", "33.89", "0.00313", "0.269"), ("two-pulse", "2", "820.7", "0.00519", "0")],
)


@pytest.mark.parametrize(
    ("width", "heads"),
    [
        (60, [["scheme", "pulses", "end", "s", "nutation", "left", "shift"]]),
        (42, [["scheme", "pulses", "end", "s", "nutation", "left", "shift"]]),
        (40, [["nutation"], ["scheme", "pulses", "end", "s", "left", "shift"]]),
        (33, [["nutation"], ["scheme", "end", "s", "left", "shift"]]),
        (26, [["nutation"], ["scheme", "end", "s", "left"]]),
        (18, [["nutation"], ["scheme", "left"]]),
    ],
)
def test_columns_of_a_default_screen_go_by_their_rank(width: int, heads: list[list[str]]) -> None:
    """The gap narrows, then headings take two lines, then the largest rank goes; never a row."""
    table = RANKED.screen("screen")
    table.shortened = True
    lines = [line.split() for line in printed(table, width)]
    assert lines[:-2] == heads
    assert [line[0] for line in lines[-2:]] == ["one-pulse", "two-pulse"]
    table.told = True
    shown = {word for head in heads for word in head}
    out = [name for name in ("pulses", "end s", "shift") if name.split()[0] not in shown]
    last = printed(table, width)[len(lines) :]
    assert " ".join(last).startswith(f"left out: {', '.join(out)}") if out else not last


def test_without_a_rank_columns_go_on_below_and_nothing_is_lost() -> None:
    for width in (18, 24, 30):
        lines = printed(RANKED.screen("screen"), width)
        assert max(map(len, lines)) <= width
        assert sum(line.startswith("one-pulse") for line in lines) > 1
        words = {word for line in lines for word in line.split()}
        assert words >= {text for row in RANKED.rows for text in row}


def test_of_many_rows_the_first_ones_and_the_last_are_shown_where_that_saves_room() -> None:
    many = DataTable("", TABLE.columns[:2], [(f"row{index}", index) for index in range(9)])
    assert [row[0] for row in screen(many, first=2)[1:]] == ["row0", "row1", "…", "row8"]
    assert len(screen(many, first=7)[1:]) == 9


def test_quantities_go_down_where_rows_go_across() -> None:
    assert [line.split() for line in printed(TABLE.transposed("screen"))[:3]] == [
        ["one", "two", "three"],
        ["count", "1", "2", "3"],
        ["size,", "mm", "500.0", "–", "250.0"],
    ]


@spread("name", NAMES, quick=3, deep=4)
def test_files_of_pulses_and_blocks_have_the_names_that_are_read_again(name: str) -> None:
    plan = nutdamp.plan(nutdamp.load(CONFIGS / f"{name}.yaml"), "optimal")
    if not plan.feasible:
        pytest.skip("optimal is infeasible here")
    names = pulse_table(plan._flight).array().dtype.names or ()
    dated = plan.spacecraft.utc(0.0) is not None
    valves = any(pulse.through_valve for pulse in plan.pulses)
    assert names == (*PULSES_HEADER, *(EFFECTIVE * valves), *(("utc",) * dated))
    assert tuple(next(csv.reader(io.StringIO(block_table(plan._flight).csv())))) == BLOCKS_HEADER


def test_an_angle_of_a_row_is_in_degrees_and_unknown_where_a_step_to_it_is() -> None:
    end = angle_of("flight.end")
    assert end(Row(flight=Row(end=math.pi))) == 180.0
    assert (end(Row(flight=None)), end(Row(flight=Row(end=None)))) == (None, None)


def test_a_screen_has_the_units_requested_and_files_are_si() -> None:
    """One pound of mass, foot pounds of a vector; a value that is not known stays so."""
    columns = (
        Column(
            "mass_kg",
            "mass",
            "kg",
            lambda row: row[0],
            lambda size: f"{size:.4f}",
            "screen csv json",
        ),
        Column(
            "torque#_Nm", "torque", "N m", lambda row: row[1], vector, "screen csv json", kind=TEXT
        ),
    )
    table = DataTable(
        "Units",
        columns,
        [(0.45359237, np.array([1.3558179483314004, 0.0, -2.7116358966628])), (None, None)],
    )
    files = table.csv(), table.json()
    assert screen(table) == [
        ["mass", "kg", "torque", "N", "m"],
        ["0.4536", "(1.356,", "0,", "-2.712)"],
        ["–", "–"],
    ]
    with screen_units(US):
        assert screen(table)[:2] == [
            ["mass", "lbm", "torque", "ft", "lbf"],
            ["1.0000", "(1,", "0,", "-2)"],
        ]
        assert [heading.unit for heading in table.headings("screen")] == ["lbm", "ft lbf"]
        assert (table.csv(), table.json()) == files


# --- the default screen of plan: what to fire on top, in 40 lines of 80 columns


def glance_lines(compared: nutdamp.Comparison) -> list[str]:
    return printed(glance(compared), WIDTH)


def compared(body: Spacecraft, *names: str) -> nutdamp.Comparison:
    return nutdamp.compare(body, names, samples=0)


@pytest.mark.usefixtures("plans_shared")
@spread("name", NAMES, quick=2, deep=len(NAMES))
def test_a_plan_is_seen_at_a_glance(name: str) -> None:
    screen = glance(compared(nutdamp.load(CONFIGS / f"{name}.yaml")))
    for width, most in ((60, LINES[1]), (WIDTH, LINES[0]), (120, LINES[0])):
        lines = printed(screen, width)
        assert len(lines) <= most
        assert max(map(len, lines)) <= width
        assert [line for line in lines if line.startswith((*HEADLINES.values(),))] == [lines[1]]
        assert lines[-1].startswith("-v ")
        assert sum(line.startswith(("note[", "warning[")) for line in lines) <= NOTES
        assert not any("…" in line and "more" not in line for line in lines)
        (table,) = (part for part in "\n".join(lines).split("\n\n") if "\none-pulse" in part)
        assert re.match(r"(?: .*\n)?scheme .*verdict(\n\S+ .*\S)+", table), "a row is broken"


@pytest.mark.deep
@pytest.mark.parametrize("name", ["plan-25-lines", "plan-30-lines"])
def test_a_plan_of_many_bounds_and_warnings_fits_a_terminal(name: str) -> None:
    """Lines between its tables go before a warning does."""
    with pytest.warns(UserWarning, match="is read as") if "25" in name else nullcontext():
        body = nutdamp.load(case(f"{name}.yaml"))
    lines = printed(glance(nutdamp.compare(body)), 160)
    assert len(lines) <= LINES[0]
    assert any(line.startswith("warning[") for line in lines)


@pytest.mark.usefixtures("plans_shared")
def test_the_screen_of_the_example() -> None:
    check_text("glance.example", "\n".join(glance_lines(compared(nutdamp.example()))))


def test_a_requirement_that_is_missed_is_never_dropped() -> None:
    weak = replace(
        spinner(degrees=5.0),
        requirement=Requirement(nutation=math.radians(1e-7), momentum_shift=1e-9),
    )
    lines = glance_lines(compared(weak, "one-pulse"))
    assert lines[2].startswith("NOT met")
    assert any(line.startswith("momentum shift") and line.endswith("NOT met") for line in lines)


def test_of_many_pulses_the_first_ones_and_the_last_are_shown() -> None:
    body = nutdamp.load(
        {
            "name": "weak",
            "inertia": {"A": 100, "C": 80},
            "state": {"spin": 3.0, "nutation": "5 deg"},
            "thrusters": [{"name": "T", "torque": [2.0, 0, 0], "max_on_time": "0.3 s"}],
            "limits": {"horizon": "200 s"},
        }
    )
    plan = compared(body, "optimal")
    count = len(plan["optimal"].pulses)
    most, _ = SIZES[0]
    assert count > most + 1
    rows = glance_lines(plan)
    start = next(index for index, line in enumerate(rows) if line.startswith("pulse"))
    first = [row.split()[0] for row in rows[start + 1 : rows.index("", start)]]
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
def test_zero_is_written_one_way_below_what_matters(
    degrees: float, largest: float, text: str
) -> None:
    assert short_angle(math.radians(degrees), math.radians(largest)) == text


def test_a_plan_that_misses_is_no_headline_to_fly_and_digits_stay_on_their_side() -> None:
    body = nutdamp.example().with_(
        requirement={"nutation": "0.5 deg", "momentum_shift": "0.16836 deg"}
    )
    lines = glance_lines(compared(body, "four-pulse"))
    assert lines[1].startswith("NOT ENOUGH: four-pulse")
    (row,) = (line for line in lines if line.startswith("momentum shift"))
    most, left = (float(text) for text in re.findall(r"([0-9.]+) deg", row)[:2])
    assert row.endswith("NOT met")
    assert left > most


@pytest.mark.usefixtures("plans_shared")
def test_what_only_timed_pulses_reach_names_the_option() -> None:
    body = nutdamp.load(CONFIGS / "lunar-prospector.yaml")
    plans = nutdamp.compare(body, options=nutdamp.Options(max_blocks=1), samples=0)
    assert any("--timed" in line for line in glance_lines(plans))
