"""Fly a schedule by independent means, and tell what each imperfection costs: an error budget a reviewer can sign."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from nutdamp import basilisk, dop853, flight
from nutdamp.errors import Infeasible, MissingExtra
from nutdamp.flight import Flight, Residual
from nutdamp.lightening import shed
from nutdamp.limits import commandable
from nutdamp.physics import attitude, rates
from nutdamp.physics.arc_cones import arc_cones
from nutdamp.schedule import Pulse, Schedule
from nutdamp.spacecraft import Spacecraft, Vector
from nutdamp.supply import lacking, supplied

SAMPLES = 201
"""Even times at which two flights are compared, besides the edges of the pulses."""

AGREE = 1e-9
"""rad; flights that differ by less agree, DOP853 at its tightest tolerance included."""


IDEAL, AS_FLOWN = "none: ideal impulses", "all: as flown"
"""The rows of the budget that every schedule has."""

WITHOUT = "without "
"""How the rows of the budget begin that leave out what plans include."""


@dataclass(frozen=True, slots=True)
class Method:
    """One way to fly the schedule: its residual (rad), or why it could not be flown.

    ``axis``, ``momentum`` (rad) and ``rate`` (relative to |ω|) are its largest differences from the flown motion.
    ``outside``: an integration that shares nothing with it, and so is to confirm it.
    """

    name: str
    nutation: float | None = None
    momentum_shift: float | None = None
    axis: float | None = None
    momentum: float | None = None
    rate: float | None = None
    missing: str = ""
    outside: bool = False

    @property
    def short(self) -> str:
        """The name without what it says of the model."""
        return self.name.partition(",")[0]

    @property
    def difference(self) -> float:
        """The largest of the three, NaN where one is not known."""
        found = (self.axis, self.momentum, self.rate)
        return float(np.max([math.nan if one is None else one for one in found]))


@dataclass(frozen=True, slots=True)
class Imperfection:
    """Residual (rad) with one imperfection alone, everything else ideal; or without one that plans include."""

    name: str
    nutation: float
    momentum_shift: float
    axis_error: float


@dataclass(frozen=True, slots=True)
class Conservation:
    """The largest relative change of |H| or of the energy on a coast; ``changed``: what may change it there, if any."""

    name: str
    drift: float
    changed: tuple[str, ...] = ()

    @property
    def kept(self) -> bool | None:
        """Whether it keeps to `AGREE`; None where something may change it."""
        return None if self.changed else self.drift <= AGREE


@dataclass(frozen=True, slots=True)
class Verification:
    """Methods side by side, what must be conserved, and the budget."""

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
        """Names of those whose motion differs from the flown one by more than `AGREE`, or is not a number."""
        return tuple(method.short for method in self._outside if not method.difference <= AGREE)

    @property
    def drifting(self) -> tuple[str, ...]:
        """What changes on coasts although nothing may change it."""
        return tuple(one.name for one in (self.momentum, self.energy) if one.kept is False)

    @property
    def agree(self) -> bool:
        """Whether there are any, and all of them confirm the flown motion."""
        return bool(self.checks) and not self.disagreeing

    @property
    def _outside(self) -> list[Method]:
        return [method for method in self.methods if method.outside and not method.missing]


def verify(
    spacecraft: Spacecraft, schedule: Schedule, unrounded: Schedule | None = None, *, expected: bool = False
) -> Verification:
    """Fly ``schedule`` by the impulse sum, Taylor series, DOP853 and, where it is installed, Basilisk.

    ``unrounded`` is the schedule before its commands were rounded to ticks, where there is one; ``expected``: it was
    planned on the motion with the disturbances.
    """
    end = schedule.end + spacecraft.inertial_period
    judge = flight.flown(spacecraft, schedule, end)
    times = np.unique(np.concatenate([np.linspace(0.0, end, SAMPLES), [pulse.over for pulse in schedule]]))
    reference = judge.motion(times)
    methods = (
        _closed_form(judge, end, times, reference),
        Method("flown (Taylor series)", judge.residual.nutation, judge.residual.momentum_shift, 0.0, 0.0, 0.0),
        _by_dop853(judge, times, reference),
        _by_basilisk(judge, end),
    )
    return Verification(methods, *_conserved(judge), _budget(spacecraft, schedule, unrounded, expected=expected))


def _closed_form(judge: Flight, end: float, times: Vector, reference: tuple[Vector, Vector]) -> Method:
    """Exact arcs between effective impulses; where ω3 keeps between them, the rates by the sum (17) written out."""
    spacecraft, schedule = judge.spacecraft, judge.schedule
    arcs = flight.by_impulses(spacecraft, schedule, end)
    body, quaternion = arcs.motion(times)
    inertia = spacecraft.inertia
    if inertia.symmetric and not spacecraft.disturbances and spacecraft.growth == 0.0 and shed(spacecraft) is None:
        omega, spin = rates.impulse_sum(
            times,
            complex(spacecraft.omega0[0], spacecraft.omega0[1]),
            spacecraft.spin,
            inertia.A,
            inertia.C,
            np.array([pulse.t for pulse in schedule]),
            flight.effective_impulses(spacecraft, schedule),
            np.array([pulse.impulse[2] for pulse in schedule]),
        )
        body = np.column_stack([omega.real, omega.imag, spin])
    outside = np.all([(times <= pulse.thrust[0]) | (times >= pulse.thrust[1]) for pulse in schedule], axis=0)
    between = np.broadcast_to(outside, times.shape)  # within a pulse the impulse has been given or not
    moments = judge.moments_at(times)
    return _method("impulse sum (17), arcs", moments, arcs.residual, (body, quaternion), reference, between)


def _by_dop853(judge: Flight, times: Vector, reference: tuple[Vector, Vector]) -> Method:
    name = "DOP853, full tensor"
    try:
        motion = dop853.integrate(judge.spacecraft, judge.schedule, times)
    except Infeasible as reason:
        return Method(name, missing=str(reason), outside=True)
    return _compared(name, judge, times, motion, reference)


def _by_basilisk(judge: Flight, end: float) -> Method:
    name = "Basilisk"
    if shed(judge.spacecraft) is not None:
        return Method(name, missing="it flies with constant moments, and those of the file fall", outside=True)
    try:
        flown = basilisk.fly(judge.spacecraft, judge.schedule, end)
    except (MissingExtra, Infeasible) as reason:
        return Method(name, missing=str(reason), outside=True)
    return _compared(name, judge, flown.t, (flown.rates, flown.quaternion), judge.motion(flown.t))


def _compared(
    name: str, judge: Flight, times: Vector, motion: tuple[Vector, Vector], reference: tuple[Vector, Vector]
) -> Method:
    """A method that gives motion only: its residual is read at the first time after the last pulse."""
    last = int(np.searchsorted(times, judge.schedule.end - 1e-9))
    start = judge.spacecraft.initial
    before = attitude.rotate(start.quaternion, start.rates * np.asarray(judge.moments))
    after = attitude.rotate(motion[1][last], motion[0][last] * np.asarray(judge.last_moments))
    shift = float(attitude.angle_between(before, after))
    left = arc_cones(judge.last_moments, motion[0][last], math.copysign(1.0, judge.spacecraft.spin))
    residual = Residual(left.nutation, left.body, left.space, shift, shift)
    method = _method(name, judge.moments_at(times), residual, motion, reference, np.ones(len(times), dtype=bool))
    return replace(method, outside=True)


def _method(
    name: str,
    moments: Vector,
    residual: Residual,
    motion: tuple[Vector, Vector],
    reference: tuple[Vector, Vector],
    rows: np.ndarray[tuple[int, ...], np.dtype[np.bool_]],
) -> Method:
    """Largest differences between two motions over the ``rows`` compared; ``moments`` (3,) or of each row (n, 3)."""
    spin_axis = np.array([0.0, 0.0, 1.0])
    (body, turn), (other_body, other_turn) = motion, reference
    differences = (
        attitude.angle_between(attitude.rotate(turn, spin_axis), attitude.rotate(other_turn, spin_axis)),
        attitude.angle_between(
            attitude.rotate(turn, body * moments), attitude.rotate(other_turn, other_body * moments)
        ),
        np.linalg.norm(body - other_body, axis=1) / np.linalg.norm(other_body, axis=1),
    )
    axis, momentum, rate = (float(np.max(values[rows], initial=0.0)) for values in differences)
    return Method(name, residual.nutation, residual.momentum_shift, axis, momentum, rate)


def _conserved(flown: Flight) -> tuple[Conservation, Conservation]:
    """|H| and energy along each coast: torques from outside change both, dissipation within the body the energy."""
    firing = [pulse.thrust for pulse in flown.schedule]
    worst = [0.0, 0.0]
    for leg in flown.legs:
        if leg.end == leg.start or any(start <= leg.start and leg.end <= end for start, end in firing):
            continue
        turning, _ = leg.path.motion(np.linspace(leg.start, leg.end, 25))
        moments = flown.moments_at(np.array([leg.start])).ravel()
        for index, value in enumerate((np.linalg.norm(turning * moments, axis=1), turning**2 @ moments)):
            worst[index] = max(worst[index], float(np.ptp(value) / np.max(value)))
    body = flown.spacecraft
    outside, inside = ("disturbances",) * bool(body.disturbances), ("dissipation",) * (body.growth != 0.0)
    return Conservation("|H|", worst[0], outside), Conservation("energy", worst[1], (*outside, *inside))


def _budget(
    spacecraft: Spacecraft, schedule: Schedule, unrounded: Schedule | None, *, expected: bool
) -> tuple[Imperfection, ...]:
    """Residual of the ideal flight, with each imperfection alone, with all of them; and without what plans include.

    Plans include the moments of the body, with the axial parts of its torques, with dissipation and, ``expected``,
    with disturbances: these are part of the ideal flight, so that it leaves little.
    """
    exact = schedule if unrounded is None else unrounded
    inertia = spacecraft.inertia
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
        rows.append((f"{WITHOUT}axial torque", ideal, _sharp(ideal, _transverse(exact))))
    if not inertia.symmetric:
        mean = replace(inertia, moments=(inertia.A, inertia.A, inertia.C))
        rows.append((f"{WITHOUT}I1 ≠ I2", replace(ideal, inertia=mean), sharp))
    if spacecraft.growth != 0.0:
        rows.append((f"{WITHOUT}dissipation", replace(ideal, dissipation=None), sharp))
    rows += [(f"{WITHOUT}{name}", *lacking(ideal, exact, name)) for name in spacecraft.thrust_laws]
    if spacecraft.disturbances and expected:
        rows.append((f"{WITHOUT}disturbances", replace(ideal, disturbances=()), sharp))
    return tuple(
        Imperfection(name, left.nutation, left.momentum_shift, left.axis_error)
        for name, body, pulses in rows
        for left in (flight.flown(body, pulses).residual,)
    )


def _sharp(spacecraft: Spacecraft, schedule: Schedule) -> Schedule:
    """Every pulse as an ideal impulse at its centre, as strong as it acts on ω."""
    effective = flight.effective_impulses(spacecraft, schedule)
    return Schedule(
        tuple(
            Pulse(
                pulse.t,
                0.0,
                pulse.channel,
                np.array([impulse.real, impulse.imag, pulse.impulse[2]]),
                propellant=pulse.propellant,
            )
            for pulse, impulse in zip(schedule, effective, strict=True)
        )
    )


def _transverse(schedule: Schedule) -> Schedule:
    """The schedule without the axial parts of its torques."""
    flat = np.array([1.0, 1.0, 0.0])
    return Schedule(
        tuple(
            replace(pulse, impulse=pulse.impulse * flat, torque=None if pulse.torque is None else pulse.torque * flat)
            for pulse in schedule
        )
    )
