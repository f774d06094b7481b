"""Reference model: the motion from the numbers of the spacecraft file alone, integrated by DOP853.

`verify` compares flights with it, so it shares no law of physics with them: the full inertia tensor
and every vector in the axes of the file, torques as (r - r_cm) × F, valves, tank, wheel, damper and
disturbances are worked out here from the values of the document (SI, as they are read). Two
conventions are those of the guide: pulses draw on the tank one after the other, and during a pulse
the center of mass is where half of its propellant leaves it.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from nutdamp.errors import Infeasible
from nutdamp.units import STANDARD_GRAVITY

Array = NDArray[np.float64]

EQUAL = (
    1e-9  # relative difference of principal moments below which any axis between them is principal
)
PURE = 1e-13  # sine of a nutation that is rounding: a pure spin
SOLVE: Any = partial(solve_ivp, method="DOP853", rtol=1e-13, dense_output=True)
AT_ONCE = SimpleNamespace(
    open_delay=0.0, close_delay=0.0, rise_time=0.0, fall_time=0.0, on_time_is="command"
)
X, Z, FLAT = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 1.0, 0.0])


class _Burn(NamedTuple):
    # Thrust of a command: it rises, stays and falls between four corners, s, at which it has these
    # levels.
    shape: Array  # (2, 4): corners and levels
    torque: Array  # (3,) N m at the thrust of the file; N m s of an ideal impulse
    taken: float  # propellant, kg
    supply: Callable[
        [float], Array
    ]  # after so many s of full thrust: kg of it, and the thrust over that of the file

    def full(self, time: float) -> float:
        # Seconds of full thrust up to a time.
        corners, levels = self.shape
        spans = np.diff(corners)
        since = np.clip(time - corners[:-1], 0.0, spans)
        share = 0.5 * since / np.where(spans > 0.0, spans, 1.0)
        return float(np.sum((levels[:-1] + share * np.diff(levels)) * since))


class ReferenceModel:
    """Spacecraft of a ``document``, with the ``sun`` (3,); ``evaluations`` so far, at most
    ``most``.
    """

    def __init__(self, document: Any, sun: Array | None, most: int) -> None:
        self.most = most
        self.evaluations = 0
        self.document = document
        inertia = document.inertia
        tank = document.tank
        tensor = np.array(inertia.tensor or np.diag([inertia.A, inertia.A, inertia.C]), dtype=float)
        self.tensor = 0.5 * (tensor + tensor.T)
        values, vectors = np.linalg.eigh(self.tensor)
        spaces = [vectors[:, np.abs(values - value) <= EQUAL * values.max()] for value in values]
        third = self.third = _nearest(spaces, Z, np.eye(3))
        first = _nearest(spaces, X, np.eye(3) - np.outer(third, third))
        self.axes = np.column_stack([first, _cross(third, first), third])
        self.wheel = third * (document.wheel.momentum if document.wheel else 0.0)
        self.rates = (
            np.array(document.omega0, dtype=float)
            if document.omega0
            else self._rates(document.state)
        )
        momentum = self.tensor @ self.rates + self.wheel
        self.axis = third * math.copysign(1.0, third @ momentum)
        turn = self._attitude(document.attitude, momentum, sun)
        self.initial = np.concatenate([self.rates, turn.as_quat()])
        shed: Any = tank and tank.inertia_per_kg
        each: Any = [shed.A, shed.A, shed.C] if hasattr(shed, "A") else shed
        self.shed = self.axes @ np.diag(each) @ self.axes.T if each else np.zeros((3, 3))
        self.burns, self.kicks = list[_Burn](), list[_Burn]()
        self.fired = list[str]()
        self.propellant = 0.0
        still = (
            -(third @ self.rates) * third
        )  # the rate in the body of what is nearly fixed in space
        pushes = document.disturbances
        self.pushes = [
            (
                still if one.fixed_in else (one.rate or 0.0) * third,
                one.torque,
                vars(one)["from"] or -math.inf,
                one.until or math.inf,
            )
            for one in pushes
        ]

    def _rates(self, state: Any) -> Array:
        across = self.axes[:, :2] @ [math.cos(state.phase), math.sin(state.phase)]
        axial = abs(self.third @ (self.tensor @ self.third * state.spin + self.wheel))
        rate = axial * math.tan(state.nutation) / np.linalg.norm(self.tensor @ across)
        return np.asarray(state.spin * self.third + rate * across)

    def _attitude(self, given: Any, momentum: Array, sun: Array | None) -> Rotation:
        # From the axes of the file to the inertial frame at t = 0.
        upright = _unit(momentum)
        if given is None:  # z along H, the spin axis in the half plane x >= 0 of x-z
            leaning = self.axis - (self.axis @ upright) * upright
            return _triad(
                upright, self.axes[:, 0] if np.linalg.norm(leaning) < PURE else leaning
            ).inv()
        if given.quaternion is not None:
            return Rotation.from_quat(np.roll(given.quaternion, -1))
        right_ascension, declination = given.spin_axis
        along = Rotation.from_euler("ZY", [right_ascension, -declination]).apply(X)
        side: Any = np.cross(Z, along) if given.sun_phase is None else sun
        phase = Rotation.from_rotvec((given.sun_phase or given.phase or 0.0) * along)
        body = _triad(upright if given.of == "momentum" else self.axis, X)
        return phase * _triad(along, X if np.linalg.norm(side) < EQUAL else side) * body.inv()

    def command(
        self, channel: str, start: float, on_time: float, vector: Array | None = None
    ) -> None:
        """Fire a ``channel``, behind those before, for ``on_time`` s from ``start`` s on.

        ``vector``: torque, N m, of a steered pulse in the axes of the file; impulse, N m s, where
        the on-time is 0.
        """
        document, tank, cold = self.document, self.document.tank, self.document.cold
        if vector is None:
            names = (document.channels or {}).get(channel, [channel])
            members = [each for name in names for each in document.thrusters if each.name == name]
            shape = _response(members[0], document.valve, on_time)
        else:
            torquer = document.steerable if channel == "steerable" else None
            tank = None
            cold = None
            arm, isp = (torquer.lever_arm, torquer.isp) if torquer else (None, None)
            members = [SimpleNamespace(torque=vector.tolist(), lever_arm=arm, isp=isp, force=None)]
            shape = np.array([[0.0, 0.0, on_time or 1.0, on_time or 1.0], FLAT])
        length = _Burn(shape, X, 0.0, np.array).full(math.inf)
        if length <= 0.0:
            return
        warm = (
            1.0 - (1.0 - cold.first) * math.exp(-self.fired.count(channel) / cold.pulses)
            if cold
            else 1.0
        )
        self.fired.append(channel)
        supply = self._supply(members, tank, warm, length)
        taken, _ = supply(length)
        share = (
            min(max(tank.propellant - self.propellant, 0.0) / taken, 1.0) if tank and taken else 1.0
        )
        torque = np.sum(
            [self._torque(each, self.propellant + 0.5 * taken) for each in members], axis=0
        )
        self.propellant += share * taken
        shape = np.add(shape, [[start], [0.0]])
        burn = _Burn(shape, torque, share * taken, lambda full: share * supply(full))
        (self.burns if on_time > 0.0 else self.kicks).append(burn)

    def _torque(self, thruster: Any, used: float) -> Array:
        if thruster.torque is not None:
            return np.array(thruster.torque, dtype=float)
        center, per_kg = (
            self.document.center_of_mass or 0.0,
            self.document.center_of_mass_per_kg or 0.0,
        )
        arm = np.array(thruster.position) - (np.array(center) + used * np.array(per_kg))
        return _cross(arm, thruster.force * _unit(np.array(thruster.direction, dtype=float)))

    def _supply(
        self, members: Sequence[Any], tank: Any, warm: float, length: float
    ) -> Callable[[float], Array]:
        # Propellant of a pulse, kg, and thrust over that of the file, after so many s of full
        # thrust.
        begun = min(self.propellant, tank.propellant) if tank else 0.0
        growth = (tank.pressure / tank.final_pressure - 1.0) / tank.propellant if tank else 0.0
        power = -tank.exponent if tank else 0.0
        table = tank and tank.isp
        pairs: Any = [(_thrust(member), member.isp) for member in members]
        known = all(force and (isp or table) for force, isp in pairs)

        def flow(_: float, used: Array) -> Array:
            volume = 1.0 + growth * used
            isp = np.interp(tank.pressure / volume, *np.transpose(table)) if table else 0.0
            speed = sum(force / (isp if table else own) for force, own in pairs if known)
            return np.asarray(warm * volume**power * speed / STANDARD_GRAVITY)

        used = SOLVE(flow, (0.0, length), [begun], atol=1e-20, max_step=0.25 * length).sol
        return lambda full: np.array(
            [(now := used(full)[0]) - begun, warm * (1.0 + growth * now) ** power]
        )

    def fly(
        self,
        state: Array,
        start: float,
        end: float,
        reach: Callable[[float], None] = lambda _: None,
    ) -> Callable[[Any], Array]:
        """Motion from a ``state`` at ``start`` to ``end`` s: at times (n,) states (7, n), just
        after jumps.

        A state is the rates (3) and the quaternion, scalar last (4). ``reach`` is told the time.
        Raises Infeasible beyond the evaluations allowed.
        """
        jumps = np.concatenate(
            [[], *(each.shape[0] for each in (*self.burns, *self.kicks))]
        ).tolist()
        jumps += [edge for push in self.pushes for edge in push[2:]]
        times = [start]
        pieces = list[Any]()
        for now, then in pairwise(
            [start, *sorted({jump for jump in jumps if start < jump < end}), end]
        ):
            kicks = [kick for kick in self.kicks if kick.shape[0, 0] == now]
            jumped = [
                np.linalg.solve(self._tensor_at(now, 0.5 * kick.taken), kick.torque)
                for kick in kicks
            ]
            state = state + np.pad(sum(jumped, np.zeros(3)), (0, 4))
            if then - now <= 16.0 * math.ulp(then):  # edges that touch
                continue
            solution = SOLVE(self._derivative(now, then), (now, then), state, atol=1e-15)
            times, pieces = [*times, *solution.sol.ts[1:]], [*pieces, *solution.sol.interpolants]
            state = solution.y[:, -1]
            reach(then)
        # The piece that begins last up to a time; the first before, the last after all.
        at = np.vectorize(
            lambda time: pieces[bisect_right(times[:-1], time, 1) - 1](time), signature="()->(n)"
        )
        return lambda moments: at(moments).T

    def _tensor_at(self, time: float, unused: float = 0.0) -> Array:
        # Tensor in the axes of the file at a time; so many kg used at that time are still there.
        begun = [burn for burn in self.burns if burn.shape[0, 0] < time] if self.shed.any() else []
        burnt = [
            burn.supply(burn.full(time))[0] if time < burn.shape[0, 3] else burn.taken
            for burn in begun
        ]
        burnt += [kick.taken for kick in self.kicks if kick.shape[0, 0] <= time]
        return np.asarray(self.tensor - (sum(burnt) - unused) * self.shed)

    def _derivative(self, start: float, end: float) -> Callable[[float, Array], Array]:
        # Euler's equations and the turning of the body on a stretch without a jump: levels are
        # straight lines.
        early, late = start + 0.25 * (end - start), start + 0.75 * (end - start)
        firing = [
            (burn, *np.interp([early, late], *burn.shape))
            for burn in self.burns
            if burn.shape[0, 0] < late and early < burn.shape[0, 3]
        ]

        pushing = [push[:2] for push in self.pushes if push[2] < late and early < push[3]]

        def derivative(t: float, y: Array) -> Array:
            self.evaluations += 1
            if self.evaluations > self.most:
                raise Infeasible(
                    f"the motion takes more than {self.most} evaluations of Euler's equations"
                )
            torque = np.zeros(3)
            for burn, first, last in firing:
                level = first + (last - first) * (t - early) / (late - early)
                torque += level * burn.supply(burn.full(t))[1] * burn.torque
            for rate, push in pushing:
                torque += Rotation.from_rotvec(rate * t).apply(push)
            tensor = self._tensor_at(t)
            rates = y[:3]
            vector = y[3:6]
            momentum = tensor @ rates + self.wheel
            drive = self._damper(tensor, momentum)
            # Nothing inside a body turns H in space: the body slips against it.
            turning = rates + _cross(drive, momentum) / (momentum @ momentum or 1.0)
            changing = np.linalg.solve(tensor, torque + drive - _cross(rates, momentum))
            return np.array(
                [
                    *changing,
                    *0.5 * (y[6] * turning + _cross(vector, turning)),
                    -0.5 * vector @ turning,
                ]
            )

        return derivative

    def _damper(self, tensor: Array, momentum: Array) -> Array:
        # dH/dt in the body, N m, by a linear damper that the nutation moves: θ grows at ± sin θ
        # D(θ)/(T D(0)) with D(θ) = |H| cos θ (1/A - 1/C) + h/C, while |H| and the wheel keep.
        loss = self.document.dissipation
        size = math.sqrt(momentum @ momentum)
        axis = self.axis
        axial = float(axis @ tensor @ axis)
        transverse = 0.5 * (float(np.trace(tensor)) - axial)
        if loss is None or size == 0.0:
            return np.zeros(3)
        shape = np.sign(round(transverse / axial - 1.0, 8))  # a sphere has no energy to give
        sign = {"grows": 1.0, "decays": -1.0}.get(loss.nutation) or shape
        cosine, wheel = float(momentum @ axis) / size, float(self.wheel @ axis) / axial
        slope = size * (1.0 / transverse - 1.0 / axial)
        share = (slope * cosine + wheel) / (slope + wheel or math.inf) if wheel else cosine
        return np.asarray(sign * share / loss.time_constant * (cosine * momentum - size * axis))

    def vectors(self, states: Array, times: Array) -> tuple[Array, Array, Array]:
        """Rates in the axes of the file, inertial spin axis and H, (n, 3) each, of ``states`` (7,
        n) at ``times``.
        """
        turn = Rotation.from_quat(states[3:].T)
        rates = states[:3].T
        momentum = [self._tensor_at(time) @ row for time, row in zip(times, rates, strict=True)]
        return (
            rates,
            np.asarray(turn.apply(self.axis)),
            np.asarray(turn.apply(np.array(momentum) + self.wheel)),
        )

    def nutation(self, state: Array, time: float) -> float:
        """Angle between spin axis and H, rad; of three unequal moments its largest on the free
        motion that follows.
        """
        tensor = self._tensor_at(time)
        sense = float(self.third @ self.axis)
        first, second, third = (float(axis @ tensor @ axis) for axis in self.axes.T)
        one, two, axial = self.axes.T @ (tensor @ state[:3] + self.wheel) * [1.0, 1.0, sense]
        spin = sense * float(self.third @ state[:3])
        falls = []
        pairs = (
            ((one, first, second), (two, second, first))
            if abs(first - second) > EQUAL * third
            else ()
        )
        # Where H3 has fallen by δ, |H| and the energy leave H1² = H1(0)² + bδ + aδ², and H2²
        # likewise.
        for part, own, other in pairs:
            apart = 1.0 / own - 1.0 / other
            b, a = 2.0 * (spin - axial / other) / apart, (1.0 / other - 1.0 / third) / apart
            square = b * b - 4.0 * a * part**2
            if square >= 0.0 and min(a, b) < 0.0:  # it falls to zero
                falls.append(
                    2.0 * part**2 / (square**0.5 - b) if b < 0.0 else -0.5 * (b + square**0.5) / a
                )
        fall = min(falls, default=0.0)
        across = one**2 + two**2 + fall * (2.0 * axial - fall)
        return math.atan2(math.sqrt(max(across, 0.0)), axial - fall)


def _nearest(spaces: Sequence[Array], direction: Array, across: Array) -> Array:
    # Unit vector nearest to a direction among the spaces of equal moments, projected by a matrix.
    return _unit(
        max((across @ space @ (space.T @ direction) for space in spaces), key=np.linalg.norm)
    )


def _response(thruster: Any, every: Any, on_time: float) -> Array:
    # Corners of the thrust, s after the start of a command, and its levels there over full thrust.
    rows = thruster.impulse_bit
    valve = thruster.valve or every or AT_ONCE
    if rows is not None:
        times, *columns = np.transpose(rows)
        impulse, middle = (np.interp(on_time, times, column) for column in columns)
        half = 0.5 * impulse / (_thrust(thruster) or math.nan)
        return np.array([[middle - half, middle - half, middle + half, middle + half], FLAT])
    rise = valve.rise_time
    fall = valve.fall_time
    shortest = 0.5 * (valve.rise_time + valve.fall_time)
    opened = on_time + valve.close_delay - valve.open_delay
    if valve.on_time_is == "effective":
        opened = (
            on_time - 0.5 * (fall - rise)
            if on_time >= shortest
            else rise * math.sqrt(on_time / shortest)
        )
    height = 0.0 if opened <= 0.0 or on_time <= 0.0 else min(opened / (rise or opened), 1.0)
    corners = valve.open_delay + np.array([0.0, height * rise, opened, opened + height * fall])
    return np.array([corners, height * FLAT])


def _thrust(thruster: Any) -> float | None:
    known = thruster.torque is None or thruster.lever_arm
    return (thruster.force or math.hypot(*thruster.torque) / thruster.lever_arm) if known else None


def _triad(along: Array, towards: Array) -> Rotation:
    # Turn of axis 3 to a unit vector, and of axis 1 as near to ``towards`` as can be.
    first = _unit(towards - (towards @ along) * along)
    return Rotation.from_matrix(np.column_stack([first, _cross(along, first), along]))


def _unit(vector: Array) -> Array:
    return np.asarray(vector / np.linalg.norm(vector))


def _cross(one: Array, two: Array) -> Array:
    (a, b, c), (x, y, z) = one.tolist(), two.tolist()  # np.cross takes ten times as long
    return np.array([b * z - c * y, c * x - a * z, a * y - b * x])
