"""Prediction of telemetry from parameters: closed forms for coasts, the flight where pulses were
fired.

Transverse moments that differ are A[[1 + e1, e2], [e2, 1 - e1]] about the axes 1 and 2 of the
file's principal axes: regular at e = 0, where principal axes are any.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from nutdamp.common import work
from nutdamp.control_loop.sensor import is_blind
from nutdamp.errors import BadRequest, Infeasible, Unsuitable
from nutdamp.estimation.parameters import (
    ACCELERATION,
    CROSSING,
    DIRECTION,
    KIND,
    SUN_ASPECT,
    Parameter,
    Record,
    Sighting,
    Values,
    Vector,
    in_moments,
    parameters,
    prior,
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
