"""Prediction of telemetry from parameters, by closed forms of coasts and the flight of pulses, and
least squares by it: residuals, derivatives, the search, the noise.

Transverse moments that differ are A[[1 + e1, e2], [e2, 1 - e1]] about the axes 1 and 2 of the
file's principal axes: regular at e = 0, where principal axes are any.

With noise of one sigma s on each sample, residuals r = measured - predicted, and the tolerances of
the file as priors,

    minimise  Σ (r/s)² + Σ ((x - x_file)/prior)²,      P = (Jᵀ S⁻² J + prior⁻²)⁻¹,

J the derivatives of the prediction at the minimum: P is then the Cramér-Rao bound, which least
squares attains for normal noise as far as the motion is linear over the errors.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.special import chdtrc

from nutdamp.common import work
from nutdamp.control_loop.sensor import is_blind
from nutdamp.errors import BadRequest, Infeasible, Unsuitable
from nutdamp.estimation.parameters import (
    ACCELERATION,
    CROSSING,
    DIRECTION,
    KIND,
    SUN_ASPECT,
    SUN_PULSE,
    Matrix,
    Parameter,
    Record,
    Sighting,
    Values,
    Vector,
    in_moments,
    parameters,
    prior,
    quantisation,
    tilted,
    turned,
)
from nutdamp.flight.dynamics import Path, free_coast, make_dynamics
from nutdamp.flight.propagation import Flight, flown
from nutdamp.physics import attitude, energy_sink, triaxial
from nutdamp.spacecraft.equipment import ACCELEROMETER
from nutdamp.spacecraft.model import (
    Attitude,
    Inertia,
    Spacecraft,
    SpinState,
    disturbing_after,
)
from nutdamp.spacecraft.schedule import Schedule

PREDICTION = 0.1  # units of `work` of a prediction, besides steps
SHOWN = 2e-4  # of each of its samples
SAMPLE = 1e-3  # of each time of a motion that is new


class Body(NamedTuple):
    """The body that parameters describe: its ``state`` at the start of the record in its own
    principal axes.
    """

    inertia: Inertia
    state: SpinState
    growth: float

    @property
    def sense(self) -> float:
        """Sign σ of H3 at the start."""
        return math.copysign(1.0, self.inertia.axial(self.state.spin))

    @property
    def closed(self) -> bool:
        """True where a coast is a closed form."""
        return self.inertia.symmetric or (self.growth == 0.0 and self.inertia.wheel == 0.0)


class Model:
    """Predictor of a record of a spacecraft.

    ``measured`` (m,) are the samples that there are, signal by signal, or zero where what is off is
    compared; ``signals`` their names and ``signal`` (m,) which of them each is; ``times`` (m,) s
    when; ``samples`` (n, k) of each signal as they came. Raises BadRequest where the spacecraft
    file lacks what a signal needs.
    """

    def __init__(
        self,
        spacecraft: Spacecraft,
        record: Record,
        *,
        unequal: bool | None = None,
        growing: bool = True,
        steady: bool = False,
    ) -> None:
        """``unequal``: with I1 ≠ I2, as the file has it where that is not said; ``growing``: κ is
        estimated; ``steady``: no nutation shows the moments, which stay as the file has them.
        """
        _expect_described(spacecraft, record)
        self.spacecraft, self.record = spacecraft, record
        self.unequal = not spacecraft.inertia.symmetric if unequal is None else unequal
        first, second, _ = spacecraft.inertia.moments
        self._uneven = (first - second) / (first + second)
        self.start = record.start
        self._at: dict[tuple[float, ...], tuple[Body, SpinState]] = {}
        self._last: tuple[tuple[tuple[str, float], ...], tuple[Vector, Vector]] | None = None
        self.parameters = tuple(
            parameters(
                spacecraft,
                record,
                unequal=self.unequal and not steady,
                growing=growing and not steady,
                steady=steady,
            )
        )
        self.prior = prior(spacecraft, self.parameters)
        self._of_sensors = {each.name for each in self.parameters if each.kind.of_sensor}
        self.pulses = self._pulses()
        kinds = record.kinds
        if not kinds:
            raise Infeasible("the record has no samples")
        self.signals = tuple(kind.name for kind in kinds)
        rows = [kind.samples(record) for kind in kinds]
        self.samples = [samples for _, samples in rows]
        self.times = np.concatenate(
            [np.tile(times, kind.parts) for kind, (times, _) in zip(kinds, rows, strict=True)]
        )
        compared = [
            np.zeros(kind.parts * len(samples)) if kind.off else samples[:, 0]
            for kind, samples in zip(kinds, self.samples, strict=True)
        ]
        self.measured = np.concatenate(compared)
        self.signal = np.repeat(np.arange(len(rows)), [len(values) for values in compared])
        # Rows of the motion at all times that show each sample of a signal.
        self._instants, back = np.unique(self.times, return_inverse=True)
        firsts = np.searchsorted(self.signal, np.arange(len(rows)))
        self._rows = [
            back[first : first + len(samples)]
            for first, samples in zip(firsts, self.samples, strict=True)
        ]

    @cached_property
    def reference(self) -> SpinState:
        """The motion at the start of the record as the file has it."""
        spacecraft = self.spacecraft
        # As if the record began at t = 0; a file's disturbances are too small to turn it much
        # before.
        return _state(
            _coast(Body(spacecraft.inertia, spacecraft.initial, spacecraft.growth)), self.start
        )

    def parameter(self, name: str) -> Parameter | None:
        """The one of that name, if it is estimated."""
        return next((parameter for parameter in self.parameters if parameter.name == name), None)

    def turned(self, values: Values) -> Vector:
        """Attitude (4,) of the file's principal axes at the start of the record."""
        # The axis is tilted first, then the body turned about it, by any angle: no turn makes the
        # tilts singular.
        turn = turned(np.array([0.0, 0.0, values.get("attitude_3", 0.0)]))
        return attitude.multiply(
            self.reference.quaternion, attitude.multiply(tilted(values, "attitude"), turn)
        )

    def body(self, values: Values) -> Body:
        """The body that parameters describe."""
        of_file, spacecraft = self.spacecraft.inertia, self.spacecraft
        A, C = in_moments(spacecraft, values)
        rates = np.array(
            [values["omega_1"], values["omega_2"], values.get("omega_3", spacecraft.omega0[2])]
        )
        quaternion = self.turned(values)
        e1, e2 = values.get("unequal_1", self._uneven), values.get("unequal_2", 0.0)
        size = math.hypot(e1, e2)
        if not (A > 0.0 and C > 0.0 and size < 1.0):
            raise Infeasible("no body has such moments of inertia")
        moments = (A, A, C)
        axes = of_file.axes
        if size > 0.0:
            half = 0.5 * math.atan2(e2, e1)
            about = np.array(
                [
                    [math.cos(half), -math.sin(half), 0.0],
                    [math.sin(half), math.cos(half), 0.0],
                    [0, 0, 1],
                ]
            )
            moments = (A * (1.0 + size), A * (1.0 - size), C)
            axes = axes @ about
            rates = about.T @ rates
            quaternion = attitude.multiply(
                quaternion, np.array([math.cos(0.5 * half), 0, 0, math.sin(0.5 * half)])
            )
        state = SpinState.of(rates, quaternion)
        inertia = Inertia(moments, axes, values.get("wheel", of_file.wheel))
        return Body(inertia, state, values.get("growth", spacecraft.growth))

    def motion(self, values: Values, times: Vector) -> tuple[Vector, Vector]:
        """Rates (n, 3) rad/s and quaternions (n, 4) of the file's axes at rising ``times`` (n,)
        s.
        """
        body = self.body(values)
        rates, quaternion = self._path(body, self._fired(values), float(times[-1])).motion(
            times - self.start
        )
        return rates @ body.inertia.axes.T, attitude.multiply(
            quaternion, attitude.from_matrix(body.inertia.axes.T)
        )

    def at(self, values: Values, time: float) -> tuple[Body, SpinState]:
        """The body, and its motion at ``time`` s in its own principal axes; before the record it
        coasts.
        """
        key = (time, *values.values())
        if key not in self._at:
            body = self.body(values)
            schedule = Schedule() if time < self.start else self._fired(values)
            self._at[key] = body, _state(self._path(body, schedule, time), time - self.start)
        return self._at[key]

    def predicted(self, values: Values) -> Vector:
        """Samples of `measured` as they would be without noise, (m,)."""
        work.spend(PREDICTION + SHOWN * len(self.measured))
        rates, quaternion = self._remembered(values)
        A, C = in_moments(self.spacecraft, values)
        e1 = values.get("unequal_1", self._uneven)
        parts = []
        moments = A * (1.0 + e1), A * (1.0 - e1), C
        for name, samples, rows in zip(self.signals, self.samples, self._rows, strict=True):
            seen = Sighting(
                self.spacecraft, values, moments, samples, rates[rows], quaternion[rows]
            )
            parts.append(KIND[name].predicted(seen))
        return np.concatenate(parts)

    def _remembered(self, values: Values) -> tuple[Vector, Vector]:
        """The motion at all times; once for values that differ in what only the sensors are off."""
        key = tuple((name, value) for name, value in values.items() if name not in self._of_sensors)
        if self._last is None or self._last[0] != key:
            times = self._instants
            work.spend(SAMPLE * len(times))
            shows_attitude = any(KIND[name].attitude for name in self.signals)
            bare = np.empty((len(times), 0))
            self._last = (
                key,
                self.motion(values, times)
                if shows_attitude
                else (self._rates(values, times), bare),
            )
        return self._last[1]

    def _rates(self, values: Values, times: Vector) -> Vector:
        body = self.body(values)
        if self.pulses.pulses or self.spacecraft.disturbances or not body.closed:
            return self.motion(values, times)[0]
        inertia, state, growth = body
        (A, _, C), since = inertia.moments, times - self.start
        if not inertia.symmetric:
            return triaxial.free_rates(inertia.moments, state.rates, since) @ inertia.axes.T
        motion = state.omega, state.spin, since, inertia.wheel, body.sense
        omega, spin = energy_sink.rates_on_arc(A, C, growth, *motion)
        return np.column_stack([omega.real, omega.imag, spin]) @ inertia.axes.T

    def _pulses(self) -> Schedule:
        """The pulses fired since the record began; times count from there."""
        pulses = [pulse for pulse in self.record.schedule if pulse.over > self.start]
        for pulse in pulses:
            if pulse.thrust[0] < self.start:
                raise BadRequest(
                    f"the pulse at {pulse.t:g} s is on as the record begins, at {self.start:g} s"
                )
        return Schedule(tuple(pulse.moved(-self.start) for pulse in pulses))

    def _fired(self, values: Values) -> Schedule:
        """The pulses with the thrust factors and delays of their channels."""
        pulses = []
        for pulse in self.pulses:
            factor = values.get(f"thrust {pulse.channel}", 1.0)
            torque = None if pulse.torque is None else factor * pulse.torque
            late = max(values.get(f"delay {pulse.channel}", 0.0), -pulse.thrust[0])
            pulses.append(replace(pulse.moved(late), torque=torque, impulse=factor * pulse.impulse))
        return Schedule(tuple(pulses))

    def _path(self, body: Body, fired: Schedule, until: float) -> Path | Flight:
        """The motion from the start of the record, from which its times count, to ``until`` s from
        t = 0.
        """
        if not fired.pulses and not self.spacecraft.disturbances and body.closed:
            return _coast(body)
        if until < self.start:
            raise Infeasible(
                f"the motion at {until:g} s, before the record begins at {self.start:g} s, "
                "needs an integration "
                "backwards: name a later --at"
            )
        inertia, state, growth = body
        turn = (
            inertia.axes.T @ self.spacecraft.inertia.axes
        )  # from the principal axes of the file to those of the body
        about = complex(turn[0, 0], turn[1, 0])  # both have axis 3
        disturbances = (
            replace(each, transverse=about * each.transverse)
            for each in disturbing_after(self.spacecraft.disturbances, self.start)
        )
        spacecraft = replace(
            self.spacecraft,
            inertia=inertia,
            disturbances=tuple(disturbances),
            omega0=state.rates,
            attitude=Attitude(
                attitude.multiply(state.quaternion, attitude.from_matrix(inertia.axes.T))
            ),
        )
        acting = make_dynamics(spacecraft)
        dynamics = replace(acting, forcing=acting.forcing._replace(growth=growth))
        pulses = tuple(
            replace(
                pulse,
                torque=None if pulse.torque is None else turn @ pulse.torque,
                impulse=turn @ pulse.impulse,
            )
            for pulse in fired
        )
        return flown(spacecraft, Schedule(pulses), until - self.start, dynamics=dynamics)


def _state(path: Path | Flight, time: float) -> SpinState:
    rates, quaternion = path.motion(np.array([time]))
    return SpinState.of(rates[0], quaternion[0])


def _coast(body: Body) -> Path:
    """The motion without pulses; of three moments that without dissipation and wheel."""
    inertia, state, growth = body
    return free_coast(inertia, state, growth=growth, sense=body.sense)


def _expect_described(spacecraft: Spacecraft, record: Record) -> None:
    """Raise BadRequest where the file does not describe what a signal needs."""
    if record.has(ACCELERATION):
        loop = spacecraft.loop
        if loop is None or loop.sensor.kind != ACCELEROMETER:
            problem = (
                "expected kind: accelerometer with its position, for the column acceleration_m_s2"
            )
            raise Unsuitable(("loop", "sensor"), problem)
        if spacecraft.inertia.wheel != 0.0:
            raise Unsuitable(
                ("wheel",), "with a wheel no accelerometer is modelled: leave acceleration_m_s2 out"
            )
        if is_blind(spacecraft.inertia.moments, loop.sensor.position, loop.sensor.axis):
            raise Unsuitable(
                ("loop", "sensor"), "the accelerometer shows nothing of a nutation where it is"
            )
    if len(record.sun_pulses) and (spacecraft.sun is None or spacecraft.sun_sensor is None):
        key = "sun" if spacecraft.sun is None else "sun_sensor"
        raise Unsuitable(
            (key,), f"expected the key {key}: Sun pulses are timed by attitude, sun and sun_sensor"
        )
    if record.has(SUN_ASPECT) and spacecraft.sun is None:
        raise Unsuitable(("sun",), f"expected the key sun, for the columns of {SUN_ASPECT}")
    if record.has(DIRECTION[0]) and spacecraft.attitude is None:
        raise Unsuitable(("attitude",), f"expected the key attitude, for the columns of {CROSSING}")


NORMAL_MAD = 1.4826  # standard deviation of normal numbers over their median magnitude
BROKEN = (
    0.2  # part of the samples of a sensor that are alike, no motion or left out where it is broken
)
ABSURD = 1e3  # times the usual size of a signal from which on a sample is no motion
# noise that a signal has at least, as a share of its largest value: no telemetry has more digits
ROUNDING = 1e-7
EVALUATIONS = 60  # trials of one of the last least-squares searches, at most
TRIAL = 40  # trials of one from a start, at most, which may lead nowhere
GRADIENT = 1e-8  # slope of a cost that is least
STEP = 1e-10  # relative change of it, and of the values, from which on a search is over


def noise_floor(model: Model) -> Vector:
    """Noise that each signal has at least: that of its steps, and rounding."""
    # A signal of zeros has no digits, but its prediction is rounded, as rates and angles are.
    turned = usual(model.spacecraft, "rad/s") * model.record.length
    rounding = float(np.finfo(float).eps) * (1.0 + turned)
    sigmas = []
    for index, name in enumerate(model.signals):
        kind, values = KIND[name], model.measured[model.signal == index]
        step = 0.0
        size = usual(model.spacecraft, kind.unit)
        largest = size if kind.off else float(np.abs(values).max())
        if name == SUN_PULSE:
            step = model.record.sun_step
        elif not kind.off:
            step = quantisation(values)
        sigmas.append(max(step / math.sqrt(12.0), ROUNDING * largest, rounding * size))
    return np.array(sigmas)


def usual(spacecraft: Spacecraft, unit: str) -> float:
    """Size of the motion in the ``unit`` of a signal: a radian, H3/C, what 1 m off the axis feels.

    Of times that in which the body spins by a radian.
    """
    if unit == "s":
        return 1.0 / abs(spacecraft.spin)
    pace = abs(spacecraft.axial) / spacecraft.inertia.C
    return {"rad": 1.0, "rad/s": pace, "m/s²": pace * pace}[unit]


def absurd(spacecraft: Spacecraft, name: str, values: Vector) -> NDArray[np.bool_]:
    """True for samples of a signal that are no motion, however fast; of directions none."""
    return np.asarray(np.abs(values) > ABSURD * max(usual(spacecraft, KIND[name].unit), 1.0)) & (
        not KIND[name].off
    )


def robust(model: Model, misfits: Vector) -> Vector:
    """One sigma of each signal by its median magnitude, which outliers hardly change."""
    sizes = [
        np.median(np.abs(misfits[model.signal == index])) for index in range(len(model.signals))
    ]
    return NORMAL_MAD * np.array(sizes)


def plain(
    model: Model, misfits: Vector, used: NDArray[np.bool_], leverage: Vector | None = None
) -> Vector:
    """One sigma of each signal by its samples that are no outliers; ``leverage`` is what the fit
    takes of each.

    Of n samples with leverages that add up to p the variance is Σr²/(n - p - 2), the mean of its
    posterior.
    """
    sigmas = []
    signal = model.signal[used]
    for index in range(len(model.signals)):
        rows = signal == index
        spent = 0.0 if leverage is None else float(leverage[rows].sum()) + 2.0
        total = float(misfits[used][rows] @ misfits[used][rows])
        sigmas.append(math.sqrt(total / max(float(rows.sum()) - spent, 1.0)))
    return np.array(sigmas)


def named_of(model: Model, values: Iterable[float]) -> dict[str, float]:
    """The values (p,) by the names of their parameters."""
    return {
        parameter.name: float(value)
        for parameter, value in zip(model.parameters, values, strict=True)
    }


def residuals(model: Model, values: Vector) -> Vector:
    """Measured less predicted, (m,)."""
    return model.measured - model.predicted(named_of(model, values))


def scales_of(model: Model) -> Vector:
    """Sizes that residuals of each signal are compared with before its noise is known: a tenth of
    what varies.
    """
    scales = []
    for index, name in enumerate(model.signals):
        kind, values = KIND[name], model.measured[model.signal == index]
        spread = NORMAL_MAD * float(np.median(np.abs(values - np.median(values))))
        varies = spread > ROUNDING * usual(model.spacecraft, kind.unit)
        before = kind.spread * (usual(model.spacecraft, "s") if kind.unit == "s" else 1.0)
        scales.append(0.1 * spread if varies else before)
    return np.array(scales)


FEW_EARLY = 12  # samples before the last pulse below which the whole record counts


def share_left(model: Model, values: Vector) -> float:
    """Least share of a signal's own variation that the residuals still have.

    Until the last pulse, where there are pulses: the motion that they have damped hardly varies.
    """
    misfits = residuals(model, values)
    until = model.start + model.pulses.end if len(model.pulses) else math.inf
    shares = []
    for index, samples in enumerate(model.samples):
        rows = np.flatnonzero(model.signal == index)
        early = model.times[rows] <= until
        if np.count_nonzero(early) < FEW_EARLY:
            early[:] = True
        shown = samples[early[: len(samples)]]
        varied = float(np.median(np.linalg.norm(shown - np.median(shown, axis=0), axis=1)))
        if varied > 0.0:
            shares.append(float(np.median(np.abs(misfits[rows[early]]))) / varied)
    return min(shares, default=0.0)


def jacobian(
    model: Model, values: Vector, which: Iterable[int], *, one_sided: bool = False
) -> Matrix:
    """Derivatives (m, k) of the prediction by the parameters at some positions, by central
    differences.

    ``one_sided`` ones take half as long, and err by a part of about the step, 1e-7: good enough for
    a search.
    """
    columns = []
    base = model.predicted(named_of(model, values)) if one_sided else None
    for index in which:
        ends = np.stack([values, values])
        ends[:, index] += np.array([1.0, 0.0 if one_sided else -1.0]) * model.parameters[index].step
        above = model.predicted(named_of(model, ends[0]))
        below = model.predicted(named_of(model, ends[1])) if base is None else base
        columns.append((above - below) / (ends[0, index] - ends[1, index]))
    return np.column_stack(columns)


def units_of(model: Model) -> Vector:
    """Sizes in which the parameters are searched: their priors, or what is usual."""
    of_unit = {
        "rad/s": 1e-2 * model.spacecraft.fastest,
        "1/s": 0.1 / max(model.record.length, 1e-9),
    }
    sizes = (
        each.prior if math.isfinite(each.prior) else of_unit.get(each.kind.unit, 1e-2)
        for each in model.parameters
    )
    return np.array(list(sizes))


def search(
    model: Model,
    values: Vector,
    noise: Vector,
    rows: NDArray[np.bool_],
    *,
    robust: bool,
    near: bool = True,
) -> tuple[Vector, float]:
    """Values of the least cost over some of the samples, or reached with the budget of work, and
    that cost.
    """
    units = units_of(model)
    weights = 1.0 / noise[model.signal[rows]]
    bound = model.prior[0] * units
    nominal = model.prior[1]

    best = math.inf
    place = values / units

    def errors(scaled: Vector) -> Vector:
        nonlocal best, place
        try:
            misfits = residuals(model, scaled * units)[rows] * weights
        except Infeasible:  # a trial too far to be flown: the search comes nearer
            return np.full(int(rows.sum()) + len(nominal), math.inf)
        every = np.concatenate([misfits, bound @ scaled - nominal])
        cost = float(np.sum(np.sqrt(1.0 + every * every) - 1.0 if robust else 0.5 * every * every))
        if cost < best:
            best = cost
            place = scaled.copy()
        return every

    def derivatives(scaled: Vector) -> Matrix:
        if work.exhausted():
            raise _SpentError
        slopes = jacobian(model, scaled * units, range(len(units)), one_sided=True)[rows] * units
        return np.concatenate([-slopes * weights[:, None], bound])

    # Not so far from the minimum, where steps as long as the derivatives allow lead astray.
    scale: Literal["jac"] | float = "jac" if near else 1.0
    loss: Literal["soft_l1", "linear"] = "soft_l1" if robust else "linear"
    trials = EVALUATIONS if near else TRIAL
    if np.isfinite(errors(place)).all():
        with suppress(_SpentError):
            least_squares(
                errors,
                place,
                derivatives,
                loss=loss,
                x_scale=scale,
                ftol=STEP,
                xtol=STEP,
                gtol=GRADIENT,
                max_nfev=trials,
            )
    return place * units, best


class _SpentError(Exception):
    """The budget of work is spent: the search ends with the best values so far."""


def covariance_of(model: Model, scaled: Matrix) -> Matrix:
    """P of the derivatives over the noise; what neither data nor priors tell is infinite, here very
    large.
    """
    units = units_of(model)
    stacked = np.concatenate([scaled, model.prior[0]]) * units
    _, sizes, turned = np.linalg.svd(stacked, full_matrices=False)
    inverse = turned.T / np.maximum(sizes, 1e-13 * sizes[0])
    covariance = inverse @ inverse.T
    return np.asarray(covariance * np.outer(units, units))


# By which the square of a shift across a curved region counts: (t², s t²) is then in the ellipsoid
# in 95 % of cases, for 2 to 10 parameters, whether s is small or large.
CURVED = 7.0

GROWS = 3.0  # standard deviations of κ from which on it shows
KEPT = 0.9  # share of its prior above which a parameter's sigma is where the data do not tell it
MOVED = 0.1  # share of its prior from which on a parameter has moved from the file
WHITE = 1e-3  # chance below which residuals are not white: one of a thousand records of noise


def unmoved(change: float, sigma: float, prior: float) -> bool:
    """True where the data do not tell a value, and do not move it."""
    return sigma > KEPT * prior and abs(change) <= MOVED * prior


@dataclass(frozen=True, eq=False)
class Fit:
    """Estimate of a spacecraft from a record."""

    model: Model
    values: Vector  # (p,) of the model's parameters, SI
    covariance: Matrix  # (p, p) of these
    noise: Vector  # one sigma of each signal: rad of directions, s of Sun pulses
    used: NDArray[np.bool_]  # (m,) samples that are no outliers
    residuals: Vector  # (m,) measured less predicted
    jacobian: Matrix  # (m, p)
    finished: bool = True  # unless the search ended with its budget of work
    steady: bool = False  # a spin without nutation
    constant: tuple[str, ...] = ()  # signals of one that do not change at all
    coarse: tuple[str, ...] = ()  # signals with steps that are large beside their noise
    causes: tuple[
        str, ...
    ] = ()  # what would bring an estimate that is far from the file back to it

    @property
    def named(self) -> dict[str, float]:
        """The values by name."""
        return named_of(self.model, self.values)

    @property
    def sigmas(self) -> Vector:
        """Standard deviations of the values, (p,)."""
        return np.sqrt(np.diag(self.covariance))

    def index(self, name: str) -> int | None:
        """Position of a parameter; None where it is not estimated."""
        return next(
            (at for at, parameter in enumerate(self.model.parameters) if parameter.name == name),
            None,
        )

    @property
    def grows(self) -> bool:
        """True where κ is estimated and shows:
        then a body of three moments is taken to dissipate.
        """
        at = self.index("growth")
        return at is not None and bool(abs(self.values[at]) > GROWS * self.sigmas[at])

    @cached_property
    def region(self) -> Matrix:
        """The covariance (p, p) whose ellipsoids hold the true values as often as they say, though
        regions are curved.

        A direction of the covariance, followed for one sigma both ways, leaves residuals that do
        not cancel: least squares by J turns them into the shift s across it that the curve takes
        there. It is off by s t² at t sigmas: of P + `CURVED` Σ s sᵀ the 95 % ellipsoid holds 95 %
        of a normal t, for any length of s.
        """
        scale = np.where(self.sigmas > 0.0, self.sigmas, 1.0)
        sizes, turned = np.linalg.eigh(self.covariance / np.outer(scale, scale))
        noise = self.noise[self.model.signal[self.used]]
        slopes = self.jacobian[self.used] / noise[:, None]
        centre = self.model.predicted(self.named)
        shifts = []
        for direction in (scale[:, None] * turned * np.sqrt(np.maximum(sizes, 0.0))).T:
            both_ways = (self.values + direction, self.values - direction)
            try:
                with np.errstate(all="ignore"):
                    ends = [
                        self.model.predicted(named_of(self.model, values)) for values in both_ways
                    ]
            except Infeasible:  # of what nothing is known one sigma may be no body at all
                continue
            bent = (0.5 * (ends[0] + ends[1]) - centre)[self.used] / noise
            shifts.append(self.covariance @ (slopes.T @ bent))
        across = np.array([shift for shift in shifts if np.isfinite(shift).all()]).reshape(
            -1, len(scale)
        )
        return np.asarray(self.covariance + CURVED * across.T @ across)

    @cached_property
    def kept(self) -> tuple[str, ...]:
        """Parameters that the data do not tell, and that stay as the file has them."""
        rows = zip(self.model.parameters, self.values, self.sigmas, strict=True)
        return tuple(
            each.name
            for each, value, sigma in rows
            if unmoved(value - each.file, sigma, each.prior)
        )

    @cached_property
    def resolved(self) -> NDArray[np.bool_]:
        """Of each signal, whether its noise is more than its digits or its steps make anyway."""
        return np.asarray(self.noise > noise_floor(self.model) * (1.0 + 1e-9))

    def whiteness(self, signal: int, lags: int = 40) -> Vector:
        """Autocorrelations of the residuals of a signal, from lag 1 on; of white ones 95 % are
        below 1.96/√n.
        """
        rows = self.used & (self.model.signal == signal)
        deviations = self.residuals[rows] - self.residuals[rows].mean()
        total = float(deviations @ deviations) or 1.0
        return np.array(
            [
                float(deviations[lag:] @ deviations[:-lag]) / total
                for lag in range(1, min(lags, len(deviations) - 1) + 1)
            ]
        )

    def white(self, signal: int) -> bool:
        """True where the autocorrelations are as small as those of white noise (Ljung-Box)."""
        count = int((self.used & (self.model.signal == signal)).sum())
        correlations = self.whiteness(signal, 20)
        lags = np.arange(1, len(correlations) + 1)
        statistic = count * (count + 2) * np.sum(correlations**2 / (count - lags))
        return bool(chdtrc(len(lags), statistic) > WHITE)
