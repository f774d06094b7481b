"""What optimal does where the program's own schedule is missing or dear: shorter horizons, and other schemes."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from support.builders import cross, spinner

from nutdamp.schedule import Schedule
from nutdamp.schemes import two_pulse
from nutdamp.schemes.optimal.problem import DEARER, Problem
from nutdamp.schemes.optimal.search import HALVINGS, _Search
from nutdamp.schemes.options import OptimalOptions, TwoPulseOptions
from nutdamp.schemes.tools.reasons import bounded_by, no_channels
from nutdamp.spacecraft import Limits

BODY = spinner(channels=cross(8.0), limits=Limits(horizon=400.0))
"""400 s are 128 inertial nutation periods, so that the horizon can be halved six times."""


@pytest.fixture
def search() -> _Search:
    return _Search(BODY, OptimalOptions())


def pair() -> Schedule:
    return two_pulse.schedule(BODY, TwoPulseOptions())


def settle(monkeypatch: pytest.MonkeyPatch, made: dict[float, Schedule]) -> list[float]:
    """Let the program lead to ``made`` within each horizon, else to nothing; the horizons that were looked at."""
    tried: list[float] = []

    def settled(self: _Search, _: float) -> Schedule | None:
        tried.append(self.spacecraft.horizon)
        return made.get(self.spacecraft.horizon)

    monkeypatch.setattr(_Search, "settled", settled)
    return tried


def dearer(made: Schedule, share: float) -> Schedule:
    return Schedule(tuple(replace(one, on_time=one.on_time * share, impulse=one.impulse * share) for one in made))


def test_without_a_schedule_the_horizon_is_halved_down_to_a_period(
    search: _Search, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried = settle(monkeypatch, {})
    search.programmed(search.program().solve())
    halves = int(math.log2(400.0 / BODY.inertial_period))
    assert tried == [400.0 * 0.5**turn for turn in range(halves + 1)]
    assert halves > HALVINGS


def test_with_a_dear_schedule_three_shorter_horizons_are_looked_at(
    search: _Search, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = search.program().solve()
    dear = {400.0 * 0.5**turn: dearer(pair(), 3.0 - 0.1 * turn) for turn in range(7)}
    tried = settle(monkeypatch, dear)
    monkeypatch.setattr(_Search, "others", lambda *_: None)
    assert search.programmed(first) is dear[50.0]
    assert tried == [400.0, 200.0, 100.0, 50.0]


def test_the_first_schedule_that_is_not_dear_ends_the_halving(search: _Search, monkeypatch: pytest.MonkeyPatch) -> None:
    first, made = search.program().solve(), pair()
    cheap = dearer(made, (1.0 + 0.5 * DEARER) * first.cost / search.price(made))
    tried = settle(monkeypatch, {400.0: dearer(cheap, 2.0), 200.0: cheap})
    assert search.programmed(first) is cheap
    assert tried == [400.0, 200.0]


@pytest.mark.parametrize("known", [False, True], ids=["none", "dear"])
def test_where_the_program_leads_nowhere_or_is_dear_other_schemes_are_starts(
    search: _Search, monkeypatch: pytest.MonkeyPatch, known: bool
) -> None:
    """Their schedules are taken as they are, or corrected, and leave nothing."""
    settle(monkeypatch, {400.0: dearer(pair(), 2.0)} if known else {})
    made = search.programmed(search.program().solve())
    assert made is not None
    assert search.price(made) <= search.price(pair()) * (1.0 + 1e-9)


def test_ticks_are_among_the_limits_named_where_the_file_sets_them() -> None:
    for tick, named in ((None, False), (0.01, True)):
        body = replace(BODY, limits=replace(BODY.limits, tick=tick))
        assert bounded_by(body) == "the horizon of 400 s" + " and ticks" * named
        assert ("ticks of 0.01 s" in Problem(body, OptimalOptions()).not_found()) is named
        brief = replace(body, channels=cross(8.0, min_on_time=500.0))
        assert ("as a multiple of limits.tick" in no_channels(brief)) is named
