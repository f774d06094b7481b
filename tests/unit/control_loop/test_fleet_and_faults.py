"""What is wired backwards is named, whatever sensor and law; loops flown together fire as each
flown alone.
"""

import cmath
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.builders import present, spinner
from support.cases import deep, spread
from support.loops import FOUR, around, fired_by, fires, rad

from nutdamp.control_loop.controller import Case, Ending, Scatter
from nutdamp.control_loop.law import Law
from nutdamp.control_loop.sensor import Estimator, gain
from nutdamp.control_loop.simulation import Fleet, LoopRun, expects_alone, fly
from nutdamp.control_loop.stability import Margin, feeding
from nutdamp.errors import Infeasible
from nutdamp.physics.thruster import Cold, Trapezoid
from nutdamp.spacecraft.equipment import ACCELEROMETER, BANG, FOUR_PULSE, ONE_PULSE, Loop, Sensor
from nutdamp.spacecraft.model import Limits, Spacecraft, Vector
from nutdamp.spacecraft.tolerances import Dispersions, Tolerance
from nutdamp.views.loop import margin_table

CRAFT = fired_by(channels=around(4, 2.0))
PERIOD = CRAFT.body_period
LAWS = (FOUR_PULSE, ONE_PULSE, BANG)


def wrong(loop: Loop) -> tuple[Loop, Loop]:
    """The loop with its first channel wired backwards, and with its sensor reversed."""
    return replace(loop, reversed=("T0",)), replace(
        loop, sensor=replace(loop.sensor, scale=-loop.sensor.scale)
    )


def check_named(loop: Loop, until: float) -> LoopRun:
    """T0 fires once where it is wired backwards; gives the run with the sensor reversed."""
    channel, reverse = wrong(loop)
    run = fly(CRAFT, channel, until)
    assert (run.stop, run.channel) == (Ending.CHANNEL, "T0")
    assert [pulse.channel for pulse in run.schedule].count("T0") == 1
    run = fly(CRAFT, reverse, until)
    assert run.stop is Ending.SENSOR
    return run


@pytest.mark.parametrize(
    ("law", "delay", "settle"),
    [
        (FOUR_PULSE, 0, 0),
        (ONE_PULSE, 5, 0),
        (BANG, 5, 5),
        deep(FOUR_PULSE, 5, 5),
        deep(ONE_PULSE, 0, 5),
        deep(BANG, 5, 0),
    ],
)
def test_after_five_periods_it_is_named_by_as_many_firings_as_at_once(
    law: str, delay: int, settle: int
) -> None:
    sensor = Sensor(rate=20.0 / PERIOD, noise=rad(0.002), delay=delay * PERIOD)
    late = (delay + settle + 1.0) * PERIOD
    run = check_named(
        fires(sensor, law=law, settle=settle * PERIOD, on_time=0.05 if law == BANG else None),
        40 * late,
    )
    assert len(run.fired) == 2
    assert run.fired[1].pulse.start - run.fired[0].pulse.start < late


@pytest.mark.parametrize(
    "sensor", [Sensor(), Sensor(rate=20.0, noise=rad(0.02))], ids=["continuous", "noisy"]
)
def test_a_bias_as_large_as_half_of_start_makes_no_fault(sensor: Sensor) -> None:
    """Firings of 0.02 deg in a bias of 0.25 deg: between samples it turns by more than they do."""
    bias = Law(CRAFT, fires(sensor, 0.5)).size(rad(0.25), 3.0) / math.sqrt(2.0)
    loop = fires(replace(sensor, bias=bias), 0.5, 0.2, law=BANG, on_time=0.05)
    run = fly(CRAFT, loop, 200.0)
    assert run.stop is Ending.END
    assert {pulse.on_time for pulse in run.schedule} == {0.05}
    if sensor.rate is None:
        check_named(loop, 200.0)


@spread("law", LAWS, quick=1)
@spread("share", [1.0, 3.0], quick=1)
@spread("stop", [0.0, 0.1], quick=1)
def test_a_healthy_loop_in_more_noise_than_start_is_not_accused(
    law: str, share: float, stop: float
) -> None:
    noise = share * Law(CRAFT, fires()).size(rad(0.3), 3.0)
    for rate, settle in ((5.0, 0.0), (20.0, 1.0)):
        sensor = Sensor(rate=rate, noise=noise, bias=0.2 * noise, low_pass=0.3 * settle)
        loop = fires(
            sensor, 0.3, stop, law=law, settle=settle, on_time=0.02 if law == BANG else None
        )
        run = fly(CRAFT, loop, 150.0, seed=7)
        assert (run.stop, run.channel) == (Ending.END, None)
        assert len(run.fired) > 20


def test_a_body_that_is_not_as_known_makes_no_fault_of_a_healthy_loop() -> None:
    """The rate of nutation off by 6 %, pulses of a hundredth of the nutation each."""
    about = Tolerance("normal", 0.02, relative=True)
    known = replace(CRAFT, channels=around(4, 6.0), dispersions=Dispersions(A=about, C=about))
    inertia = replace(CRAFT.inertia, moments=(122.5, 122.5, 79.0))
    truth = replace(known, inertia=inertia, omega0=CRAFT.omega0 * [1.5, 1.5, 1.0])
    loop = fires(Sensor(delay=0.5 * PERIOD), 0.5, 0.2, law=BANG, settle=PERIOD, on_time=0.02)
    run = fly(truth, loop, 300.0, law=Law(known, loop))
    assert run.stop is Ending.END
    assert len(run.fired) > 25
    assert fly(truth, wrong(loop)[1], 3000.0, law=Law(known, loop)).stop in (
        Ending.SENSOR,
        Ending.FED,
    )


def some(rng: np.random.Generator) -> tuple[Spacecraft, Loop]:
    """Any shape and sense of spin, sensor, law, delay, settling and bias; noise that leaves a
    firing to be seen.
    """
    C = 120.0 * (rng.uniform(0.3, 0.85) if rng.random() < 0.5 else rng.uniform(1.15, 1.9))
    channels = around(
        int(rng.integers(2, 5)),
        rng.choice([6.0, 20.0]),
        rng.uniform(0.0, 6.0),
        rng.choice([0.002, 0.02]),
    )
    craft = spinner(
        C=C, spin=rng.choice([-3.0, 3.0]), degrees=rng.uniform(1.0, 4.0), channels=channels
    )
    if rng.random() < 0.3:
        craft = replace(craft, dissipation=30.0 * craft.body_period)
    period = craft.body_period
    start = rad(rng.uniform(0.3, 1.0))
    law = str(rng.choice(LAWS))
    kind = Sensor().kind
    at = np.array([1.0, 0.3, 0.2])
    size = craft.inertia.C * 3.0 / craft.inertia.A * math.tan(start)
    if rng.random() < 0.35:
        kind = ACCELEROMETER
        size *= 3.0 * math.hypot(*gain(craft.inertia.moments, at, np.array([0.0, 0.0, 1.0])))
    sampled = kind == ACCELEROMETER or rng.random() < 0.8
    sensor = Sensor(
        kind,
        2.0 ** rng.uniform(2.5, 6.0) / period if sampled else None,
        quantisation=size * rng.choice([0.0, 0.02]) * sampled,
        noise=size * rng.choice([0.0, 0.01]) * sampled,
        bias=size * rng.choice([0.0, 0.2, 0.5]),
        delay=period * rng.choice([0.0, 0.2, 1.0, 5.0]),
        low_pass=period * rng.choice([0.0, 0.0, 0.3]) * sampled,
        position=at,
    )
    stop, settle = start * rng.choice([0.1, 0.5]), period * rng.choice([0.0, 0.3, 5.0])
    pause = period * rng.choice([0.0, 1.5])
    predict = bool(rng.random() < 0.7)
    return craft, Loop(
        sensor, law, start, stop, settle, pause, predict, 0.05 * period if law == BANG else None
    )


@pytest.mark.weekly
def test_random_loops_are_accused_of_what_is_wrong_with_them_and_of_nothing_else() -> None:
    """Not of each is it named, where bias hides it or one channel fires alone: none is misnamed."""
    rng = np.random.default_rng(15)
    stops: list[Ending] = []
    for _ in range(60):
        craft, loop = some(rng)
        law = Law(craft, loop)
        act = law.firing(
            law.actuators[0], complex(law.size(craft.nutation, craft.spin)), craft.spin
        )
        doubts = Estimator(law, loop.sensor, 0.0).doubts
        if feeding(craft, loop) is not None or act is None:
            continue
        periods = 90.0 + 60.0 * loop.settle / craft.body_period
        span = periods * craft.body_period + 30.0 * loop.sensor.delay
        try:
            assert fly(craft, loop, span).stop is Ending.END
            if abs(act.acts) < 12.0 * math.hypot(doubts.noise, doubts.steps):
                continue
            channel, sensor = (fly(craft, faulty, span) for faulty in wrong(loop))
        except Infeasible:
            continue
        if "T0" in {pulse.channel for pulse in channel.schedule}:
            assert channel.stop in (Ending.CHANNEL, Ending.UNCLEAR, Ending.FED, Ending.END)
            assert channel.stop is not Ending.CHANNEL or channel.channel == "T0"
            stops.append(channel.stop)
        if sensor.fired:
            assert sensor.stop in (Ending.SENSOR, Ending.UNCLEAR, Ending.FED)
            stops.append(sensor.stop)
    named = sum(stop in (Ending.CHANNEL, Ending.SENSOR) for stop in stops)
    assert len(stops) > 50
    assert named > 0.6 * len(stops)


def test_rounding_is_no_share_that_a_firing_leaves() -> None:
    margin = Margin("+M1", 0.01, 0.0, 1.0, 2.22e-16, 1.0, 0.4, turned=False)
    assert margin_table((margin,)).cells("screen")[0][2] == "0"


UP = np.array([0.0, 0.0, 1.0])


class Off(Scatter):
    """Every other firing a little weaker and late."""

    def of(self, number: int) -> tuple[float, float]:
        return (0.97, 0.004) if number % 2 else (1.02, 0.0)


def random_loop(rng: np.random.Generator, law: str) -> tuple[Spacecraft, Loop]:
    """Any shape, sense of spin, sensor; three or four channels with axial parts; sometimes valves,
    limits, a sink.
    """
    C = 120.0 * (rng.uniform(0.3, 0.8) if rng.random() < 0.5 else rng.uniform(1.2, 1.8))
    valve = Trapezoid(*rng.uniform(0.0, 0.03, 4).tolist()) if rng.random() < 0.5 else None
    channels = tuple(
        each.of(
            valve=valve,
            torque=each.torque + UP * (rng.uniform(-0.5, 0.5) if rng.random() < 0.3 else 0.0),
        )
        for each in around(int(rng.integers(3, 5)), 6.0, rng.uniform(0.0, 6.0), 0.02)
    )
    limits = (
        Limits(tick=0.01, gap=0.1, earliest=1.0, blackout=((8.0, 11.0),))
        if rng.random() < 0.3
        else Limits()
    )
    craft = fired_by(channels=channels, C=C, spin=rng.choice([-3.0, 3.0]), limits=limits)
    cold = Cold(0.9, 3.0) if rng.random() < 0.3 else None
    craft = replace(craft, cold=cold, dissipation=150.0 if rng.random() < 0.5 else None)
    rate = 2.0 ** rng.uniform(3.0, 5.0) / craft.body_period
    sensor: dict[str, Any] = {
        "rate": rate,
        "delay": rng.uniform(0.0, 0.1),
        "noise": 4e-4,
        "bias": 2e-4,
    }
    if rng.random() < 0.4:
        sensor |= {"low_pass": rng.uniform(0.5, 4.0) / rate}
    if rng.random() < 0.4:
        sensor |= {
            "kind": ACCELEROMETER,
            "position": np.array([1.0, 0.3, 0.2]),
            "noise": 2e-3,
            "bias": 0.0,
        }
    sensor["quantisation"] = 0.5 * sensor["noise"]
    given: dict[str, Any] = {"predict": bool(rng.random() < 0.7), "settle": rng.choice([0.0, 0.3])}
    given |= {"min_interval": 0.2, "on_time": None if law == ONE_PULSE else 0.15, "law": law}
    return craft, fires(Sensor(**sensor), 0.5, 0.15, **given)


def truths(rng: np.random.Generator, craft: Spacecraft, loop: Loop, count: int) -> list[Case]:
    """Cases that differ in moments, motion, thrust and sensor from what the law knows."""
    cases = []
    for number in range(count):
        turn = (
            cmath.exp(2j * math.pi * rng.random())
            * complex(*craft.omega0[:2])
            * rng.uniform(0.5, 1.5)
        )
        A, C = (
            moment * (1.0 + 0.02 * rng.normal()) for moment in (craft.inertia.A, craft.inertia.C)
        )
        sensor = replace(
            loop.sensor,
            scale=1.0 + 0.02 * rng.normal(),
            bias=loop.sensor.bias * rng.normal(),
            noise=loop.sensor.noise * rng.uniform(0.5, 1.5),
            delay=loop.sensor.delay * rng.uniform(0.8, 1.2),
        )
        if sensor.kind != ACCELEROMETER:
            sensor = replace(sensor, second=(1.0 + 0.02 * rng.normal(), 1e-4 * rng.normal()))
        channels = tuple(
            each.of(torque=each.torque * (1.0 + 0.03 * rng.normal()) + 0.05 * rng.normal(size=3))
            for each in craft.channels
        )
        truth = replace(
            craft,
            inertia=replace(craft.inertia, moments=(A, A, C)),
            omega0=np.array([turn.real, turn.imag, craft.spin * (1.0 + 0.01 * rng.normal())]),
            channels=channels,
            loop=replace(loop, sensor=sensor, reversed=(channels[0].name,) if number == 0 else ()),
        )
        cases.append(Case(truth, (11, number + 1), Off((), None, None) if number % 2 else None))
    return cases


def nutation(moments: tuple[float, float, float], rates: Vector) -> Vector:
    """Angle between H and the axis about which the body spins, from rates (n, 3)."""
    momentum = rates * moments
    return np.arctan2(np.hypot(momentum[:, 0], momentum[:, 1]), np.abs(momentum[:, 2]))


@spread("law", LAWS, quick=1)
@spread("seed", range(8), quick=1)
def test_loops_flown_together_fire_as_each_alone(seed: int, law: str) -> None:
    rng = np.random.default_rng((seed, LAWS.index(law)))
    craft, loop = random_loop(rng, law)
    known = Law(craft, loop)
    until = 30.0 * craft.body_period
    cases = truths(rng, craft, loop, 6)
    assert not expects_alone(known, craft)
    together = Fleet(known, cases, until).fly()
    for row, (case, pilot) in enumerate(zip(cases, together.pilots, strict=True)):
        run = fly(
            case.truth,
            present(case.truth.loop),
            until,
            seed=case.key,
            law=known,
            scatter=case.scatter,
        )
        assert [each.pulse.channel for each in pilot.fired] == [
            each.pulse.channel for each in run.fired
        ]
        for mine, other in zip(pilot.fired, run.fired, strict=True):
            assert mine.pulse.loaded == pytest.approx(other.pulse.loaded, abs=1e-9)
            assert mine.decided == pytest.approx(other.decided, abs=1e-9)
            assert mine.true_nutation == pytest.approx(other.true_nutation, abs=1e-11)
            assert mine.pulse.impulse == pytest.approx(other.pulse.impulse, abs=1e-9)
        assert pilot.quiet == pytest.approx(list(run.quiet), abs=1e-9)
        assert (pilot.ending[0], pilot.ending[1] or None, pilot.looked_at) == (
            run.stop,
            run.channel,
            run.looked_at,
        )
        (rates,), _ = run.flight.motion(np.array([max(until, run.flight.legs[-1].end)]))
        assert together.rates[:, row] == pytest.approx(rates, abs=1e-11)
        if run.settled is not None:
            angles = nutation(
                case.truth.inertia.moments,
                run.flight.motion(np.linspace(run.settled, until, 4000))[0],
            )
            assert together.quiet[row] == pytest.approx(angles[0], abs=1e-10)
            # In a pulse it may be more for a moment.
            later = any(each.pulse.start > run.settled for each in run.fired)
            assert together.largest[row] >= angles.max() - 1e-10 or later
    assert sum(len(pilot.fired) for pilot in together.pilots) >= 12


def test_a_case_does_not_depend_on_those_beside_it(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(4)
    craft, loop = random_loop(rng, FOUR_PULSE)
    craft = replace(craft, dissipation=200.0)
    known = Law(craft, loop)
    cases = truths(rng, craft, loop, 9)
    whole = Fleet(known, cases, 40.0).fly()
    monkeypatch.setattr("nutdamp.control_loop.simulation.TOGETHER", 100)
    parts, alone = Fleet(known, cases, 40.0).fly(), Fleet(known, cases[7:8], 40.0).fly()
    assert np.abs(whole.rates - parts.rates).max() < 1e-12
    assert np.abs(whole.rates[:, 7] - alone.rates[:, 0]).max() < 1e-12
    assert len(whole.pilots[7].fired) == len(alone.pilots[0].fired) > 2


def test_a_loop_without_end_is_over_and_the_others_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("nutdamp.control_loop.controller.MOST_FIRINGS", 3)
    craft = fired_by(3.0, FOUR[:2])
    loop = fires(Sensor(rate=20.0), 0.57, 0.29, on_time=0.2)
    still = replace(craft, omega0=np.array([0.021, 0.0, 3.0]))
    fleet = Fleet(
        Law(craft, loop), [Case(replace(each, loop=loop), (1,)) for each in (craft, still)], 60.0
    ).fly()
    assert [len(pilot.fired) for pilot in fleet.pilots] == [3, 2]
    assert [pilot.ending[0] for pilot in fleet.pilots] == [Ending.FULL, Ending.END]
