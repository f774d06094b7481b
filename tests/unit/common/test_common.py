"""Searches are bounded by counted work: they end with the best found so far, and say so; instants
of time.
"""

import datetime
import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import messages, places
from support.builders import aimed, codes, cross, spinner
from support.cases import deep, spread
from support.golden import check_text, refusal

from nutdamp.common import work
from nutdamp.common.time import FIRST_DAY, LEAP_DAYS, Epoch
from nutdamp.files.reader import load_spacecraft
from nutdamp.flight import dynamics, propagation
from nutdamp.physics import attitude, sky
from nutdamp.planning import plan as planning
from nutdamp.planning.causes import CUT, infeasibility
from nutdamp.planning.decision import compare
from nutdamp.planning.notes import comparison_warnings, plan_notes
from nutdamp.schemes.optimal import linear_program
from nutdamp.spacecraft.model import Disturbance, Goal, Limits
from nutdamp.spacecraft.schedule import Schedule


def test_steps_of_a_task_are_part_of_a_step_of_the_task_around_it() -> None:
    heard: list[tuple[float, float]] = []
    with work.watched() as watch:
        seen = [watch.task]
        work.reach(5.0)  # nobody counts
        with work.steps(10.0, hook=lambda done, of: heard.append((done, of))) as whole:
            assert whole.share == 0.0
            with work.steps(4.0, 5.0):
                work.reach(2.0)
                assert whole.share == 0.25
                work.reach(9.0)  # more than was expected
                assert whole.share == 0.5
            assert whole.share == 0.5
            whole.reach(7.0)
            with work.steps(0.0):
                assert whole.share == 0.8
            seen.append(watch.task)
    assert seen == [None, whole]
    assert heard == [(7.0, 10.0)]


def test_work_counts_for_all_budgets_around_it_and_who_watches_sees_the_innermost() -> None:
    with work.watched() as watch:
        seen = [watch.budget]
        with work.budget("all", 10.0) as outer:
            with work.budget("first", 7.0) as first:
                seen.append(watch.budget)
                for left in (3.0, 0.0):
                    work.spend(4.0)
                    assert (work.left(), work.exhausted()) == (left, left == 0.0)
            seen.append(watch.budget)
            assert (first.done, outer.done) == (8.0, 8.0)
            with work.budget("second", 7.0) as second:
                assert second.most == 2.0
            assert not work.exhausted()
            assert outer.done == 8.0
        seen.append(watch.budget)
    assert seen == [None, first, outer, None]
    assert work.left() == math.inf
    work.spend(1e9)  # nobody counts
    assert not work.exhausted()


def test_flights_count_by_legs_and_steps() -> None:
    driven = replace(
        spinner(moments=(100.0, 120.0, 80.0)), disturbances=(Disturbance(1e-3 + 0.0j),)
    )
    for body, until in ((spinner(channels=cross(8.0)), 10.0), (driven, 100.0)):
        with work.budget("flight", 1e9) as spent:
            flown = propagation.flown(body, Schedule(), until)
        if body.inertia.symmetric:
            assert 0.0 < spent.done == dynamics.LEG * len(flown.legs)
        else:
            assert spent.done > dynamics.STEP * flown.steps > 10.0


@pytest.mark.parametrize("most", [20.0, deep(500.0)])
def test_a_search_that_is_cut_ends_soon_with_what_it_has(
    most: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A comparison shares one budget."""
    body = load_spacecraft(places.case("slow-optimal.yaml"))
    monkeypatch.setattr(work, "SCHEME", most)
    with work.budget("test", 1e9) as spent:
        plan = planning.plan(body, "optimal")
    assert plan._cut
    assert spent.done < most + 300.0
    assert "search-ended" in codes(plan_notes(plan)) or CUT in infeasibility(plan)
    monkeypatch.setattr(work, "COMMAND", 30.0)
    with work.budget("test", 1e9) as spent:
        compared = compare(body, ("one-pulse", "optimal"))
    assert compared.plans[-1]._cut
    for other in (
        compared,
        compare(replace(body, goal=Goal(), requirement=None), ("one-pulse", "optimal")),
    ):
        missed = other.recommendation.standing is not planning.Standing.COMPLIES
        assert (missed, other.plans[-1]._cut) == (other is compared, True)
        assert ("search-incomplete" in codes(comparison_warnings(other))) is missed
    assert spent.done < 330.0


def test_what_is_not_cut_is_the_same_with_any_budget(monkeypatch: pytest.MonkeyPatch) -> None:
    body = load_spacecraft(places.case("kick-stage.yaml"))
    before = planning.plan(body, "optimal")
    monkeypatch.setattr(work, "SCHEME", 1e9)
    after = planning.plan(body, "optimal")
    assert (before._cut, before.feasible) == (False, True)
    assert [(one.t, one.on_time) for one in before.pulses] == [
        (one.t, one.on_time) for one in after.pulses
    ]
    assert "search-ended" not in codes(plan_notes(before))


@pytest.mark.deep
@spread("scheme", ["rhumb-line", "half-cone"], quick=1)
def test_damping_of_thousands_of_turns_before_a_turn_of_the_axis_is_cut_too(
    scheme: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each of its pulses takes a thousand steps of integration, and neither it nor a longer horizon
    is tried twice.
    """
    body = replace(
        spinner(200.0, 250.0, -0.44, degrees=89.9, channels=cross(30.0)), dissipation=1e4
    )
    monkeypatch.setattr(work, "SCHEME", 300.0)
    with work.budget("test", 1e9) as spent:
        plan = planning.plan(aimed(body, 40.0, 10.0), scheme)
    assert (plan._cut, plan.feasible) == (True, False)
    assert spent.done < 1500.0  # of 39,000 without a bound


def test_a_longer_horizon_is_sought_within_bounds(monkeypatch: pytest.MonkeyPatch) -> None:
    """What only names a cure leaves the other schemes of a comparison their search."""
    body = aimed(
        spinner(150.0, 100.0, 0.3, channels=cross(1.0), limits=Limits(horizon=60.0)), 40.0, 10.0
    )
    units, named = [], []
    for most in (0.0, 50.0, work.CURE):
        monkeypatch.setattr(work, "CURE", most)
        with work.budget("test", 1e9) as spent:
            plan = planning.plan(body, "rhumb-line")
        units.append(spent.done)
        named.append("limits.horizon" in infeasibility(plan))
    assert named == [False, False, True]
    assert (
        units[0] < units[1] < units[0] + 2.0 * 50.0 < units[2]
    )  # the try under way when it is spent is finished
    with work.budget("test", 1e9) as spent, work.no_cures():  # as for plans that nobody is told of
        planning.plan(body, "rhumb-line")
    assert spent.done == units[0]


def test_linear_programs_count_by_their_size(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a sphere pulses of every turn do alike, and all slots of a long horizon get into the
    program.
    """
    body = spinner(
        7500.0, 7500.0, 0.018, degrees=0.5, channels=cross(3e-4), limits=Limits(horizon=2e5)
    )
    monkeypatch.setattr(work, "SCHEME", 300.0)
    sizes: list[int] = []
    optimum = linear_program.GrowingProgram.optimum

    def counted(self: linear_program.GrowingProgram) -> linear_program.Optimum | None:
        sizes.append(self._highs.getNumNz())
        return optimum(self)

    monkeypatch.setattr(linear_program.GrowingProgram, "optimum", counted)
    assert planning.plan(aimed(body, 3.0, 0.0), "optimal")._cut
    assert sum(sizes) < 200_000  # of 1.2 million


def test_the_leap_seconds_are_those_of_another_list() -> None:
    lines = messages.tai_utc().splitlines()
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
    texts = (
        *("yesterday", "2026-03-01_12:00:00", "2026-03-01T12:00:00,5", "1971-12-31T23:59:59"),
        *("2025-366T00:00:00", "2026-000T00:00:00"),
        *("2026-03-01T24:00:00", "2026-03-01T12:60:00", "2026-03-01T23:59:60"),
        *("2016-12-31T23:58:60", "2016-12-31T23:59:61"),
    )
    check_text("epoch.refused", "\n".join(refusal(ValueError, Epoch.parse, text) for text in texts))
    with pytest.raises(ValueError, match="no epoch: day"):  # in the words of Python
        Epoch.parse("2026-02-29T00:00:00")


def test_seconds_pass_a_leap_second_one_by_one() -> None:
    start = Epoch.parse("2016-12-31T23:59:58.5")
    texts = [start.plus(step).text for step in range(4)]
    assert [text[11:21] for text in texts] == [
        "23:59:58.5",
        "23:59:59.5",
        "23:59:60.5",
        "00:00:00.5",
    ]
    assert Epoch.parse(texts[3]).since(start) == 3.0


@given(
    st.datetimes(datetime.datetime(1972, 1, 1), datetime.datetime(2100, 1, 1)),
    st.floats(0.0, 1e6),
    st.integers(1, 9),
)
def test_nothing_is_lost_but_the_last_digit(
    moment: datetime.datetime, seconds: float, digits: int
) -> None:
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
    assert since == Fraction(
        (moment - datetime.datetime(2017, 1, 1)) // datetime.timedelta(microseconds=1), 10**6
    )


@pytest.mark.parametrize(
    ("text", "system"),
    [
        ("2017-01-01T00:00:37", "TAI"),
        ("2017-01-01T00:00:18", "GPS"),
        ("2017-01-01T00:01:09.184", "TT"),
    ],
)
def test_clocks_without_leap_seconds(text: str, system: str) -> None:
    """TAI - UTC is 37 s from 2017 on (IERS, Bulletin C 52); GPS is TAI - 19 s, TT is TAI + 32.184
    s.
    """
    assert Epoch.parse(text, system) == Epoch.parse("2017-01-01T00:00:00Z")
    with pytest.raises(ValueError, match="zone"):
        Epoch.parse(f"{text}Z", system)
    assert Epoch.parse(text, system).since(Epoch.parse("2016-12-31T23:59:60Z")) == 1.0


def test_days_count_from_j2000_in_terrestrial_time_and_barycentric_time_swings() -> None:
    """In 2000 TAI was UTC + 32 s; TDB - TT follows the anomaly of the Earth, 0 at perihelion and
    1.66 ms at most.
    """
    for text, days in (("2000-01-01T11:58:55.816Z", 0.0), ("2000-01-02T11:58:55.816Z", 1.0)):
        assert Epoch.parse(text).days_of_j2000 == days
    assert Epoch.parse("1972-01-01T00:00:00Z").days_of_j2000 == pytest.approx(
        -10227.4995118, abs=1e-6
    )
    for day, ahead in (("2026-04-04", 1.6e-3), ("2026-10-05", -1.6e-3), ("2026-01-04", 0.0)):
        difference = Epoch.parse(f"{day}T00:00:00", "TT").since(
            Epoch.parse(f"{day}T00:00:00", "TDB")
        )
        assert difference == pytest.approx(ahead, abs=1e-4)


def test_the_direction_of_the_sun_is_right_to_a_hundredth_of_a_degree_from_1972_to_2100() -> None:
    """Against ERFA (golden/make_golden.py)."""
    rows = np.loadtxt(places.GOLDEN / "sun.csv", delimiter=",", skiprows=1)
    errors = [
        float(attitude.angle_between(sky.sun_direction(days), row)) for days, *row in rows.tolist()
    ]
    assert len(errors) == 100
    assert math.degrees(max(errors)) < 0.01
