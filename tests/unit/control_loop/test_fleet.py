"""Loops flown together against each of them flown alone: the same firings, whatever sensor, law and body."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from support import reference
from support.builders import channel, spinner
from support.cases import spread

from nutdamp.loop.diagnosis import Stop
from nutdamp.loop.fleet import Case, expects_alone, fly_together
from nutdamp.loop.law import Law
from nutdamp.loop.run import fly
from nutdamp.loop_settings import ACCELEROMETER, BANG, FOUR_PULSE, ONE_PULSE, Loop, Sensor
from nutdamp.physics.feed import Cold
from nutdamp.physics.valve import Trapezoid
from nutdamp.spacecraft import Disturbance, Limits, Spacecraft

LAWS = (FOUR_PULSE, ONE_PULSE, BANG)


@dataclass
class Off:
    """Every other firing a little weaker and late."""

    def of(self, number: int) -> tuple[float, float]:
        return (0.97, 0.004) if number % 2 else (1.02, 0.0)


def random_craft(rng: np.random.Generator) -> Spacecraft:
    """Any shape and sense of spin, three or four channels with axial parts, sometimes valves, cold nozzles, sink."""
    A = 120.0
    C = A * (rng.uniform(0.3, 0.8) if rng.random() < 0.5 else rng.uniform(1.2, 1.8))
    valve = None
    if rng.random() < 0.5:
        valve = Trapezoid(*rng.uniform(0.0, 0.03, 4).tolist())
    count, first = int(rng.integers(3, 5)), rng.uniform(0.0, 6.0)
    channels = []
    for index in range(count):
        angle = first + 2.0 * math.pi * index / count
        one = channel(
            f"T{index}",
            6.0 * math.cos(angle),
            6.0 * math.sin(angle),
            rng.uniform(-0.5, 0.5) if rng.random() < 0.3 else 0.0,
            min_on_time=0.02,
            max_on_time=0.3,
        )
        channels.append(one.of(valve=valve))
    craft = spinner(C=C, spin=rng.choice([-3.0, 3.0]), degrees=2.0, channels=tuple(channels))
    limits = Limits(tick=0.01, gap=0.1, earliest=1.0, blackout=((8.0, 11.0),)) if rng.random() < 0.3 else Limits()
    cold = Cold(0.9, 3.0) if rng.random() < 0.3 else None
    return replace(craft, limits=limits, cold=cold, dissipation=150.0 if rng.random() < 0.5 else None)


def random_loop(rng: np.random.Generator, craft: Spacecraft, law: str) -> Loop:
    rate = 2.0 ** rng.uniform(3.0, 5.0) / craft.body_period
    kinds: dict[str, Any] = {"rate": rate, "delay": rng.uniform(0.0, 0.1)}
    if rng.random() < 0.4:
        kinds |= {"low_pass": rng.uniform(0.5, 4.0) / rate}
    if rng.random() < 0.4:
        kinds |= {"kind": ACCELEROMETER, "position": np.array([1.0, 0.3, 0.2]), "noise": 2e-3, "quantisation": 1e-3}
    else:
        kinds |= {"noise": 4e-4, "bias": 2e-4, "quantisation": 1e-4}
    on_time = None if law == ONE_PULSE else 0.15
    more = {"predict": bool(rng.random() < 0.7), "settle": rng.choice([0.0, 0.3]), "min_interval": 0.2}
    return Loop(Sensor(**kinds), law, math.radians(0.5), math.radians(0.15), on_time=on_time, **more)


def truths(rng: np.random.Generator, craft: Spacecraft, loop: Loop, count: int) -> list[Case]:
    """Cases that differ in moments, motion, thrust and sensor from what the law knows."""
    found = []
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
            one.of(torque=one.torque * (1.0 + 0.03 * rng.normal()) + 0.05 * rng.normal(size=3))
            for one in craft.channels
        )
        truth = replace(
            craft,
            inertia=replace(craft.inertia, moments=(A, A, C)),
            omega0=np.array([turn.real, turn.imag, craft.spin * (1.0 + 0.01 * rng.normal())]),
            channels=channels,
            loop=replace(loop, sensor=sensor, reversed=(channels[0].name,) if number == 0 else ()),
        )
        found.append(Case(truth, (11, number + 1), Off() if number % 2 else None))
    return found


@spread("law", LAWS, quick=1)
@spread("seed", range(8), quick=1)
def test_loops_flown_together_fire_as_each_alone(seed: int, law: str) -> None:
    rng = np.random.default_rng((seed, LAWS.index(law)))
    craft = random_craft(rng)
    loop = random_loop(rng, craft, law)
    known, until = Law(craft, loop), 30.0 * craft.body_period
    cases = truths(rng, craft, loop, 6)
    assert not expects_alone(known, craft)
    together = fly_together(known, cases, until)
    fired, stopped = 0, set()
    for row, (case, pilot) in enumerate(zip(cases, together.pilots, strict=True)):
        assert case.truth.loop is not None
        run = fly(case.truth, case.truth.loop, until, seed=case.key, law=known, scatter=case.scatter)
        assert [one.pulse.channel for one in pilot.fired] == [one.pulse.channel for one in run.fired]
        for one, other in zip(pilot.fired, run.fired, strict=True):
            assert one.pulse.loaded == pytest.approx(other.pulse.loaded, abs=1e-9)
            assert one.decided == pytest.approx(other.decided, abs=1e-9)
            assert one.true_nutation == pytest.approx(other.true_nutation, abs=1e-11)
            assert one.pulse.impulse == pytest.approx(other.pulse.impulse, abs=1e-9)
        assert pilot.quiet == pytest.approx(list(run.quiet), abs=1e-9)
        assert (pilot.ending[0], pilot.ending[1] or None) == (run.stop, run.channel)
        assert pilot.looked_at == run.looked_at
        (rates,), _ = run.flight.motion(np.array([max(until, run.flight.legs[-1].end)]))
        assert together.rates[:, row] == pytest.approx(rates, abs=1e-11)
        if run.settled is not None:
            at = run.flight.motion(np.array([run.settled]))[0][0]
            sense = math.copysign(1.0, at[2])
            nutation = reference.nutation(case.truth.inertia.moments, at, sense)
            assert together.quiet[row] == pytest.approx(nutation, abs=1e-10)
            times = np.linspace(run.settled, until, 4000)
            motion = run.flight.motion(times)[0]
            among = max(reference.nutation(case.truth.inertia.moments, one, sense) for one in motion)
            assert together.largest[row] >= among - 1e-10 or any(
                one.pulse.start > run.settled
                for one in run.fired  # in a pulse it may be more for a moment
            )
        fired += len(run.fired)
        stopped.add(run.stop)
    assert fired >= 12


def test_the_random_loops_are_of_all_kinds() -> None:
    seen: dict[str, set[object]] = {"kind": set(), "sink": set(), "valve": set(), "predict": set(), "stop": set()}
    for seed in range(8):
        for index, law in enumerate(LAWS):
            rng = np.random.default_rng((seed, index))
            craft = random_craft(rng)
            loop = random_loop(rng, craft, law)
            seen["kind"].add(loop.sensor.kind)
            seen["sink"].add(craft.dissipation)
            seen["valve"].add(craft.channels[0].valve is None)
            seen["predict"].add(loop.predict)
            seen["stop"].add(loop.sensor.low_pass > 0.0)
    assert {name: len(found) for name, found in seen.items()} == dict.fromkeys(seen, 2)


def test_a_case_does_not_depend_on_those_beside_it(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(4)
    craft = replace(random_craft(rng), dissipation=200.0)
    loop = random_loop(rng, craft, FOUR_PULSE)
    known, cases = Law(craft, loop), truths(rng, craft, loop, 9)
    whole = fly_together(known, cases, 40.0)
    monkeypatch.setattr("nutdamp.loop.fleet.TOGETHER", 100)
    parts = fly_together(known, cases, 40.0)
    alone = fly_together(known, cases[7:8], 40.0)
    assert np.abs(whole.rates - parts.rates).max() < 1e-12
    assert np.abs(whole.rates[:, 7] - alone.rates[:, 0]).max() < 1e-12
    assert len(whole.pilots[7].fired) == len(alone.pilots[0].fired) > 2


def test_what_cannot_go_together_is_named() -> None:
    craft = spinner(degrees=2.0, channels=(channel("a", 6.0, 0.0, 0.0), channel("b", 0.0, 6.0, 0.0)))
    loop = Loop(Sensor(rate=20.0), start=0.01)
    assert expects_alone(Law(craft, replace(loop, sensor=Sensor())), craft) == "a continuous signal"
    disturbed = replace(craft, disturbances=(Disturbance(0.01j),))
    assert expects_alone(Law(craft, loop), disturbed) == "disturbances"
    tensor = replace(craft, inertia=spinner(moments=(120.0, 100.0, 80.0)).inertia)
    assert expects_alone(Law(craft, loop), tensor) == "three different moments of inertia"


def test_a_loop_without_end_is_over_and_the_others_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("nutdamp.loop.pilot.MOST_FIRINGS", 3)
    craft = spinner(degrees=3.0, channels=(channel("a", 6.0, 0.0, 0.0), channel("b", -6.0, 0.0, 0.0)))
    loop = Loop(Sensor(rate=20.0), start=0.01, stop=0.005, on_time=0.2)
    still = replace(craft, omega0=np.array([0.021, 0.0, 3.0]))
    found = fly_together(Law(craft, loop), [Case(replace(one, loop=loop), (1,)) for one in (craft, still)], 60.0)
    assert [len(one.fired) for one in found.pilots] == [3, 2]
    assert [one.ending[0] for one in found.pilots] == [Stop.FULL, Stop.END]
