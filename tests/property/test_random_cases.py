"""Random bodies, pulses and disturbances over many nutation periods: flights and closed forms against DOP853.

The reference integrates Euler's equations and quaternions of many cases at once, each in units of its own inertial
nutation period, restarted at every edge of every pulse.
"""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from support.cases import spread

from nutdamp import flight
from nutdamp.physics import forced, rates
from nutdamp.schedule import Pulse, Schedule
from nutdamp.spacecraft import Disturbance, Inertia, Spacecraft

Array = NDArray[np.float64]

AGREEMENT = 1e-9
"""rad, and relative to |ω| for rates."""


class Case(NamedTuple):
    spacecraft: Spacecraft
    schedule: Schedule


def draw(rng: np.random.Generator, periods: float, slimmest: float = 0.05) -> Case:
    """A stable spinner with up to four pulses of any width and three disturbances; nutation up to 80°.

    ``slimmest`` is the least C/A: a slim body turns A/C times about itself in one inertial nutation period, and all
    of that is summed up by the reference.
    """
    A = 10 ** rng.uniform(0, 3)
    C = A * rng.choice([rng.uniform(slimmest, 0.95), rng.uniform(1.05, 2.0), 1.0, 1.0 + 1e-9])
    moments = (A, A, C)
    if rng.random() < 0.3 and abs(C - A) > 0.2 * A:
        spread = 0.5 * min(abs(C - A), 2 * A - C) * rng.uniform(0, 1)
        moments = (A + spread, A - spread, C)
    spin = rng.choice([-1, 1]) * 10 ** rng.uniform(-1, 1)
    # With three different moments large angles come near the separatrix, where any two flights part exponentially.
    theta, phase = rng.uniform(0.001, 1.4 if moments[0] == moments[1] else 0.4), rng.uniform(0, 2 * math.pi)
    omega = C * abs(spin) * math.tan(theta) / A
    body = Spacecraft("random", Inertia(moments), np.array([omega * math.cos(phase), omega * math.sin(phase), spin]))
    period = body.inertial_period
    strength = 0.05 * A * omega / period  # N m: over ten periods worth half the nutation
    disturbances = []
    if rng.random() < 0.6:
        for kind in rng.choice(["constant", "turning", "axial"], size=rng.integers(1, 4)):
            torque = strength * complex(rng.normal(), rng.normal())
            rate = rng.normal() * abs(spin) if kind == "turning" else 0.0
            axial = 0.1 * C * abs(spin) / (periods * period) * rng.normal()
            disturbances.append(Disturbance(0.0j, axial=axial) if kind == "axial" else Disturbance(torque, rate=rate))
    pulses = []
    axial_pulses = rng.random() < 0.4
    for start in np.sort(rng.uniform(0, periods * period * 0.9, size=rng.integers(0, 5))):
        on_time = rng.choice([0.0, 0.02 * period, rng.uniform(0, 0.08) * period * periods / 10])
        direction = rng.normal(size=3) * (1.0, 1.0, 0.2 if axial_pulses else 0.0)
        impulse = 0.3 * A * omega * direction
        torque_ = None if on_time == 0.0 else impulse / on_time
        pulses.append(Pulse(float(start + on_time / 2), float(on_time), "x", impulse, torque_))
    body = Spacecraft("random", body.inertia, body.omega0, disturbances=tuple(disturbances))
    return Case(body, Schedule(tuple(pulses)))


def reference(cases: list[Case], periods: float) -> Array:
    """Rates and quaternion (7,) of each case at its end, by DOP853."""
    units = np.array([case.spacecraft.inertial_period for case in cases])
    moments = np.array([case.spacecraft.inertia.moments for case in cases])
    count = max(len(case.spacecraft.disturbances) for case in cases) or 1
    strength, turn, axial = np.zeros((3, len(cases), count), dtype=complex)
    for index, case in enumerate(cases):
        for column, one in enumerate(case.spacecraft.disturbances):
            strength[index, column], turn[index, column] = one.transverse, 1j * one.rate
            axial[index, column] = one.axial
    state = np.array([[*case.spacecraft.omega0, *case.spacecraft.initial.quaternion] for case in cases])
    edges = {0.0, periods}
    for case, unit in zip(cases, units, strict=True):
        edges |= {time / unit for pulse in case.schedule for time in (pulse.start, pulse.end)}
    knots = sorted(edges)
    for now, end in itertools.pairwise(knots):
        middle = 0.5 * (now + end)
        pushes = np.zeros((len(cases), 3))
        for index, (case, unit) in enumerate(zip(cases, units, strict=True)):
            for pulse in case.schedule:
                if pulse.on_time == 0.0 and pulse.t / unit == now:
                    state[index, :3] += pulse.impulse / moments[index]
                if pulse.torque is not None and pulse.start / unit < middle < pulse.end / unit:
                    pushes[index] += pulse.torque

        def slope(t: float, flat: Array, pushes: Array = pushes) -> Array:
            y = flat.reshape(len(cases), 7)
            w, q = y[:, :3], y[:, 3:]
            swept = (strength * np.exp(turn * (t * units)[:, None])).sum(axis=1)
            torque = pushes + np.column_stack([swept.real, swept.imag, axial.sum(axis=1).real])
            dw = (torque - np.cross(w, moments * w)) / moments
            dq = 0.5 * np.column_stack([-np.sum(q[:, 1:] * w, axis=1), q[:, :1] * w + np.cross(q[:, 1:], w)])
            return np.asarray((np.hstack([dw, dq]) * units[:, None]).ravel())

        scale = np.concatenate(
            [np.linalg.norm(state[:, :3], axis=1)[:, None] * np.ones(3), np.ones((len(cases), 4))], 1
        )
        done = solve_ivp(slope, (now, end), state.ravel(), method="DOP853", rtol=3e-14, atol=1e-15 * scale.ravel())
        assert done.success
        state = done.y[:, -1].reshape(len(cases), 7)
    return state


def closed_form(case: Case, time: float) -> tuple[complex, float] | None:
    """Impulse sum (17) with effective impulses, plus (24) from rest; None where (24) does not hold: ω3 changes."""
    body, made = case
    inertia = body.inertia
    changing = body.spin_drift != 0.0 or (len(body.disturbances) > 0 and any(p.impulse[2] != 0.0 for p in made))
    if changing or not inertia.symmetric:
        return None
    omega, spin = rates.impulse_sum(
        np.array([time]),
        complex(body.omega0[0], body.omega0[1]),
        body.spin,
        inertia.A,
        inertia.C,
        np.array([pulse.t for pulse in made]),
        flight.effective_impulses(body, made),
        np.array([pulse.impulse[2] for pulse in made]),
    )
    driven = forced.rotating_torques(
        np.array([time]),
        0.0,
        body.spin,
        inertia.A,
        inertia.C,
        np.array([one.transverse for one in body.disturbances]),
        np.array([one.rate for one in body.disturbances]),
    )
    return complex(omega[0] + driven[0]), float(spin[0])


def check(cases: list[Case], periods: float) -> int:
    """Every case agrees with the reference; returns how many closed forms were compared."""
    compared = 0
    for case, end in zip(cases, reference(cases, periods), strict=True):
        body, made = case
        until = periods * body.inertial_period
        leg = flight.flown(body, made, until).legs[-1]
        (got,), (turned,) = leg.path.motion(np.array([until]))
        size = float(np.linalg.norm(end[:3]))
        assert np.linalg.norm(got - end[:3]) <= AGREEMENT * size
        q = end[3:] / np.linalg.norm(end[3:])
        # |q - q'| is half the angle between two attitudes
        assert 2 * min(np.linalg.norm(turned - q), np.linalg.norm(turned + q)) <= AGREEMENT
        closed = closed_form(case, until)
        if closed is not None:
            compared += 1
            assert abs(closed[0] - complex(end[0], end[1])) <= AGREEMENT * size
            assert abs(closed[1] - end[2]) <= AGREEMENT * size
    return compared


@pytest.mark.weekly
@spread("batch", range(12), quick=1, deep=0)
def test_25_random_cases_over_10_periods(batch: int) -> None:
    rng = np.random.default_rng(1970 + batch)
    assert check([draw(rng, 10.0) for _ in range(25)], 10.0) >= 5


@spread("batch", range(10), quick=0, deep=0)
def test_2_random_cases_over_100_periods(batch: int) -> None:
    rng = np.random.default_rng(2070 + batch)
    check([draw(rng, 100.0, slimmest=0.25) for _ in range(2)], 100.0)
