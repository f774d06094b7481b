"""Verification: cross-check by the reference model of the file, conservation laws, error budget."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib.util import find_spec
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from nutdamp.common import work
from nutdamp.errors import Infeasible, MissingExtra
from nutdamp.flight import basilisk, propagation
from nutdamp.flight.dynamics import shed, supplied
from nutdamp.flight.propagation import Flight
from nutdamp.physics import attitude, response
from nutdamp.spacecraft.constraints import commandable
from nutdamp.spacecraft.model import (
    BLOWDOWN,
    LIGHTER,
    TRAVEL,
    VALVES,
    Spacecraft,
    Vector,
)
from nutdamp.spacecraft.schedule import Pulse, Schedule, on_command

if TYPE_CHECKING:
    from nutdamp.flight.reference_model import ReferenceModel

# evaluations of Euler's equations by DOP853, at most: a thousand turns, some 15 seconds
EVALUATIONS = 200_000


def reference_model(spacecraft: Spacecraft, most: int) -> ReferenceModel:
    """Model of the file of a ``spacecraft``, of ``most`` evaluations; raises Infeasible where it is
    of none.
    """
    from nutdamp.flight.reference_model import ReferenceModel  # few commands need scipy

    if spacecraft.document is None:
        raise Infeasible("there is no file to fly by: change its keys by with_, not fields")
    return ReferenceModel(spacecraft.document, spacecraft.sun, most)


def command(model: ReferenceModel, spacecraft: Spacecraft, pulse: Pulse) -> None:
    """Command a ``pulse`` to a ``model``: by channel and times, or as torque or impulse where the
    file has none.
    """
    fires = pulse.channel in [channel.name for channel in spacecraft.channels] and not (
        pulse.torque is None and pulse.command is None
    )
    push = pulse.impulse if pulse.torque is None else pulse.torque
    model.command(pulse.channel, *pulse.loaded, None if fires else spacecraft.inertia.axes @ push)


SAMPLES = 201  # even times at which two flights are compared, besides the edges of the pulses
AGREE = 1e-9  # rad; flights that differ by less agree, DOP853 at its tightest tolerance included


IDEAL, AS_FLOWN = "none: ideal impulses", "all: as flown"  # rows of the budget of every schedule
WITHOUT = "without "  # prefix of the rows of the budget that omit an effect included in plans


@dataclass(frozen=True, slots=True)
class Method:
    """Method of flying the schedule: its residual and its largest differences from the flown
    motion.
    """

    name: str
    nutation: float | None = None  # left, rad
    momentum_shift: float | None = None  # left, rad
    axis: float | None = None  # difference, rad
    momentum: float | None = None  # difference, rad
    rate: float | None = (
        None  # over |ω|, or over |H| by the largest moment where a wheel holds the body still
    )
    missing: str = ""  # reason why it could not be flown
    outside: bool = False  # it shares nothing with the flown motion, and so is to confirm it
    exact: bool = False  # its rates between pulses are those of the flown motion
    # difference of nutation (t = 0, after pulses) and shift, rad, or relative of propellant
    result: float = 0.0

    @property
    def short(self) -> str:
        """Name without the model."""
        return self.name.partition(",")[0]

    @property
    def difference(self) -> float:
        """Largest of those that are to be none, NaN where one is unknown."""
        differences = (
            (self.rate,) if self.exact else (self.axis, self.momentum, self.rate, self.result)
        )
        return float(
            np.max([math.nan if difference is None else difference for difference in differences])
        )


@dataclass(frozen=True, slots=True)
class Imperfection:
    """Residual (rad) with one imperfection alone, everything else ideal; or without one that plans
    include.
    """

    name: str
    nutation: float
    momentum_shift: float
    axis_error: float


@dataclass(frozen=True, slots=True)
class Conservation:
    """Largest relative change of |H| or of the energy on a coast; ``changed``: legitimate cause, if
    any.
    """

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
        """Names of methods that differ from the flown motion by more than `AGREE`, or not by a
        number.
        """
        exact = [method for method in self.methods if method.exact]
        return tuple(
            method.short for method in (*self._outside, *exact) if not method.difference <= AGREE
        )

    @property
    def drifting(self) -> tuple[str, ...]:
        """Quantities that change on coasts without a cause."""
        return tuple(
            quantity.name for quantity in (self.momentum, self.energy) if quantity.kept is False
        )

    @property
    def agree(self) -> bool:
        """True if there are other methods and all of them confirm the flown motion."""
        return bool(self.checks) and not self.disagreeing

    @property
    def _outside(self) -> list[Method]:
        return [method for method in self.methods if method.outside and not method.missing]


def verify(
    spacecraft: Spacecraft,
    schedule: Schedule,
    unrounded: Schedule | None = None,
    *,
    expected: bool = False,
) -> Verification:
    """Fly ``schedule`` by the impulse sum, Taylor series, the reference model and, where installed,
    Basilisk.

    ``unrounded``: the schedule before its commands were rounded to ticks; ``expected``: planned
    with the disturbances.
    """
    end = spacecraft.watched_until(schedule.end)
    judge = propagation.flown(spacecraft, schedule, end)
    times = np.unique(
        np.concatenate([np.linspace(0.0, end, SAMPLES), [pulse.over for pulse in schedule]])
    )
    methods = [
        _closed_form(judge, end, times),
        Method(
            "flown (Taylor series)",
            judge.residual.nutation,
            judge.residual.momentum_shift,
            0.0,
            0.0,
            0.0,
        ),
    ]
    with work.steps(
        2.0 if find_spec("Basilisk") else 1.0
    ):  # all else takes no time beside these two
        with work.steps(end):
            methods.append(_by_the_file(judge, end, times))
        methods.append(
            _from_outside("Basilisk", judge, lambda: basilisk.fly(spacecraft, schedule, end).motion)
        )
    return Verification(
        tuple(methods),
        *_conserved(judge),
        _budget(spacecraft, schedule, unrounded, expected=expected),
    )


def _closed_form(judge: Flight, end: float, times: Vector) -> Method:
    """Exact arcs between effective impulses; where ω3 keeps between them, the rates by the sum (17)
    written out.
    """
    spacecraft, schedule = judge.spacecraft, judge.schedule
    arcs = propagation.by_impulses(spacecraft, schedule, end)
    inertia = spacecraft.inertia
    body, quaternion = arcs.motion(times)
    exact = inertia.symmetric and not spacecraft.disturbances and spacecraft.growth == 0.0
    if exact and shed(spacecraft) is None:
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
    outside = np.all(
        [(times <= pulse.thrust[0]) | (times >= pulse.thrust[1]) for pulse in schedule], axis=0
    )
    between = np.broadcast_to(
        outside, times.shape
    )  # within a pulse the impulse has been given or not
    left = arcs.residual
    apart = _differences(judge, times, _vectors(judge, times, body, quaternion), between)
    # While two pulses with axial torque overlap, the turn of the body within one is not that of its
    # own torque.
    alone = all(one.thrust[1] <= other.thrust[0] for one, other in pairwise(schedule))
    exact = (
        exact
        and shed(spacecraft) is None
        and (alone or not any(pulse.impulse[2] for pulse in schedule))
    )
    return Method("impulse sum (17), arcs", left.nutation, left.momentum_shift, *apart, exact=exact)


def _by_the_file(judge: Flight, end: float, times: Vector) -> Method:
    """The same commands by the reference model: motion, what is left, and propellant."""
    name = "DOP853, the file alone"
    spacecraft = judge.spacecraft
    schedule = judge.schedule
    try:
        model = reference_model(spacecraft, EVALUATIONS)
        for pulse in sorted(schedule, key=lambda pulse: pulse.loaded[0]):
            command(model, spacecraft, pulse)
        path = model.fly(model.initial, 0.0, end, work.reach)
    except Infeasible as reason:
        return Method(name, missing=str(reason), outside=True)
    vectors = model.vectors(path(times), times)
    falls = [one for one in schedule if one.command and one.command.fall]
    # While a tank's pressure falls the flown thrust is one of straight pieces, which only in all is
    # the same.
    even = np.all([(times <= one.thrust[0]) | (times >= one.thrust[1]) for one in falls], axis=0)
    ends = np.column_stack([model.initial, path(schedule.end)])
    first, last = model.vectors(ends, np.array([-1.0, schedule.end]))[
        2
    ]  # before an impulse at t = 0
    shift = math.atan2(float(np.linalg.norm(np.cross(first, last))), float(first @ last))
    nutation = model.nutation(ends[:, 1], schedule.end)
    left = judge.residual
    after = judge.around_pulses()[1]
    used = schedule.propellant
    pairs = [
        (spacecraft.nutation, model.nutation(model.initial, -1.0)),
        (left.nutation, nutation),
        (left.momentum_shift, shift),
        (model.propellant / used if used else 1.0, 1.0),
        *(
            (angle, model.nutation(path(t), t))
            for t, angle in zip(after.t, after.nutation, strict=True)
        ),
    ]
    return Method(
        name,
        nutation,
        shift,
        *_differences(judge, times, vectors, np.broadcast_to(even, times.shape)),
        outside=True,
        result=max(abs(one - other) for one, other in pairs),
    )


def _from_outside(
    name: str, judge: Flight, fly: Callable[[], tuple[Vector, tuple[Vector, Vector]]]
) -> Method:
    """A method that gives times and motion only: its residual is read at the first time after the
    last pulse.
    """
    try:
        times, motion = fly()
    except (MissingExtra, Infeasible) as reason:
        return Method(name, missing=str(reason), outside=True)
    last = int(np.searchsorted(times, judge.schedule.end - 1e-9))
    craft = judge.spacecraft
    rates, quaternion = (part[last] for part in motion)
    inertia = replace(craft.inertia, moments=judge.last_moments)
    shift = float(
        attitude.angle_between(craft.momentum, attitude.rotate(quaternion, inertia.momentum(rates)))
    )
    nutation = inertia.cones(rates, craft.sense).nutation
    return Method(
        name,
        nutation,
        shift,
        *_differences(judge, times, _vectors(judge, times, *motion)),
        outside=True,
    )


def _vectors(
    judge: Flight, times: Vector, rates: Vector, quaternion: Vector
) -> tuple[Vector, Vector, Vector]:
    """Rates in the axes of the file, inertial spin axis and H, (n, 3) each, of a motion of the
    flown spacecraft.
    """
    spacecraft = judge.spacecraft
    momentum = rates * judge.moments_at(times) + np.array([0.0, 0.0, spacecraft.inertia.wheel])
    axis = attitude.rotate(quaternion, np.array([0.0, 0.0, spacecraft.sense]))
    return (
        spacecraft.inertia.in_file_axes(rates, quaternion)[0],
        axis,
        attitude.rotate(quaternion, momentum),
    )


def _differences(
    judge: Flight, times: Vector, vectors: tuple[Vector, Vector, Vector], rows: Any = slice(None)
) -> tuple[float, float, float]:
    """Largest differences of axis, H and rates from those flown at ``times`` (n,) s over the
    ``rows``: see `Method`.
    """
    wheel = judge.spacecraft.inertia.wheel
    still = wheel and float(np.linalg.norm(judge.spacecraft.momentum)) / max(judge.moments)
    flown = _vectors(judge, times, *judge.motion(times))
    sizes = np.maximum(np.linalg.norm(flown[0], axis=1), still)
    differences = (
        *(
            attitude.angle_between(one, other)
            for one, other in zip(vectors[1:], flown[1:], strict=True)
        ),
        np.linalg.norm(vectors[0] - flown[0], axis=1) / sizes,
    )
    axis, momentum, rate = (float(np.max(values[rows], initial=0.0)) for values in differences)
    return axis, momentum, rate


def _conserved(flown: Flight) -> tuple[Conservation, Conservation]:
    """|H| and energy along each coast: torques from outside change both, dissipation within the
    body the energy.
    """
    firing = [pulse.thrust for pulse in flown.schedule]
    worst = [0.0, 0.0]
    for leg in flown.legs:
        if leg.end == leg.start or any(
            start <= leg.start and leg.end <= end for start, end in firing
        ):
            continue
        turning, _ = leg.path.motion(np.linspace(leg.start, leg.end, 25))
        moments = flown.moments_at(np.array([leg.start])).ravel()
        size = np.linalg.norm(
            turning * moments + (0.0, 0.0, flown.spacecraft.inertia.wheel), axis=1
        )
        for index, value in enumerate((size, turning**2 @ moments)):
            whole = float(np.max(value)) or 1.0  # the energy of a despun body at rest is zero
            worst[index] = max(worst[index], float(np.ptp(value)) / whole)
    spacecraft = flown.spacecraft
    outside, inside = (
        ("disturbances",) * bool(spacecraft.disturbances),
        ("dissipation",) * (spacecraft.growth != 0.0),
    )
    return Conservation("|H|", worst[0], outside), Conservation(
        "energy", worst[1], (*outside, *inside)
    )


def _budget(
    spacecraft: Spacecraft, schedule: Schedule, unrounded: Schedule | None, *, expected: bool
) -> tuple[Imperfection, ...]:
    """Residual of the ideal flight, with each imperfection alone, with all, and without those that
    plans include.

    These are three moments, axial torques, dissipation and, ``expected``, disturbances.
    """
    exact = schedule if unrounded is None else unrounded
    inertia = spacecraft.inertia
    ideal = spacecraft if expected else replace(spacecraft, disturbances=())
    sharp = _sharp(ideal, exact)
    rows = [(IDEAL, ideal, sharp)]
    if any(pulse.on_time for pulse in exact):
        rows.append(("pulse width", ideal, exact))
    if spacecraft.limits.tick is not None:
        rounded = Schedule(
            supplied(spacecraft, (commandable(spacecraft, pulse) for pulse in exact))
        )
        rows.append(("command resolution", ideal, _sharp(ideal, rounded)))
    if spacecraft.disturbances and not expected:
        rows.append(("disturbances", spacecraft, sharp))
    rows.append((AS_FLOWN, spacecraft, schedule))
    if any(pulse.impulse[2] != 0.0 for pulse in exact):
        flat = np.array([1.0, 1.0, 0.0])
        pulses = []
        for pulse in exact:
            torque = None if pulse.torque is None else pulse.torque * flat
            pulses.append(replace(pulse, impulse=pulse.impulse * flat, torque=torque))
        rows.append((f"{WITHOUT}axial torque", ideal, _sharp(ideal, Schedule(tuple(pulses)))))
    if not inertia.symmetric:
        mean = replace(inertia, moments=(inertia.A, inertia.A, inertia.C))
        rows.append((f"{WITHOUT}I1 ≠ I2", replace(ideal, inertia=mean), sharp))
    if spacecraft.growth != 0.0:
        rows.append((f"{WITHOUT}dissipation", replace(ideal, dissipation=None), sharp))
    rows += [(f"{WITHOUT}{name}", *_lacking(ideal, exact, name)) for name in spacecraft.thrust_laws]
    if spacecraft.disturbances and expected:
        rows.append((f"{WITHOUT}disturbances", replace(ideal, disturbances=()), sharp))
    ends = [(name, propagation.flown(body, fired).residual) for name, body, fired in rows]
    return tuple(
        Imperfection(name, left.nutation, left.momentum_shift, left.axis_error)
        for name, left in ends
    )


def _sharp(spacecraft: Spacecraft, schedule: Schedule) -> Schedule:
    """Every pulse as an ideal impulse at its centre, at its effective strength on ω."""
    pulses = []
    for pulse, effective in zip(
        schedule, propagation.effective_impulses(spacecraft, schedule), strict=True
    ):
        impulse = np.array([effective.real, effective.imag, pulse.impulse[2]])
        pulses.append(Pulse(pulse.t, 0.0, pulse.channel, impulse, propellant=pulse.propellant))
    return Schedule(tuple(pulses))


def _lacking(spacecraft: Spacecraft, schedule: Schedule, law: str) -> tuple[Spacecraft, Schedule]:
    """Body without one ``law`` of `Spacecraft.thrust_laws`, and the response to the commands of
    ``schedule``.
    """
    if law == VALVES:
        without = replace(
            spacecraft, channels=tuple(channel.of(valve=None) for channel in spacecraft.channels)
        )
    elif law == LIGHTER and spacecraft.tank is not None:
        without = replace(spacecraft, tank=replace(spacecraft.tank, inertia_per_kg=None))
    elif law == TRAVEL:
        without = replace(spacecraft, center_of_mass_per_kg=None)
    elif (
        law == BLOWDOWN and spacecraft.tank is not None
    ):  # once it is empty nothing fires, at full pressure too
        without = replace(
            spacecraft, tank=replace(spacecraft.tank, final_pressure=spacecraft.tank.pressure)
        )
    else:
        without = replace(spacecraft, cold=None)
    known = {channel.name: channel for channel in without.channels}
    fired = []
    for pulse in schedule:
        commanded = pulse.channel in known and pulse.torque is not None
        fired.append(on_command(known[pulse.channel], *pulse.loaded) if commanded else pulse)
    return without, Schedule(supplied(without, fired))
