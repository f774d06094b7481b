"""Random bodies, pulses and disturbances over many nutation periods: flights against DOP853.

The reference integrates Euler's equations and quaternions of many cases at once, each in units of
its own inertial nutation period, restarted at every edge of every pulse.
"""

import itertools
import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from support.builders import pulse, spinner
from support.cases import spread

from nutdamp.flight import propagation
from nutdamp.spacecraft.model import Disturbance, Spacecraft
from nutdamp.spacecraft.schedule import Schedule

Array = NDArray[np.float64]
Case = tuple[Spacecraft, Schedule]

AGREEMENT = 1e-9
"""rad, and relative to |ω| for rates."""


def draw(rng: np.random.Generator, periods: float, slimmest: float) -> Case:
    """A stable spinner with up to four pulses of any width and three disturbances; nutation up to
    80°.

    ``slimmest`` is the least C/A: a slim body turns A/C times about itself in one inertial nutation
    period, and all of that is summed up by the reference.
    """
    A = 10 ** rng.uniform(0, 3)
    C = A * rng.choice([rng.uniform(slimmest, 0.95), rng.uniform(1.05, 2.0), 1.0, 1.0 + 1e-9])
    triaxial = rng.random() < 0.3 and abs(C - A) > 0.2 * A
    apart = 0.5 * min(abs(C - A), 2 * A - C) * rng.uniform(0, 1) if triaxial else 0.0
    spin = rng.choice([-1, 1]) * 10 ** rng.uniform(-1, 1)
    # With three different moments large angles come near the separatrix, where any two flights part
    # exponentially.
    theta, phase = rng.uniform(0.001, 0.4 if apart else 1.4), rng.uniform(0, 2 * math.pi)
    body = spinner(
        spin=spin, degrees=math.degrees(theta), phase=phase, moments=(A + apart, A - apart, C)
    )
    # size: A|ω|
    size = C * abs(spin) * math.tan(theta)
    period = body.inertial_period
    disturbances = []
    for kind in rng.choice(
        ["constant", "turning", "axial"], size=rng.integers(1, 4) if rng.random() < 0.6 else 0
    ):
        torque = (
            0.05 * size / period * complex(rng.normal(), rng.normal())
        )  # ten periods worth half the nutation
        rate = rng.normal() * abs(spin) if kind == "turning" else 0.0
        axial = 0.1 * C * abs(spin) / (periods * period) * rng.normal()
        disturbances.append(
            Disturbance(0.0j, axial=axial) if kind == "axial" else Disturbance(torque, rate=rate)
        )
    pulses = []
    tilt = 0.2 if rng.random() < 0.4 else 0.0
    for start in np.sort(rng.uniform(0, periods * period * 0.9, size=rng.integers(0, 5))):
        on_time = float(
            rng.choice([0.0, 0.02 * period, rng.uniform(0, 0.08) * period * periods / 10])
        )
        pulses.append(
            pulse(
                float(start + on_time / 2),
                on_time,
                0.3 * size * rng.normal(size=3) * (1.0, 1.0, tilt),
            )
        )
    return replace(body, disturbances=tuple(disturbances)), Schedule(tuple(pulses))


def reference(cases: list[Case], periods: float) -> Array:
    """Rates and quaternion (7,) of each case at its end, by DOP853."""
    units = np.array([body.inertial_period for body, _ in cases])
    moments = np.array([body.inertia.moments for body, _ in cases])
    strength, turn, axial = np.zeros((3, len(cases), 3), dtype=complex)
    for row, (body, _) in enumerate(cases):
        for column, one in enumerate(body.disturbances):
            strength[row, column], turn[row, column], axial[row, column] = (
                one.transverse,
                1j * one.rate,
                one.axial,
            )
    state = np.array([[*body.omega0, *body.initial.quaternion] for body, _ in cases])
    fired = [(row, fire) for row, (_, made) in enumerate(cases) for fire in made]
    knots = sorted(
        {
            0.0,
            periods,
            *(time / units[row] for row, fire in fired for time in (fire.start, fire.end)),
        }
    )
    for now, end in itertools.pairwise(knots):
        pushes = np.zeros((len(cases), 3))
        for row, fire in fired:
            if fire.on_time == 0.0 and fire.t / units[row] == now:
                state[row, :3] += fire.impulse / moments[row]
            if (
                fire.torque is not None
                and fire.start / units[row] < 0.5 * (now + end) < fire.end / units[row]
            ):
                pushes[row] += fire.torque

        def slope(t: float, flat: Array, pushes: Array = pushes) -> Array:
            w, q = np.split(flat.reshape(len(cases), 7), [3], axis=1)
            swept = (strength * np.exp(turn * (t * units)[:, None])).sum(axis=1)
            torque = pushes + np.column_stack([swept.real, swept.imag, axial.sum(axis=1).real])
            dw = (torque - np.cross(w, moments * w)) / moments
            dq = 0.5 * np.column_stack(
                [-np.sum(q[:, 1:] * w, axis=1), q[:, :1] * w + np.cross(q[:, 1:], w)]
            )
            return np.asarray((np.hstack([dw, dq]) * units[:, None]).ravel())

        size = np.linalg.norm(state[:, :3], axis=1, keepdims=True)
        scale = np.hstack([size * np.ones(3), np.ones((len(cases), 4))]).ravel()
        solution = solve_ivp(
            slope, (now, end), state.ravel(), method="DOP853", rtol=3e-14, atol=1e-15 * scale
        )
        assert solution.success
        state = solution.y[:, -1].reshape(len(cases), 7)
    return state


@spread(
    ("seed", "count", "periods", "slimmest"),
    [
        *((1970 + n, 25, 10.0, 0.05) for n in range(12)),
        *((2070 + n, 2, 100.0, 0.25) for n in range(10)),
    ],
    quick=0,
    deep=0,
)
def test_random_cases(seed: int, count: int, periods: float, slimmest: float) -> None:
    rng = np.random.default_rng(seed)
    cases = [draw(rng, periods, slimmest) for _ in range(count)]
    for (body, made), end in zip(cases, reference(cases, periods), strict=True):
        until = periods * body.inertial_period
        size = float(np.linalg.norm(end[:3]))
        (got,), (turned,) = (
            propagation.flown(body, made, until).legs[-1].path.motion(np.array([until]))
        )
        assert np.linalg.norm(got - end[:3]) <= AGREEMENT * size
        q = end[3:] / np.linalg.norm(end[3:])  # |q - q'| is half the angle between two attitudes
        assert 2 * min(np.linalg.norm(turned - q), np.linalg.norm(turned + q)) <= AGREEMENT
