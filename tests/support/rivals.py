"""Independent searches for cheap schedules, each on a motion of its own."""

import math
from functools import partial
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import Bounds, linprog, minimize
from support.reference import frame_n

from nutdamp.spacecraft import directions
from nutdamp.spacecraft.equipment import Channel, Thruster
from nutdamp.spacecraft.model import Goal, Inertia, Limits, Spacecraft

# --- an independent search for cheap schedules of strong thrusters: SLSQP from many random
# starts, on its own motion. Nothing of nutdamp's planning is used

Array = NDArray[np.float64]

MET = 1e-7
"""Share of |H| of transverse momentum and shift below which a schedule counts as found."""

NARROW = 0.1
"""rad that a body turns per kick, at most."""


def strong_layout(seed: int) -> tuple[Spacecraft, bool]:
    """2 to 12 channels, each worth 10 to 1000 times A|ω0| in an inertial period, some with axial
    torque; 1° to 60°.

    The horizon is 0.3 to 3 inertial periods. Also whether H may end anywhere.
    """
    rng = np.random.default_rng([10, seed])
    A = rng.uniform(60, 200)
    spin = rng.uniform(0.5, 6) * rng.choice([-1, 1])
    C = A * float(rng.choice([rng.uniform(0.3, 0.95), rng.uniform(1.05, 1.9)]))
    theta = math.radians(rng.uniform(1, 60))
    phase = rng.uniform(0, 2 * math.pi)
    omega = C * abs(spin) * math.tan(theta) / A
    rates = np.array([omega * math.cos(phase), omega * math.sin(phase), spin])
    period = 2 * math.pi * A / math.hypot(A * omega, C * spin)
    strength = A * omega / period * 10 ** rng.uniform(1, 3)
    axial = rng.random() < 0.3
    channels = []
    for index in range(int(rng.integers(2, 13))):
        angle = rng.uniform(0, 2 * math.pi)
        size = strength * rng.uniform(0.5, 1.5)
        along = rng.uniform(-0.3, 0.3) * size if axial else 0.0
        torque = np.array([size * math.cos(angle), size * math.sin(angle), along])
        name = f"T{index}"
        channels.append(
            Channel(name, (Thruster(name, torque, None, size * rng.uniform(0.8, 1.25), 220.0),))
        )
    limits = Limits(horizon=float(rng.uniform(0.3, 3) * period))
    body = Spacecraft(
        f"strong {seed}", Inertia((A, A, C)), rates, channels=tuple(channels), limits=limits
    )
    return body, bool(rng.random() < 0.35)


class Rival(NamedTuple):
    """Cost in kg and the pulses as (channel, start, on-time)."""

    cost: float
    pulses: list[tuple[str, float, float]]


def cheapest(spacecraft: Spacecraft, free_axis: bool, starts: int, seed: int = 0) -> Rival | None:
    """The cheapest schedule found from ``starts`` random starts; None where none was found.

    Two to five pulses of random channels at random moments, one to three where H is free.
    """
    rng = np.random.default_rng([11, seed])
    best: Rival | None = None
    for _ in range(starts):
        count = int(rng.integers(1 if free_axis else 2, 4 if free_axis else 6))
        which = rng.integers(len(spacecraft.channels), size=count)
        strength = np.array([spacecraft.channels[index].strength for index in which])
        times = np.sort(rng.uniform(0, 1, count))
        if rng.random() < 0.5:
            times[0] = 0.0
        if rng.random() < 0.5:
            times[-1] = 1.0
        ons = spacecraft.least_impulse / strength / count * rng.uniform(0.3, 2.0, count)
        left = spacecraft.horizon - ons.sum()
        if left > 0.0:
            x = np.concatenate([times * left + np.cumsum(ons) - ons, ons])
            found = _descended(spacecraft, which.tolist(), x, None if free_axis else 0.0)
            if found is not None and (best is None or found.cost < best.cost):
                best = found
    return best


def _descended(body: Spacecraft, which: list[int], x: Array, off: float | None) -> Rival | None:
    """The cheapest near x (2n,), starts and on-times in s of pulses one after the other, by SLSQP.

    It leaves nothing by `ended` but H ``off`` rad beside its target, None: wherever it may be; None
    where none is found.
    """
    count = len(which)
    torques = np.array([body.channels[index].torque for index in which])
    flows = np.array([body.channels[index].mass_flow for index in which], dtype=float)
    unit = np.repeat([1.0 / abs(body.spin), float(x[count:].sum()) / count], count)
    price = np.append(np.zeros(count), flows) * unit / float(flows @ x[count:])
    # start - end of the one before >= 0, and the horizon
    order = np.zeros((count + 1, 2 * count))
    for index in range(count):
        order[index, index] = 1.0
        order[index + 1, index] = order[index + 1, count + index] = -1.0
    level = np.append(np.zeros(count), -body.horizon)
    apart = order * unit / body.horizon

    def left_over(x: Array) -> Array:
        """What must be none, and what may be no less."""
        fly = by_arcs if body.inertia.symmetric else ended
        left = fly(body, torques, np.atleast_2d(x) * unit)
        if off:
            left[:, 2] = off**2 - np.sum(left[:, 2:] ** 2, axis=1)
        return left[:, : 2 if off is None else 3 if off else 4]

    def slopes(x: Array) -> Array:
        step = 1e-6 * np.eye(len(x))
        both = left_over(np.concatenate([x + step, x - step]))
        return np.asarray((both[: len(x)] - both[len(x) :]).T / 2e-6)

    met = slice(2 if off else None)
    constraints = [
        {
            "type": "eq",
            "fun": lambda x: left_over(x)[0, met],
            "jac": lambda x: slopes(x)[met],
        },
        {"type": "ineq", "fun": lambda x: apart @ x - level / body.horizon, "jac": lambda _: apart},
    ]
    if off:
        inside = {"type": "ineq", "fun": lambda x: left_over(x)[0, 2:] / off}
        constraints.append({**inside, "jac": lambda x: slopes(x)[2:] / off})
    found = cast("Any", minimize)(
        lambda x: float(price @ x),
        x / unit,
        jac=lambda _: price,
        method="SLSQP",
        bounds=Bounds(np.zeros(2 * count), np.full(2 * count, np.inf)),
        constraints=constraints,
        options={"maxiter": 80, "ftol": 1e-9},
    )
    x = np.asarray(found.x) * unit
    if not np.isfinite(x).all() or np.abs(left_over(found.x)[:, met]).max() > MET:
        return None
    if off and np.hypot(*ended(body, torques, x[None])[0, 2:]) > off + MET:
        return None
    if (order @ x - level).min() < -1e-9 * body.horizon or x[count:].min() < -1e-12:
        return None
    names = [body.channels[index].name for index in which]
    pulses = [(name, float(x[i]), float(x[count + i])) for i, name in enumerate(names)]
    return Rival(float(flows @ x[count:]), pulses)


def by_arcs(body: Spacecraft, torques: Array, x: Array) -> Array:
    """`ended` of a symmetric body that keeps H, by exact arcs between a few kicks in each pulse."""
    A, _, C = body.inertia.moments
    count = len(torques)
    rotation = np.tile(frame_n(body.inertia.moments, body.omega0), (len(x), 1, 1))
    rates = np.tile(body.omega0, (len(x), 1))
    now = np.zeros(len(x))
    fastest = float(np.linalg.norm(body.omega0)) + abs(body.spin)
    for index, torque in enumerate(torques):
        begins, ons = x[:, index], x[:, count + index]
        kicks = min(max(math.ceil(fastest * float(ons[0]) / NARROW), 1), 12)
        for kick in range(kicks):
            t = begins + ons * ((kick + 0.5) / kicks)
            rotation, rates = _coasted(A, C, rotation, rates, t - now)
            rates = rates + np.outer(ons / kicks, torque / [A, A, C])
            now = t
    size = math.hypot(A * math.hypot(*body.omega0[:2]), C * body.spin)
    moved = np.einsum("kij,kj->ki", rotation, rates * [A, A, C]) / size
    off = np.column_stack([A * rates[:, :2] / size, moved[:, :2]])
    off[moved[:, 2] < 0.0, 2:] += 1.0  # H the other way round is no solution
    return off


def _coasted(A: float, C: float, rotation: Array, rates: Array, time: Array) -> tuple[Array, Array]:
    """R(t) = Rot(H t/A) R Rot3(aω3 t) of k bodies: R (k, 3, 3), rates (k, 3), time (k,)."""
    turn = (A - C) / A * rates[:, 2] * time
    cosine = np.cos(turn)
    sine = np.sin(turn)
    axis = np.einsum("kij,kj->ki", rotation, rates * [1.0, 1.0, C / A])
    speed = np.sqrt(np.einsum("ki,ki->k", axis, axis))
    axis = axis / speed[:, None]
    angle = speed * time
    first, second = rotation[:, :, 0], rotation[:, :, 1]
    c, s = cosine[:, None], sine[:, None]
    spun = np.stack([first * c + second * s, second * c - first * s, rotation[:, :, 2]], 1)
    # Rodrigues, on the three body axes at once: spun[k, j] is axis j
    along = np.einsum("ki,kji->kj", axis, spun)
    crossed = np.cross(axis[:, None, :], spun)
    far, aside = np.cos(angle)[:, None, None], np.sin(angle)[:, None, None]
    turned = spun * far + crossed * aside + along[:, :, None] * axis[:, None, :] * (1.0 - far)
    w1 = rates[:, 0] * cosine + rates[:, 1] * sine
    w2 = rates[:, 1] * cosine - rates[:, 0] * sine
    return np.swapaxes(turned, 1, 2), np.column_stack([w1, w2, rates[:, 2]])


# --- least cost of bodies with I1 ≠ I2 by an own linear program, and a schedule near it, flown by
# an own integrator. Nothing of nutdamp's planning is used. The program has on-times in cells of a
# grid; in it H in the body follows the linear Euler equations about pure spin, by the exponential
# of their matrix, and H in space gets the torque turned by ω3 t. Its burns are taken down on the
# true motion

CELL = 0.02
"""rad of spin in a cell of the program."""

MOST = 16
"""Burns at most."""

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
        axis = directions.direction_in_n(
            body, math.radians(rng.uniform(0.05, 1.0)), rng.uniform(0, 2 * math.pi)
        )
        body = Spacecraft(
            body.name, body.inertia, omega, channels=tuple(made), limits=limits, goal=Goal(axis)
        )
    return body, math.radians(rng.uniform(0.02, 0.2)) * float(seed % 2)


class Descended(NamedTuple):
    """Least ``program`` cost of small angles, kg, and that of a schedule ``flown``, None without
    one.
    """

    program: float
    flown: float | None


def rival(body: Spacecraft, off: float) -> Descended:
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
        return Descended(math.inf, None)
    shares = np.asarray(found.x)[: acts.shape[1]].reshape(count, -1)
    burns = sorted(
        burn for index, share in enumerate(shares.T) for burn in _burns(index, share, width)
    )
    near = None
    if 0 < len(burns) <= MOST:
        starts, ons, which = zip(*burns, strict=True)
        near = _descended(body, list(which), np.array([*starts, *ons]), off)
    return Descended(float(found.fun), None if near is None else near.cost)


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


def ended(body: Spacecraft, torques: Array, x: Array) -> Array:
    """H across axis 3 and off its target, over |H|, after x (k, 2n), starts and on-times in s."""
    moments = np.array(body.inertia.moments)
    count = len(torques)
    size = float(np.linalg.norm(moments * body.omega0))
    start = np.column_stack([body.omega0, frame_n(body.inertia.moments, body.omega0).T])
    state = np.tile(start.T, (len(x), 1, 1))  # rates, and the rows of the rotation body -> inertial

    def slope(torque: Array, time: Array, _: float, flat: Array) -> Array:
        state = flat.reshape(len(x), 4, 3)
        turned = state.copy()
        turned[:, 0] *= moments
        faster = np.cross(turned, state[:, :1])
        faster[:, 0] = (faster[:, 0] + torque) / moments
        return np.asarray((faster * time[:, None, None]).ravel())

    now = np.zeros(len(x))
    for index in range(2 * count):
        pulse, ending = divmod(index, 2)
        edge = x[:, pulse] + (x[:, count + pulse] if ending else 0.0)
        torque = torques[pulse] if ending else np.zeros(3)
        turned = partial(slope, torque, edge - now)
        solution = solve_ivp(
            turned, (0.0, 1.0), state.ravel(), method="DOP853", rtol=1e-9, atol=1e-11
        )
        state = solution.y[:, -1].reshape(len(x), 4, 3)
        now = edge
    rates, rotation = state[:, 0], state[:, 1:]
    target = np.array([0.0, 0.0, 1.0]) if body.goal.axis is None else body.goal.axis
    first = np.cross(target, [0.3, 0.7, 0.2])
    first /= np.linalg.norm(first)
    moved = np.einsum("kij,kj->ki", rotation, moments * rates) / size
    moved[moved @ target < 0.0] += 1.0  # H the other way round is no solution
    return np.column_stack(
        [moments[:2] * rates[:, :2] / size, moved @ first, moved @ np.cross(target, first)]
    )
