"""The loop flown: equal to the open-loop schedule where it sees all, to simulations by DOP853 where
it samples.
"""

import cmath
import itertools
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import reference
from support.builders import codes, documented, present
from support.cases import deep, spread
from support.golden import check_text, refused
from support.loops import AXIAL, FOUR, fired_by, fires, four, ideal, rad, transverse_size
from support.process import Run as Process

import nutdamp
from nutdamp.control_loop.controller import Ending
from nutdamp.control_loop.evaluation import loop_of, verify_loop
from nutdamp.control_loop.simulation import LoopRun, fly
from nutdamp.control_loop.stability import margins
from nutdamp.errors import Infeasible
from nutdamp.flight import propagation
from nutdamp.physics.thruster import Cold, Trapezoid
from nutdamp.spacecraft.equipment import ACCELEROMETER, BANG, Loop, Sensor
from nutdamp.spacecraft.model import Disturbance, Inertia, Limits, Spacecraft
from nutdamp.views.loop import warnings

CRAFTS = {
    "prolate": nutdamp.example("magnus-a03"),
    "oblate": nutdamp.example("magnus-oblate"),
    "slender": nutdamp.example("magnus-a09"),
    "reversed": fired_by(3.0, spin=-3.0),
    "oblate, reversed": fired_by(3.0, A=80.0, C=120.0, spin=-3.0),
    "axial parts": fired_by(3.0, AXIAL),
    "gaps, blackout": fired_by(
        3.0, limits=Limits(earliest=2.0, gap=0.4, horizon=200.0, blackout=((4.0, 9.0),))
    ),
}


@pytest.mark.parametrize(
    ("name", "delay"), [*zip(CRAFTS, itertools.cycle([0.0, 0.02]), strict=False)]
)
def test_a_continuous_gyro_and_prediction_give_the_four_pulse_schedule(
    name: str, delay: float
) -> None:
    craft = CRAFTS[name]
    planned = nutdamp.plan(craft, "four-pulse").pulses
    run = fly(craft, ideal(sensor=Sensor(delay=delay)))
    assert len(planned) >= 5
    assert [pulse.channel for pulse in run.schedule] == [pulse.channel for pulse in planned]
    for fired, pulse in zip(run.schedule, planned, strict=True):
        assert (fired.start, fired.on_time) == pytest.approx((pulse.start, pulse.on_time), abs=1e-9)
    around = propagation.flown(craft, planned, run.until).around_pulses()
    for mine, other in zip(run.flight.around_pulses(), around, strict=True):
        assert np.degrees(mine.nutation) == pytest.approx(np.degrees(other.nutation), abs=1e-9)
        assert mine.momentum == pytest.approx(other.momentum, abs=1e-9)


TILTED = Path(__file__).parents[2] / "cases" / "loop-tilted-axes.yaml"


@pytest.mark.parametrize(
    ("axes", "fired", "left", "warned"), [("file", 0, 0.5, True), ("principal", 2, 0.0, False)]
)
def test_a_tilted_axis_3_shows_as_nutation_to_gyros_about_axes_of_the_file(
    axes: str, fired: int, left: float, warned: bool
) -> None:
    """0.7 kg m² of I13 turn 0.055 rad/s of ω3 into ω1, three times what there is of nutation."""
    given = nutdamp.load(TILTED, set={"loop.sensor.axes": axes})
    run = loop_of(given)
    assert len(run.pulses) == fired
    assert np.degrees(run.largest[0]) == pytest.approx(left, abs=1e-4)
    assert ("gyros-tilted" in codes(warnings(given))) is warned


def brute(craft: Spacecraft, predict: bool, until: float) -> list[tuple[float, float, str]]:
    """(start, on-time, channel) of the four-pulse law with a sampled gyro, sample by sample with
    DOP853.

    Its own reading of the law: a channel fires as the rate that is seen passes the direction
    against its torque, for as long as takes that rate away at that moment, found by halving.
    Thresholds 0.5 and 0.2 deg, 9 Hz, 70 ms late.
    """
    moments = craft.inertia.moments
    step = 1.0 / 9.0
    delay = 0.07
    A = moments[0]
    rate = (moments[0] - moments[2]) / moments[0]
    full = min(0.3, craft.body_period / 8)
    motion = reference.Motion(craft.omega0, np.eye(3))
    now = 0.0
    fired = []
    still = np.zeros(3)
    before: dict[str, float] = {}
    active = False
    for time in np.arange(math.ceil((until - delay) / step)) * step:
        if time < now:
            continue
        if time > now:
            motion = reference.coast(moments, motion, still, np.array([time - now]))[-1]
            now = time
        omega = complex(*motion.rates[:2])
        turn = rate * motion.rates[2]
        if predict:
            omega *= cmath.exp(-1j * turn * delay)
        angle = math.atan2(A * abs(omega), moments[2] * abs(motion.rates[2]))
        active = angle > rad(0.2) and (active or angle >= rad(0.5))
        chosen: list[tuple[float, float, str]] = []
        waits = {}
        for each in craft.channels:
            push = abs(each.transverse)
            low = 0.0
            high = full
            while high - low > 1e-14:
                middle = 0.5 * (low + high)
                does = 2.0 * push * math.sin(abs(turn) * middle / 2.0) / abs(turn)
                low, high = (middle, high) if does < A * abs(omega) else (low, middle)
            on_time = max(high, each.min_on_time)
            ahead = (cmath.phase(-omega / each.transverse)) / turn  # s until ω opposes the torque
            waits[each.name] = wait = ahead - 0.5 * on_time if predict else ahead
            reach = step if predict else 0.0
            last = before.get(each.name)
            passes = last is not None and last >= reach > wait and last - wait < 3.0
            if active and (passes or (last is None and 0.0 <= wait < reach)):
                chosen.append(
                    (time + delay + (max(wait, 0.0) if predict else 0.0), on_time, each.name)
                )
        before = waits
        if chosen:
            start, on_time, name = min(chosen)
            torque = next(each.torque for each in craft.channels if each.name == name)
            if start > now:
                motion = reference.coast(moments, motion, still, np.array([start - now]))[-1]
            motion = reference.coast(moments, motion, torque, np.array([on_time]))[-1]
            now = start + on_time
            fired.append((start, on_time, name))
            before = {}
    return fired


@pytest.mark.parametrize(
    ("C", "spin", "predict"),
    [(80.0, 3.0, True), (160.0, -3.0, False), deep(80.0, 3.0, False), deep(160.0, -3.0, True)],
)
def test_a_sampled_loop_is_that_of_a_simulation_sample_by_sample(
    C: float, spin: float, predict: bool
) -> None:
    craft = fired_by(C=C, spin=spin)
    run = fly(craft, fires(Sensor(rate=9.0, delay=0.07), 0.5, 0.2, predict=predict), 25.0)
    wanted = brute(craft, predict, 25.0)
    assert len(wanted) >= 4
    assert [each.channel for each in run.schedule] == [name for _, _, name in wanted]
    for fired, (start, on_time, _) in zip(run.schedule, wanted, strict=True):
        assert (fired.start, fired.on_time) == pytest.approx((start, on_time), abs=1e-8)


def test_without_prediction_firings_begin_late_by_delay_and_half_their_width() -> None:
    craft = fired_by()
    loop = ideal(sensor=Sensor(delay=0.11), predict=False, start=rad(0.1))
    run = fly(craft, loop)
    first, centred = run.schedule.pulses[0], fly(craft, ideal()).schedule.pulses[0]
    assert first.start - centred.t == pytest.approx(0.11, abs=1e-9)
    (margin,) = (
        each for each in margins(craft, loop, craft.nutation) if each.channel == first.channel
    )
    assert margin.late == pytest.approx((0.11 + 0.5 * first.on_time) * craft.inertia.a * 3.0)
    before, after = run.flight.around_pulses()
    left = transverse_size(after.rates[0]) / transverse_size(before.rates[0])
    assert margin.gain == pytest.approx(left, rel=1e-9)


def test_three_different_moments_are_damped() -> None:
    for moments in ((120.0, 100.0, 80.0), (70.0, 90.0, 130.0)):
        craft = fired_by(moments=moments)
        run = fly(craft, fires(Sensor(), 0.2, 0.02), 100.0)
        assert run.settled is not None
        assert run.flight.residual.nutation < rad(0.02)
        assert run.schedule.total_impulse < 1.03 * nutdamp.plan(craft, "four-pulse").total_impulse


def test_interval_and_settling_are_kept() -> None:
    run = fly(
        fired_by(3.0), fires(Sensor(rate=40.0), 0.2, 0.02, settle=0.3, min_interval=2.5), 120.0
    )
    assert len(run.fired) > 4
    for fired, later in itertools.pairwise(run.fired):
        assert later.pulse.start - fired.pulse.end >= 2.5
        assert later.decided >= fired.pulse.end + 0.3


FELT = Sensor(ACCELEROMETER, 20.0, noise=1e-4, position=np.array([1.0, 0.2, 0.0]))
NOISY = Sensor(rate=50.0, noise=rad(0.02), bias=rad(0.01), delay=0.03)
STEPS = fires(Sensor(rate=20.0, quantisation=0.02, scale=-1.0), 0.5, law=BANG, on_time=0.01)
SETTLING = fires(
    Sensor(rate=20.0, noise=1e-4, scale=-1.0), stop=0.0, settle=2.2 * fired_by().body_period
)


@pytest.mark.parametrize(
    ("loop", "stop", "channel"),
    [
        (fires(reversed=("-M2",)), Ending.CHANNEL, "-M2"),
        (fires(NOISY, reversed=("+M1",)), Ending.CHANNEL, "+M1"),
        (fires(Sensor(scale=-1.0)), Ending.SENSOR, None),
        (fires(replace(NOISY, scale=-0.5)), Ending.SENSOR, None),
        (fires(replace(FELT, rate=50.0, scale=-1.0)), Ending.SENSOR, None),
    ],
)
def test_what_is_wired_backwards_is_named_within_a_period(
    loop: Loop, stop: Ending, channel: str | None
) -> None:
    craft = fired_by()
    run = fly(craft, loop)
    assert run.stop is stop
    assert channel in (None, run.channel)
    fed = [pulse for pulse in run.schedule if channel in (None, pulse.channel)]
    assert len(fed) == (1 if channel else len(run.fired)) <= 2
    latency = (
        craft.body_period if loop.sensor.kind == ACCELEROMETER else loop.sensor.delay
    )  # to see what a firing did
    assert run.fired[-1].pulse.start - fed[0].start <= craft.body_period + latency


def test_faults_that_hide_are_stopped_as_what_they_show_themselves() -> None:
    """After long settling; steps hide which one it is; a single channel cannot tell itself from the
    sensor.
    """
    craft, single = fired_by(), fired_by(channels=FOUR[:1])
    assert fly(craft, SETTLING, 200.0).stop is Ending.SENSOR
    run = fly(craft, STEPS, 400.0)
    assert run.stop is Ending.FED
    assert max(each.true_nutation for each in run.fired) < 3.0 * craft.nutation
    assert fly(single, SETTLING, 200.0).stop is Ending.UNCLEAR
    for wrong in (fires(reversed=("+M1",)), fires(Sensor(scale=-1.0))):
        run = fly(single, wrong)
        assert (run.stop, run.channel, len(run.fired)) == (Ending.UNCLEAR, "+M1", 2)


def test_faults_are_named_by_the_static_check() -> None:
    craft = fired_by()
    reverse = Sensor(scale=-1.0)

    def turned(sensor: Sensor | None, *wrong: str) -> set[str]:
        return {
            each.channel for each in margins(craft, fires(sensor, reversed=wrong)) if each.turned
        }

    assert turned(None, "+M2") == {"+M2"}
    assert turned(reverse) == {each.name for each in FOUR}
    assert turned(reverse, "+M2") == {each.name for each in FOUR} - {"+M2"}


def test_firings_that_come_too_late_are_refused_before_the_flight_and_stopped_in_it() -> None:
    loop = ideal(start=rad(0.5), predict=False)
    craft = fired_by(loop=loop)
    (allowed,) = {round(each.delay, 12) for each in margins(craft, loop)}

    def late(delay: float) -> Spacecraft:
        return replace(craft, loop=replace(loop, sensor=Sensor(delay=delay)))

    assert loop_of(late(allowed - 0.01), 30.0).flown_run.stop is Ending.END
    with refused(Infeasible, "loop.too-late"):
        loop_of(late(allowed + 0.01), 30.0)
    run = fly(craft, replace(loop, sensor=Sensor(delay=0.5 * craft.body_period)))
    assert (run.stop, len(run.fired)) == (Ending.SENSOR, 2)


GROWING = fired_by(
    0.1, dissipation=100.0, loop=fires(Sensor(rate=40.0, noise=rad(0.004)), 0.3, 0.03)
)


def test_growing_nutation_is_kept_between_the_thresholds() -> None:
    plan = loop_of(GROWING, 3000.0, seed=4)
    run = plan.flown_run
    assert run.stop is Ending.END
    assert len(run.quiet) >= 5
    assert plan.largest[0] < rad(0.32)
    assert np.diff(run.quiet).min() > 100.0 * math.log(0.3 / 0.06)
    assert run.flight.residual.nutation < rad(0.05)  # just after the last firing


def test_samples_are_few_while_the_nutation_cannot_show_and_never_too_many(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    slow = replace(GROWING, dissipation=20_000.0)
    loop = present(GROWING.loop)
    run = fly(slow, loop, 300_000.0)
    assert len(run.quiet) >= 3
    assert run.looked_at < 300_000.0 * 40.0 / 10.0
    monkeypatch.setattr("nutdamp.control_loop.controller.MOST", 100_000)
    with refused(Infeasible, "loop.too-many-samples"):
        fly(GROWING, fires(Sensor(rate=1e6, noise=rad(0.25)), 80.0), 1e4)
    monkeypatch.setattr(
        "nutdamp.control_loop.controller.Coast.look", None
    )  # refused before a sample is looked at
    with refused(Infeasible, "loop.samples-known"):
        fly(GROWING, fires(Sensor(rate=100.0, noise=rad(3.0)), 0.5), 1e15)


def check_flown_again(craft: Spacecraft, run: LoopRun) -> None:
    """The schedule flown open-loop is the flight of the loop."""
    again = propagation.flown(craft, run.schedule, 60.0)
    times = np.linspace(0.0, 60.0, 150)
    for mine, other in zip(run.flight.motion(times), again.motion(times), strict=True):
        assert mine == pytest.approx(other, abs=1e-12)
    assert run.flight.residual.nutation == pytest.approx(again.residual.nutation, abs=1e-14)
    rows = [each.sampled(100, 60.0) for each in (run.flight, again)]
    assert np.array_equal(rows[0].pulse, rows[1].pulse)
    assert np.array_equal(rows[0].t, rows[1].t)


def test_the_schedule_flown_again_is_the_flight_of_the_loop() -> None:
    craft = fired_by(channels=AXIAL)
    check_flown_again(craft, fly(craft, fires(Sensor(rate=40.0, noise=rad(0.02))), 60.0))


@spread("predict", [True, False], quick=1)
def test_valves_and_cold_nozzles_are_fired_through(predict: bool) -> None:
    """The law knows the valves; with prediction what they do to time
    and impulse is reckoned with.
    """
    valve = Trapezoid(open_delay=0.03, close_delay=0.05, rise_time=0.02, fall_time=0.04)
    loop = ideal(start=rad(0.3), stop=rad(0.002), predict=predict)
    craft = fired_by(channels=tuple(each.of(valve=valve) for each in four(least=0.03)), loop=loop)
    run = fly(craft, loop, 60.0)
    first, centred = run.schedule.pulses[0], fly(fired_by(), ideal(), 9.0).schedule.pulses[0]
    assert first.command is not None
    assert first.channel == centred.channel
    assert (first.t if predict else first.loaded[0]) == pytest.approx(centred.t, abs=2e-4)
    check_flown_again(craft, run)
    if predict:
        assert run.settled is not None
        assert run.flight.residual.nutation < rad(0.01)
    colder = fly(replace(craft, cold=Cold(0.6, 2.0)), loop, 60.0).schedule
    assert np.linalg.norm(colder.pulses[0].impulse) / colder.pulses[0].on_time == pytest.approx(
        0.6 * 6.0
    )
    assert colder.total_impulse == pytest.approx(run.schedule.total_impulse, rel=0.2)
    assert verify_loop(documented(craft), 5.0).agree


SLANTED = (FOUR[0].of(torque=np.array([6.0, 0.2, 0.1])), *FOUR[1:])


def verified(sensor: Sensor, **given: Any) -> Spacecraft:
    return replace(fired_by(1.5, SLANTED, loop=fires(sensor, 0.4, 0.05)), **given)


CONTINUOUS = verified(Sensor(bias=2e-4, delay=0.05))
STRONG = tuple(
    replace(each, thrusters=(replace(each.thrusters[0], max_on_time=2.0),)) for each in SLANTED
)
CASES = {
    "continuous": (CONTINUOUS, 40.0),
    "sampled": (verified(Sensor(rate=20.0, noise=3e-4, delay=0.05, low_pass=0.1)), 40.0),
    "accelerometer": (verified(FELT), 40.0),
    "growing": (verified(Sensor(rate=20.0), dissipation=40.0), 40.0),
    "disturbed": (
        verified(Sensor(rate=20.0), disturbances=(Disturbance(0.02 + 0.01j, 0.03),)),
        40.0,
    ),
    "disturbed for a time": (
        verified(Sensor(), disturbances=(Disturbance(0.5 + 0.2j, 0.1, begin=3.0, end=21.0),)),
        40.0,
    ),
    "three moments": (verified(Sensor(), inertia=Inertia((120.0, 100.0, 80.0))), 40.0),
    "a long wait, while the spin falls": (verified(FELT, dissipation=20.0, channels=STRONG), 100.0),
}


@pytest.mark.weekly
@pytest.mark.parametrize("name", CASES)
def test_dop853_fires_alike(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "nutdamp.flight.verification.EVALUATIONS", 1000
    )  # of schedules, which loops need not keep
    craft, until = CASES[name]
    verdict = verify_loop(documented(craft), until)
    assert len(verdict.pairs) >= 3
    assert verdict.agree
    assert verdict.worst < 1e-7
    assert until == 40.0 or max(np.diff([each.pulse.start for each in verdict.run.fired])) > 20.0


def test_a_loop_is_not_confirmed_by_another_body_or_where_it_is_too_long(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    heavier = documented(replace(CONTINUOUS, inertia=Inertia((120.0, 120.0, 80.002))))
    verdict = verify_loop(replace(CONTINUOUS, document=heavier.document), 5.0)
    assert (verdict.same, verdict.agree) == (True, False)
    assert verdict.worst > 1e-6
    monkeypatch.setattr("nutdamp.control_loop.evaluation.EVALUATIONS", 200)
    verdict = verify_loop(documented(CONTINUOUS), 5.0)
    assert (verdict.other, verdict.agree) == (None, False)
    check_text("loop.too-long-to-verify", verdict.missing)


def test_the_command_verify(run: Process, tmp_path: Path) -> None:
    run("init", "--from", "magnus-a03", "craft.yaml")
    craft = tmp_path / "craft.yaml"
    craft.write_text(
        craft.read_text() + "loop: {sensor: {kind: gyro}, start: 0.5 deg, stop: 0.05 deg}\n"
    )
    shown = run("verify", "craft.yaml", "--loop", "--json", "v.json", "--set", "limits.horizon=5 s")
    assert shown.returncode == 0, shown.stderr
    assert "fires alike: 3 firings" in " ".join(shown.stdout.split())
    written = json.loads((tmp_path / "v.json").read_text())
    assert (written["agree"], len(written["firings"])) == (True, 3)
    assert run("verify", "craft.yaml", "--loop", "--scheme", "none").returncode == 2
    assert run("verify", "--loop").returncode == 2


@pytest.mark.parametrize("newton_metres", [1.0, 8.0])
@pytest.mark.parametrize("wired_wrong", [False, True])
def test_a_burn_is_no_fault_of_sensor_or_channels(
    newton_metres: float, *, wired_wrong: bool
) -> None:
    """It adds more nutation than a firing takes off, for ten seconds."""
    burn = Disturbance(complex(newton_metres), begin=10.0, end=20.0)
    body = replace(fired_by(0.1, FOUR, limits=Limits(horizon=120.0)), disturbances=(burn,))
    loop = fires(Sensor(scale=-1.0) if wired_wrong else Sensor(), 0.3, 0.05)
    run = fly(body, loop, 120.0)
    assert run.stop is (Ending.SENSOR if wired_wrong else Ending.END)
