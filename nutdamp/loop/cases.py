"""The dispersed cases of a loop: the body, the thrusters, the valves and the sensor as they are in truth.

The law on board knows the spacecraft file alone. What a case differs in is drawn as for a schedule, by the same names
from the same streams, and for the sensor: bias and scale of each gyro, noise and delay.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nutdamp.dispersion.cases import Model
from nutdamp.dispersion.correlation import Group
from nutdamp.dispersion.draws import Draws
from nutdamp.dispersion.fed import tank_of
from nutdamp.dispersion.inputs import BY_VALVE, SCHEDULE_IDLE, Input, Inputs, list_inputs, of_sensor
from nutdamp.loop.fleet import Case
from nutdamp.loop.law import Law
from nutdamp.loop_settings import ACCELEROMETER, Sensor
from nutdamp.physics import attitude
from nutdamp.schedule import Schedule, channel_pulse
from nutdamp.spacecraft import Attitude, Channel, Inertia, Spacecraft, Thruster, Vector
from nutdamp.tolerances import Tolerance

OF_FIRINGS = ("thrust_per_pulse", "timing")
"""Tolerances that each firing draws anew."""

TAG = 1
"""Ends the key of the random numbers of a firing: those of the noise are keyed by block alone."""


@dataclass(frozen=True)
class Off:
    """By what single firings of a case are off, drawn by the ``key`` of the case; ``late`` s is that of all of them."""

    key: tuple[int, ...]
    thrust: Tolerance | None
    timing: Tolerance | None
    late: float = 0.0

    def of(self, number: int) -> tuple[float, float]:
        """Factor on the thrust of the firing of a ``number`` from 0, and by how many s it is late."""
        if self.thrust is None and self.timing is None:
            return 1.0, self.late
        random = np.random.default_rng((*self.key, number, TAG))
        thrust, timing = (_drawn(random, one) for one in (self.thrust, self.timing))
        return max(1.0 + thrust, 0.0), self.late + timing


def _drawn(random: np.random.Generator, tolerance: Tolerance | None) -> float:
    """A deviation."""
    if tolerance is None:
        return 0.0
    first, second = random.random(2)
    normal = float(random.standard_normal())
    unit = {"normal": normal, "uniform": 2.0 * first - 1.0, "triangular": first + second - 1.0, "bias": 1.0}
    return tolerance.size * float(unit[tolerance.kind])


@dataclass(frozen=True, eq=False)
class LoopModel:
    """A spacecraft as its ``law`` on board knows it, ready to be dispersed; ``of_firings``: what each firing draws."""

    law: Law
    inputs: Inputs = field(init=False)
    of_firings: tuple[Input, ...] = field(init=False)
    _body: Model = field(init=False)

    def __post_init__(self) -> None:
        body = self.law.spacecraft
        fired = Schedule(tuple(channel_pulse(one.channel, 0.0, one.shortest or 1.0) for one in self.law.actuators))
        object.__setattr__(self, "_body", Model(body, fired))
        drawn, unused = list_inputs(body, fired)
        sensor, idle = of_sensor(body)
        kept = [one for one in drawn if one.tolerance not in OF_FIRINGS]
        rest = [one for one in unused if not one.name.startswith("sensor ")]
        idle = (
            tuple(one._replace(reason=one.reason.replace(SCHEDULE_IDLE, "the loop does not fire")) for one in rest)
            + idle
        )
        object.__setattr__(self, "inputs", Inputs((*kept, *sensor), idle))
        each = {one.tolerance: one._replace(name=one.tolerance) for one in drawn if one.tolerance in OF_FIRINGS}
        object.__setattr__(self, "of_firings", tuple(each.values()))

    @property
    def spacecraft(self) -> Spacecraft:
        """The spacecraft as the law knows it."""
        return self.law.spacecraft

    @property
    def groups(self) -> tuple[Group, ...]:
        """Inputs that are correlated."""
        return self._body.groups

    @property
    def target(self) -> Vector:
        """Where H shall point, a unit vector (3,) in the body axes of t = 0 as they are known."""
        return self._body.target

    @property
    def scattered(self) -> tuple[Tolerance | None, Tolerance | None]:
        """What each firing draws anew: of its thrust, of its time."""
        requested = self.law.spacecraft.dispersions
        return (None, None) if requested is None else (requested.thrust_per_pulse, requested.timing)

    def physical(self, draws: Draws) -> NDArray[np.bool_] | bool:
        """Which cases can be: those of the body, with a sensor that shows something and no signal before its time."""
        good: Any = self._body.physical(draws)
        delay = self.law.loop.sensor.delay
        for name, draw in draws.items():
            if name == "sensor delay":
                good = good & (delay + draw >= 0.0)
            elif name.startswith(("sensor scale", "sensor noise")):
                good = good & (draw > -1.0)
        return good  # type: ignore[no-any-return]

    def cases(self, draws: Draws, numbers: NDArray[np.intp], seed: int) -> list[Case]:
        """The cases of a study that have these ``numbers``, from 0, with their ``draws``, (n,) or one for all."""
        count = len(numbers)
        body = self.law.spacecraft
        draws = _at_pressure(body, draws)
        whole = {name: np.broadcast_to(draw, count) for name, draw in draws.items()}
        model = self._body.cases(draws)
        moments = np.array([np.broadcast_to(one, count) for one in model.moments]).T.tolist()
        rates = np.array([np.broadcast_to(one, count) for one in model.omega0]).T
        tilts = np.array([np.broadcast_to(one, count) for one in model.tilt]).T
        attitudes = None if body.attitude is None else self._attitudes(tilts)
        torques = {one.name: self._torques(one, draws, count) for channel in body.channels for one in channel.thrusters}
        found = []
        for row, number in enumerate(numbers.tolist()):
            draw = {name: float(values[row]) for name, values in whole.items()}
            key = (seed, number + 1)
            truth = replace(
                body,
                inertia=Inertia((moments[row][0], moments[row][1], moments[row][2]), body.inertia.axes),
                omega0=rates[row],
                attitude=None if attitudes is None else Attitude(attitudes[row]),
                channels=self._channels(draw, {name: torque[row] for name, torque in torques.items()}),
                loop=replace(self.law.loop, sensor=_sensor(self.law.loop.sensor, draw)),
            )
            if "cold" in draw and body.cold is not None:
                truth = replace(truth, cold=replace(body.cold, first=max(body.cold.first + draw["cold"], 0.0)))
            if "cold_pulses" in draw and truth.cold is not None:
                truth = replace(truth, cold=replace(truth.cold, pulses=truth.cold.pulses + draw["cold_pulses"]))
            if any(name.startswith("tank ") for name in draw):
                truth = replace(truth, tank=tank_of(body, draw))
            off = Off(key, *self.scattered, draw.get("timing offset", 0.0))
            scatter = None if off == Off(key, None, None) else off
            found.append(Case(truth, key, scatter, (float(tilts[row, 0]), float(tilts[row, 1]))))
        return found

    def _attitudes(self, tilts: Vector) -> Vector:
        """Attitudes (n, 4) of the file's axes, where that of the principal axes is turned by ``tilts`` (n, 2) rad."""
        body, angles = self.law.spacecraft, np.hypot(*tilts.T)
        turns = np.zeros((len(tilts), 4))
        turns[:, 0], turns[:, 1:3] = np.cos(0.5 * angles), (0.5 * np.sinc(0.5 * angles / math.pi))[:, None] * tilts
        turned = attitude.multiply(body.initial.quaternion, turns)
        return attitude.multiply(turned, attitude.from_matrix(body.inertia.axes.T))

    def _torques(self, thruster: Thruster, draws: Draws, count: int) -> Vector:
        """Torques (n, 3) N m at the thrust of each case."""
        torque = np.array([np.broadcast_to(one, count) for one in self._body.thruster_torque(thruster, draws)]).T
        return np.asarray(torque * (1.0 + np.broadcast_to(draws.get(f"thrust {thruster.name}", 0.0), count))[:, None])

    def _channels(self, draw: dict[str, float], torques: dict[str, Vector]) -> tuple[Channel, ...]:
        """The channels of a case; those in which nothing is off are those of the file."""
        body = self.law.spacecraft
        names = {name.split()[1] for name in draw if name.split()[0] in OF_THRUSTERS}
        found = []
        for channel in body.channels:
            if not names & {one.name for one in channel.thrusters}:
                found.append(channel)
                continue
            valve = _valve(channel, draw)
            thrusters = tuple(
                replace(one, torque=torques[one.name], valve=valve, **_thrust(one, draw)) for one in channel.thrusters
            )
            found.append(replace(channel, thrusters=thrusters))
        return tuple(found)


OF_THRUSTERS = ("thrust", "direction", "position", *BY_VALVE)
"""First words of the inputs that make a thruster another."""


def _at_pressure(body: Spacecraft, draws: Draws) -> Draws:
    """The draws with the thrust of another tank, as the file gives it at its own pressure, in that of the thrusters."""
    tank = tank_of(body, draws)
    if body.tank is None or tank is None or not {"tank pressure", "tank exponent"} & set(draws):
        return draws
    higher = (tank.pressure / body.tank.pressure) ** tank.exponent
    names = {f"thrust {one.name}" for channel in body.channels for one in channel.thrusters}
    return {**draws, **{name: (1.0 + draws.get(name, 0.0)) * higher - 1.0 for name in names}}


def _thrust(thruster: Thruster, draw: dict[str, float]) -> dict[str, Any]:
    factor = 1.0 + draw.get(f"thrust {thruster.name}", 0.0)
    force, thrust = thruster.force, thruster.thrust
    return {"force": None if force is None else factor * force, "thrust": None if thrust is None else factor * thrust}


def _valve(channel: Channel, draw: dict[str, float]) -> Any:
    """The valve of a channel: all of its thrusters open with the mean of their delays, none of them below zero."""
    valve = channel.valve
    if valve is None:
        return None

    def off(key: str) -> float:
        return float(np.mean([draw.get(f"{key} {one.name}", 0.0) for one in channel.thrusters]))

    from nutdamp.physics.valve import Measured  # few spacecraft have any

    if isinstance(valve, Measured):
        factor = 1.0 + off("impulse_bit")
        return Measured(tuple((command, factor * given, centroid) for command, given, centroid in valve.rows))
    return replace(valve, **{key: max(getattr(valve, key) + off(key), 0.0) for key in BY_VALVE[:-1]})


def _sensor(sensor: Sensor, draw: dict[str, float]) -> Sensor:
    """The sensor of a case."""
    axes = [""] if sensor.kind == ACCELEROMETER else [" 1", " 2"]
    scales = [sensor.scale * (1.0 + draw.get(f"sensor scale{axis}", 0.0)) for axis in axes]
    biases = [sensor.bias + draw.get(f"sensor bias{axis}", 0.0) for axis in axes]
    return replace(
        sensor,
        scale=scales[0],
        bias=biases[0],
        noise=sensor.noise * (1.0 + draw.get("sensor noise", 0.0)),
        delay=sensor.delay + draw.get("sensor delay", 0.0),
        second=(scales[1], biases[1]) if len(axes) == 2 else None,
    )
