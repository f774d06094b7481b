"""Spacecraft as the planner sees it: inertia, initial motion, actuators, limits, requirement,
dispersions.

Everything here is SI, radians, and in *principal axes*: axis 3 is the spin axis of the plan.
``Inertia.axes`` leads back to the axes of the file, which is where vectors and quaternions are
shown to people.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from nutdamp import units
from nutdamp.common import results
from nutdamp.common.numerics import cleaned
from nutdamp.errors import BadRequest
from nutdamp.physics import attitude
from nutdamp.physics import body as rigid_body
from nutdamp.physics import inertia as principal_moments
from nutdamp.physics.body import ConeAngles
from nutdamp.spacecraft.equipment import Channel as Channel
from nutdamp.spacecraft.equipment import Commands as Commands
from nutdamp.spacecraft.equipment import Loop as Loop
from nutdamp.spacecraft.equipment import Steerable as Steerable
from nutdamp.spacecraft.equipment import SunSensor as SunSensor
from nutdamp.spacecraft.equipment import Thruster as Thruster
from nutdamp.spacecraft.tolerances import Dispersions, SpinTolerance

if TYPE_CHECKING:
    from nutdamp.physics.thruster import Cold, Tank

Vector = NDArray[np.float64]

SLACK = 1e-9  # rad by which a bound of `Keep` may be passed: rounding


@dataclass(frozen=True, slots=True)
class Requirement:
    """Requirement at the end: nutation angle, shift of the angular momentum from t = 0 and its
    angle from a target (``pointing``), rad; None requires nothing.

    ``probability`` (0 to 1) is how surely a dispersed flight must meet it; ``spin``: tolerance of
    the goal's spin.
    """

    nutation: float | None = None
    momentum_shift: float | None = None
    probability: float | None = None
    spin: SpinTolerance | None = None
    pointing: float | None = None


PROBABILITY = 0.997  # share of cases that must comply where the requirement gives none


def required_share(requirement: Requirement | None) -> float:
    """Share of dispersed cases that must comply, 0 to 1."""
    given = None if requirement is None else requirement.probability
    return PROBABILITY if given is None else given


@dataclass(frozen=True, slots=True)
class Goal:
    """Goal of the motion besides zero nutation.

    ``axis`` (3,) is the unit vector, inertial, along which the angular momentum and the spin axis
    are to lie; None is where the angular momentum is at t = 0. ``spin`` is ω3 in rad/s, signed;
    None takes it as it comes. ``sun`` (3,) is the inertial direction by which a train of pulses
    keeps its phase; None is along the great circle to ``axis``. ``sun_angle``: angle of ``axis``
    from the Sun, rad, where it was asked for so.
    """

    axis: Vector | None = None
    spin: float | None = None
    sun: Vector | None = None
    sun_angle: float | None = None


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of every schedule, in seconds: ``blackout`` holds the windows in which no pulse may be
    on.

    ``horizon`` None means `Spacecraft.horizon`'s default.
    """

    horizon: float | None = None
    earliest: float = 0.0
    gap: float = 0.0
    tick: float | None = None
    max_pulses: int | None = None
    blackout: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Keep:
    """Cone of the spin axis: from ``least`` to ``most`` rad away from an inertial unit vector
    ``direction`` (3,).

    None is the direction of the angular momentum, wherever it points: the angle from it is the
    nutation on the way.
    """

    name: str
    direction: Vector | None
    least: float = 0.0
    most: float = math.pi


VALVES, COLD, BLOWDOWN, LIGHTER = "valves", "cold pulses", "blowdown", "falling moments"
TRAVEL = "moving center of mass"  # values of `Spacecraft.thrust_laws`


@dataclass(frozen=True, eq=False)
class Inertia:
    """Principal moments (kg m²) and the rotation that leads from principal axes to the axes of the
    file.

    ``moments`` is (I1, I2, I3), those that `inertia.settled` calls equal made so; ``axes`` is 3×3,
    its columns the principal axes in file axes. ``wheel`` is the momentum h (N m s) of a part that
    turns otherwise, constant along axis 3: a momentum wheel or a despun platform.
    """

    moments: principal_moments.Moments
    axes: Vector = field(default_factory=lambda: np.eye(3))
    wheel: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "moments", principal_moments.settled(self.moments))

    @property
    def A(self) -> float:
        """Transverse moment of the equivalent symmetric body, kg m²: the mean of I1 and I2."""
        return 0.5 * (self.moments[0] + self.moments[1])

    @property
    def C(self) -> float:
        """Moment about the spin axis, kg m²."""
        return self.moments[2]

    @property
    def a(self) -> float:
        """Inertia ratio (A - C)/A, Magnus (4): positive prolate, negative oblate."""
        return rigid_body.ratio(self.A, self.C)

    def axial(self, spin: Any) -> Any:
        """H3 = Cω3 + h, N m s, signed, at a ``spin`` ω3 in rad/s: a number or an array."""
        return self.C * spin + self.wheel

    def equivalent(self, spin: Any) -> Any:
        """Spin H3/C, rad/s, with which the body without wheel has the same H."""
        return spin + self.wheel / self.C

    def momentum(self, rates: Vector) -> Vector:
        """Angular momentum (..., 3) N m s in principal axes at ``rates`` (..., 3) rad/s."""
        return np.asarray(np.asarray(self.moments) * rates + np.array([0.0, 0.0, self.wheel]))

    def nutation_rate(self, spin: float) -> float:
        """Rate ν in rad/s at which a small nutation turns in the body at a ``spin`` ω3: ω3 - H3/A
        where I1 = I2.

        That of the mean of I1 and I2 where a small nutation grows instead.
        """
        if self._swings(spin):
            from nutdamp.physics import triaxial  # three different moments

            return triaxial.body_nutation_rate(self.moments, spin, self.wheel)
        return rigid_body.body_rate(self.A, self.C, spin, self.wheel)

    def nutation_slope(self, spin: float) -> float:
        """Derivative of `nutation_rate` by the spin: ``a`` where I1 = I2."""
        if not self._swings(spin):
            return self.a
        if self.wheel == 0.0:
            return self.nutation_rate(1.0)
        (first, second, third), axial = self.moments, self.axial(spin)
        change = (first - third) * (second * spin - axial) + (second - third) * (
            first * spin - axial
        )
        return float(0.5 * change / (first * second * self.nutation_rate(spin)))

    def linear_rate(self, spin: float) -> tuple[float, float]:
        """Slope and offset (rad/s) of `nutation_rate`, taken as linear about a ``spin``: exact
        where I1 = I2.

        Without a wheel the offset is zero.
        """
        slope = self.nutation_slope(spin)
        return slope, 0.0 if self.wheel == 0.0 else self.nutation_rate(spin) - slope * spin

    def cones(self, rates: Vector, sense: float) -> ConeAngles:
        """Cone angles at the largest nutation of the free motion through ``rates`` (3,) rad/s.

        The spin axis is ``sense``·e3: angles above 90 deg mean a spin that has been reversed.
        """
        if self.symmetric:
            return rigid_body.momentary(self.moments, rates, sense, self.wheel)
        from nutdamp.physics import triaxial  # three different moments

        widest = triaxial.widest_cones(np.array(self.moments), rates, sense, self.wheel)
        return ConeAngles(*map(float, widest))

    def _swings(self, spin: float) -> bool:
        """True if I1 ≠ I2 and a small nutation turns on an ellipse."""
        (first, second, third), wheel = self.moments, self.wheel
        rate = spin if wheel else 1.0  # without a wheel the sign is that of any spin
        return (
            first != second
            and ((first - third) * rate - wheel) * ((second - third) * rate - wheel) > 0.0
        )

    def circle(self, spin: float) -> Vector:
        """Factors (2,) of H1 and H2, at most 1, by which a small nutation turns on a circle."""
        if not self._swings(spin):
            return np.ones(2)
        (first, second, _), axial = self.moments, self.axial(spin)
        ratio = math.sqrt((first * spin - axial) / first / ((second * spin - axial) / second))
        return np.array([ratio, 1.0]) / max(ratio, 1.0)

    def nutating(self, spin: float) -> float:
        """Transverse moment of the symmetric body whose small nutation turns as fast, kg m²."""
        return (
            self.A
            if self.symmetric
            else float(self.axial(spin)) / (spin - self.nutation_rate(spin))
        )

    @property
    def shape(self) -> str:
        """``prolate``, ``oblate`` or ``sphere``; ``gyrostat`` with a wheel."""
        return "gyrostat" if self.wheel else rigid_body.shape(self.A, self.C)

    @property
    def symmetric(self) -> bool:
        """True if I1 = I2, so that the closed forms hold exactly."""
        return self.moments[0] == self.moments[1]

    @property
    def tensor(self) -> Vector:
        """Inertia tensor in the axes of the file, (3, 3) kg m², to 14 digits."""
        if self.aligned:
            return np.diag(self.moments)
        tensor = self.axes @ np.diag(self.moments) @ self.axes.T
        digits = 13 - math.floor(math.log10(max(self.moments)))
        return np.asarray(np.round(0.5 * (tensor + tensor.T), digits)) + 0.0

    @property
    def aligned(self) -> bool:
        """True if the principal axes are the axes of the file."""
        return bool(np.array_equal(self.axes, np.eye(3)))

    def in_file(self, vector: Vector) -> Vector:
        """Vector (3,) in the axes of the file from principal axes, without rounding noise."""
        return cleaned(self.axes @ vector)

    def in_file_axes(self, rates: Vector, quaternion: Vector) -> tuple[Vector, Vector]:
        """Rates (..., 3) and quaternions (..., 4) of the principal axes, in those of the file."""
        if self.aligned:
            return rates, quaternion
        return rates @ self.axes.T, attitude.multiply(quaternion, attitude.from_matrix(self.axes.T))


@dataclass(frozen=True, slots=True)
class Disturbance:
    """A torque that nobody commands, in principal body axes.

    ``transverse`` M1 + iM2 (N m, at t = 0) turns about axis 3 of the body at ``rate`` rad/s; 0 is
    fixed in the body, minus the spin is nearly fixed in space. ``axial`` M3 (N m) is constant. It
    acts from ``begin`` to ``end`` s.
    """

    transverse: complex
    axial: float = 0.0
    rate: float = 0.0
    name: str = ""
    begin: float = 0.0
    end: float = math.inf

    def within(self, start: float, end: float) -> tuple[float, float]:
        """Time, s, from which it acts between ``start`` and ``end`` s, and for how long."""
        begin = max(start, self.begin)
        return begin, max(min(end, self.end) - begin, 0.0)

    def after(self, time: float) -> Disturbance:
        """The same, where times count from ``time`` s."""
        turned = self.transverse * cmath.exp(1j * self.rate * time)
        begin = max(self.begin - time, 0.0) if self.begin > 0.0 else 0.0
        return replace(self, transverse=turned, begin=begin, end=self.end - time)


def disturbing_after(disturbances: Iterable[Disturbance], time: float) -> tuple[Disturbance, ...]:
    """Disturbances that are not over at ``time`` s, from which their times count then."""
    return tuple(each.after(time) for each in disturbances if each.end > time)


@dataclass(frozen=True, slots=True)
class Attitude:
    """Attitude at t = 0 from the file: unit quaternion body (file axes) -> frame, scalar first.

    All directions in space of a spacecraft, and of its flights, are in this ``frame``.
    """

    quaternion: Vector
    epoch: str | None = None
    frame: str | None = None

    @property
    def ecliptic(self) -> bool:
        """True where the two angles of a direction are longitude and latitude."""
        return (self.frame or "").startswith("ECLIP")

    @property
    def axes(self) -> Vector:
        """(3, 3), whose columns are the axes of the frame in EME2000."""
        from nutdamp.physics import frames  # frames other than EME2000

        if self.epoch is None:
            return frames.frame_axes(self.frame)
        from nutdamp.common.time import Epoch  # an epoch

        return frames.frame_axes(self.frame, Epoch.parse(self.epoch).days_of_j2000)

    def seen_in(self, frame: str | None, epoch: str | None = None) -> Attitude:
        """The same attitude in another frame, of the date of an ``epoch``, which is then the new
        one; not turned where a frame has no name.
        """
        other = replace(self, epoch=epoch or self.epoch)
        if frame is None or self.frame is None:
            return other
        other = replace(other, frame=frame)
        turn = attitude.from_matrix(other.axes.T @ self.axes)
        return replace(other, quaternion=attitude.multiply(turn, self.quaternion))


@dataclass(frozen=True, slots=True, eq=False)
class Orbit:
    """Orbital state at t = 0: (3,) m and (3,) m/s from ``center``, in the attitude's frame.

    Nothing is computed from it: messages to flight dynamics carry it.
    """

    position: Vector
    velocity: Vector
    center: str = "EARTH"


@dataclass(frozen=True, slots=True)
class SpinState:
    """State of the motion at one time, for the closed forms.

    ``omega`` is ω1 + iω2 in rad/s, ``spin`` is ω3 in rad/s, ``quaternion`` (4,) body -> inertial,
    scalar first.
    """

    omega: complex
    spin: float
    quaternion: Vector

    @classmethod
    def of(cls, rates: Vector, quaternion: Vector) -> SpinState:
        """State with ``rates`` (3,) in rad/s."""
        first, second, third = rates.tolist()
        return cls(complex(first, second), third, quaternion)

    @property
    def rates(self) -> Vector:
        """(ω1, ω2, ω3) in rad/s."""
        return np.array([self.omega.real, self.omega.imag, self.spin])


class SourceFile(Protocol):
    """Origin of a spacecraft: its file."""

    def changed(self, keys: Mapping[str, object]) -> Spacecraft:
        """Spacecraft with keys of its file changed; raises FaultyFile or BadRequest."""


LONG_BEAT = 20.0
"""Inertial nutation periods after a disturbance begins within which its beat, of the period in the
body, is looked for: that period is without end where the nutation stands still in the body.
"""


@dataclass(frozen=True, eq=False, repr=False)
class Spacecraft(results.Data, results.Shown):
    """Spinning rigid body with its motion at t = 0 and its actuators.

    ``name``; ``inertia`` kg m²; ``omega0`` (3,) rad/s in principal axes; ``attitude`` at t = 0, or
    None; ``mass`` in kg or None; ``channels`` and a ``steerable`` torquer that it fires; ``goal``,
    ``requirement`` and ``limits``, in rad, s and rad/s; ``disturbances`` N m. ``center_of_mass``
    (3,) m where the file gives it, in its axes, and ``center_of_mass_per_kg``, its travel with the
    propellant used, (3,) m/kg in principal axes; ``dissipation`` the time constant in s with which
    energy dissipation lets the nutation grow or decay, or None; ``nutation_grows`` says which,
    None: by shape; ``dispersions``: how far true values may differ; ``object_id`` names it in
    messages, which carry ``orbit``; ``sun`` (3,) is the inertial unit vector to the Sun, where it
    is known; ``keep`` are cones for the spin axis; ``commands`` is what blocks fired from the Sun
    pulses of ``sun_sensor`` may hold; ``cold`` and ``tank`` make pulses weaker than the thrusters
    say, None where they are not; ``loop`` damps by what a sensor shows; ``built_in``: the built-in
    example, since no file was named; ``document`` are the values of the file, SI, by which `verify`
    flies on its own; ``source`` is what it was read from, None once a field is replaced.
    """

    name: str
    inertia: Inertia
    omega0: Vector
    mass: float | None = None
    attitude: Attitude | None = None
    channels: tuple[Channel, ...] = ()
    steerable: Steerable | None = None
    requirement: Requirement | None = None
    limits: Limits = field(default_factory=Limits)
    disturbances: tuple[Disturbance, ...] = ()
    dissipation: float | None = None
    nutation_grows: bool | None = None
    goal: Goal = field(default_factory=Goal)
    dispersions: Dispersions | None = None
    object_id: str | None = None
    orbit: Orbit | None = None
    sun: Vector | None = None
    keep: tuple[Keep, ...] = ()
    sun_sensor: SunSensor | None = None
    commands: Commands | None = None
    cold: Cold | None = None
    tank: Tank | None = None
    loop: Loop | None = None
    center_of_mass: Vector | None = None
    center_of_mass_per_kg: Vector | None = None
    built_in: bool = False
    document: object = None
    source: SourceFile | None = field(default=None, init=False)

    def with_(self, **keys: object) -> Spacecraft:
        """Spacecraft with keys of its file changed: ``with_(limits={"horizon": "300 s"},
        mass=210.0)``.

        Of a mapping only the keys that are in it change, so that the other limits keep their
        values; entries of a list are named by their ``name``: ``thrusters={"T1": {"force": "12
        N"}}``. All is checked as the file is. Raises FaultyFile with everything wrong, BadRequest
        for what no file can hold or where no file was read.
        """
        if self.source is None:
            raise BadRequest(
                "with_: expected a spacecraft from nutdamp.load, read or example, "
                "with no field replaced"
            )
        return self.source.changed(keys)

    def replace(self, **fields: object) -> Spacecraft:
        """Spacecraft with fields replaced, in SI and principal axes: ``replace(mass=210.0)``.

        Names, types and signs are checked; `with_` checks all that a file is checked for, and keeps
        the ``document``. Raises BadRequest.
        """
        from nutdamp.physics import thruster  # types of fields

        changed = units.replaced(self, {"document": None, **fields}, vars(thruster))
        for name in ("mass", "dissipation"):
            value = getattr(changed, name)
            units.expect(value is None or value > 0.0, name, value, "a number above zero")
        return changed

    @property
    def thrust_laws(self) -> tuple[str, ...]:
        """Effects that make pulses other than rectangles of the thrust of the file, in words."""
        valves = any(channel.valve is not None for channel in self.channels)
        laws = (VALVES, valves), (COLD, self.cold is not None), (BLOWDOWN, self.tank is not None)
        lighter = self.tank is not None and self.tank.inertia_per_kg is not None
        moves = self.center_of_mass_per_kg is not None
        return tuple(name for name, holds in (*laws, (LIGHTER, lighter), (TRAVEL, moves)) if holds)

    @property
    def rates(self) -> Vector:
        """Body rates at t = 0, (3,) rad/s, in the axes of the file."""
        return self.inertia.in_file(self.omega0)

    @property
    def watched(self) -> tuple[Keep, ...]:
        """Cones that the spin axis has to keep; also the Sun, if it is known and no cone is about
        it.
        """
        if self.sun is None or any(
            cone.direction is not None and np.array_equal(cone.direction, self.sun)
            for cone in self.keep
        ):
            return self.keep
        return (*self.keep, Keep("Sun", self.sun))

    @property
    def growth(self) -> float:
        """Growth rate κ (1/s) of a small nutation by energy dissipation; negative where it decays.

        By shape it grows in a prolate body and decays in an oblate one, unless the file says what
        it does, as of a boom that the Sun heats. A sphere has no energy to give, nor has a body in
        which ω stands still for its wheel: zero. See `physics.energy_sink`.
        """
        still = self.nutation_rate == 0.0 and (
            self.nutation_grows is None or self.inertia.wheel != 0.0
        )
        if self.dissipation is None or still:
            return 0.0
        grows = self.inertia.a > 0.0 if self.nutation_grows is None else self.nutation_grows
        return 1.0 / self.dissipation if grows else -1.0 / self.dissipation

    @property
    def damper(self) -> tuple[float, float]:
        """Shares u and v of `energy_sink` at t = 0, for the angle from the spin axis."""
        from nutdamp.physics import energy_sink  # dissipation

        inertia = self.inertia
        size = float(np.linalg.norm(self.momentum))
        return energy_sink.damper(inertia.A, inertia.C, self.sense * inertia.wheel, size, 1.0)

    def spin_drift(self, start: float, end: float) -> float:
        """Mean spin acceleration by the axial disturbances from ``start`` to ``end`` s, rad/s²; 0
        of no time.
        """
        first, last = min(start, end), max(start, end)
        axial = (each.axial * each.within(first, last)[1] for each in self.disturbances)
        return math.fsum(axial) / (self.inertia.C * (last - first)) if last > first else 0.0

    @property
    def edges(self) -> list[float]:
        """Times after t = 0, s, at which disturbances begin or end, in order."""
        times = {time for each in self.disturbances for time in (each.begin, each.end)}
        return sorted(time for time in times if 0.0 < time < math.inf)

    def watched_until(self, last: float) -> float:
        """Time, s, to which a flight with pulses until ``last`` s is judged.

        The later of two times: a nutation period after the last pulse and after the last edge of a
        disturbance, and `beats_until`.
        """
        return max(max([last, *self.edges]) + self.inertial_period, self.beats_until)

    @property
    def beats_until(self) -> float:
        """Time, s, at which the nutation has gone through its beat under the last disturbance that
        begins after t = 0; 0 without one. The beat has the nutation period in the body.
        """
        begun = max((each.begin for each in self.disturbances), default=0.0)
        if begun <= 0.0:
            return 0.0
        return begun + min(self.body_period, LONG_BEAT * self.inertial_period)

    @property
    def torquer(self) -> Steerable | None:
        """Steerable torquer. An ideal one is assumed if the file has no actuator."""
        if self.steerable is None and not self.channels:
            return Steerable()
        return self.steerable

    @property
    def horizon(self) -> float:
        """End of the planning time, s.

        Default: 20 × the longer of the nutation periods seen in the body and inertially; a sphere:
        the latter.
        """
        if self.limits.horizon is not None:
            return self.limits.horizon
        inertia, inertial = self.inertia, self.inertial_period
        body = rigid_body.body_period(inertia.A, inertia.C, self.spin, inertia.wheel)
        return 20.0 * (max(body, inertial) if math.isfinite(body) else inertial)

    @cached_property
    def initial(self) -> SpinState:
        """State at t = 0; without an attitude in the file in the frame `attitude.frame_n`."""
        omega = complex(self.omega0[0], self.omega0[1])
        spin = float(self.omega0[2])
        if self.attitude is None:
            first, second, third = self.inertia.momentum(self.omega0).tolist()
            # With moments of one, rates are momenta: N goes by the true H.
            quaternion = attitude.frame_n(1.0, 1.0, complex(first, second), third)
        else:
            quaternion = attitude.multiply(
                self.attitude.quaternion, attitude.from_matrix(self.inertia.axes)
            )
        return SpinState(omega, spin, quaternion)

    @property
    def axis(self) -> Vector:
        """Spin axis at t = 0, inertial unit vector (3,)."""
        return attitude.rotate(self.initial.quaternion, np.array([0.0, 0.0, self.sense]))

    @cached_property
    def momentum(self) -> Vector:
        """Angular momentum at t = 0 in the inertial frame, (3,) N m s."""
        start = self.initial
        return attitude.rotate(start.quaternion, self.inertia.momentum(start.rates))

    @cached_property
    def target_axis(self) -> Vector:
        """Direction in which the angular momentum is to end, inertial unit vector (3,)."""
        if self.goal.axis is not None:
            return self.goal.axis
        momentum = self.momentum
        return np.asarray(momentum / np.linalg.norm(momentum))

    @property
    def to_turn(self) -> float:
        """Angle from H at t = 0 to the target axis, rad; exactly zero without a target."""
        return (
            0.0
            if self.goal.axis is None
            else float(attitude.angle_between(self.momentum, self.goal.axis))
        )

    @property
    def turning_impulse(self) -> float:
        """|H3| β in N m s with β = `to_turn`: lower bound on the impulse that turns H of a
        symmetric body to the target.
        """
        return abs(self.axial) * self.to_turn

    def angles_of(self, direction: Vector) -> tuple[float | None, float]:
        """Angles of an inertial ``direction`` (3,), rad.

        Right ascension in [0, 2π) and declination where the file has an attitude; else azimuth in
        [0, 2π) and tilt, as `directions.direction_in_n` takes them. Right ascension and azimuth are
        None at the pole, where there is none.
        """
        about, declination = attitude.sphere_angles(direction)
        return about, math.atan2(
            math.hypot(*direction[:2]), direction[2]
        ) if self.attitude is None else declination

    def utc(self, time: float, digits: int | None = None) -> str | None:
        """Date and time in UTC ``time`` s after the epoch, rounded to ``digits`` of a second.

        None without an epoch and after the year 9999.
        """
        if self.attitude is None or self.attitude.epoch is None:
            return None
        from nutdamp.common.time import DIGITS, Epoch  # an epoch

        try:
            moment = Epoch.parse(self.attitude.epoch).plus(time)
            return f"{moment.rounded(DIGITS if digits is None else digits)}Z"
        except ValueError:
            return None

    @cached_property
    def widest(self) -> ConeAngles:
        """Cone angles at the largest nutation of the free motion; constant where I1 = I2."""
        return self.inertia.cones(self.omega0, self.sense)

    @property
    def nutation(self) -> float:
        """Largest nutation angle θ of the free motion from t = 0, rad, Magnus (19)."""
        return self.widest.nutation

    @property
    def tilt(self) -> float:
        """Angle between H and the spin axis at t = 0, rad; at most `nutation`."""
        return rigid_body.momentary(
            self.inertia.moments, self.omega0, self.sense, self.inertia.wheel
        ).nutation

    @property
    def transverse_rate(self) -> float:
        """|ω0| at t = 0, rad/s."""
        return math.hypot(self.omega0[0], self.omega0[1])

    @property
    def spin(self) -> float:
        """ω3 at t = 0, rad/s, signed."""
        return float(self.omega0[2])

    @property
    def axial(self) -> float:
        """H3 = Cω3 + h at t = 0, N m s, signed."""
        return float(self.inertia.axial(self.spin))

    @property
    def sense(self) -> float:
        """Sign σ of H3 at t = 0: the spin axis is σ·e3, also through a reversal."""
        return math.copysign(1.0, self.axial)

    @property
    def nutation_rate(self) -> float:
        """Rate ν of a small nutation in the body at t = 0, rad/s, signed."""
        return self.inertia.nutation_rate(self.spin)

    @property
    def fastest(self) -> float:
        """Faster of spin and nutation in the body, rad/s. It sets how fine moments are chosen."""
        return max(abs(self.spin), abs(self.nutation_rate))

    @property
    def body_period(self) -> float:
        """Period of a small nutation seen in the body, Magnus (12), s; infinite for a sphere."""
        rate = abs(self.nutation_rate)
        return 2 * math.pi / rate if rate > 0.0 else math.inf

    @property
    def motion_period(self) -> float:
        """Period of ω in the body, s; with I1 ≠ I2 that of the actual motion (no wheel)."""
        if self.inertia.symmetric or self.inertia.wheel:
            return self.body_period
        from nutdamp.physics import triaxial  # three different moments

        return triaxial.nutation_period(self.inertia.moments, self.omega0)

    @property
    def inertial_period(self) -> float:
        """Nutation period seen inertially, 2π A/|H|, s; with I1 ≠ I2 that of a small nutation."""
        inertia = self.inertia
        spin = self.inertia.equivalent(self.spin)
        return rigid_body.inertial_period(
            inertia.nutating(self.spin), inertia.C, self.transverse_rate, spin
        )

    @property
    def nutation_period(self) -> float:
        """Nutation period seen in the body, s; of a sphere the inertial one."""
        return self.body_period if math.isfinite(self.body_period) else self.inertial_period

    @property
    def least_impulse(self) -> float:
        """A |ω0| in N m s: lower bound on the impulse that removes the nutation of a symmetric body
        without dissipation.
        """
        return self.inertia.A * self.transverse_rate
