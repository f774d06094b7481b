"""Verification: cross-check by DOP853, conservation laws, error budget.

Euler's equations by scipy's DOP853 are written independently of everything else that flies: cross products, a matrix
for the tensor, in the axes of the file, and restarts at every edge of a pulse.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib.util import find_spec
from typing import Any

import numpy as np

from nutdamp.common import work
from nutdamp.errors import Infeasible, MissingExtra
from nutdamp.flight import basilisk, propagation
from nutdamp.flight.dynamics import lacking, shed, supplied
from nutdamp.flight.propagation import Flight
from nutdamp.physics import attitude, response
from nutdamp.physics.triaxial import arc_cones
from nutdamp.spacecraft.constraints import commandable
from nutdamp.spacecraft.model import Spacecraft, SpinState, Vector
from nutdamp.spacecraft.schedule import Pulse, Schedule

EVALUATIONS = 200_000  # evaluations of Euler's equations by DOP853, at most: a thousand turns, some 15 seconds

Push = tuple[Vector, Vector | None]
"""Torque (3,) N m, principal axes, as a stretch begins, and its slope, N m/s, None for none."""

Numbers = Sequence[float]
Matrix = Sequence[Numbers]


class EulerEquations:
    """Euler's equations of a spacecraft and its attitude; ``evaluations`` of them so far, ``most`` at most."""

    def __init__(self, spacecraft: Spacecraft, most: int | None = None) -> None:
        self.most = EVALUATIONS if most is None else most
        self.spacecraft, self.axes = spacecraft, spacecraft.inertia.axes
        self.tensor = self.axes @ np.diag(spacecraft.inertia.moments) @ self.axes.T
        self.inverse: Vector = np.asarray(np.linalg.inv(self.tensor), dtype=np.float64)
        per_kg = shed(spacecraft)
        self.shed = None if per_kg is None else self.axes @ np.diag(per_kg) @ self.axes.T
        self._constant = self.tensor.tolist(), self.inverse.tolist()
        self.growth, self.axis = spacecraft.growth, self.axes[:, 2].tolist()
        self.wheel = (spacecraft.inertia.wheel * self.axes[:, 2]).tolist()
        self.sense, self.evaluations = spacecraft.sense, 0

    def state(self, motion: SpinState) -> Vector:
        """Rates, rad/s, and quaternion in the axes of the file, (7,); (8,) with propellant used, kg: moments fall."""
        turned = attitude.multiply(motion.quaternion, attitude.from_matrix(self.axes.T))
        return np.concatenate([self.axes @ motion.rates, turned, [] if self.shed is None else [0.0]])

    def motion(self, states: Vector) -> tuple[Vector, Vector]:
        """Rates (n, 3) and quaternions (n, 4) in principal axes of ``states`` (n, 7) or (n, 8)."""
        quaternion = states[:, 3:7] / np.linalg.norm(states[:, 3:7], axis=1, keepdims=True)
        return states[:, :3] @ self.axes, attitude.multiply(quaternion, attitude.from_matrix(self.axes))

    def kicked(self, state: Vector, impulse: Vector, propellant: float = 0.0) -> Vector:
        """State after an ``impulse`` (3,) N m s in principal axes, which uses ``propellant`` kg."""
        _, inverse = self._body((state[7:] + 0.5 * propellant).tolist())
        kick = np.array(inverse) @ (self.axes @ impulse)
        return np.concatenate([state[:3] + kick, state[3:7], state[7:] + propellant])

    def _body(self, used: Numbers) -> tuple[Matrix, Matrix]:
        """Tensor and its inverse once ``used`` kg, (1,), are gone; (0,) where they stay."""
        if self.shed is None:
            return self._constant
        tensor = self.tensor - used[0] * self.shed
        return tensor.tolist(), np.linalg.inv(tensor).tolist()

    def solved(
        self,
        state: Vector,
        start: float,
        end: float,
        pushes: Iterable[Push],
        *,
        burn: tuple[float, float] = (0.0, 0.0),
        dense: bool = False,
    ) -> Any:
        """Result of solve_ivp from ``state`` at ``start`` to ``end`` s, with interpolant where ``dense``.

        ``burn``: flow of propellant at ``start``, kg/s, and its slope, kg/s². Raises Infeasible beyond ``most``.
        """
        from scipy.integrate import solve_ivp

        derivative = self._derivative(start, tuple(pushes), burn)
        return solve_ivp(
            derivative, (start, end), state, method="DOP853", rtol=1e-13, atol=1e-15, dense_output=dense,
            first_step=end - start,  # often one step does: the guess would take two, and two evaluations more
        )  # fmt: skip

    def _derivative(
        self, start: float, pushes: tuple[Push, ...], burn: tuple[float, float]
    ) -> Callable[[float, Vector], list[float]]:
        constant, slope = np.zeros(3), np.zeros(3)
        for torque, rise in pushes:
            constant = constant + torque
            slope = slope if rise is None else slope + rise
        pushed, rising = ((self.axes @ part).tolist() for part in (constant, slope))
        disturbances = [(each.rate, each.transverse, each.axial) for each in self.spacecraft.disturbances]
        principal = self.axes.tolist()

        # Plain numbers: an evaluation takes a tenth of what it takes with arrays of three.
        def derivative(t: float, y: Vector) -> list[float]:
            self.evaluations += 1
            if self.evaluations > self.most:
                raise Infeasible(f"the motion takes more than {self.most} evaluations of Euler's equations")
            first, second, third, w, x, v, z, *used = y.tolist()
            rates, since = (first, second, third), t - start
            tensor, inverse = self._body(used)
            momentum = [part + more for part, more in zip(_times(tensor, rates), self.wheel, strict=True)]
            drive, slip = self._sink(tensor, momentum)
            torque = [push + rise * since for push, rise in zip(pushed, rising, strict=True)]
            for rate, transverse, axial in disturbances:
                turned = transverse * complex(math.cos(rate * t), math.sin(rate * t))
                acting = _times(principal, (turned.real, turned.imag, axial))
                torque = [both + part for both, part in zip(torque, acting, strict=True)]
            against = _cross(rates, momentum)
            spin = _times(inverse, [torque[i] + drive[i] - against[i] for i in range(3)])
            p, q, r = first + slip[0], second + slip[1], third + slip[2]
            turning = (
                0.5 * (-x * p - v * q - z * r),
                0.5 * (w * p + v * r - z * q),
                0.5 * (w * q + z * p - x * r),
                0.5 * (w * r + x * q - v * p),
            )
            return [*spin, *turning, burn[0] + burn[1] * since] if used else [*spin, *turning]

        return derivative

    def _sink(self, tensor: Matrix, momentum: Numbers) -> tuple[Numbers, Numbers]:
        """Contribution of energy dissipation to dH/dt in the body, N m, and to its turning, rad/s, axes of the file.

        It turns axis 3 away from H (towards it for an oblate body) at κ sin θ D(θ)/D(0), D the rate at which a nutation
        turns in the body, dE/dθ over |H| sin θ: cos θ without a wheel. In the body H moves along the part of -axis 3
        square to H. Nothing inside a body can turn H in space, so the body slips against it to undo this.
        """
        squared = sum(part * part for part in momentum)
        if self.growth == 0.0 or squared == 0.0:
            return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        size = math.sqrt(squared)
        cosine = sum(part * along for part, along in zip(momentum, self.axis, strict=True)) / size
        pairs = zip(momentum, self.axis, strict=True)
        C = sum(part * along for part, along in zip(_times(tensor, self.axis), self.axis, strict=True))
        wheel = self.spacecraft.inertia.wheel
        A = 0.5 * (sum(tensor[i][i] for i in range(3)) - C)
        turns = [size * angle * (1 / A - 1 / C) + wheel / C for angle in (cosine, self.sense)]
        rate = self.growth * (self.sense * turns[0] / turns[1] if wheel else cosine)
        drive = [rate * (cosine * part - size * along) for part, along in pairs]
        return drive, [part / squared for part in _cross(drive, momentum)]


def _times(matrix: Matrix, vector: Numbers) -> Numbers:
    """Product of a matrix (3, 3) with a vector (3,)."""
    x, y, z = vector
    return [row[0] * x + row[1] * y + row[2] * z for row in matrix]


def _cross(one: Numbers, other: Numbers) -> Numbers:
    """Cross product of vectors (3,)."""
    a, b, c = one
    x, y, z = other
    return (b * z - c * y, c * x - a * z, a * y - b * x)


def integrate(spacecraft: Spacecraft, schedule: Schedule, times: Vector) -> tuple[Vector, Vector]:
    """Rates (n, 3), quaternions (n, 4), principal axes, at rising ``times`` (n,) s. Raises Infeasible if too long."""
    equations = EulerEquations(spacecraft)
    state = equations.state(spacecraft.initial)
    edges = {0.0, float(times[-1]), *times.tolist()}
    edges |= {edge for pulse in schedule for edge in pulse.edges}
    knots = sorted(edge for edge in edges if edge <= times[-1])
    rows = {}
    for now, end in zip(knots, [*knots[1:], knots[-1]], strict=True):
        for pulse in schedule:
            if pulse.on_time == 0.0 and pulse.t == now:
                state = equations.kicked(state, pulse.impulse, pulse.propellant or 0.0)
        rows[now] = state
        if end > now:
            firing = [(pulse, push) for pulse in schedule if (push := pulse.push(now, end)) is not None]
            burn = np.sum([_flow(pulse, now, end) for pulse, _ in firing], axis=0) if firing else (0.0, 0.0)
            state = equations.solved(state, now, end, [push for _, push in firing], burn=(burn[0], burn[1])).y[:, -1]
        work.reach(end)
    return equations.motion(np.array([rows[time] for time in times.tolist()]))


def _flow(pulse: Pulse, start: float, end: float) -> tuple[float, float]:
    """Flow of propellant, kg/s, as a stretch without an edge starts, and its slope, kg/s², by the share of impulse."""
    times = np.array([start, 0.5 * (start + end), end])
    before, middle, after = ((pulse.propellant or 0.0) * pulse.share(times)).tolist()
    length = end - start
    return (4.0 * middle - 3.0 * before - after) / length, 4.0 * (before - 2.0 * middle + after) / length**2


SAMPLES = 201  # even times at which two flights are compared, besides the edges of the pulses
AGREE = 1e-9  # rad; flights that differ by less agree, DOP853 at its tightest tolerance included


IDEAL, AS_FLOWN = "none: ideal impulses", "all: as flown"  # rows of the budget of every schedule
WITHOUT = "without "  # prefix of the rows of the budget that omit an effect included in plans


@dataclass(frozen=True, slots=True)
class Method:
    """Method of flying the schedule: its residual and its largest differences from the flown motion."""

    name: str
    nutation: float | None = None  # left, rad
    momentum_shift: float | None = None  # left, rad
    axis: float | None = None  # difference, rad
    momentum: float | None = None  # difference, rad
    rate: float | None = None  # over |ω|, or over |H| by the largest moment where a wheel holds the body still
    missing: str = ""  # reason why it could not be flown
    outside: bool = False  # it shares nothing with the flown motion, and so is to confirm it

    @property
    def short(self) -> str:
        """Name without the model."""
        return self.name.partition(",")[0]

    @property
    def difference(self) -> float:
        """Largest of the three, NaN where one is unknown."""
        differences = (self.axis, self.momentum, self.rate)
        return float(np.max([math.nan if difference is None else difference for difference in differences]))


@dataclass(frozen=True, slots=True)
class Imperfection:
    """Residual (rad) with one imperfection alone, everything else ideal; or without one that plans include."""

    name: str
    nutation: float
    momentum_shift: float
    axis_error: float


@dataclass(frozen=True, slots=True)
class Conservation:
    """Largest relative change of |H| or of the energy on a coast; ``changed``: legitimate cause, if any."""

    name: str
    drift: float
    changed: tuple[str, ...] = ()

    @property
    def kept(self) -> bool | None:
        """True if within `AGREE`; None where there is a legitimate cause."""
        return None if self.changed else self.drift <= AGREE


@dataclass(frozen=True, slots=True)
class Verification:
    """Methods side by side, conserved quantities, and the budget."""

    methods: tuple[Method, ...]
    momentum: Conservation
    energy: Conservation
    budget: tuple[Imperfection, ...]

    @property
    def checks(self) -> tuple[str, ...]:
        """Names of the integrations from outside that were flown."""
        return tuple(method.short for method in self._outside)

    @property
    def disagreeing(self) -> tuple[str, ...]:
        """Names of methods whose motion differs from the flown one by more than `AGREE`, or is not a number."""
        return tuple(method.short for method in self._outside if not method.difference <= AGREE)

    @property
    def drifting(self) -> tuple[str, ...]:
        """Quantities that change on coasts without a cause."""
        return tuple(quantity.name for quantity in (self.momentum, self.energy) if quantity.kept is False)

    @property
    def agree(self) -> bool:
        """True if there are other methods and all of them confirm the flown motion."""
        return bool(self.checks) and not self.disagreeing

    @property
    def _outside(self) -> list[Method]:
        return [method for method in self.methods if method.outside and not method.missing]


def verify(
    spacecraft: Spacecraft, schedule: Schedule, unrounded: Schedule | None = None, *, expected: bool = False
) -> Verification:
    """Fly ``schedule`` by the impulse sum, Taylor series, DOP853 and, where it is installed, Basilisk.

    ``unrounded``: the schedule before its commands were rounded to ticks; ``expected``: planned with the disturbances.
    """
    end = schedule.end + spacecraft.inertial_period
    judge = propagation.flown(spacecraft, schedule, end)
    times = np.unique(np.concatenate([np.linspace(0.0, end, SAMPLES), [pulse.over for pulse in schedule]]))
    methods = [
        _closed_form(judge, end, times),
        Method("flown (Taylor series)", judge.residual.nutation, judge.residual.momentum_shift, 0.0, 0.0, 0.0),
    ]
    with work.steps(2.0 if find_spec("Basilisk") else 1.0):  # all else takes no time beside these two
        with work.steps(end):
            dop853 = partial(integrate, spacecraft, schedule, times)
            methods.append(_from_outside("DOP853, full tensor", judge, lambda: (times, dop853())))
        methods.append(_from_outside("Basilisk", judge, lambda: basilisk.fly(spacecraft, schedule, end).motion))
    return Verification(tuple(methods), *_conserved(judge), _budget(spacecraft, schedule, unrounded, expected=expected))


def _closed_form(judge: Flight, end: float, times: Vector) -> Method:
    """Exact arcs between effective impulses; where ω3 keeps between them, the rates by the sum (17) written out."""
    spacecraft, schedule = judge.spacecraft, judge.schedule
    arcs, inertia = propagation.by_impulses(spacecraft, schedule, end), spacecraft.inertia
    body, quaternion = arcs.motion(times)
    if inertia.symmetric and not spacecraft.disturbances and spacecraft.growth == 0.0 and shed(spacecraft) is None:
        omega, spin = response.impulse_sum(
            times,
            complex(spacecraft.omega0[0], spacecraft.omega0[1]),
            spacecraft.spin,
            inertia.A,
            inertia.C,
            np.array([pulse.t for pulse in schedule]),
            propagation.effective_impulses(spacecraft, schedule),
            np.array([pulse.impulse[2] for pulse in schedule]),
            inertia.wheel,
        )
        body = np.column_stack([omega.real, omega.imag, spin])
    outside = np.all([(times <= pulse.thrust[0]) | (times >= pulse.thrust[1]) for pulse in schedule], axis=0)
    between = np.broadcast_to(outside, times.shape)  # within a pulse the impulse has been given or not
    left, apart = arcs.residual, _differences(judge, times, (body, quaternion), between)
    return Method("impulse sum (17), arcs", left.nutation, left.momentum_shift, *apart)


def _from_outside(name: str, judge: Flight, fly: Callable[[], tuple[Vector, tuple[Vector, Vector]]]) -> Method:
    """A method that gives times and motion only: its residual is read at the first time after the last pulse."""
    try:
        times, motion = fly()
    except (MissingExtra, Infeasible) as reason:
        return Method(name, missing=str(reason), outside=True)
    last, craft = int(np.searchsorted(times, judge.schedule.end - 1e-9)), judge.spacecraft
    rates, quaternion = (part[last] for part in motion)
    inertia = replace(craft.inertia, moments=judge.last_moments)
    shift = float(attitude.angle_between(craft.momentum, attitude.rotate(quaternion, inertia.momentum(rates))))
    nutation = arc_cones(inertia.moments, rates, craft.sense, inertia.wheel).nutation
    return Method(name, nutation, shift, *_differences(judge, times, motion), outside=True)


def _differences(
    judge: Flight, times: Vector, motion: tuple[Vector, Vector], rows: Any = slice(None)
) -> tuple[float, float, float]:
    """Largest differences of a motion from the flown one at ``times`` (n,) s over the ``rows``: see `Method`."""
    moments, wheel = judge.moments_at(times), np.array([0.0, 0.0, judge.spacecraft.inertia.wheel])
    still = wheel[2] and float(np.linalg.norm(judge.spacecraft.momentum)) / max(judge.moments)
    spin_axis = np.array([0.0, 0.0, 1.0])
    (body, turn), (other_body, other_turn) = motion, judge.motion(times)
    differences = (
        attitude.angle_between(attitude.rotate(turn, spin_axis), attitude.rotate(other_turn, spin_axis)),
        attitude.angle_between(
            attitude.rotate(turn, body * moments + wheel), attitude.rotate(other_turn, other_body * moments + wheel)
        ),
        np.linalg.norm(body - other_body, axis=1) / np.maximum(np.linalg.norm(other_body, axis=1), still),
    )
    axis, momentum, rate = (float(np.max(values[rows], initial=0.0)) for values in differences)
    return axis, momentum, rate


def _conserved(flown: Flight) -> tuple[Conservation, Conservation]:
    """|H| and energy along each coast: torques from outside change both, dissipation within the body the energy."""
    firing = [pulse.thrust for pulse in flown.schedule]
    worst = [0.0, 0.0]
    for leg in flown.legs:
        if leg.end == leg.start or any(start <= leg.start and leg.end <= end for start, end in firing):
            continue
        turning, _ = leg.path.motion(np.linspace(leg.start, leg.end, 25))
        moments = flown.moments_at(np.array([leg.start])).ravel()
        size = np.linalg.norm(turning * moments + (0.0, 0.0, flown.spacecraft.inertia.wheel), axis=1)
        for index, value in enumerate((size, turning**2 @ moments)):
            whole = float(np.max(value)) or 1.0  # the energy of a despun body at rest is zero
            worst[index] = max(worst[index], float(np.ptp(value)) / whole)
    body = flown.spacecraft
    outside, inside = ("disturbances",) * bool(body.disturbances), ("dissipation",) * (body.growth != 0.0)
    return Conservation("|H|", worst[0], outside), Conservation("energy", worst[1], (*outside, *inside))


def _budget(
    spacecraft: Spacecraft, schedule: Schedule, unrounded: Schedule | None, *, expected: bool
) -> tuple[Imperfection, ...]:
    """Residual of the ideal flight, with each imperfection alone, with all, and without those that plans include.

    These are three moments, axial torques, dissipation and, ``expected``, disturbances.
    """
    exact, inertia = schedule if unrounded is None else unrounded, spacecraft.inertia
    ideal = spacecraft if expected else replace(spacecraft, disturbances=())
    sharp = _sharp(ideal, exact)
    rows = [(IDEAL, ideal, sharp)]
    if any(pulse.on_time for pulse in exact):
        rows.append(("pulse width", ideal, exact))
    if spacecraft.limits.tick is not None:
        rounded = Schedule(supplied(spacecraft, (commandable(spacecraft, pulse) for pulse in exact)))
        rows.append(("command resolution", ideal, _sharp(ideal, rounded)))
    if spacecraft.disturbances and not expected:
        rows.append(("disturbances", spacecraft, sharp))
    rows.append((AS_FLOWN, spacecraft, schedule))
    if any(pulse.impulse[2] != 0.0 for pulse in exact):
        flat, pulses = np.array([1.0, 1.0, 0.0]), []
        for pulse in exact:
            torque = None if pulse.torque is None else pulse.torque * flat
            pulses.append(replace(pulse, impulse=pulse.impulse * flat, torque=torque))
        rows.append((f"{WITHOUT}axial torque", ideal, _sharp(ideal, Schedule(tuple(pulses)))))
    if not inertia.symmetric:
        mean = replace(inertia, moments=(inertia.A, inertia.A, inertia.C))
        rows.append((f"{WITHOUT}I1 ≠ I2", replace(ideal, inertia=mean), sharp))
    if spacecraft.growth != 0.0:
        rows.append((f"{WITHOUT}dissipation", replace(ideal, dissipation=None), sharp))
    rows += [(f"{WITHOUT}{name}", *lacking(ideal, exact, name)) for name in spacecraft.thrust_laws]
    if spacecraft.disturbances and expected:
        rows.append((f"{WITHOUT}disturbances", replace(ideal, disturbances=()), sharp))
    ends = [(name, propagation.flown(body, fired).residual) for name, body, fired in rows]
    return tuple(Imperfection(name, left.nutation, left.momentum_shift, left.axis_error) for name, left in ends)


def _sharp(spacecraft: Spacecraft, schedule: Schedule) -> Schedule:
    """Every pulse as an ideal impulse at its centre, at its effective strength on ω."""
    pulses = []
    for pulse, effective in zip(schedule, propagation.effective_impulses(spacecraft, schedule), strict=True):
        impulse = np.array([effective.real, effective.imag, pulse.impulse[2]])
        pulses.append(Pulse(pulse.t, 0.0, pulse.channel, impulse, propellant=pulse.propellant))
    return Schedule(tuple(pulses))
