"""When a pulse may be on: earliest start, horizon, gap, blackout windows, ticks."""

from __future__ import annotations

import cmath
import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.builders import channel, fan, spinner

from nutdamp.limits import Windows, commandable, for_pairs, free_windows, longest_on_time, rooms
from nutdamp.schedule import TOUCHING, channel_pulse, steerable_pulse
from nutdamp.spacecraft import Limits, Steerable


def windows(**limits: object) -> Windows:
    return Windows(spinner(limits=Limits(**{"horizon": 100.0, **limits})))  # type: ignore[arg-type]


def test_without_limits_a_pulse_may_start_at_once_and_end_at_the_horizon() -> None:
    free = windows()
    assert free.earliest_start(1.0, 0.0) == 0.0
    assert free.allows(99.0, 1.0, 0.0)
    assert not free.allows(99.01, 1.0, 0.0)
    assert free.earliest_start(1.0, 99.5) is None


def test_not_before_the_actuators_are_ready() -> None:
    assert windows().allows(5.0, 1.0, 5.0)
    assert not windows().allows(5.0, 1.0, 5.01)


def test_blackouts_cover_whole_pulses() -> None:
    """A pulse may end as a window begins and start as it ends, and touch it nowhere else."""
    dark = windows(blackout=((10.0, 20.0),))
    assert dark.allows(9.0, 1.0, 0.0)
    assert dark.allows(20.0, 1.0, 0.0)
    for start in (9.5, 10.0, 15.0, 19.9):
        assert not dark.allows(start, 1.0, 0.0)
        assert dark.blocked_until(start, 1.0) == 20.0
    assert not dark.allows(9.0, 12.0, 0.0)  # a pulse longer than the window
    assert dark.allows(9.5, 0.0, 0.0)  # an ideal impulse
    assert not dark.allows(12.0, 0.0, 0.0)


def test_earliest_start_jumps_over_one_blackout_into_no_other() -> None:
    """Overlapping, out of order, and with a hole too short for the pulse."""
    dark = windows(blackout=((8.0, 12.0), (1.0, 5.0), (4.0, 7.5)))
    assert dark.earliest_start(0.5, 0.0) == 0.0
    assert dark.earliest_start(0.5, 0.8) == 7.5
    assert dark.earliest_start(1.0, 0.8) == 12.0


def test_a_blackout_to_the_horizon_leaves_no_start() -> None:
    assert windows(blackout=((1.0, 100.0),)).earliest_start(0.5, 2.0) is None


def test_starts_lie_on_ticks() -> None:
    ticking = windows(tick=0.25, blackout=((1.1, 2.1),))
    assert ticking.earliest_start(0.25, 0.3) == 0.5
    assert ticking.earliest_start(0.25, 1.0) == 2.25
    assert ticking.nearest_tick(0.62) == 0.5
    assert ticking.tick_after(0.51) == 0.75
    assert ticking.tick_after(0.5) == 0.5


def test_on_times_lie_on_ticks_within_the_bounds_and_are_never_nothing() -> None:
    ticking = windows(tick=0.1)
    assert ticking.on_time(0.34, 0.0, math.inf) == pytest.approx(0.3, rel=1e-15)
    assert ticking.on_time(0.01, 0.0, math.inf) == pytest.approx(0.1, rel=1e-15)
    assert ticking.on_time(0.34, 0.38, math.inf) == pytest.approx(0.4, rel=1e-15)
    assert ticking.on_time(0.9, 0.0, 0.57) == pytest.approx(0.5, rel=1e-15)
    # Bounds that are multiples themselves, but for rounding: 3 × 0.1 > 0.3.
    assert ticking.on_time(0.9, 0.0, 0.3) == pytest.approx(0.3, rel=1e-15)
    assert ticking.on_time(0.1, 0.3, 5.0) == pytest.approx(0.3, rel=1e-15)


def test_without_ticks_on_times_are_as_requested_within_the_bounds() -> None:
    free = windows()
    assert free.on_time(0.3456, 0.0, math.inf) == 0.3456
    assert free.on_time(0.3, 0.5, 2.0) == 0.5
    assert free.on_time(3.0, 0.5, 2.0) == 2.0


def test_endless_windows_have_no_horizon_but_all_other_limits() -> None:
    endless = Windows(spinner(limits=Limits(horizon=10.0, blackout=((20.0, 30.0),))), endless=True)
    assert endless.allows(1e9, 5.0, 0.0)
    assert not endless.allows(25.0, 5.0, 0.0)


@given(
    st.floats(0.0, 50.0),
    st.floats(0.0, 5.0),
    st.sampled_from([None, 1e-3, 0.1, 0.25, 1.7]),
    st.lists(st.tuples(st.floats(0.0, 60.0), st.floats(0.0, 10.0)), max_size=5),
)
def test_earliest_start_is_allowed_and_nothing_before_it_is(
    ready: float, on_time: float, tick: float | None, holes: list[tuple[float, float]]
) -> None:
    dark = windows(tick=tick, blackout=tuple((begin, begin + length) for begin, length in holes))
    start = dark.earliest_start(on_time, ready)
    last = 100.0 - on_time if start is None else start
    if start is not None:
        assert start >= ready - TOUCHING
        assert dark.allows(start, on_time, ready)
        assert tick is None or abs(start / tick - round(start / tick)) < 1e-9
    step = tick or 0.05
    for index in range(math.ceil(ready / step), math.floor(last / step)):
        earlier = index * step
        if ready <= earlier < last - 10 * TOUCHING:
            assert not dark.allows(earlier, on_time, ready)


def test_of_very_many_channels_pairs_are_made_of_the_cheapest_about_each_direction() -> None:
    some = for_pairs(spinner(channels=fan(200, 5.0)))
    assert len(some) == 24
    turns = sorted(cmath.phase(channel.transverse) for channel in some)
    assert max(np.diff(turns)) < 2 * math.tau / 24
    few = spinner(channels=fan(9, 5.0))
    assert for_pairs(few) == list(few.channels)


def test_a_pulse_across_the_spin_axis_is_useful_for_half_a_nutation_period() -> None:
    """π/|aω3| with a = 1/3 and ω3 = 3 rad/s; about the spin axis only max_on_time bounds it."""
    body = spinner()
    across, along = (8.0, 0.0, 0.0), (0.0, 0.0, 8.0)
    assert longest_on_time(body, channel("T", *across)) == pytest.approx(math.pi, rel=1e-12)
    assert longest_on_time(body, channel("T", *across, max_on_time=2.0)) == 2.0
    assert longest_on_time(body, channel("T", *along)) == math.inf
    assert longest_on_time(body, channel("T", *along, max_on_time=9.0)) == 9.0


def test_pulses_of_a_torquer_are_put_on_ticks_with_the_impulse_of_their_on_time() -> None:
    body = spinner(limits=Limits(tick=0.1))
    ideal = commandable(body, steerable_pulse(Steerable(), 0.33, 0.4, impulse=3.0))
    assert ideal.on_time == 0.0
    assert ideal.t == pytest.approx(0.3)
    assert ideal.magnitude == pytest.approx(3.0)
    torquer = Steerable(20.0, 220.0, 0.8)
    exact = steerable_pulse(torquer, 1.02, 0.4, on_time=0.26)
    wide = commandable(body, exact)
    assert wide.start == pytest.approx(0.9)
    assert wide.on_time == pytest.approx(0.3)
    assert wide.magnitude == pytest.approx(20.0 * 0.3)
    assert exact.propellant is not None
    assert wide.propellant == pytest.approx(exact.propellant * 0.3 / 0.26)


def test_two_pulses_share_the_time_between_them_but_for_the_gap() -> None:
    """Pulses from 10 to 11 s and from 20 to 22 s: 8 of the 9 s between them are shared, 1 s is the gap."""
    body = spinner(limits=Limits(horizon=100.0, earliest=0.5, gap=1.0, blackout=((2.0, 3.0), (30.0, 40.0))))
    thruster = channel("T", 8.0, 0.0, 0.0)
    pulses = (channel_pulse(thruster, 10.5, 1.0), channel_pulse(thruster, 21.0, 2.0))
    assert rooms(body, pulses) == [(3.0, pytest.approx(15.0)), (pytest.approx(16.0), 30.0)]
    alone = spinner(limits=Limits(horizon=100.0, earliest=0.5))
    assert rooms(alone, pulses[:1]) == [(0.5, 100.0)]


def test_the_room_of_a_pulse_is_found_among_many_windows_as_by_looking_at_each() -> None:
    rng = np.random.default_rng(5)
    begins = np.sort(rng.uniform(0.0, 100.0, 60))
    dark = tuple((float(one), float(one + width)) for one, width in zip(begins, rng.uniform(0.0, 1.5, 60), strict=True))
    body = spinner(limits=Limits(horizon=95.0, earliest=1.0, blackout=tuple(rng.permutation(dark).tolist())))
    thruster, windows, found = channel("T", 8.0, 0.0, 0.0), Windows(body), 0
    for t in rng.uniform(2.0, 94.0, 200):
        pulse = channel_pulse(thruster, float(t), 0.05)
        if windows.allows(pulse.start, pulse.on_time, 1.0):
            found += 1
            begin = max([1.0, *(end for _, end in dark if end <= pulse.start)])
            end = min([95.0, *(one for one, _ in dark if one >= pulse.end)])
            assert rooms(body, (pulse,)) == [(begin, end)]
    assert found > 30


def test_slots_are_blocked_as_by_looking_at_each_window() -> None:
    rng = np.random.default_rng(6)
    begins = rng.uniform(0.0, 100.0, 40)
    dark = tuple((float(one), float(one + width)) for one, width in zip(begins, rng.uniform(0.0, 1.0, 40), strict=True))
    body = spinner(limits=Limits(horizon=110.0, blackout=dark))
    edges = np.linspace(0.0, 110.0, 400)
    each = [any(low < end and high > begin for begin, end in dark) for low, high in itertools.pairwise(edges)]
    assert Windows(body).blocked(edges[:-1], edges[1:]).tolist() == each
    assert 50 < sum(each) < 350
    assert not Windows(spinner()).blocked(edges[:-1], edges[1:]).any()


def test_of_three_pulses_each_shares_with_its_neighbours() -> None:
    """One second each, from 10, 20 and 40 s on: 9 s and 19 s between them are halved."""
    body = spinner(limits=Limits(horizon=100.0))
    thruster = channel("T", 8.0, 0.0, 0.0)
    pulses = [channel_pulse(thruster, begin + 0.5, 1.0) for begin in (10.0, 20.0, 40.0)]
    expected = [(0.0, 15.5), (15.5, 30.5), (30.5, 100.0)]
    assert rooms(body, pulses) == [pytest.approx(one) for one in expected]


def test_windows_behind_the_horizon_leave_no_empty_window_at_its_end() -> None:
    body = spinner(limits=Limits(horizon=100.0, blackout=((10.0, 100.0), (105.0, 110.0))))
    assert free_windows(body) == [(0.0, 10.0)]
    assert free_windows(body, 107.0) == [(0.0, 10.0), (100.0, 105.0)]
