from __future__ import annotations

import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nutdamp.units import KINDS, LARGEST, parse, pattern, shown

pytestmark = pytest.mark.usefixtures("plans_shared")


@pytest.mark.parametrize(
    ("text", "kind", "value"),
    [
        ("250 kg", "mass", 250.0),
        ("250 g", "mass", 0.25),
        ("0.8 m", "length", 0.8),
        ("5 mm", "length", 0.005),
        ("5 cm", "length", 0.05),
        ("5 km", "length", 5000.0),
        ("120 s", "time", 120.0),
        ("20 ms", "time", 0.02),
        ("2 min", "time", 120.0),
        ("2 hours", "time", 7200.0),
        ("10 N", "force", 10.0),
        ("10 mN", "force", 0.01),
        ("8 N m", "torque", 8.0),
        ("8 mN m", "torque", 0.008),
        ("120 kg m^2", "inertia", 120.0),
        ("0.4 kg m^2/kg", "shed", 0.4),
        ("0.4 m²", "shed", 0.4),
        ("0.5 rad", "angle", 0.5),
        ("5 mrad", "angle", 0.005),
        ("180 deg", "angle", math.pi),
        ("3 rad/s", "rate", 3.0),
        ("180 deg/s", "rate", math.pi),
        ("60 rpm", "rate", 2 * math.pi),
        ("2 %", "ratio", 0.02),
        ("2 m/s^2", "acceleration", 2.0),
        ("2 mm/s²", "acceleration", 0.002),
        ("100 Hz", "frequency", 100.0),
    ],
)
def test_every_unit_of_the_table(text: str, kind: str, value: float) -> None:
    assert parse(text, kind) == pytest.approx(value, rel=1e-15)
    assert re.fullmatch(pattern(kind), text)


def test_the_table_holds_nothing_else() -> None:
    units = {unit for kind in KINDS.values() for unit in kind.factors}
    assert len(units) == 32


@pytest.mark.parametrize(
    "text", ["8Nm", "8 Nm", "8 N*m", "8 N·m", "  8   N   m ", "+8 N m", "8. N m", "0.8e1 N m", "80E-1N m"]
)
def test_spellings_of_one_quantity(text: str) -> None:
    assert parse(text, "torque") == 8.0
    assert re.search(pattern("torque"), text)


@pytest.mark.parametrize(
    ("text", "kind", "value"),
    [
        ("180 degrees", "angle", math.pi),
        ("180 degree", "angle", math.pi),
        ("180°", "angle", math.pi),
        ("180 °", "angle", math.pi),
        ("180 °/s", "rate", math.pi),
        ("180 degrees/sec", "rate", math.pi),
        ("3 rad/sec", "rate", 3.0),
        ("60 RPM", "rate", 2 * math.pi),
        ("60Rpm", "rate", 2 * math.pi),
        ("3 sec", "time", 3.0),
        ("1 hour", "time", 3600.0),
    ],
)
def test_spellings_of_words_within_units(text: str, kind: str, value: float) -> None:
    assert parse(text, kind) == pytest.approx(value, rel=1e-15)
    assert re.search(pattern(kind), text)


@pytest.mark.parametrize("unit", ["Deg", "dg", "secs", "Sec", "hrs", "rp m", "deg°", "M", "KM", "msec", "arcmin"])
def test_other_spellings_are_refused(unit: str) -> None:
    for kind in KINDS:
        with pytest.raises(ValueError, match="is not a"):
            parse(f"5 {unit}", kind)
        assert not re.search(pattern(kind), f"5 {unit}")


@pytest.mark.parametrize("text", ["120 kg m²", "120 kgm^2", "120 kg*m²", "120kg·m^2"])
def test_spellings_of_an_inertia(text: str) -> None:
    assert parse(text, "inertia") == 120.0
    assert re.search(pattern("inertia"), text)


def test_a_right_angle_is_exactly_half_of_pi() -> None:
    assert parse("90 deg", "angle") == math.pi / 2


def test_numbers_are_si() -> None:
    assert parse(3, "rate") == 3.0
    assert parse(0.25, "number") == 0.25


def test_a_bare_number_in_a_text_is_for_command_lines() -> None:
    assert parse("30", "time", bare=True) == 30.0
    assert parse("-.5", "number", bare=True) == -0.5
    with pytest.raises(ValueError, match="'30' has no unit; add s, ms, min or hours, or leave the quotes out"):
        parse("30", "time")


@pytest.mark.parametrize(
    ("value", "kind", "message"),
    [
        (
            "20 Hz",
            "rate",
            "'20 Hz': 'Hz' is not a unit of angular rate; use rad/s, deg/s or rpm (Hz hides a factor 2π)",
        ),
        ("2 rev/min", "rate", "(rev/min hides a factor 2π)"),
        ("1 rev", "angle", "'rev' is not a unit of angle; use rad, mrad or deg (rev hides a factor 2π)"),
        ("5 KG", "mass", "'KG' is not a unit of mass; use kg or g"),
        ("5 m s", "time", "'m s' is not a unit of time"),
        (
            "120 kg",
            "inertia",
            "'120 kg' is a mass; expected a moment of inertia: a number in kg m^2, or a text in kg m^2",
        ),
        ("5 rpm", "angle", "'5 rpm' is an angular rate; expected an angle"),
        ("5 deg", "ratio", "'5 deg' is an angle; expected a ratio: a number, or a text in %"),
        ("1,5 kg", "mass", "'1,5 kg' is not a mass: a number in kg, or a text in kg or g"),
        ("1_000 kg", "mass", "is not a mass"),
        ("1 500 kg", "mass", "is not a mass"),
        ("heavy", "mass", "'heavy' is not a mass"),
        ("", "mass", "'' is not a mass"),
        ("0x10 kg", "mass", "'x10 kg' is not a unit of mass"),
        ("1", "number", "'1' is not a plain number: no unit, no quotes"),
        ("1 m", "number", "'1 m' is not a plain number: no unit, no quotes"),
        (True, "mass", "expected a mass (a number in kg, or a text in kg or g), got true"),
        (None, "time", "expected a time (a number in s, or a text in s, ms, min or hours), got nothing"),
        ([1], "time", "expected a time (a number in s, or a text in s, ms, min or hours), got a list"),
        ({}, "number", "expected a plain number (no unit, no quotes), got a mapping"),
        (math.nan, "mass", "nan is not a finite number"),
        (-math.inf, "mass", "-inf is not a finite number"),
        ("1e400 kg", "mass", "'1e400 kg' is not a finite number"),
        ("1e308 min", "time", "is not a finite number"),
        (10**400, "mass", "is not a finite number"),
        (1.1e15, "mass", "is beyond anything physical; at most 1e+15 kg"),
        ("-2e15 N m", "torque", "is beyond anything physical; at most 1e+15 N m"),
    ],
)
def test_refusals_say_what_is_allowed(value: object, kind: str, message: str) -> None:
    with pytest.raises(ValueError, match=re.escape(message)):
        parse(value, kind)


def test_messages_stay_short_and_on_one_line() -> None:
    assert len(shown("x" * 10_000)) < 80
    assert "\n" not in shown("a\nb")


@given(st.text(max_size=20), st.sampled_from(sorted(KINDS)), st.booleans())
def test_any_text_is_a_quantity_or_a_value_error(text: str, kind: str, bare: bool) -> None:
    try:
        value = parse(text, kind, bare=bare)
    except ValueError:
        return
    assert abs(value) <= LARGEST


@given(
    st.floats(-1e6, 1e6),
    st.sampled_from([(kind, unit) for kind in KINDS for unit in KINDS[kind].factors]),
    st.sampled_from(["", " ", "   "]),
)
def test_what_parses_fits_the_pattern(number: float, kind_and_unit: tuple[str, str], space: str) -> None:
    kind, unit = kind_and_unit
    text = f"{number!r}{space}{unit}"
    assert parse(text, kind) == number * KINDS[kind].factors[unit]
    assert re.search(pattern(kind), text)
