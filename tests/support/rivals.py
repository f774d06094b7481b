"""An independent search for cheap schedules of strong thrusters: SLSQP from many random starts, on
its own motion.

Nothing of nutdamp's planning is used. The motion is that of exact torque-free arcs, R(t) = Rot(H
t/A) R Rot3(aω3 t), between kicks; a pulse of real width is a few kicks, evenly spread over it.
"""

import math
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, minimize
from support.reference import frame_n

from nutdamp.spacecraft.equipment import Channel, Thruster
from nutdamp.spacecraft.model import Inertia, Limits, Spacecraft

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
