"""Spinners commanded by blocks, and their flight by an integrator of its own."""

import cmath
import itertools
import math
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from support import reference
from support.builders import aimed, cross, spinner

from nutdamp.physics import attitude
from nutdamp.physics.thruster import Trapezoid, Valve
from nutdamp.spacecraft.equipment import Block, Commands, SunSensor
from nutdamp.spacecraft.model import Limits, Spacecraft
from nutdamp.spacecraft.schedule import Schedule

Array = NDArray[np.float64]

FILE = """
name: Spinner
mass: 300 kg
inertia: {A: 120 kg m^2, C: 180 kg m^2}
state: {spin: 12 rpm, nutation: 0 deg}
attitude: {epoch: 1998-01-07T12:00:00Z, frame: EME2000, quaternion: [1, 0, 0, 0]}
thrusters:
  - {name: T1, position: [0.5, 0, 0.8], direction: [0, 0, 1], force: 10 N, isp: 220 s, \
     max_on_time: 2 s}
sun: epoch
sun_sensor: {azimuth: 35 deg}
commands: {delay_step: 2 ms, delay_max: 4.9 s, width: {step: 10 ms, min: 100 ms, max: 500 ms}, \
  every: [1, 2]}
limits: {horizon: 1200 s}
requirement: {nutation: 0.3 deg, momentum_shift: 0.1 deg}
"""
"""A spinner that is commanded by blocks, as a file."""


def through(valve: Valve | None, body: Spacecraft) -> Spacecraft:
    """The body with this valve on all its thrusters."""
    channels = tuple(one if valve is None else one.of(valve=valve) for one in body.channels)
    return replace(body, channels=channels)


def swells(body: Spacecraft, made: Schedule) -> list[reference.Swell]:
    """The thrust of commands through the valves of `Trapezoid`, from start and on-time as loaded
    alone.
    """
    thrusts = list[reference.Swell]()
    channels = {one.name: one for one in body.channels}
    for pulse in made:
        jet = channels[pulse.channel]
        assert isinstance(jet.valve, Trapezoid)
        assert pulse.torque is not None
        times: dict[str, Any] = {"opening": jet.valve.open_delay, "closing": jet.valve.close_delay}
        ramps: dict[str, Any] = {"rise": jet.valve.rise_time, "fall": jet.valve.fall_time}
        thrusts += reference.through_valve(
            pulse.loaded[0], pulse.loaded[1], pulse.torque, **times, **ramps
        )
    return thrusts


def commanded(
    body: Spacecraft, sun: Array, azimuth: float = 0.4, grid: int = 500, widths: int = 40
) -> Spacecraft:
    """The body with a Sun, a sensor, and blocks whose steps divide a spin turn by ``grid``."""
    turn = 2.0 * math.pi / abs(body.spin)
    commands = Commands(
        turn / grid,
        turn * (1.0 - 1.0 / grid),
        np.arange(4.0, 4.0 + widths) * (turn / 400),
        255,
        (1, 2),
    )
    return replace(
        body,
        sun=sun / np.linalg.norm(sun),
        sun_sensor=SunSensor(azimuth),
        commands=commands,
        limits=Limits(horizon=600.0 * turn),
    )


def some_body(seed: int, *, target: bool = True) -> Spacecraft:
    """A spinner from rest, or nutating a little, with a target 1 to 60 deg away."""
    rng = np.random.default_rng(seed)
    A = 100.0
    spin = rng.choice([-1.0, 1.0]) * rng.uniform(0.3, 3.0)
    C = A * rng.choice([rng.uniform(0.4, 0.85), rng.uniform(1.15, 1.9)])
    turn = rng.uniform(1.0, 60.0)
    torque = C * spin**2 * math.radians(turn) * rng.uniform(0.15, 1.0)
    body = spinner(
        A, C, spin, rng.choice([0.0, 0.0, 0.3]), rng.uniform(0.0, 6.0), channels=cross(torque)
    )
    while True:
        sun = rng.normal(size=3)
        sun /= np.linalg.norm(sun)
        aim = aimed(body, turn, rng.uniform(0.0, 360.0))
        ends = [
            float(attitude.angle_between(sun, axis)) for axis in (aim.momentum, aim.target_axis)
        ]
        if min(*ends, *(math.pi - end for end in ends)) > 0.4:
            return commanded(aim if target else body, sun, rng.uniform(-3.0, 3.0))


def flown_by_reference(
    body: Spacecraft, blocks: Iterable[Block]
) -> tuple[reference.Motion, list[float]]:
    """The motion after the last pulse, and when each began, by Euler's equations."""
    moments = np.asarray(body.inertia.moments)
    torques = {one.name: one.torque for one in body.channels}
    assert body.sun is not None
    assert body.sun_sensor is not None
    sun, mark = body.sun, body.sun_sensor.azimuth
    state = np.concatenate([body.omega0, attitude.matrix(body.initial.quaternion).ravel()])
    now = 0.0
    passed = 0
    last = -math.inf
    starts = []
    turn = 2.0 * math.pi / abs(body.spin)

    def slope(_: float, y: Array, torque: Array) -> Array:
        w = y[:3]
        rotation = y[3:].reshape(3, 3)
        cross_ = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
        return np.concatenate(
            [(torque - cross_ @ (moments * w)) / moments, (rotation @ cross_).ravel()]
        )

    def seen_at(y: Array, azimuth: float) -> complex:
        """The Sun across the axis, turned so that it is real and positive at this azimuth."""
        seen = y[3:].reshape(3, 3).T @ sun
        return complex(seen[0], seen[1]) * cmath.exp(-1j * azimuth)

    def passages(at: Any, until: float, azimuth: float) -> list[float]:
        """When the Sun passes an azimuth from now on, by the motion ``at`` a time."""
        grid = np.linspace(now, until, max(int(48 * (until - now) / turn), 4) + 1)
        values = [seen_at(at(t), azimuth) for t in grid]
        return [
            float(brentq(lambda t: seen_at(at(t), azimuth).imag, *edge, xtol=1e-13))
            for edge, pair in zip(itertools.pairwise(grid), itertools.pairwise(values), strict=True)
            if pair[0].imag * pair[1].imag < 0.0 and pair[0].real > 0.0
        ]

    def integrated(until: float, torque: Array) -> Any:
        """Motion from now on, by time."""
        return solve_ivp(
            slope,
            (now, until),
            state,
            method="DOP853",
            rtol=1e-11,
            atol=1e-13,
            args=(torque,),
            dense_output=True,
        ).sol

    def move(until: float, torque: Array, *, stops: bool = False) -> list[float]:
        """Sun pulses on the way; ``state`` and ``now`` go on, or to the first (``stops``)."""
        nonlocal state, now
        at = integrated(until, torque)
        roots = passages(at, until, mark)
        stop = next((root for root in roots if root > last + 0.3 * turn), until) if stops else until
        state = at(stop)
        now = stop
        return [root for root in roots if root <= stop]

    none = np.zeros(3)
    due = [
        (block.first + k * block.every, block.angle, block.delay, block)
        for block in blocks
        for k in range(block.count)
    ]
    due.sort(key=lambda each: each[:3])
    while due:
        for root in move(now + 0.05 * turn, none, stops=True) if due[0][0] > passed else []:
            if root > last + 0.3 * turn:
                passed = passed + 1
                last = root
        if passed >= due[0][0]:
            _, angle, _, block = due.pop(0)
            since = last
            if angle:
                at = integrated(now + 1.1 * turn, none)
                since = passages(at, now + 1.1 * turn, mark - math.copysign(angle, body.spin))[0]
            starts.append(since + block.delay)
            seen = move(starts[-1], none) if starts[-1] > now else []
            assert now <= starts[-1] + 1e-12
            seen += move(starts[-1] + block.width, torques[block.channel])
            for root in seen:
                if root > last + 0.3 * turn:
                    passed = passed + 1
                    last = root
    return reference.Motion(state[:3], state[3:].reshape(3, 3)), starts
