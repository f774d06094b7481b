"""Loops flown together against each of them flown alone: the same firings, whatever sensor, law and body."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from support.builders import spinner
from support.cases import spread
from support.loops import FOUR, around, fired_by, fires

from nutdamp.loop.diagnosis import Stop
from nutdamp.loop.fleet import Case, expects_alone, fly_together
from nutdamp.loop.law import Law
from nutdamp.loop.run import fly
from nutdamp.loop_settings import ACCELEROMETER, BANG, FOUR_PULSE, ONE_PULSE, Loop, Sensor
from nutdamp.physics.feed import Cold
from nutdamp.physics.valve import Trapezoid
from nutdamp.spacecraft import Disturbance, Limits, Spacecraft, Vector

LAWS = (FOUR_PULSE, ONE_PULSE, BANG)
UP = np.array([0.0, 0.0, 1.0])


@dataclass
class Off:
    """Every other firing a little weaker and late."""

    def of(self, number: int) -> tuple[float, float]:
        return (0.97, 0.004) if number % 2 else (1.02, 0.0)


def random_loop(rng: np.random.Generator, law: str) -> tuple[Spacecraft, Loop]:
    """Any shape, sense of spin, sensor; three or four channels with axial parts; sometimes valves, limits, a sink."""
    C = 120.0 * (rng.uniform(0.3, 0.8) if rng.random() < 0.5 else rng.uniform(1.2, 1.8))
    valve = Trapezoid(*rng.uniform(0.0, 0.03, 4).tolist()) if rng.random() < 0.5 else None
    channels = tuple(
        each.of(valve=valve, torque=each.torque + UP * (rng.uniform(-0.5, 0.5) if rng.random() < 0.3 else 0.0))
        for each in around(int(rng.integers(3, 5)), 6.0, rng.uniform(0.0, 6.0), 0.02)
    )
    limits = Limits(tick=0.01, gap=0.1, earliest=1.0, blackout=((8.0, 11.0),)) if rng.random() < 0.3 else Limits()
    craft = fired_by(channels=channels, C=C, spin=rng.choice([-3.0, 3.0]), limits=limits)
    cold = Cold(0.9, 3.0) if rng.random() < 0.3 else None
    craft = replace(craft, cold=cold, dissipation=150.0 if rng.random() < 0.5 else None)
    rate = 2.0 ** rng.uniform(3.0, 5.0) / craft.body_period
    sensor: dict[str, Any] = {"rate": rate, "delay": rng.uniform(0.0, 0.1), "noise": 4e-4, "bias": 2e-4}
    if rng.random() < 0.4:
        sensor |= {"low_pass": rng.uniform(0.5, 4.0) / rate}
    if rng.random() < 0.4:
        sensor |= {"kind": ACCELEROMETER, "position": np.array([1.0, 0.3, 0.2]), "noise": 2e-3, "bias": 0.0}
    sensor["quantisation"] = 0.5 * sensor["noise"]
    given: dict[str, Any] = {"predict": bool(rng.random() < 0.7), "settle": rng.choice([0.0, 0.3])}
    given |= {"min_interval": 0.2, "on_time": None if law == ONE_PULSE else 0.15, "law": law}
    return craft, fires(Sensor(**sensor), 0.5, 0.15, **given)


def truths(rng: np.random.Generator, craft: Spacecraft, loop: Loop, count: int) -> list[Case]:
    """Cases that differ in moments, motion, thrust and sensor from what the law knows."""
    cases = []
    for number in range(count):
        turn = cmath.exp(2j * math.pi * rng.random()) * complex(*craft.omega0[:2]) * rng.uniform(0.5, 1.5)
        A, C = (moment * (1.0 + 0.02 * rng.normal()) for moment in (craft.inertia.A, craft.inertia.C))
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
        cases.append(Case(truth, (11, number + 1), Off() if number % 2 else None))
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
    known, until = Law(craft, loop), 30.0 * craft.body_period
    cases = truths(rng, craft, loop, 6)
    assert not expects_alone(known, craft)
    together = fly_together(known, cases, until)
    for row, (case, pilot) in enumerate(zip(cases, together.pilots, strict=True)):
        assert case.truth.loop is not None
        run = fly(case.truth, case.truth.loop, until, seed=case.key, law=known, scatter=case.scatter)
        assert [each.pulse.channel for each in pilot.fired] == [each.pulse.channel for each in run.fired]
        for mine, other in zip(pilot.fired, run.fired, strict=True):
            assert mine.pulse.loaded == pytest.approx(other.pulse.loaded, abs=1e-9)
            assert mine.decided == pytest.approx(other.decided, abs=1e-9)
            assert mine.true_nutation == pytest.approx(other.true_nutation, abs=1e-11)
            assert mine.pulse.impulse == pytest.approx(other.pulse.impulse, abs=1e-9)
        assert pilot.quiet == pytest.approx(list(run.quiet), abs=1e-9)
        assert (pilot.ending[0], pilot.ending[1] or None, pilot.looked_at) == (run.stop, run.channel, run.looked_at)
        (rates,), _ = run.flight.motion(np.array([max(until, run.flight.legs[-1].end)]))
        assert together.rates[:, row] == pytest.approx(rates, abs=1e-11)
        if run.settled is not None:
            angles = nutation(case.truth.inertia.moments, run.flight.motion(np.linspace(run.settled, until, 4000))[0])
            assert together.quiet[row] == pytest.approx(angles[0], abs=1e-10)
            # In a pulse it may be more for a moment.
            later = any(each.pulse.start > run.settled for each in run.fired)
            assert together.largest[row] >= angles.max() - 1e-10 or later
    assert sum(len(pilot.fired) for pilot in together.pilots) >= 12


def test_the_random_loops_are_of_all_kinds() -> None:
    made = [
        random_loop(np.random.default_rng((seed, number)), LAWS[number]) for seed in range(8) for number in range(3)
    ]
    kinds = [
        (loop.sensor.kind, craft.dissipation, craft.channels[0].valve is None, loop.predict, loop.sensor.low_pass > 0.0)
        for craft, loop in made
    ]
    assert [len(set(kind)) for kind in zip(*kinds, strict=True)] == [2] * 5


def test_a_case_does_not_depend_on_those_beside_it(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(4)
    craft, loop = random_loop(rng, FOUR_PULSE)
    craft = replace(craft, dissipation=200.0)
    known, cases = Law(craft, loop), truths(rng, craft, loop, 9)
    whole = fly_together(known, cases, 40.0)
    monkeypatch.setattr("nutdamp.loop.fleet.TOGETHER", 100)
    parts, alone = fly_together(known, cases, 40.0), fly_together(known, cases[7:8], 40.0)
    assert np.abs(whole.rates - parts.rates).max() < 1e-12
    assert np.abs(whole.rates[:, 7] - alone.rates[:, 0]).max() < 1e-12
    assert len(whole.pilots[7].fired) == len(alone.pilots[0].fired) > 2


def test_what_cannot_go_together_is_named() -> None:
    craft, sampled = fired_by(), fires(Sensor(rate=20.0))
    tensor = spinner(moments=(120.0, 100.0, 80.0)).inertia
    for body, loop, why in (
        (craft, fires(), "a continuous signal"),
        (replace(craft, disturbances=(Disturbance(0.01j),)), sampled, "disturbances"),
        (replace(craft, inertia=tensor), sampled, "three different moments of inertia"),
    ):
        assert expects_alone(Law(craft, loop), body) == why


def test_a_loop_without_end_is_over_and_the_others_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("nutdamp.loop.pilot.MOST_FIRINGS", 3)
    craft, loop = fired_by(3.0, FOUR[:2]), fires(Sensor(rate=20.0), 0.57, 0.29, on_time=0.2)
    still = replace(craft, omega0=np.array([0.021, 0.0, 3.0]))
    fleet = fly_together(Law(craft, loop), [Case(replace(each, loop=loop), (1,)) for each in (craft, still)], 60.0)
    assert [len(pilot.fired) for pilot in fleet.pilots] == [3, 2]
    assert [pilot.ending[0] for pilot in fleet.pilots] == [Stop.FULL, Stop.END]
