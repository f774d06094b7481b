"""Quantities with units, as in files and on command lines; errors cross the border between
processes whole.
"""

import math
import pickle
import re
from multiprocessing import get_context
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.golden import check_text, refusal

import nutdamp
from nutdamp import errors
from nutdamp.units import KINDS, LARGEST, SI, US, parse, pattern, screen_unit, screen_units, shown

UNITS = {
    "mass": {"250 kg": 250.0, "250 g": 0.25, "10 lbm": 4.5359237, "1 slug": 14.593902937206},
    "length": {
        "0.8 m": 0.8,
        "5 mm": 0.005,
        "5 cm": 0.05,
        "5 km": 5000.0,
        "10 ft": 3.048,
        "10 in": 0.254,
    },
    "time": {
        "120 s": 120.0,
        "20 ms": 0.02,
        "2 min": 120.0,
        "2 hours": 7200.0,
        "3 sec": 3.0,
        **dict.fromkeys(("1 hour", "1h", "1 hours"), 3600.0),
        **dict.fromkeys(("2 days", "2d", "2 day"), 172800.0),
    },
    "force": {"10 N": 10.0, "10 mN": 0.01, "5 lbf": 22.241108076303},
    "torque": {
        "8 mN m": 0.008,
        **dict.fromkeys(("10 ft lbf", "10 ft-lbf", "120 in·lbf"), 13.558179483314),
        **dict.fromkeys(
            ("8Nm", "8 Nm", "8 N m", "8 N*m", "8 N·m", "  8   N   m ", "+8 N m", "8. N m"), 8.0
        ),
        **dict.fromkeys(("0.8e1 N m", "80E-1N m"), 8.0),
    },
    "inertia": {
        **dict.fromkeys(
            ("120 kg m^2", "120 kg m²", "120 kgm^2", "120 kg*m²", "120kg·m^2", "120 kg-m^2"), 120.0
        ),
        **dict.fromkeys(("10 slug ft^2", "10 slug-ft²"), 13.558179483314),
        "1e6 lbm in^2": 292.6396534292,
    },
    "travel": {"2 mm/kg": 0.002, "0.1 m/kg": 0.1},
    "shed": {"0.4 kg m^2/kg": 0.4, "0.4 m²": 0.4},
    "angle": {
        "0.5 rad": 0.5,
        "5 mrad": 0.005,
        "90 deg": math.pi / 2,
        "60 arcmin": math.pi / 180,
        "3600 arcsec": math.pi / 180,
        **dict.fromkeys(("180 deg", "180 degrees", "180 degree", "180°", "180 °"), math.pi),
    },
    "right ascension": {
        "0.5 rad": 0.5,
        "5 mrad": 0.005,
        "60 arcmin": math.pi / 180,
        "3600 arcsec": math.pi / 180,
        "180 deg": math.pi,
        **dict.fromkeys(("18 h", "18h 0m", "18h00m00.0s"), 1.5 * math.pi),
        "18h 12m 33s": math.radians(273.1375),
        " 0 h 0 m 0.5 s ": math.radians(0.5 / 240.0),
    },
    "rate": {
        **dict.fromkeys(("3 rad/s", "3 rad/sec"), 3.0),
        **dict.fromkeys(("180 deg/s", "180 °/s", "180 degrees/sec"), math.pi),
        **dict.fromkeys(("60 rpm", "60 RPM", "60Rpm"), 2 * math.pi),
    },
    "speed": {"2 m/s": 2.0, "2 km/s": 2000.0, "10 ft/s": 3.048},
    "pressure": {"2 Pa": 2.0, "2 bar": 2e5, "300 psi": 2068427.1879504},
    "impulse": {"2 N s": 2.0, "2 lbf s": 8.896443230521},
    "ratio": {"2 %": 0.02},
    "acceleration": {"2 m/s^2": 2.0, "2 mm/s²": 0.002, "10 ft/s^2": 3.048},
    "frequency": {"100 Hz": 100.0},
}
"""Every unit of the table, and how it may be spelt."""


@pytest.mark.parametrize("kind", UNITS)
def test_every_unit_and_its_spellings(kind: str) -> None:
    for text, value in UNITS[kind].items():
        assert parse(text, kind) == pytest.approx(value, rel=1e-13)  # of NIST SP 811 for US units
        assert re.search(pattern(kind), text)
    spellings = [re.sub(r"[ *·-]*", "", text).replace("²", "^2") for text in UNITS[kind]]
    assert all(
        any(text.endswith(unit.replace(" ", "")) for text in spellings)
        for unit in KINDS[kind].factors
    )


def test_numbers_are_si_and_a_right_angle_is_half_of_pi() -> None:
    assert parse("90 deg", "angle") == math.pi / 2
    assert (parse(3, "rate"), parse(0.25, "number")) == (3.0, 0.25)
    # A bare number in a text is for command lines.
    assert (parse("30", "time", bare=True), parse("-.5", "number", bare=True)) == (30.0, -0.5)


def test_refusals_say_what_is_allowed() -> None:
    check_text(
        "units.refused",
        "\n".join(
            refusal(ValueError, parse, value, kind)
            for value, kind in [
                *[
                    ("30", "time"),
                    ("20 Hz", "rate"),
                    ("2 rev/min", "rate"),
                    ("1 rev", "angle"),
                    ("5 KG", "mass"),
                    ("5 m s", "time"),
                ],
                *[
                    ("120 kg", "inertia"),
                    ("5 rpm", "angle"),
                    ("18h 12m 33s", "angle"),
                    ("18 h", "angle"),
                    ("18h 72m 33s", "right ascension"),
                    ("25h 12m 33s", "right ascension"),
                    ("18:12:33", "right ascension"),
                    ("-23d 26m 21s", "angle"),
                    ("95° 3' 2\"", "angle"),
                    ("18h 12m 33,5s", "right ascension"),
                    ("5 s", "right ascension"),
                    ("-0,5 deg", "angle"),
                    ("0,5", "angle"),
                    ("1,234.5 kg", "mass"),
                    ("5 deg", "ratio"),
                    ("1 m", "number"),
                    ("1", "number"),
                ],
                *[
                    (text, "mass")
                    for text in (
                        "1,5 kg",
                        "1_000 kg",
                        "1 500 kg",
                        "heavy",
                        "",
                        "0x10 kg",
                        "1e400 kg",
                    )
                ],
                *[
                    (True, "mass"),
                    (None, "time"),
                    ([1], "time"),
                    ({}, "number"),
                    (math.nan, "mass"),
                    (-math.inf, "mass"),
                ],
                *[
                    ("1e308 min", "time"),
                    (10**400, "mass"),
                    (1.1e15, "mass"),
                    ("-2e15 N m", "torque"),
                ],
            ]
        ),
    )
    for unit in ("Deg", "dg", "secs", "Sec", "hrs", "rp m", "deg°", "M", "KM", "msec", "arcmins"):
        for kind in KINDS:
            with pytest.raises(ValueError, match="is not a"):
                parse(f"5 {unit}", kind)
            assert not re.search(pattern(kind), f"5 {unit}")


def test_messages_stay_short_and_on_one_line() -> None:
    assert len(shown("x" * 10_000)) < 80
    assert "\n" not in shown("a\nb")


@given(st.text(max_size=20), st.sampled_from(sorted(KINDS)), st.booleans())
def test_any_text_is_a_quantity_or_a_value_error(text: str, kind: str, bare: bool) -> None:
    try:
        assert abs(parse(text, kind, bare=bare)) <= LARGEST
    except ValueError:
        return


@given(
    st.floats(-1e6, 1e6),
    st.sampled_from([(kind, unit) for kind in KINDS for unit in KINDS[kind].factors]),
    st.sampled_from(["", " ", "   "]),
)
def test_what_parses_fits_the_pattern(
    number: float, kind_and_unit: tuple[str, str], space: str
) -> None:
    kind, unit = kind_and_unit
    text = f"{number!r}{space}{unit}"
    assert parse(text, kind) == number * KINDS[kind].factors[unit]
    assert re.search(pattern(kind), text)


SCREENS = [
    ("kg", "lbm", 1 / 0.45359237),
    ("g", "lbm", 1e-3 / 0.45359237),
    ("kg/year", "lbm/year", 1 / 0.45359237),
    ("N", "lbf", 1 / 4.4482216152605),
    ("N s", "lbf s", 1 / 4.4482216152605),
    ("N m", "ft lbf", 1 / 1.3558179483314004),
    ("N m s", "ft lbf s", 1 / 1.3558179483314004),
    ("kg m²", "slug ft²", 1 / 1.3558179483314004),
    ("m", "ft", 1 / 0.3048),
    ("mm", "in", 1 / 25.4),
    ("m/s", "ft/s", 1 / 0.3048),
    ("m/s²", "ft/s²", 1 / 0.3048),
    ("bar", "psi", 14.503773773020923),
]
"""Units of SI and of US screens, and factors by NIST SP 811."""


@pytest.mark.parametrize(("si", "us", "factor"), SCREENS)
def test_screens_have_us_units_where_requested(si: str, us: str, factor: float) -> None:
    assert screen_unit(si, 3.0) == (si, 3.0)
    with screen_units(US):
        assert screen_unit(si)[0] == us
        assert screen_unit(si)[1] == pytest.approx(factor, rel=1e-14)
        assert screen_unit(si, 3.0)[1] == pytest.approx(3.0 * factor, rel=1e-14)
        assert screen_unit(us, 2.0) == (us, 2.0)
        with screen_units(SI):
            assert screen_unit(si) == (si, 1.0)
    assert screen_unit(si) == (si, 1.0)


@pytest.mark.parametrize(
    "unit", ["", "s", "ms", "min", "rad/s", "mrad/s", "deg", "rpm", "%", "%/day", "1/day", "Hz"]
)
def test_angles_rates_times_and_shares_are_the_same_in_both_systems(unit: str) -> None:
    with screen_units(US):
        assert screen_unit(unit, 2.0) == (unit, 2.0)


FAULTS = [errors.Fault("b.yaml", 3, 1, "mass", "zero"), errors.Fault("a.yaml", 0, 0, "", "empty")]
EVERY = [
    errors.NutdampError("anything"),
    errors.FaultyFile(FAULTS),
    errors.BadRequest("no such scheme"),
    errors.Unsuitable(("attitude", "epoch"), "before 1972"),
    errors.SenselessOption("per_turn", "0", "expected a whole number of at least 1"),
    errors.CannotRead("in.yaml", "no such file"),
    errors.CannotWrite("out.csv", "permission denied"),
    errors.MissingExtra("plot", "a picture"),
    errors.MissingPandas(),
    errors.Infeasible("no thrusters"),
    errors.NotFound("no schedule within the budget"),
    errors.TooShort("no pulse fits", "limits.horizon = 90 s is long enough"),
]


def test_every_kind_of_error_survives_pickling() -> None:
    kinds = {
        kind
        for kind in vars(errors).values()
        if isinstance(kind, type) and issubclass(kind, BaseException)
    }
    assert {type(error) for error in EVERY} == kinds
    for error in EVERY:
        again = pickle.loads(pickle.dumps(error))
        assert (type(again), str(again), vars(again)) == (type(error), str(error), vars(error))
    assert str(errors.FaultyFile(FAULTS)) == "a.yaml: empty\nb.yaml:3:1: mass: zero"  # sorted


@pytest.mark.deep
def test_a_pool_of_processes_reports_a_missing_file(tmp_path: Path) -> None:
    with get_context("spawn").Pool(1) as pool:
        waiting = pool.apply_async(nutdamp.load, (tmp_path / "missing.yaml",))
        with pytest.raises(errors.CannotRead, match=r"missing\.yaml"):
            # where the error cannot be rebuilt the pool waits for it for ever; see the test above
            waiting.get()
