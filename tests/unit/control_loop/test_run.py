"""The loop flown: equal to the open-loop schedule where it sees all, to a brute-force simulation where it samples."""

from __future__ import annotations

import cmath
import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from support import reference
from support.builders import channel, spinner
from support.cases import spread

import nutdamp
from nutdamp import flight
from nutdamp.errors import Infeasible
from nutdamp.loop.diagnosis import Stop
from nutdamp.loop.plan import loop_of
from nutdamp.loop.run import fly
from nutdamp.loop.stability import margins
from nutdamp.loop.verify import verify_loop
from nutdamp.loop_settings import ACCELEROMETER, BANG, ONE_PULSE, Loop, Sensor
from nutdamp.physics.feed import Cold
from nutdamp.physics.valve import Trapezoid
from nutdamp.spacecraft import Limits, Spacecraft

FOUR = tuple(
    channel(name, *torque, min_on_time=0.002, max_on_time=0.3)
    for name, torque in {"+M1": (6, 0, 0), "-M1": (-6, 0, 0), "+M2": (0, 6, 0), "-M2": (0, -6, 0)}.items()
)
AXIAL = tuple(
    channel(name, *torque, min_on_time=0.002, max_on_time=0.3)
    for name, torque in {"a": (6, 1, 0.5), "b": (-5, 3, -0.8), "c": (0, -7, 0.2)}.items()
)


def rad(degrees: float) -> float:
    return math.radians(degrees)


def ideal(**changes: object) -> Loop:
    return replace(Loop(Sensor(), start=1e-7, stop=0.0), **changes)  # type: ignore[arg-type]


CRAFTS = {
    "prolate": nutdamp.example("magnus-a03"),
    "oblate": nutdamp.example("magnus-oblate"),
    "slender": nutdamp.example("magnus-a09"),
    "reversed": spinner(spin=-3.0, degrees=3.0, channels=FOUR),
    "oblate, reversed": spinner(A=80.0, C=120.0, spin=-3.0, degrees=3.0, channels=FOUR),
    "axial parts": spinner(degrees=3.0, channels=AXIAL),
    "ticks, gaps, blackout": spinner(
        degrees=3.0, channels=FOUR, limits=Limits(earliest=2.0, gap=0.4, horizon=200.0, blackout=((4.0, 9.0),))
    ),
}


@pytest.mark.parametrize("delay", [0.0, 0.02])
@pytest.mark.parametrize("name", CRAFTS)
def test_a_continuous_gyro_and_prediction_give_the_four_pulse_schedule(name: str, delay: float) -> None:
    craft = CRAFTS[name]
    planned = nutdamp.plan(craft, "four-pulse").pulses
    run = fly(craft, ideal(sensor=Sensor(delay=delay)))
    assert len(planned) >= 5
    assert [pulse.channel for pulse in run.schedule] == [pulse.channel for pulse in planned]
    for fired, pulse in zip(run.schedule, planned, strict=True):
        assert fired.start == pytest.approx(pulse.start, abs=1e-9)
        assert fired.on_time == pytest.approx(pulse.on_time, abs=1e-9)
    made = flight.flown(craft, planned, run.until)
    for one, other in zip(run.flight.around_pulses(), made.around_pulses(), strict=True):
        assert np.degrees(one.nutation) == pytest.approx(np.degrees(other.nutation), abs=1e-9)
        assert one.momentum == pytest.approx(other.momentum, abs=1e-9)


def brute(craft: Spacecraft, loop: Loop, until: float) -> list[tuple[float, float, str]]:
    """(start, on-time, channel) of the four-pulse law with a sampled gyro, sample by sample with DOP853.

    Its own reading of the law: a channel fires as the rate that is seen passes the direction against its torque, for
    as long as takes that rate away at that moment, found by halving.
    """
    moments, sensor = craft.inertia.moments, loop.sensor
    assert sensor.rate is not None
    A, rate = moments[0], (moments[0] - moments[2]) / moments[0]
    full = min(0.3, craft.body_period / 8)
    motion, now, fired, number = reference.Motion(craft.omega0, np.eye(3)), 0.0, [], 0
    before: dict[str, float] = {}
    active = False
    while number / sensor.rate + sensor.delay < until:
        time = number / sensor.rate
        number += 1
        if time < now:
            continue
        if time > now:
            motion, now = reference.coast(moments, motion, np.zeros(3), np.array([time - now]))[-1], time
        omega, turn = complex(*motion.rates[:2]), rate * motion.rates[2]
        if loop.predict:
            omega *= cmath.exp(-1j * turn * sensor.delay)
        angle = math.atan2(A * abs(omega), moments[2] * abs(motion.rates[2]))
        active = angle > loop.stop and (active or angle >= loop.start)
        chosen: list[tuple[float, float, str]] = []
        waits = {}
        for one in craft.channels:
            push = abs(one.transverse)
            low, high = 0.0, full
            while high - low > 1e-14:
                middle = 0.5 * (low + high)
                does = 2.0 * push * math.sin(abs(turn) * middle / 2.0) / abs(turn)
                low, high = (middle, high) if does < A * abs(omega) else (low, middle)
            on_time = max(high, one.min_on_time)
            ahead = (cmath.phase(-omega / one.transverse)) / turn  # s until ω opposes the torque
            waits[one.name] = ahead - 0.5 * on_time if loop.predict else ahead
            reach = 1.0 / sensor.rate if loop.predict else 0.0
            last = before.get(one.name)
            passes = last is not None and last >= reach > waits[one.name] and last - waits[one.name] < 3.0
            first = last is None and 0.0 <= waits[one.name] < reach
            if active and (passes or first):
                wait = max(waits[one.name], 0.0) if loop.predict else 0.0
                chosen.append((time + sensor.delay + wait, on_time, one.name))
        before = waits
        if chosen:
            start, on_time, name = min(chosen)
            torque = next(one.torque for one in craft.channels if one.name == name)
            motion = (
                reference.coast(moments, motion, np.zeros(3), np.array([start - now]))[-1] if start > now else motion
            )
            motion, now = reference.coast(moments, motion, torque, np.array([on_time]))[-1], start + on_time
            fired.append((start, on_time, name))
            before = {}
    return fired


@pytest.mark.parametrize("predict", [True, False])
@pytest.mark.parametrize(("C", "spin"), [(80.0, 3.0), (160.0, -3.0)])
def test_a_sampled_loop_is_that_of_a_simulation_sample_by_sample(C: float, spin: float, predict: bool) -> None:
    craft = spinner(C=C, spin=spin, degrees=2.0, channels=FOUR)
    loop = Loop(Sensor(rate=9.0, delay=0.07), start=rad(0.5), stop=rad(0.2), predict=predict)
    run, wanted = fly(craft, loop, 25.0), brute(craft, loop, 25.0)
    assert len(wanted) >= 4
    assert [(one.channel) for one in run.schedule] == [name for _, _, name in wanted]
    for fired, (start, on_time, _) in zip(run.schedule, wanted, strict=True):
        assert fired.start == pytest.approx(start, abs=1e-8)
        assert fired.on_time == pytest.approx(on_time, abs=1e-8)


def test_without_prediction_firings_begin_late_by_delay_and_half_their_width() -> None:
    craft = spinner(degrees=2.0, channels=FOUR)
    loop = ideal(sensor=Sensor(delay=0.11), predict=False, start=rad(0.1))
    first, centred = fly(craft, loop).schedule.pulses[0], fly(craft, ideal()).schedule.pulses[0]
    assert first.start - centred.t == pytest.approx(0.11, abs=1e-9)
    (found,) = (one for one in margins(craft, loop, craft.nutation) if one.channel == first.channel)
    assert found.late == pytest.approx((0.11 + 0.5 * first.on_time) * craft.inertia.a * 3.0)
    before, after = fly(craft, loop).flight.around_pulses()
    left = np.hypot(*after.rates[0, :2]) / np.hypot(*before.rates[0, :2])
    assert found.gain == pytest.approx(left, rel=1e-9)


@pytest.mark.parametrize("law", [ONE_PULSE, BANG])
def test_other_laws_damp(law: str) -> None:
    craft = spinner(degrees=2.0, channels=FOUR)
    loop = Loop(Sensor(), law, start=rad(0.2), stop=rad(0.06), on_time=0.05 if law == BANG else None)
    run = fly(craft, loop, 400.0)
    assert run.settled is not None
    assert run.flight.residual.nutation <= rad(0.06)
    if law == BANG:
        assert {pulse.on_time for pulse in run.schedule} == {0.05}


def test_interval_and_settling_are_kept() -> None:
    craft = spinner(degrees=3.0, channels=FOUR)
    loop = ideal(sensor=Sensor(rate=40.0), start=rad(0.2), stop=rad(0.02), settle=0.3, min_interval=2.5)
    run = fly(craft, loop, 120.0)
    pulses = run.schedule.pulses
    assert len(pulses) > 4
    assert min(b.start - a.end for a, b in itertools.pairwise(pulses)) >= 2.5
    for one, later in itertools.pairwise(run.fired):
        assert later.decided >= one.pulse.end + 0.3


@pytest.mark.parametrize("sensor", [Sensor(), Sensor(rate=50.0, noise=rad(0.02), bias=rad(0.01), delay=0.03)])
@pytest.mark.parametrize("wrong", ["+M1", "-M2"])
def test_a_channel_wired_backwards_is_named_within_a_period(sensor: Sensor, wrong: str) -> None:
    craft = spinner(degrees=2.0, channels=FOUR)
    run = fly(craft, Loop(sensor, start=rad(0.3), stop=rad(0.1), reversed=(wrong,)))
    assert (run.stop, run.channel) == (Stop.CHANNEL, wrong)
    fed = [pulse for pulse in run.schedule if pulse.channel == wrong]
    assert len(fed) == 1
    assert run.fired[-1].pulse.end - fed[0].start < craft.body_period


@pytest.mark.parametrize(
    "sensor",
    [
        Sensor(scale=-1.0),
        Sensor(scale=-0.5, rate=50.0, noise=rad(0.02), bias=rad(0.01)),
        Sensor(ACCELEROMETER, 50.0, scale=-1.0, noise=1e-4, position=np.array([1.0, 0.2, 0.0])),
    ],
)
def test_a_reversed_sensor_is_named_within_a_period(sensor: Sensor) -> None:
    craft = spinner(degrees=2.0, channels=FOUR)
    run = fly(craft, Loop(sensor, start=rad(0.3), stop=rad(0.1)))
    assert run.stop is Stop.SENSOR
    assert len(run.fired) == 2
    latency = craft.body_period if sensor.kind == ACCELEROMETER else 0.0  # until it has seen what a firing did
    assert run.fired[1].pulse.start - run.fired[0].pulse.start <= craft.body_period + latency


def test_long_settling_hides_no_fault() -> None:
    craft = spinner(degrees=2.0, channels=FOUR)
    loop = Loop(Sensor(rate=20.0, noise=1e-4, scale=-1.0), start=rad(0.3), settle=2.2 * craft.body_period)
    assert fly(craft, loop, 200.0).stop is Stop.SENSOR
    single = replace(craft, channels=FOUR[:1])
    assert fly(single, loop, 200.0).stop is Stop.UNCLEAR


def test_firings_that_feed_are_stopped_where_steps_hide_which() -> None:
    craft = spinner(degrees=2.0, channels=FOUR)
    loop = Loop(Sensor(rate=20.0, quantisation=0.02, scale=-1.0), BANG, start=rad(0.5), stop=rad(0.1), on_time=0.01)
    run = fly(craft, loop, 400.0)
    assert run.stop is Stop.FED
    assert max(one.true_nutation for one in run.fired) < 3.0 * craft.nutation


def test_a_single_channel_cannot_tell_itself_from_the_sensor() -> None:
    craft = spinner(degrees=2.0, channels=FOUR[:1])
    for loop in (ideal(reversed=("+M1",)), ideal(sensor=Sensor(scale=-1.0))):
        run = fly(craft, replace(loop, start=rad(0.3)))
        assert (run.stop, run.channel, len(run.fired)) == (Stop.UNCLEAR, "+M1", 1)


def test_firings_that_come_too_late_are_refused_before_the_flight_and_stopped_in_it() -> None:
    craft = replace(spinner(degrees=2.0, channels=FOUR), loop=ideal(start=rad(0.5), predict=False))
    assert craft.loop is not None
    (allowed,) = {round(one.delay, 12) for one in margins(craft, craft.loop)}
    just, over = (replace(craft, loop=replace(craft.loop, sensor=Sensor(delay=allowed + by))) for by in (-0.01, 0.01))
    assert loop_of(just, 30.0).flown_run.stop is Stop.END
    with pytest.raises(Infeasible, match=r"deg late, and damps up to .* deg; shorten the delays by 0\.01 s"):
        loop_of(over, 30.0)
    assert over.loop is not None
    late = replace(over.loop, sensor=Sensor(delay=0.5 * craft.body_period))
    run = fly(craft, late)
    assert (run.stop, len(run.fired)) == (Stop.FEEDS, 1)


def growing(**changes: object) -> Spacecraft:
    loop = Loop(Sensor(rate=40.0, noise=rad(0.004)), start=rad(0.3), stop=rad(0.03))
    craft = spinner(degrees=0.1, channels=FOUR)
    return replace(craft, dissipation=100.0, loop=replace(loop, **changes))  # type: ignore[arg-type]


def test_growing_nutation_is_kept_between_the_thresholds() -> None:
    plan = loop_of(growing(), 3000.0, seed=4)
    run = plan.flown_run
    assert run.stop is Stop.END
    assert len(run.quiet) >= 5
    assert plan.largest[0] < rad(0.32)
    waits = np.diff(run.quiet)
    assert waits.min() > 100.0 * math.log(0.3 / 0.06)
    assert run.flight.residual.nutation < rad(0.05)  # just after the last firing


def test_nothing_is_looked_at_while_the_nutation_cannot_show() -> None:
    slow = replace(growing(), dissipation=20_000.0)
    assert slow.loop is not None
    run = fly(slow, slow.loop, 300_000.0)
    assert len(run.quiet) >= 3
    assert run.looked_at < 300_000.0 * 40.0 / 10.0


def test_a_flight_that_would_look_at_too_many_samples_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("nutdamp.loop.pilot.MOST", 100_000)
    craft = growing(sensor=Sensor(rate=1e6, noise=rad(0.25)))
    assert craft.loop is not None
    with pytest.raises(Infeasible, match="samples"):
        fly(craft, replace(craft.loop, start=rad(80.0)), 1e4)


def test_the_schedule_flown_again_is_the_flight_of_the_loop() -> None:
    craft = spinner(degrees=2.0, channels=AXIAL)
    run = fly(craft, Loop(Sensor(rate=40.0, noise=rad(0.02)), start=rad(0.3), stop=rad(0.1)), 60.0)
    again = flight.flown(craft, run.schedule, 60.0)
    times = np.linspace(0.0, 60.0, 200)
    for one, other in zip(run.flight.motion(times), again.motion(times), strict=True):
        assert one == pytest.approx(other, abs=1e-12)
    assert run.flight.residual.nutation == pytest.approx(again.residual.nutation, abs=1e-14)
    rows = [one.sampled(100, 60.0) for one in (run.flight, again)]
    assert np.array_equal(rows[0].pulse, rows[1].pulse)
    assert np.array_equal(rows[0].t, rows[1].t)


@spread("predict", [True, False], quick=1)
def test_valves_and_cold_nozzles_are_fired_through(predict: bool) -> None:
    """The law knows the valves; with prediction what they do to time and impulse is reckoned with."""
    valve = Trapezoid(open_delay=0.03, close_delay=0.05, rise_time=0.02, fall_time=0.04)
    channels = tuple(
        replace(one, thrusters=tuple(replace(each, valve=valve, min_on_time=0.03) for each in one.thrusters))
        for one in FOUR
    )
    loop = ideal(start=rad(0.3), stop=rad(0.002), predict=predict)
    craft = replace(spinner(degrees=2.0, channels=channels), loop=loop)
    run = fly(craft, loop, 60.0)
    first = run.schedule.pulses[0]
    assert first.command is not None
    centred = fly(spinner(degrees=2.0, channels=FOUR), ideal(), 9.0).schedule.pulses[0]
    assert first.channel == centred.channel
    late = first.loaded[0] - centred.t if not predict else first.t - centred.t
    assert late == pytest.approx(0.0, abs=2e-4)
    again = flight.flown(craft, run.schedule, 60.0)
    times = np.linspace(0.0, 60.0, 100)
    for one, other in zip(run.flight.motion(times), again.motion(times), strict=True):
        assert one == pytest.approx(other, abs=1e-12)
    if predict:
        assert run.settled is not None
        assert run.flight.residual.nutation < rad(0.01)
    colder = fly(replace(craft, cold=Cold(0.6, 2.0)), loop, 60.0)
    strengths = [np.linalg.norm(one.impulse) / one.on_time / 6.0 for one in colder.schedule]
    assert strengths[0] == pytest.approx(0.6)
    assert colder.schedule.total_impulse == pytest.approx(run.schedule.total_impulse, rel=0.2)
    assert verify_loop(craft, 12.0).agree


def test_three_different_moments_are_damped() -> None:
    for moments in ((120.0, 100.0, 80.0), (70.0, 90.0, 130.0)):
        craft = spinner(moments=moments, degrees=2.0, channels=FOUR)
        run = fly(craft, Loop(Sensor(), start=rad(0.2), stop=rad(0.02)), 100.0)
        assert run.settled is not None
        assert run.flight.residual.nutation < rad(0.02)
        planned = nutdamp.plan(craft, "four-pulse")
        assert run.schedule.total_impulse < 1.03 * planned.total_impulse


def test_reversed_and_unreversed_faults_are_named_by_the_static_check() -> None:
    craft = spinner(degrees=2.0, channels=FOUR)
    found = margins(craft, ideal(start=rad(0.3), reversed=("+M2",)))
    assert [one.channel for one in found if one.cause.turned] == ["+M2"]
    assert all(one.cause.turned for one in margins(craft, ideal(start=rad(0.3), sensor=Sensor(scale=-1.0))))
    both = margins(craft, ideal(start=rad(0.3), sensor=Sensor(scale=-1.0), reversed=("+M2",)))
    assert [one.channel for one in both if not one.cause.turned] == ["+M2"]
