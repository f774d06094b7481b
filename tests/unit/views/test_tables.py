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
from support.builders import cross, spinner
from support.cases import spread
from support.commands import printed
from support.places import CONFIGS, case

import nutdamp
from nutdamp.files.schedules import BLOCKS_HEADER, EFFECTIVE, PULSES_HEADER
from nutdamp.spacecraft.model import Limits, Requirement, Spacecraft
from nutdamp.units import US, screen_units
from nutdamp.views.glance import LINES, glance
from nutdamp.views.parts import NOTES, ROWS, block_table, pulse_table
from nutdamp.views.tables import REAL, TEXT, WHOLE, WIDTH, YES_NO, Column, DataTable
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


def test_one_declaration_gives_files_arrays_and_screens() -> None:
    """Vectors in three columns or a list; what is not known is empty, null or a dash."""
    header, *rows = csv.reader(io.StringIO(TABLE.csv()))
    assert header == ["name", "count", "axis_1_m", "axis_2_m", "axis_3_m", "size_m", "good"]
    assert rows[0] == ["one", "1", "1.0", "2.0", "3.0", "0.5", "true"]
    assert rows[1] == ["two", "2", "", "", "", "", ""]
    array = TABLE.array()
    assert array.dtype.names == tuple(header)
    assert array["name"].tolist() == ["one", "two", "three"]
    assert math.isnan(array["size_m"][1])
    keys = ("name", "count", "axis_m", "size_m", "good")
    first, second, _ = TABLE.json()
    assert first == dict(zip(keys, ("one", 1, [1.0, 2.0, 3.0], 0.5, True), strict=True))
    assert second == dict(zip(keys, ("two", 2, None, None, None), strict=True))
    assert screen(TABLE) == [
        ["name", "count", "size", "mm", "verdict"],
        ["one", "1", "500.0", "met"],
        ["two", "2", "–", "–"],
        ["three", "3", "250.0", "NOT", "met"],
    ]
    assert [line.split() for line in printed(TABLE.transposed("screen"))[:3]] == [
        ["one", "two", "three"],
        ["count", "1", "2", "3"],
        ["size,", "mm", "500.0", "–", "250.0"],
    ]


def test_a_column_has_key_and_value_by_its_name_and_words_of_a_row() -> None:
    rows = [Row(axis=Row(turn=math.pi / 6)), Row(axis=Row(turn=None)), Row(axis=None)]
    column = Column.named("turn_deg=axis.turn", "turn", "deg", "{:.1f}".format, "json")
    values = [entry["turn_deg"] for entry in DataTable("", [column], rows).json()]
    assert values == [pytest.approx(30.0), None, None]
    assert [*map(column.worded, rows)] == ["30.0 deg", "–", "–"]
    told = column._replace(words=lambda row: "free" if row.axis is None else None)
    assert [*map(told.shown, rows)] == ["–", "–", "free"]


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
    ("width", "heads", "out"),
    [
        (60, [["scheme", "pulses", "end", "s", "nutation", "left", "shift"]], ""),
        (42, [["scheme", "pulses", "end", "s", "nutation", "left", "shift"]], ""),
        (40, [["nutation"], ["scheme", "pulses", "end", "s", "left", "shift"]], ""),
        (33, [["nutation"], ["scheme", "end", "s", "left", "shift"]], "pulses"),
        (26, [["nutation"], ["scheme", "end", "s", "left"]], "pulses, shift"),
        (18, [["nutation"], ["scheme", "left"]], "pulses, end s, shift"),
    ],
)
def test_columns_are_left_out_by_their_rank_and_named(
    width: int, heads: list[list[str]], out: str
) -> None:
    """The gap narrows, then headings take two lines, then the largest rank goes; never a row."""
    table = RANKED.screen("screen")
    table.brief = True
    lines = [line.split() for line in printed(table, width)]
    rows = len(heads) + 2
    assert lines[: len(heads)] == heads
    assert [line[0] for line in lines[len(heads) : rows]] == ["one-pulse", "two-pulse"]
    last = " ".join(word for line in lines[rows:] for word in line)
    assert last == (f"left out: {out} (-v or a wider screen)" if out else "")


def test_of_many_rows_the_first_ones_and_the_last_are_shown_where_that_saves_room() -> None:
    many = DataTable("", TABLE.columns[:2], [(f"row{index}", index) for index in range(9)])
    assert [row[0] for row in screen(many, first=2)[1:]] == ["row0", "row1", "…", "row8"]
    assert len(screen(many, first=7)[1:]) == 9


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


def test_a_screen_has_the_units_requested_and_files_are_si() -> None:
    """One pound of mass, foot pounds of a vector; a value that is not known stays so."""
    columns = (
        Column("m_kg", "mass", "kg", itemgetter(0), "{:.4f}".format, "screen csv json"),
        Column("M#_Nm", "torque", "N m", itemgetter(1), vector, "screen csv json", kind=TEXT),
    )
    pound, torque = 0.45359237, np.array([1.3558179483314004, 0.0, -2.7116358966628])
    table = DataTable("Units", columns, [(pound, torque), (None, None)])
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


def test_a_requirement_that_is_missed_is_never_dropped() -> None:
    weak = replace(
        spinner(degrees=5.0),
        requirement=Requirement(nutation=math.radians(1e-7), momentum_shift=1e-9),
    )
    lines = glance_lines(compared(weak, "one-pulse"))
    assert lines[2].startswith("NOT met")
    assert any(line.startswith("momentum shift") and line.endswith("NOT met") for line in lines)


def test_of_many_pulses_the_first_ones_and_the_last_are_shown() -> None:
    body = spinner(degrees=5.0, channels=cross(2.0, max_on_time=0.3), limits=Limits(horizon=200.0))
    plan = compared(body, "optimal")
    count = len(plan["optimal"].pulses)
    assert count > ROWS + 1
    rows = glance_lines(plan)
    start = next(index for index, line in enumerate(rows) if line.startswith("pulse"))
    first = [row.split()[0] for row in rows[start + 1 : rows.index("", start)]]
    shown = first.index("…")
    assert first[: shown + 2] == [*map(str, range(1, shown + 1)), "…", str(count)]
    assert f"{count - shown - 1} more" in rows[start + shown + 1]
    assert len(rows) == LINES[0]


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
