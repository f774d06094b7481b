"""Pole curve and axis track in the terminal: braille dots where the track is, equal scales, widths that fit."""

from __future__ import annotations

import io
import math

import numpy as np
import pytest
from rich.console import Console
from rich.text import Text
from support.builders import cross, spinner
from support.cases import deep

import nutdamp
from nutdamp.figures.geometry import ticks
from nutdamp.figures.terminal import FAINT, BraillePanel, framed, motion_drawing
from nutdamp.flight import propagation
from nutdamp.flight.propagation import Flight, Track
from nutdamp.planning import plan as planning
from nutdamp.spacecraft.equipment import Steerable
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.schedule import Schedule

pytestmark = pytest.mark.usefixtures("plans_shared")

CASES: dict[str, tuple[Spacecraft, str]] = {
    "two pulses": (spinner(channels=cross(20.0)), "two-pulse"),
    "34 pulses": (spinner(degrees=8.0, channels=cross(20.0, max_on_time=0.05)), "four-pulse"),
    "reversed": (spinner(80, 120, -3.0, 75.0, steerable=Steerable()), "two-pulse"),
    "0.0001°": (spinner(degrees=1e-4, steerable=Steerable()), "two-pulse"),
    "free": (spinner(), "none"),
    "no nutation": (spinner(degrees=0.0), "none"),
}


WIDTHS = (40, 60, 80, 140, 220)


def flown(case: str) -> tuple[Flight, Track]:
    body, scheme = CASES[case]
    pulses = planning.plan(body, scheme).pulses
    end = pulses.end + body.inertial_period
    made = propagation.flown(body, pulses, end)
    return made, made.sampled(300, end)


def screen(case: str, width: int, **settings: object) -> str:
    stream = io.StringIO()
    Console(file=stream, width=width, **settings).print(motion_drawing(*flown(case)))  # type: ignore[arg-type]
    return stream.getvalue()


def dots(lines: list[Text]) -> Vector:
    """Dots (n, 2), right and down from the upper left, that the characters of a panel show."""
    found = []
    for row, line in enumerate(lines):
        for column, sign in enumerate(line.plain):
            if 0x2800 <= ord(sign) <= 0x28FF:
                bits = ord(sign) - 0x2800
                # The standard numbers the dots 1 2 3 7 down the left column, 4 5 6 8 down the right.
                for bit, (x, y) in enumerate([(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2), (0, 3), (1, 3)]):
                    if bits >> bit & 1:
                        found.append((2 * column + x, 4 * row + y))
    return np.array(found, dtype=float).reshape(-1, 2)


def panel(columns: int = 20) -> BraillePanel:
    return BraillePanel(columns, np.zeros(2), 1.0)


# --- braille ---------------------------------------------------------------------------------------------------------


def test_corners_of_the_data_are_corners_of_the_panel_and_what_lies_outside_is_left_out() -> None:
    for place, spots in {
        (-1, 1): [[0, 0]], (1, 1): [[39, 0]], (-1, -1): [[0, 39]], (1, -1): [[39, 39]], (1.2, 0): [], (0, -1.1): []
    }.items():  # fmt: skip
        drawn = panel()
        drawn.scatter(np.array([place], dtype=float), "")
        assert dots(drawn.lines()).tolist() == spots


@pytest.mark.parametrize("columns", [10, 20, 31, 61])
def test_a_circle_is_round_and_closed(columns: int) -> None:
    drawn = panel(columns)
    turn = np.linspace(0, 2 * math.pi, 300)
    drawn.curve(0.8 * np.column_stack([np.cos(turn), np.sin(turn)]), "")
    seen = dots(drawn.lines())
    size = np.array([2 * columns - 1, 4 * drawn.rows - 1])
    share = (seen / size - 0.5) * 2.0
    assert np.hypot(*share.T) == pytest.approx(0.8, abs=1.5 / columns)
    across = np.ptp(seen, axis=0)
    assert abs(across[0] - across[1]) <= 2
    angles = np.sort(np.arctan2(*share.T))
    assert np.diff(angles).max() < 2.5 / columns / 0.4


def test_faint_lines_give_way_to_curves() -> None:
    both, alone = panel(), panel()
    both.scatter(np.column_stack([np.linspace(-1, 1, 100), np.full(100, 0.02)]), FAINT)
    for drawn in (both, alone):
        drawn.curve(np.array([[-1.0, 0.0], [1.0, 0.0]]), "cyan")
    kept = {tuple(dot) for dot in dots(alone.lines())}
    cells = {(x // 2, y // 4) for x, y in kept}
    assert {tuple(dot) for dot in dots(both.lines()) if (dot[0] // 2, dot[1] // 4) in cells} == kept


def test_numbers_never_touch() -> None:
    drawn = panel()
    placed = [drawn.mark(np.array([0.01 * number, 0.0]), str(10 + number), "") for number in range(10)]
    assert placed[0]
    assert not all(placed)
    for line in drawn.lines():
        assert all(len(word) == 2 for word in line.plain.replace("⠀", " ").split())


@pytest.mark.parametrize(("low", "high"), [(-1.0, 1.0), (0.0, 1e-7), (-3e5, 4.1e5), (38.99, 41.01), (-1e-9, 2e-9)])
@pytest.mark.parametrize("most", [2, 5, 9])
def test_ticks_are_round_and_few(low: float, high: float, most: int) -> None:
    found = ticks(low, high, most)
    assert 1 <= len(found) <= most + 1
    assert all(low - 1e-9 * (high - low) <= value <= high + 1e-9 * (high - low) for value in found)
    steps = np.diff(found)
    if len(steps):
        mantissa = steps[0] / 10.0 ** math.floor(math.log10(steps[0]) + 1e-9)
        assert steps == pytest.approx(steps[0])
        assert min(abs(mantissa - round_) for round_ in (1.0, 2.0, 5.0, 10.0)) < 1e-6


def test_ticks_stand_at_their_values() -> None:
    """The number beside a line is that of its dots; below, that of its column."""
    drawn = panel(40)
    for value in (-0.5, 0.5):
        drawn.scatter(np.array([[value, value]]), "")
    lines = framed(drawn, "T", "x, deg", "y, deg")
    body = lines[2 : 2 + drawn.rows]
    rows = {row for row, line in enumerate(body) if any("\u2801" <= sign <= "\u28ff" for sign in line.plain)}
    named = {row: line.plain.split("┤")[0].strip() for row, line in enumerate(body) if "┤" in line.plain}
    assert {named[row] for row in rows if row in named} == {"0.5", "-0.5"}
    rule, names = lines[2 + drawn.rows].plain, lines[3 + drawn.rows].plain
    for mark in ("0.5", "-0.5"):
        assert rule[names.index(f" {mark}") + 1 + len(mark) // 2] == "┬"


# --- the drawing -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("case", "width"),
    [
        (case, width) if case in ("free", "reversed") and width < 100 else deep(case, width)
        for case in CASES
        for width in WIDTHS
    ],
)
def test_every_line_fits_the_terminal_and_nothing_but_text_is_sent(case: str, width: int) -> None:
    shown = screen(case, width)
    assert all(len(line) <= width for line in shown.splitlines())
    assert "\x1b" not in shown
    units = {"ω1, °/s", "ω2, °/s", "towards inertial x, °", "towards inertial y, °", "Pole curve", "Axis track"}
    assert not [unit for unit in units if unit not in shown]
    assert ("Axis track" in shown.splitlines()[1]) == (width >= 76), "side by side where there is room"
    assert ("spin about -3" in shown) == (case == "reversed")


def test_it_grows_with_the_terminal_and_has_colours_only_where_they_are_wanted() -> None:
    assert len(screen("free", 140).splitlines()) > 1.6 * len(screen("free", 80).splitlines())
    assert "\x1b[" in screen("two pulses", 80, force_terminal=True, color_system="standard")
    plain = screen("two pulses", 80, force_terminal=True, color_system="standard", no_color=True)
    assert not any(f"\x1b[{colour}m" in plain for colour in range(30, 38))


def test_pulses_are_numbered_where_there_is_room() -> None:
    few = screen("two pulses", 80)
    assert "digits: firing" in few
    assert set("ox12") <= set("".join(line[:39] for line in few.splitlines()[3:17]))
    assert "digits" not in screen("free", 80)


def test_the_dots_are_the_track() -> None:
    """Of free motion: every dot of the left panel lies on the circle of ω, and all of it is there."""
    made, track = flown("free")
    made = propagation.flown(made.spacecraft, Schedule(), made.spacecraft.body_period)
    drawing = motion_drawing(made, made.sampled(100, made.spacecraft.body_period))
    lines = drawing.pole_curve(45)[2:-3]
    begins = min(line.plain.index(sign) for line in lines for sign in "│┤" if sign in line.plain) + 1
    inner = [line[begins:] for line in lines]
    for line in inner:  # without the faint lines through zero
        for span in [span for span in line.spans if span.style == FAINT]:
            line.plain = line.plain[: span.start] + " " * (span.end - span.start) + line.plain[span.end :]
    seen = dots(inner)
    radius = np.degrees(np.hypot(*track.rates[0, :2]))
    size = np.array([2 * (45 - begins) - 1, 4 * len(lines) - 1])
    place = (seen / size - 0.5) * 2.0 * 1.1 * radius
    assert len(seen) > 150
    assert np.hypot(*place.T) == pytest.approx(radius, rel=0.03)


@pytest.mark.parametrize("turned", [False, True])
def test_the_pole_curve_says_where_its_axes_are_not_those_of_the_file(turned: bool) -> None:
    tensor = [[100.0, 1.0, 0.0], [1.0, 120.0, 0.0], [0.0, 0.0, 80.0]] if turned else np.diag([100.0, 120.0, 80.0])
    state = {"spin": 3.0, "nutation": "5 deg"}
    body = nutdamp.load({"name": "turned", "inertia": {"tensor": np.asarray(tensor).tolist()}, "state": state})
    flight = propagation.flown(body, Schedule(), body.inertial_period)
    stream = io.StringIO()
    Console(file=stream, width=120).print(motion_drawing(flight, flight.sampled(50, body.inertial_period)))
    assert ("principal axes" in stream.getvalue()) is turned
