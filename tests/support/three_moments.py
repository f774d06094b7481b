"""Least cost of bodies with I1 ≠ I2 by an own linear program, and a schedule near it, flown by an
own integrator.

Nothing of nutdamp's planning is used. The program has on-times in cells of a grid; in it H in the
body follows the linear Euler equations about pure spin, by the exponential of their matrix, and H
in space gets the torque turned by ω3 t. Its burns are taken down on the true motion by linear
programs, by fourth-order Runge-Kutta steps.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.optimize import linprog
from support.reference import frame_n

from nutdamp.spacecraft.equipment import Channel, Thruster
from nutdamp.spacecraft.model import Goal, Inertia, Limits, Spacecraft
from nutdamp.spacecraft.schedule import Schedule, channel_pulse

Array = NDArray[np.float64]

CELL, STRIDE = 0.02, 0.12
"""rad of spin in a cell of the program, and in a step of the integrator."""

ROUNDS, MOST = 16, 16  # programs about one flight after the other; burns at most

MET = 1e-7  # rad left by a schedule that counts
AROUND = np.array([part(2 * math.pi / 64 * np.arange(64)) for part in (np.cos, np.sin)])


def unequal_body(seed: int) -> tuple[Spacecraft, float]:
    """One to four channels, 0.1° to 2° of nutation, one to six turns; half of them with a target of
    up to 1°.

    Spin about the axis of the largest or of the least moment. Also the shift allowed, rad: zero in
    every other case.
    """
    rng = np.random.default_rng([54, seed])
    middle = rng.uniform(80, 150)
    apart = rng.uniform(0.03, 0.25) * rng.choice([-1, 1])
    first, second = middle * (1 + apart), middle * (1 - apart)
    oblate = rng.random() < 0.6
    third = (
        max(first, second) * rng.uniform(1.1, 1.4)
        if oblate
        else min(first, second) * rng.uniform(0.4, 0.85)
    )
    spin = float(rng.uniform(0.5, 5) * rng.choice([-1, 1]))
    angle = math.radians(10 ** rng.uniform(-1, 0.3))
    phase = rng.uniform(0, 2 * math.pi)
    across = third * abs(spin) * math.tan(angle)
    omega = np.array([across * math.cos(phase) / first, across * math.sin(phase) / second, spin])
    horizon = float(2 * math.pi / abs(spin) * rng.uniform(1.5, 6))
    made = []
    for index in range(int(rng.integers(1, 5))):
        way = rng.uniform(0, 2 * math.pi)
        size = across / horizon * 10 ** rng.uniform(0.6, 1.6)
        torque = np.array([size * math.cos(way), size * math.sin(way), 0.0])
        made.append(
            Channel(
                f"c{index}",
                (Thruster(f"c{index}", torque, None, size * rng.uniform(0.8, 1.2), 220.0),),
            )
        )
    limits = Limits(horizon=horizon)
    body = Spacecraft(
        f"unequal {seed}",
        Inertia((first, second, third)),
        omega,
        channels=tuple(made),
        limits=limits,
    )
    if rng.random() < 0.5:
        axis = body.direction_in_n(
            math.radians(rng.uniform(0.05, 1.0)), rng.uniform(0, 2 * math.pi)
        )
        body = Spacecraft(
            body.name, body.inertia, omega, channels=tuple(made), limits=limits, goal=Goal(axis)
        )
    return body, math.radians(rng.uniform(0.02, 0.2)) * float(seed % 2)


class Rival(NamedTuple):
    """Least ``program`` cost of small angles, kg, and the schedule ``flown``, None without one."""

    program: float
    flown: Schedule | None


def rival(body: Spacecraft, off: float) -> Rival:
    """The rival of a plan of ``body`` that may leave H ``off`` rad beside its target."""
    moments, (first, second, third) = np.array(body.inertia.moments), body.inertia.moments
    spin = float(body.omega0[2])
    rotation = frame_n(body.inertia.moments, body.omega0)
    size = abs(third * spin)
    torques = np.array([one.torque[:2] for one in body.channels])
    flows = np.array([one.mass_flow for one in body.channels], dtype=float)
    count = math.ceil(body.horizon * abs(spin) / CELL)
    width = body.horizon / count
    times = width * (np.arange(count) + 0.5)
    linear = np.array(
        [[0.0, (second - third) * spin / second], [(third - first) * spin / first, 0.0]]
    )
    back = [np.eye(2)]
    step, half = expm(-linear * width), expm(-linear * 0.5 * width)
    for _ in range(count - 1):
        back.append(back[-1] @ step)
    turn = np.exp(1j * spin * times)
    across = np.einsum("nij,kj->ink", np.array(back) @ half, torques)
    shifts = turn[:, None] * (torques[:, 0] + 1j * torques[:, 1])
    acts = np.array([*across, shifts.real, shifts.imag]).reshape(4, -1) * width / size
    target = rotation.T @ (np.array([0.0, 0.0, 1.0]) if body.goal.axis is None else body.goal.axis)
    now = (moments * body.omega0)[:2] / size
    ring = np.vstack([np.zeros((2, AROUND.shape[1])), math.sin(off) * AROUND])
    found = linprog(
        np.concatenate([np.tile(flows * width, count), np.zeros(ring.shape[1])]),
        A_eq=np.hstack([acts, ring]),
        b_eq=np.concatenate([-now, target[:2] - now]),
        A_ub=np.concatenate([np.zeros(acts.shape[1]), np.ones(ring.shape[1])])[None],
        b_ub=[1.0],
        bounds=(0.0, 1.0),
    )
    if found.fun is None:
        return Rival(math.inf, None)
    shares = np.asarray(found.x)[: acts.shape[1]].reshape(count, -1)
    burns = sorted(
        burn for index, share in enumerate(shares.T) for burn in _burns(index, share, width)
    )
    return Rival(float(found.fun), _flown(body, off, burns))


def _burns(index: int, share: Array, width: float) -> list[tuple[float, float, int]]:
    """Cells beside each other as one burn: start, on-time and number of the channel."""
    on = np.flatnonzero(share > 1e-6)
    groups = np.split(on, np.flatnonzero(np.diff(on) > 1) + 1) if len(on) else []
    made = []
    for group in groups:
        time = width * float(share[group].sum())
        centre = width * float(share[group] @ (group + 0.5)) / float(share[group].sum())
        made.append((centre - 0.5 * time, time, index))
    return made


def _flown(body: Spacecraft, off: float, burns: list[tuple[float, float, int]]) -> Schedule | None:
    """Schedule near the ``burns``, one after the other, that leaves nothing by `ends`; None where
    none is found.

    Linear programs about one flight after the other, in a region that shrinks, lower the cost.
    """
    which = [burn[2] for burn in burns]
    count = len(burns)
    if not 0 < count <= MOST:
        return None
    torques = np.array([body.channels[index].torque for index in which])
    flows = np.array([body.channels[index].mass_flow for index in which], dtype=float)
    unit = np.repeat(
        [1.0 / abs(float(body.omega0[2])), sum(burn[1] for burn in burns) / count], count
    )
    order = np.zeros((count + 1, 2 * count))
    for index in range(count):
        order[index, index] = 1.0
        order[index + 1, index] = order[index + 1, count + index] = -1.0
    level = np.append(np.zeros(count), -body.horizon)
    ring = np.vstack([np.zeros((2, AROUND.shape[1])), math.sin(off) * AROUND])
    x = np.array([*(burn[0] for burn in burns), *(burn[1] for burn in burns)])
    price = np.append(np.zeros(count), flows) * unit / float(flows @ x[count:])
    slack = np.hstack([np.eye(4), -np.eye(4)])
    for region in 0.3 * 0.6 ** np.arange(ROUNDS):
        there = ends(body, torques, np.vstack([x, x + 1e-6 * np.diag(unit)]))
        slopes = (there[1:] - there[0]).T / 1e-6
        moved = linprog(
            np.concatenate([price, np.full(8, 1e4), np.zeros(ring.shape[1]), [1e4]]),
            A_eq=np.hstack([slopes, slack, ring, np.zeros((4, 1))]),
            b_eq=-there[0],
            A_ub=np.vstack(
                [
                    np.hstack(
                        [
                            -order * unit,
                            np.zeros((count + 1, 8 + ring.shape[1])),
                            -np.ones((count + 1, 1)),
                        ]
                    ),
                    np.concatenate([np.zeros(2 * count + 8), np.ones(ring.shape[1]), [0.0]]),
                ]
            ),
            b_ub=np.append(order @ x - level, 1.0),
            bounds=[
                *((max(-region, least), region) for least in -x / unit),
                *[(0.0, None)] * (9 + len(ring.T)),
            ],
        )
        if moved.fun is None:
            return None
        x = x + np.asarray(moved.x)[: 2 * count] * unit
    missed = ends(body, torques, x[None])[0]
    if (
        (order @ x - level).min() < -1e-9
        or np.abs(missed[:2]).max() > MET
        or np.hypot(*missed[2:]) > off + MET
    ):
        return None
    starts, ons = np.split(x, 2)
    pulses = zip(which, starts.tolist(), ons.tolist(), strict=True)
    return Schedule(
        tuple(channel_pulse(body.channels[i], t + 0.5 * on, on) for i, t, on in pulses if on > 1e-9)
    )


def ends(body: Spacecraft, torques: Array, x: Array) -> Array:
    """H across axis 3 and off its target, over |H|, after x (k, 2n), starts and on-times in s."""
    moments = np.array(body.inertia.moments)
    count = len(torques)
    size = float(np.linalg.norm(moments * body.omega0))
    rates = np.tile(body.omega0, (len(x), 1))
    rotation = np.tile(frame_n(body.inertia.moments, body.omega0), (len(x), 1, 1))

    def slope(rates: Array, rotation: Array, torque: Array) -> tuple[Array, Array]:
        faster = (torque - np.cross(rates, moments * rates)) / moments
        return faster, np.cross(rotation, rates[:, None, :])

    now = np.zeros(len(x))
    for index in range(2 * count):
        pulse, ending = divmod(index, 2)
        edge = x[:, pulse] + (x[:, count + pulse] if ending else 0.0)
        torque = torques[pulse] if ending else np.zeros(3)
        steps = max(
            math.ceil(
                float(np.max(np.abs(edge - now))) * float(np.linalg.norm(body.omega0)) / STRIDE
            ),
            1,
        )
        step = ((edge - now) / steps)[:, None]
        for _ in range(steps):
            k1, r1 = slope(rates, rotation, torque)
            k2, r2 = slope(rates + 0.5 * step * k1, rotation + 0.5 * step[:, None] * r1, torque)
            k3, r3 = slope(rates + 0.5 * step * k2, rotation + 0.5 * step[:, None] * r2, torque)
            k4, r4 = slope(rates + step * k3, rotation + step[:, None] * r3, torque)
            rates = rates + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
            rotation = rotation + step[:, None] / 6.0 * (r1 + 2.0 * r2 + 2.0 * r3 + r4)
        now = edge
    target = np.array([0.0, 0.0, 1.0]) if body.goal.axis is None else body.goal.axis
    first = np.cross(target, [0.3, 0.7, 0.2])
    first /= np.linalg.norm(first)
    moved = np.einsum("kij,kj->ki", rotation, moments * rates) / size
    return np.column_stack(
        [moments[:2] * rates[:, :2] / size, moved @ first, moved @ np.cross(target, first)]
    )
