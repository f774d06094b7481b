"""Flight by Basilisk, an independent simulator (extra ``verify``): a check from outside the
project.

Its clock counts whole nanoseconds, and a stop off the grid of its steps is made early. So every
stretch of constant torque is flown in a unit of time of its own, κ seconds, in which it lasts a
whole number of steps: the rates go in as κω, the torque as κ²M, which leaves Euler's equations as
they are. A wheel is a balanced reaction wheel without motor torque, whose rotor adds its own axial
moment to the hub: the rotor keeps its momentum I_w (ω3 + Ω) = h.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from types import SimpleNamespace
from typing import Any

import numpy as np

from nutdamp.errors import BadRequest, Infeasible, MissingExtra
from nutdamp.flight.dynamics import shed
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.schedule import Schedule

ROTOR = 0.01  # axial moment of the rotor of a wheel, over that of the body: any will do
ACCEPT_ALL = 1e30  # tolerance that no step fails, so that the integrator keeps its step

TURN, TURN_TURNING = 0.1, 0.05
"""Largest turn of the body within a default step, rad, also where a torque turns in the body:
errors below rounding.
"""

# steps of a flight, at most: three thousand turns at the default step, some ten seconds
MOST_STEPS = 200_000
GAUSS = (
    math.sqrt(3.0) / 6.0
)  # distance of the two Gauss nodes from the middle of an interval, over its length


@dataclass(frozen=True, eq=False)
class BasiliskFlight:
    """Motion flown by Basilisk, in principal axes; where the rates jump, the row is just after the
    jump.
    """

    t: Vector  # (n,) s
    rates: Vector  # (n, 3) rad/s
    quaternion: Vector  # (n, 4) body -> inertial, scalar part not negative
    step: float  # longest step of integration taken, s

    @property
    def motion(self) -> tuple[Vector, tuple[Vector, Vector]]:
        """Times, and rates with quaternions."""
        return self.t, (self.rates, self.quaternion)


def fly(
    spacecraft: Spacecraft,
    schedule: Schedule,
    until: float,
    *,
    step: float | None = None,
    samples: int = 50,
) -> BasiliskFlight:
    """Fly ``schedule`` from 0 to ``until`` s with Basilisk, real widths and true principal moments.

    There is a row for each of ``samples`` even times from 0 to ``until`` and each edge of a pulse
    in between. ``step`` is the longest step in s, see `default_step`; torques that change are those
    of `stretches`. Raises MissingExtra without Basilisk, Infeasible where there is energy
    dissipation (a rigid hub has none), moments fall, or the flight takes more than `MOST_STEPS`,
    BadRequest for times that cannot be.
    """
    if not 0.0 <= until < math.inf:
        raise BadRequest(f"until = {until} s: expected a time of 0 s or later")
    if step is not None and not 0.0 < step < math.inf:
        raise BadRequest(f"step = {step} s: expected more than 0 s")
    if spacecraft.growth != 0.0:
        raise Infeasible(
            "Basilisk is flown without energy dissipation, because its hub is rigid, "
            "and this body has it"
        )
    if shed(spacecraft) is not None:
        raise Infeasible("it flies with constant moments, and those of the file fall")
    longest = default_step(spacecraft, schedule, until) if step is None else step
    if until > MOST_STEPS * longest:
        raise Infeasible(f"the motion takes more than {MOST_STEPS} steps of Basilisk")
    hub = _Hub(spacecraft, longest)
    edges = {edge for pulse in schedule for edge in pulse.edges if 0.0 < edge < until}
    edges |= {edge for edge in spacecraft.edges if edge < until}
    knots = sorted({0.0, until, *np.linspace(0.0, until, samples).tolist(), *edges})
    motion: list[tuple[Vector, Vector]] = []
    taken = 0.0
    for now, end in zip(knots, [*knots[1:], until], strict=True):
        for pulse in schedule:
            if pulse.on_time == 0.0 and pulse.t == now:
                hub.kick(pulse.impulse)
        motion.append(hub.motion)
        if end > now:
            for duration, torque in stretches(spacecraft, schedule, now, end, longest):
                taken = max(taken, hub.coast(duration, torque))
    rates, quaternion = (np.array(column) for column in zip(*motion, strict=True))
    return BasiliskFlight(np.array(knots), rates, quaternion, taken)


def default_step(spacecraft: Spacecraft, schedule: Schedule, until: float) -> float:
    """Step in s by the fastest that the body can ever turn.

    √(2T) = √(Σ Ij ωj²) is constant without torque, grows by |J|/√Imin at most under an impulse J,
    and bounds |ω| √Imin.
    """
    moments = np.asarray(spacecraft.inertia.moments)
    rates = spacecraft.initial.rates
    lasting = math.fsum(
        math.hypot(abs(each.transverse), each.axial) for each in spacecraft.disturbances
    )
    pushes = schedule.total_impulse + until * lasting
    least = math.sqrt(float(moments.min()))
    pace = (math.sqrt(float(moments @ rates**2)) + pushes / least) / least
    pace += abs(spacecraft.inertia.wheel) / float(moments.min())
    turning = [abs(each.rate) for each in spacecraft.disturbances if each.rate != 0.0]
    angle, pace = (TURN_TURNING, pace + max(turning)) if turning else (TURN, pace)
    return angle / pace if pace > 0.0 else 1.0


def stretches(
    spacecraft: Spacecraft, schedule: Schedule, start: float, end: float, longest: float
) -> Iterator[tuple[float, Vector]]:
    """Durations (s) and constant torques (3,) (N m) that make up a stretch between edges of pulses
    and disturbances.

    One that turns, rises or falls becomes two constant ones an interval, mixed from its values at
    the Gauss nodes so that the mean and the first moment over time are kept: the commutator-free
    Magnus method of fourth order (Celledoni, Marthinsen, Owren 2003), in which each half step is a
    motion under constant torque.
    """
    constant, slope = np.zeros(3), np.zeros(3)
    for torque, rise in filter(None, (pulse.push(start, end) for pulse in schedule)):
        constant += torque
        slope += 0.0 if rise is None else rise
    acting = [each for each in spacecraft.disturbances if each.begin <= start and end <= each.end]
    for disturbance in acting:
        constant[2] += disturbance.axial
        if disturbance.rate == 0.0:
            constant[:2] += (disturbance.transverse.real, disturbance.transverse.imag)
    turning = [(each.transverse, each.rate) for each in acting if each.rate != 0.0]
    if not turning and not slope.any():
        yield end - start, constant
        return
    count = max(math.ceil((end - start) / (2.0 * longest)), 1)
    interval = (end - start) / count
    for index in range(count):
        middle = start + (index + 0.5) * interval
        early, late = (
            complex(
                sum(
                    size * np.exp(1j * rate * (middle + shift * interval)) for size, rate in turning
                )
            )
            for shift in (-GAUSS, GAUSS)
        )
        mean, lean = 0.5 * (early + late), 2.0 * GAUSS * (early - late)
        even = constant + slope * (middle - start)
        uneven = -4.0 * GAUSS * GAUSS * interval * slope
        for turned, ramp in ((mean + lean, uneven), (mean - lean, -uneven)):
            yield 0.5 * interval, even + ramp + np.array([turned.real, turned.imag, 0.0])


class _Hub:
    """Rigid hub in Basilisk with a torque on it, in the state of ``spacecraft`` at t = 0, in
    principal axes.
    """

    def __init__(self, spacecraft: Spacecraft, longest: float) -> None:
        basilisk = _modules()
        self._longest, self._period, self._clock = longest, max(round(longest * 1e9), 1), 0
        self._moments = np.asarray(spacecraft.inertia.moments)
        initial = spacecraft.initial
        self._body = basilisk.spacecraft.Spacecraft()
        self._body.ModelTag = "body"
        rotor = ROTOR * self._moments[2] if spacecraft.inertia.wheel else 0.0  # any share will do
        self._body.hub.IHubPntBc_B = np.diag(self._moments + np.array([0.0, 0.0, rotor])).tolist()
        self._body.hub.omega_BN_BInit = _column(initial.rates)
        upper = -initial.quaternion if initial.quaternion[0] < 0.0 else initial.quaternion
        self._body.hub.sigma_BNInit = _column(
            upper[1:] / (1.0 + upper[0])
        )  # MRPs e·tan(φ/4), |σ| <= 1
        self._torque = basilisk.extForceTorque.ExtForceTorque()
        self._torque.ModelTag = "torque"
        self._body.addDynamicEffector(self._torque)
        self._speed, self._wheel = 0.0, None
        if rotor:
            self._speed = spacecraft.inertia.wheel / rotor  # absolute, rad/s
            turning = basilisk.reactionWheelStateEffector.RWConfigPayload()
            turning.gsHat_B, turning.rWB_B = [[0.0], [0.0], [1.0]], [[0.0], [0.0], [0.0]]
            turning.Js, turning.Omega = rotor, self._speed - float(initial.rates[2])
            turning.RWModel = basilisk.messaging.BalancedWheels
            turning.u_max = -1.0
            turning.Omega_max = -1.0
            self._wheel = basilisk.reactionWheelStateEffector.ReactionWheelStateEffector()
            self._wheel.ModelTag = "wheel"
            self._wheel.addReactionWheel(turning)
            self._body.addStateEffector(self._wheel)
        # Kept here, as all its objects are: Basilisk's own hold on them is a plain pointer.
        self._integrator = basilisk.svIntegrators.svIntegratorRKF78(self._body)
        self._integrator.relTol = self._integrator.absTol = (
            ACCEPT_ALL  # no step fails, so that it keeps its step
        )
        self._body.setIntegrator(self._integrator)
        self._simulation = basilisk.SimulationBaseClass.SimBaseClass()
        self._simulation.bskLogger.setLogLevel(
            basilisk.bskLogging.BSK_ERROR
        )  # handed on to the models
        process = self._simulation.CreateNewProcess("flight")
        process.addTask(self._simulation.CreateNewTask("dynamics", self._period))
        for model in (*([self._wheel] if rotor else []), self._body, self._torque):
            self._simulation.AddModelToTask("dynamics", model)
        self._simulation.InitializeSimulation()
        self._rates = self._body.dynManager.getStateObject(self._body.hub.nameOfHubOmega)
        self._attitude = self._body.dynManager.getStateObject(self._body.hub.nameOfHubSigma)
        self._spun = self._wheel and self._body.dynManager.getStateObject(
            self._wheel.nameOfReactionWheelOmegasState
        )

    @property
    def motion(self) -> tuple[Vector, Vector]:
        """Rates (3,) in rad/s and quaternion (4,) body -> inertial, now."""
        return np.ravel(self._rates.getState()), _from_mrp(np.ravel(self._attitude.getState()))

    def kick(self, impulse: Vector) -> None:
        """An ideal impulse (3,) N m s: the rates jump by J/I."""
        self._set(np.ravel(self._rates.getState()) + impulse / self._moments, 1.0)

    def coast(self, duration: float, torque: Vector) -> float:
        """Fly on for ``duration`` s under a constant ``torque`` (3,) N m; returns the step taken,
        s.
        """
        steps = max(math.ceil(duration / self._longest), 1)
        unit = duration / (steps * self._period * 1e-9)
        self._torque.extTorquePntB_B = _column(torque * unit**2)
        self._set(np.ravel(self._rates.getState()), unit)
        self._clock += steps * self._period
        self._simulation.ConfigureStopTime(self._clock)
        self._simulation.ExecuteSimulation()
        self._set(np.ravel(self._rates.getState()) / unit, 1.0)
        return duration / steps

    def _set(self, rates: Vector, unit: float) -> None:
        """Set ``rates`` (3,) rad/s and the rotor's speed of its constant momentum, in a unit of
        time of ``unit`` s.
        """
        self._rates.setState(_column(rates * unit))
        if self._spun is not None:
            self._spun.setState([[(self._speed - float(rates[2])) * unit]])


MODULES = {
    "utilities": ("SimulationBaseClass",),
    "architecture": ("bskLogging", "messaging"),
    "simulation": ("spacecraft", "reactionWheelStateEffector", "extForceTorque", "svIntegrators"),
}
"""Modules of Basilisk for a flight."""


def _modules() -> Any:
    """The `MODULES` by name, loaded on demand."""
    paths = {
        name: f"Basilisk.{package}.{name}" for package, names in MODULES.items() for name in names
    }
    try:
        return SimpleNamespace(**{name: import_module(path) for name, path in paths.items()})
    except ImportError as reason:
        raise MissingExtra("verify", "flying with Basilisk") from reason


def _column(vector: Vector) -> list[list[float]]:
    """Vector as a Basilisk column."""
    return [[float(component)] for component in vector]


def _from_mrp(sigma: Vector) -> Vector:
    """Unit quaternion (4,) of MRPs (3,), or of their shadow set -σ/σ², which Basilisk takes beyond
    |σ| = 1.
    """
    square = float(sigma @ sigma)
    quaternion = np.array([1.0 - square, *(2.0 * sigma)]) / (1.0 + square)
    return np.asarray(-quaternion if quaternion[0] < 0.0 else quaternion)
