"""Rows of the track of a flight: before and after each pulse, in order, none twice."""

from __future__ import annotations

import numpy as np
import pytest
from support import reference
from support.builders import pulse, spinner

from nutdamp import flight
from nutdamp.physics import cones
from nutdamp.schedule import Schedule

EPS = float(np.finfo(float).eps)

WIDE = Schedule(
    (
        pulse(2.0, 0.5, np.array([5.0, 0.0, 0.0]), "one"),
        pulse(4.0, 1.0, np.array([0.0, -5.0, 2.0]), "two"),
        pulse(6.5, 0.0, np.array([3.0, 3.0, 0.0]), "kick"),
    )
)


@pytest.mark.parametrize("fly", [flight.by_impulses, flight.flown])
@pytest.mark.parametrize("samples", [1, 2, 11, 1000])
def test_track_goes_from_zero_to_until_in_order(fly: object, samples: int) -> None:
    track = fly(spinner(), WIDE, 10.0).sampled(samples, 10.0)  # type: ignore[operator]
    assert track.t[0] == 0.0
    assert track.t[-1] == 10.0
    assert np.all(np.diff(track.t) >= 0.0)
    assert np.all(np.diff(track.pulse) >= 0)
    assert set(np.linspace(0.0, 10.0, samples)) <= set(track.t)
    rows = np.column_stack([track.t, track.rates, track.quaternion])
    assert len(np.unique(rows, axis=0)) == len(rows)  # no row twice


def test_track_by_impulses_has_a_row_before_and_after_each_pulse() -> None:
    track = flight.by_impulses(spinner(), WIDE, 10.0).sampled(3, 10.0)
    for number, one in enumerate(WIDE):
        at = np.flatnonzero(track.t == one.t)
        assert track.pulse[at].tolist() == [number, number + 1]
        jump = np.diff(track.rates[at], axis=0)[0] * np.array([120.0, 120.0, 80.0])
        effective = flight.effective_impulses(spinner(), WIDE)[number]
        assert jump == pytest.approx([effective.real, effective.imag, one.impulse[2]], abs=1e-12)
        assert track.quaternion[at[0]] == pytest.approx(track.quaternion[at[1]], abs=4 * EPS)


def test_flown_track_has_a_row_as_each_pulse_begins_and_ends() -> None:
    track = flight.flown(spinner(), WIDE, 10.0).sampled(3, 10.0)
    for number, one in enumerate(WIDE):
        assert number in track.pulse[track.t == one.start]
        assert one.end in track.t
    kick = np.flatnonzero(track.t == 6.5)
    assert track.pulse[kick].tolist() == [2, 3]
    assert np.diff(track.rates[kick], axis=0)[0] == pytest.approx([3 / 120, 3 / 120, 0], abs=4 * EPS)


def test_pulses_completed_by_the_end_of_the_last_one_are_all() -> None:
    """The row at the end of a pulse counts it as completed."""
    made = Schedule(WIDE.pulses[:2])
    track = flight.flown(spinner(), made, made.end).sampled(3, made.end)
    for number, one in enumerate(made, start=1):
        assert track.pulse[track.t == one.end].max() == number


@pytest.mark.parametrize("fly", [flight.by_impulses, flight.flown])
def test_ideal_impulse_at_zero_has_the_motion_before_it_too(fly: object) -> None:
    made = Schedule((pulse(0.0, 0.0, np.array([6.0, 0.0, 0.0])),))
    spacecraft = spinner()
    track = fly(spacecraft, made, 5.0).sampled(5, 5.0)  # type: ignore[operator]
    assert track.t[:2].tolist() == [0.0, 0.0]
    assert track.pulse[:3].tolist() == [0, 1, 1]
    assert np.array_equal(track.rates[0], spacecraft.omega0)
    assert track.rates[1] - track.rates[0] == pytest.approx([6 / 120, 0, 0], abs=2 * EPS)


@pytest.mark.parametrize("fly", [flight.by_impulses, flight.flown])
def test_motion_around_pulses(fly: object) -> None:
    """|ω| before the first, between, and after the last, as the whole track has it."""
    flown = fly(spinner(), WIDE, 10.0)  # type: ignore[operator]
    before, after = flown.around_pulses()
    assert before.pulse.tolist() == [0, 1, 2]
    assert after.pulse.tolist() == [1, 2, 3]
    assert before.nutation[0] == pytest.approx(spinner().nutation, rel=8 * EPS)
    assert before.nutation[1:] == pytest.approx(after.nutation[:-1], rel=100 * EPS)
    assert after.nutation[-1] == pytest.approx(flown.residual.nutation, rel=8 * EPS)


def test_flight_without_pulses_has_a_track_and_no_rows_around_pulses() -> None:
    flown = flight.flown(spinner(), Schedule(), 7.0)
    assert np.array_equal(flown.sampled(8, 7.0).t, np.linspace(0.0, 7.0, 8))
    before, after = flown.around_pulses()
    assert len(before.t) == len(after.t) == 0


def test_cone_angles_of_the_track_are_those_of_its_rates() -> None:
    track = flight.flown(spinner(), WIDE, 10.0).sampled(50, 10.0)
    omega = np.hypot(track.rates[:, 0], track.rates[:, 1])
    assert track.nutation == pytest.approx(cones.nutation_angle(120.0, 80.0, omega, track.rates[:, 2]), abs=4 * EPS)
    assert track.body_cone == pytest.approx(cones.body_cone(omega, track.rates[:, 2]), abs=4 * EPS)
    assert track.space_cone == pytest.approx(cones.space_cone(120.0, 80.0, omega, track.rates[:, 2]), abs=8 * EPS)
    between = [reference.angle(h, axis) for h, axis in zip(track.momentum, track.axis, strict=True)]
    assert track.nutation == pytest.approx(between, abs=1e-13)
