"""Moments of UTC: exact, with leap seconds, read and written as ISO 8601; where the Sun is seen at each."""

from __future__ import annotations

import datetime
import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import orekit, places
from support.golden import check_text

from nutdamp.common.time import FIRST_DAY, LEAP_DAYS, Epoch
from nutdamp.physics import attitude, sky


def test_the_leap_seconds_are_those_of_another_list() -> None:
    lines = orekit.tai_utc().splitlines()
    assert len(lines) == 28
    days = [round(float(line.split("=JD")[1].split()[0]) - 1721424.5) for line in lines]
    assert (days[0], days[1:]) == (FIRST_DAY, [day + 1 for day in LEAP_DAYS])


def test_texts() -> None:
    for text, written in {
        "2026-03-01T12:00:00Z": "2026-03-01T12:00:00.000000000",
        "2026-03-01T12:00": "2026-03-01T12:00:00.000000000",
        "2013-02-05 18:07:07+00:00": "2013-02-05T18:07:07.000000000",  # a blank for the T
        "2026-060T12:00:00.25": "2026-03-01T12:00:00.250000000",
        "2024-366T00:00:00": "2024-12-31T00:00:00.000000000",
        "2026-03-01T12:00:00.1234567894": "2026-03-01T12:00:00.123456789",
        "2026-12-31T23:59:59.9999999999": "2027-01-01T00:00:00.000000000",
        "2016-12-31T23:59:59.9999999999": "2016-12-31T23:59:60.000000000",
        "2016-12-31T23:59:60.5": "2016-12-31T23:59:60.500000000",
        "2017-01-01T02:59:60+03:00": "2016-12-31T23:59:60.000000000",
        "2026-03-01T00:30:00+02:00": "2026-02-28T22:30:00.000000000",
        "2026-02-28T20:00:00-05:30": "2026-03-01T01:30:00.000000000",
        "1972-01-01T00:00:00": "1972-01-01T00:00:00.000000000",
    }.items():
        assert Epoch.parse(text).text == written
    for exact, shown in {
        "2026-03-01T12:00:00.1239": "2026-03-01T12:00:00.124",  # fewer digits: rounded, not cut
        "2026-03-01T12:00:00.1234": "2026-03-01T12:00:00.123",
        "2026-03-01T12:00:59.99951": "2026-03-01T12:01:00.000",
        "2026-12-31T23:59:59.9996": "2027-01-01T00:00:00.000",
        "2016-12-31T23:59:59.9996": "2016-12-31T23:59:60.000",
        "2016-12-31T23:59:60.9996": "2017-01-01T00:00:00.000",
    }.items():
        assert Epoch.parse(exact).rounded(3) == shown


def test_texts_that_are_none() -> None:
    said = []
    for text in (
        *("yesterday", "2026-03-01_12:00:00", "2026-03-01T12:00:00,5", "1971-12-31T23:59:59"),
        *("2025-366T00:00:00", "2026-000T00:00:00"),
        *("2026-03-01T24:00:00", "2026-03-01T12:60:00", "2026-03-01T23:59:60"),
        *("2016-12-31T23:58:60", "2016-12-31T23:59:61"),
    ):
        with pytest.raises(ValueError) as refusal:  # noqa: PT011 - its text is kept
            Epoch.parse(text)
        said.append(str(refusal.value))
    check_text("epoch.refused", "\n".join(said))
    with pytest.raises(ValueError, match="no epoch: day"):  # in the words of Python
        Epoch.parse("2026-02-29T00:00:00")


def test_seconds_pass_a_leap_second_one_by_one() -> None:
    start = Epoch.parse("2016-12-31T23:59:58.5")
    texts = [start.plus(step).text for step in range(4)]
    assert [text[11:21] for text in texts] == ["23:59:58.5", "23:59:59.5", "23:59:60.5", "00:00:00.5"]
    assert Epoch.parse(texts[3]).since(start) == 3.0


@given(
    st.datetimes(datetime.datetime(1972, 1, 1), datetime.datetime(2100, 1, 1)), st.floats(0.0, 1e6), st.integers(1, 9)
)
def test_nothing_is_lost_but_the_last_digit(moment: datetime.datetime, seconds: float, digits: int) -> None:
    epoch = Epoch.parse(moment.isoformat())
    later = epoch.plus(seconds)
    assert later.elapsed - epoch.elapsed == Fraction(seconds)
    assert Epoch.parse(later.text).text == later.text == later.rounded(9)
    text = later.rounded(digits)
    assert abs(Epoch.parse(text).elapsed - later.elapsed) <= Fraction(1, 2 * 10**digits)
    assert len(text) == len("2016-12-25T00:00:00.") + digits


@given(st.datetimes(datetime.datetime(2017, 1, 1), datetime.datetime(2100, 1, 1)))
def test_without_leap_seconds_it_is_the_calendar(moment: datetime.datetime) -> None:
    since = Epoch.parse(moment.isoformat()).elapsed - Epoch.parse("2017-01-01T00:00:00").elapsed
    assert since == Fraction((moment - datetime.datetime(2017, 1, 1)) // datetime.timedelta(microseconds=1), 10**6)


@pytest.mark.parametrize(
    ("text", "system"),
    [("2017-01-01T00:00:37", "TAI"), ("2017-01-01T00:00:18", "GPS"), ("2017-01-01T00:01:09.184", "TT")],
)
def test_clocks_without_leap_seconds(text: str, system: str) -> None:
    """TAI - UTC is 37 s from 2017 on (IERS, Bulletin C 52); GPS is TAI - 19 s, TT is TAI + 32.184 s."""
    assert Epoch.parse(text, system) == Epoch.parse("2017-01-01T00:00:00Z")
    with pytest.raises(ValueError, match="zone"):
        Epoch.parse(f"{text}Z", system)
    assert Epoch.parse(text, system).since(Epoch.parse("2016-12-31T23:59:60Z")) == 1.0


def test_days_count_from_j2000_in_terrestrial_time_and_barycentric_time_swings() -> None:
    """In 2000 TAI was UTC + 32 s; TDB - TT follows the anomaly of the Earth, 0 at perihelion and 1.66 ms at most."""
    for text, days in (("2000-01-01T11:58:55.816Z", 0.0), ("2000-01-02T11:58:55.816Z", 1.0)):
        assert Epoch.parse(text).days_of_j2000 == days
    assert Epoch.parse("1972-01-01T00:00:00Z").days_of_j2000 == pytest.approx(-10227.4995118, abs=1e-6)
    for day, ahead in (("2026-04-04", 1.6e-3), ("2026-10-05", -1.6e-3), ("2026-01-04", 0.0)):
        difference = Epoch.parse(f"{day}T00:00:00", "TT").since(Epoch.parse(f"{day}T00:00:00", "TDB"))
        assert difference == pytest.approx(ahead, abs=1e-4)


def test_the_direction_of_the_sun_is_right_to_a_hundredth_of_a_degree_from_1972_to_2100() -> None:
    """Against ERFA (golden/make_sun.py)."""
    rows = np.loadtxt(places.GOLDEN / "sun.csv", delimiter=",", skiprows=1)
    errors = [float(attitude.angle_between(sky.direction(days), row)) for days, *row in rows.tolist()]
    assert len(errors) == 100
    assert math.degrees(max(errors)) < 0.01
