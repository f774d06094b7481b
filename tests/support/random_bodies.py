"""Random spacecraft with all kinds of limits and actuators; what a test draws of them it draws from a seed."""

import math
from typing import Any

import numpy as np
from support.builders import channel, fan, spinner

from nutdamp.spacecraft.equipment import Channel, Steerable
from nutdamp.spacecraft.model import Disturbance, Limits, Spacecraft


def power(rng: np.random.Generator, least: float, most: float) -> float:
    """Ten to a random power."""
    return float(10.0 ** rng.uniform(least, most))


def random_channels(rng: np.random.Generator, needed: float, period: float) -> tuple[Channel, ...]:
    """One to six, of any direction, mostly transverse; on-times from a thousandth to a multiple of what is needed."""
    made = []
    for index in range(rng.integers(1, 7)):
        angle = rng.choice([0.0, 0.5 * math.pi, math.pi, -0.5 * math.pi, rng.uniform(-math.pi, math.pi)])
        size = needed / (period * power(rng, -1.5, 0.5))
        torque = size * math.cos(angle), size * math.sin(angle), size * float(rng.choice([0.0] * 3 + [0.05, -0.2, 1.5]))
        shortest = period * power(rng, -4.0, -1.0) if rng.random() < 0.5 else 0.0
        longest = shortest + period * power(rng, -3.0, 0.0) if rng.random() < 0.5 else math.inf
        jet: dict[str, Any] = {"isp": 220.0 if rng.random() < 0.5 else None, "thrust": 1.0}
        times: dict[str, Any] = {"min_on_time": shortest, "max_on_time": longest}
        made.append(channel(f"T{index}", *torque, **times, **jet, force=(0.0, 0.0, 1.0)))
    return tuple(made)


def random_limits(rng: np.random.Generator, period: float, horizon: float) -> Limits:
    """Each limit in about half of the cases; blackouts overlap and come in any order."""
    end = horizon if rng.random() < 0.5 else period * power(rng, -1.0, 2.0)
    tick = rng.choice([1e-3, 0.01, 0.1, period * power(rng, -4.0, -0.5)])
    windows = [tuple(sorted(rng.uniform(0.0, min(end, 10 * period), 2).tolist())) for _ in range(rng.integers(0, 4))]
    return Limits(
        horizon=None if end == horizon else end,
        earliest=end * float(rng.choice([0.0, 0.0, 0.1, rng.uniform(0.0, 0.9)])),
        gap=period * float(rng.choice([0.0, 0.0, 0.01, 0.3, 3.0])),
        tick=float(tick) if rng.random() < 0.5 else None,
        max_pulses=int(rng.integers(1, 10)) if rng.random() < 0.5 else None,
        blackout=tuple((begin, end) for begin, end in windows) if rng.random() < 0.5 else (),
    )


def random_spacecraft(rng: np.random.Generator) -> Spacecraft:
    """Prolate, oblate, sphere, nearly one, flat disc; now and then triaxial; thrusters, a torquer, or both."""
    A = power(rng, -1.0, 4.0)
    usual = [rng.uniform(-0.99, 0.95), rng.uniform(-0.99, 0.95)]
    a = float(rng.choice([*usual, 0.0, -1.0, 0.25, 0.2, -1 / 3, 1e-3, -1e-9]))
    moments = (A, A, A * (1 - a))
    if rng.random() < 0.2 and abs(a) > 0.3 and a > -0.8:
        apart = rng.uniform(0.01, 0.15)  # still stable, and still a body
        moments = (A * (1 + apart), A * (1 - apart), A * (1 - a))
    spin = float(rng.choice([1.0, -1.0])) * power(rng, -1.0, 1.0)
    degrees = float(rng.choice([rng.uniform(0.01, 10.0), rng.uniform(1.0, 40.0)]))
    phase = float(rng.choice([0.0, 0.5 * math.pi, math.pi, rng.uniform(-math.pi, math.pi)]))
    plain = spinner(spin=spin, degrees=degrees, phase=phase, moments=moments)
    period, needed = min(plain.body_period, plain.inertial_period), plain.least_impulse
    torque = needed / (period * power(rng, -1.5, 0.5)) if rng.random() < 0.7 else None
    return spinner(
        spin=spin,
        degrees=degrees,
        phase=phase,
        moments=moments,
        channels=random_channels(rng, needed, period) if rng.random() < 0.8 else (),
        steerable=Steerable(torque) if rng.random() < 0.3 else None,
        limits=random_limits(rng, period, plain.horizon),
        mass=250.0,
    )


def disturbed_spacecraft(rng: np.random.Generator) -> Spacecraft:
    """Any disturbances, gaps, ticks and windows: alignments wander, and some are never to be had."""
    A, a = power(rng, -1, 3), float(rng.choice([0.3, -0.5, 0.0, 1e-3, 0.9, -1.0]))
    spin, degrees = float(rng.choice([3.0, -0.2])), float(rng.choice([0.1, 5.0, 60.0]))
    plain = spinner(A, A * (1 - a), spin, degrees)
    period, torque = min(plain.body_period, plain.inertial_period), plain.least_impulse * plain.inertial_period
    size = plain.least_impulse / period
    turning = float(rng.choice([0.0, -spin, -plain.inertia.a * spin, rng.normal()]))
    torques = [
        Disturbance(power(rng, -4, 1) * size, 0.0, turning),
        Disturbance(0j, power(rng, -4, 0) * size * float(rng.choice([1.0, -1.0]))),
    ]
    ends = np.sort(rng.uniform(0.0, 20.0 * period, 8)).reshape(-1, 2)
    limits = Limits(
        horizon=power(rng, 0, 4) * period,
        gap=float(rng.choice([0.0, power(rng, -2, 1) * period])),
        earliest=float(rng.choice([0.0, 0.1 * period])),
        tick=float(rng.choice([1e-3, 0.3, 3.0])) * period if rng.random() < 0.3 else None,
        blackout=tuple((float(begin), float(end)) for begin, end in ends) if rng.random() < 0.5 else (),
    )
    return Spacecraft(
        "disturbed",
        plain.inertia,
        plain.omega0,
        channels=fan(int(rng.integers(1, 6)), power(rng, -2, 1) * torque),
        limits=limits,
        disturbances=tuple(torques[: rng.integers(0, 3)]),
    )
