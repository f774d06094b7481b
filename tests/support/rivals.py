"""Independent searches for cheap schedules, each on a motion of its own."""

import math
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.optimize import Bounds, linprog, minimize
from support.reference import frame_n

from nutdamp.spacecraft.equipment import Channel, Thruster
from nutdamp.spacecraft.model import Goal, Inertia, Limits, Spacecraft
from nutdamp.spacecraft.schedule import Schedule, channel_pulse

# --- an independent search for cheap schedules of strong thrusters: SLSQP from many random
# starts, on its own motion. Nothing of nutdamp's planning is used. The motion is that of exact
# torque-free arcs, R(t) = Rot(H t/A) R Rot3(aω3 t), between kicks; a pulse of real width is a few
# kicks, evenly spread over it

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
    """The cheapest schedule found from ``starts`` random starts; None where none was found."""
    rng = np.random.default_rng([11, seed])
    best: Rival | None = None
    for _ in range(starts):
        found = _descended(spacecraft, free_axis, rng)
        if found is not None and (best is None or found.cost < best.cost):
            best = found
    return best


def _descended(body: Spacecraft, free_axis: bool, rng: np.random.Generator) -> Rival | None:
    """SLSQP over starts and on-times of two to five pulses of random channels at random moments."""
    horizon = body.horizon
    count = int(rng.integers(1 if free_axis else 2, 4 if free_axis else 6))
    which = rng.integers(len(body.channels), size=count)
    torques = np.array([body.channels[index].torque for index in which])
    flows = np.array([body.channels[index].mass_flow for index in which], dtype=float)
    longest = body.least_impulse / np.linalg.norm(torques, axis=1)
    times = np.sort(rng.uniform(0, 1, count))
    if rng.random() < 0.5:
        times[0] = 0.0
    if rng.random() < 0.5:
        times[-1] = 1.0
    ons = longest / count * rng.uniform(0.3, 2.0, count)
    gaps = np.diff(np.concatenate([[0.0], times, [1.0]]))
    left = horizon - ons.sum()
    if left <= 0.0:
        return None
    begins = np.cumsum(gaps[:-1]) * left + np.concatenate([[0.0], np.cumsum(ons)[:-1]])
    unit = np.concatenate([np.full(count, 1.0 / abs(body.spin)), longest])
    price = np.concatenate([np.zeros(count), flows * longest]) / float(np.max(flows * longest))
    # start - end of the one before >= 0, and the horizon
    order = np.zeros((count + 1, 2 * count))
    for index in range(count):
        order[index, index] = 1.0
        if index:
            order[index, index - 1] = order[index, count + index - 1] = -1.0
    order[count, count - 1] = order[count, -1] = -1.0
    level = np.zeros(count + 1)
    level[count] = -horizon
    apart = order * unit / horizon

    def left_over(x: Array) -> Array:
        return ends(body, torques, np.atleast_2d(x) * unit, free_axis)

    def slopes(x: Array) -> Array:
        step = 1e-6
        both = left_over(np.concatenate([x + step * np.eye(len(x)), x - step * np.eye(len(x))]))
        return np.asarray((both[: len(x)] - both[len(x) :]).T / (2 * step))

    met = {"type": "eq", "fun": lambda x: left_over(x)[0], "jac": slopes}
    kept = {"type": "ineq", "fun": lambda x: apart @ x - level / horizon, "jac": lambda _: apart}
    found = cast("Any", minimize)(
        lambda x: float(price @ x),
        np.concatenate([begins, ons]) / unit,
        jac=lambda _: price,
        method="SLSQP",
        bounds=Bounds(np.zeros(2 * count), np.full(2 * count, np.inf)),
        constraints=[met, kept],
        options={"maxiter": 80, "ftol": 1e-9},
    )
    x = np.asarray(found.x) * unit
    if not np.isfinite(x).all() or np.abs(left_over(found.x)).max() > MET:
        return None
    if (order @ x - level).min() < -1e-9 * horizon or x[count:].min() < -1e-12:
        return None
    names = [body.channels[index].name for index in which]
    pulses = [(name, float(x[i]), float(x[count + i])) for i, name in enumerate(names)]
    return Rival(float(flows @ x[count:]), pulses)


def ends(body: Spacecraft, torques: Array, x: Array, free_axis: bool) -> Array:
    """Transverse momentum and shift of H, over |H|, after x (k, 2n), starts and on-times in s."""
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
    return np.asarray(off[:, :2] if free_axis else off)


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
# true motion by linear programs, by fourth-order Runge-Kutta steps

CELL, STRIDE = 0.02, 0.12
"""rad of spin in a cell of the program, and in a step of the integrator."""

ROUNDS, MOST = 16, 16  # programs about one flight after the other; burns at most

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


class Descended(NamedTuple):
    """Least ``program`` cost of small angles, kg, and the schedule ``flown``, None without one."""

    program: float
    flown: Schedule | None


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
    return Descended(float(found.fun), _flown(body, off, burns))


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
    """Schedule near the ``burns``, one after the other, that leaves nothing by `ended`; None where
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
        there = ended(body, torques, np.vstack([x, x + 1e-6 * np.diag(unit)]))
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
    missed = ended(body, torques, x[None])[0]
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


def ended(body: Spacecraft, torques: Array, x: Array) -> Array:
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
