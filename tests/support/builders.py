"""Spacecraft in one line each, in principal axes and SI, and a guard against endless loops."""

import json
import math
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from types import FrameType
from typing import Any, TypeVar

import numpy as np
from support import reference

from nutdamp.common import results
from nutdamp.errors import Infeasible
from nutdamp.files.rules import Facts
from nutdamp.files.yaml import read_tree
from nutdamp.flight.propagation import Residual
from nutdamp.physics import attitude
from nutdamp.physics.thruster import Measured, Trapezoid
from nutdamp.planning.decision import Comparison
from nutdamp.planning.notes import comparison_warnings, reasons
from nutdamp.planning.plan import Plan
from nutdamp.spacecraft import directions
from nutdamp.spacecraft.equipment import Channel, Steerable, Thruster
from nutdamp.spacecraft.model import (
    Attitude,
    Goal,
    Inertia,
    Limits,
    Requirement,
    Spacecraft,
    Vector,
)
from nutdamp.spacecraft.requirements import Left
from nutdamp.spacecraft.schedule import Pulse, Schedule

T = TypeVar("T")


def spinner(
    A: float = 120.0,
    C: float = 80.0,
    spin: float = 3.0,
    degrees: float = 5.0,
    phase: float = 0.7,
    *,
    moments: tuple[float, float, float] | None = None,
    channels: tuple[Channel, ...] = (),
    steerable: Steerable | None = None,
    limits: Limits | None = None,
    requirement: Requirement | None = None,
    mass: float | None = None,
    attitude: Attitude | None = None,
) -> Spacecraft:
    """A body with ``degrees`` of nutation and arg ω0 = ``phase`` rad; else that of the sheet."""
    moments = moments or (A, A, C)
    mean = 0.5 * (moments[0] + moments[1])
    omega = moments[2] * abs(spin) * math.tan(math.radians(degrees)) / mean
    rates = np.array([omega * math.cos(phase), omega * math.sin(phase), spin])
    return Spacecraft(
        "test",
        Inertia(moments),
        rates,
        mass,
        attitude,
        channels,
        steerable,
        requirement,
        limits or Limits(),
    )


def aimed(spacecraft: Spacecraft, tilt: float, azimuth: float) -> Spacecraft:
    """With a target axis ``tilt`` degrees from H at t = 0 and ``azimuth`` degrees about it."""
    axis = directions.direction_in_n(spacecraft, math.radians(tilt), math.radians(azimuth))
    return replace(spacecraft, goal=replace(spacecraft.goal, axis=axis))


def off_target(spacecraft: Spacecraft, made: Schedule) -> float:
    """Angle of H from the target by the reference integrator, rad."""
    return reference.angle(Outcome(spacecraft, made).momentum, spacecraft.target_axis)


def channel(
    name: str,
    *torque: float,
    min_on_time: float = 0.0,
    max_on_time: float = math.inf,
    isp: float | None = None,
    thrust: float | None = None,
    force: tuple[float, float, float] | None = None,
) -> Channel:
    """One thruster that is a channel of its own."""
    push = None if force is None else np.array(force, dtype=float)
    turn = np.array(torque, dtype=float)
    return Channel(name, (Thruster(name, turn, push, thrust, isp, min_on_time, max_on_time),))


def cross(torque: float, label: str = "", **given: Any) -> tuple[Channel, ...]:
    """The thrusters of Magnus 1970: +1, -1, +2, -2; a ``label`` stands before the number."""
    directions = {
        f"+{label}1": (torque, 0.0, 0.0),
        f"-{label}1": (-torque, 0.0, 0.0),
        f"+{label}2": (0.0, torque, 0.0),
        f"-{label}2": (0.0, -torque, 0.0),
    }
    return tuple(channel(name, *each, **given) for name, each in directions.items())


def fan(count: int, torque: float, first: float = 0.3, **given: Any) -> tuple[Channel, ...]:
    """``count`` channels with evenly spread transverse directions."""
    angles = [first + 2 * math.pi * index / count for index in range(count)]
    return tuple(
        channel(f"T{index}", torque * math.cos(angle), torque * math.sin(angle), 0.0, **given)
        for index, angle in enumerate(angles)
    )


def pulse(t: float, on_time: float, impulse: Vector, name: str = "T") -> Pulse:
    """A rectangular pulse, or with no on-time an ideal impulse."""
    return Pulse(t, on_time, name, impulse, None if on_time == 0.0 else impulse / on_time)


def events(made: Schedule | tuple[Pulse, ...]) -> list[reference.Push | reference.Kick]:
    """What the reference integrator flies for a schedule."""
    return [
        reference.Kick(pulse.t, pulse.impulse)
        if pulse.torque is None or pulse.on_time == 0.0
        else reference.Push(pulse.start, pulse.end, pulse.torque)
        for pulse in made
    ]


class Outcome:
    """How a schedule ends by the reference integrator: angles in rad."""

    def __init__(self, spacecraft: Spacecraft, made: Schedule) -> None:
        moments, wheel = spacecraft.inertia.moments, spacecraft.inertia.wheel
        begun = reference.Motion(
            spacecraft.omega0,
            reference.frame_n(moments, spacecraft.omega0, wheel)
            if spacecraft.attitude is None
            else attitude.matrix(spacecraft.initial.quaternion),
        )
        self.motion = reference.fly(
            moments,
            begun.rates,
            events(made),
            made.end,
            begun.rotation,
            spacecraft.growth,
            wheel,
        )
        sense = math.copysign(1.0, moments[2] * spacecraft.spin + wheel)
        self.nutation = reference.nutation(moments, self.motion.rates, sense, wheel)
        self.momentum = reference.momentum(moments, self.motion, wheel)
        self.shift = reference.angle(reference.momentum(moments, begun, wheel), self.momentum)
        self.spin: float = float(self.motion.rates[2])


def present(value: T | None, why: str | None = None) -> T:
    """The value, which must be there."""
    assert value is not None, why
    return value


def transverse(vector: Vector) -> complex:
    """v1 + i v2."""
    return complex(vector[0], vector[1])


@contextmanager
def within(calls: int) -> Iterator[None]:
    """Fails, rather than hangs, where the body calls more functions than that, of Python or of C.

    Calls are counted, not seconds: it is the same on a busy machine.
    """
    made = 0

    def count(frame: FrameType, event: str, argument: object) -> None:
        nonlocal made
        made += event in ("call", "c_call")
        if made > calls:
            sys.setprofile(None)
            raise AssertionError(f"not done within {calls} calls")

    previous = sys.getprofile()
    sys.setprofile(count)
    try:
        yield
    finally:
        sys.setprofile(previous)


@dataclass(frozen=True, eq=False)
class Judged(Plan):
    """A plan whose flown residual is given, and perhaps the spin at its end."""

    ended: Residual | None = None
    ended_spin: float | None = None

    @property
    def flown(self) -> Residual | None:
        return self.ended

    @property
    def _left(self) -> Left | None:
        spin = self.spacecraft.spin if self.ended_spin is None else self.ended_spin
        return (
            None if self.ended is None else Left(self.ended.nutation, self.ended.axis_error, spin)
        )


def judged(
    name: str,
    nutation: float,
    *,
    shift: float = 0.0,
    impulse: float = 1.0,
    propellant: float | None = None,
    end: float = 1.0,
    required: Requirement | None = None,
    goal: Goal | None = None,
    spin: float | None = None,
    pulses: int = 1,
) -> Plan:
    """A plan for 5° of nutation that leaves so much, flown; angles in degrees.

    Its pulses share impulse and propellant.
    """
    spacecraft = replace(spinner(requirement=required), goal=goal or Goal())
    share = None if propellant is None else propellant / max(pulses, 1)
    each = np.array([impulse / max(pulses, 1), 0.0, 0.0])
    fired = tuple(
        Pulse(end * (one + 1) / pulses, 0.0, "T", each, propellant=share) for one in range(pulses)
    )
    theta, turned = math.radians(nutation), math.radians(shift)
    ended = Residual(theta, theta, 0.0, turned, turned)
    return Judged(spacecraft, name, Schedule(fired), ended=ended, ended_spin=spin)


def noted(notes: Iterable[results.Note]) -> str:
    """Codes of notes with values, one a line: ``momentum-shift scheme=x shift_deg=0.25``."""
    return "\n".join(" ".join((entry.code, *map(_valued, entry.items))) for entry in notes)


def _valued(item: tuple[str, results.Value]) -> str:
    name, value = item
    return f"{name}={value:.4g}" if isinstance(value, float) else f"{name}={value}"


def codes(notes: Iterable[results.Note]) -> list[str]:
    """Codes of notes."""
    return [entry.code for entry in notes]


def one_of(notes: Iterable[results.Note], code: str) -> dict[str, results.Value]:
    """Values of the one note with a code."""
    (entry,) = (entry for entry in notes if entry.code == code)
    return entry.values


def recommended(what: str, compared: Comparison) -> str:
    """The reason for the recommended plan, and the warnings of it."""
    return f"{what}: {noted((*reasons(compared), *comparison_warnings(compared)))}"


INFEASIBLE = Plan(spinner(), "infeasible", None, Infeasible("because"))
HALF_A_DEGREE = Requirement(nutation=math.radians(0.5))
BOTH = Requirement(nutation=math.radians(0.5), momentum_shift=math.radians(0.2))
POINTING = Goal(axis=np.array([math.sin(0.2), 0.0, math.cos(0.2)]))
"""A target 0.2 rad = 11.46° from H at t = 0."""

COUNTS = 0.05
"""Degrees that count as damped: 1 % of the 5° of `judged` plans."""


# --- the file of a spacecraft that a test has built, for `verify`


def documented(spacecraft: Spacecraft) -> Spacecraft:
    """The spacecraft with a document that says the same, in SI and the axes of the file."""
    axes, tank = spacecraft.inertia.axes, spacecraft.tank
    jets = {
        f"{channel.name} {number}": thruster
        for channel in spacecraft.channels
        for number, thruster in enumerate(channel.thrusters)
    }
    file: dict[str, Any] = {
        "name": spacecraft.name,
        "inertia": {"tensor": (axes @ np.diag(spacecraft.inertia.moments) @ axes.T).tolist()},
        "omega0": (axes @ spacecraft.omega0).tolist(),
        "wheel": {"momentum": spacecraft.inertia.wheel},
        "thrusters": [{"name": name, **_thruster(jet, axes)} for name, jet in jets.items()],
        "disturbances": list(_disturbances(spacecraft)),
        "attitude": spacecraft.attitude and {"quaternion": spacecraft.attitude.quaternion.tolist()},
        "steerable": spacecraft.steerable and _values(spacecraft.steerable, "torque isp lever_arm"),
        "cold": spacecraft.cold and _values(spacecraft.cold, "first pulses"),
        "tank": tank
        and _values(tank, "propellant pressure final_pressure exponent isp inertia_per_kg"),
    }
    if spacecraft.channels:
        each = {channel.name: len(channel.thrusters) for channel in spacecraft.channels}
        file["channels"] = {
            name: [f"{name} {number}" for number in range(count)] for name, count in each.items()
        }
    if spacecraft.dissipation is not None:
        grows = {None: None, True: "grows", False: "decays"}[spacecraft.nutation_grows]
        file["dissipation"] = {"time_constant": spacecraft.dissipation, "nutation": grows}
    if spacecraft.center_of_mass_per_kg is not None:
        file["center_of_mass_per_kg"] = (axes @ spacecraft.center_of_mass_per_kg).tolist()
    facts = Facts(read_tree(json.dumps(file), "built")[0])
    assert all(finding.problem.startswith("empty") for finding in facts.findings)
    return replace(spacecraft, document=facts.contents)


def _values(part: object, names: str) -> dict[str, Any]:
    values = {name: getattr(part, name) for name in names.split()}
    rows = {name: [list(row) if isinstance(row, tuple) else row for row in value]
            for name, value in values.items() if isinstance(value, tuple)}  # fmt: skip
    return {**values, **rows}


def _thruster(jet: Thruster, axes: Vector) -> dict[str, Any]:
    known: dict[str, Any] = {"isp": jet.isp}
    if jet.position is not None and jet.force is not None:
        known |= {
            "position": (axes @ jet.position).tolist(),
            "direction": (axes @ jet.force).tolist(),
        }
        known["force"] = float(np.linalg.norm(jet.force))
    else:
        size = float(np.linalg.norm(jet.torque))
        known |= {
            "torque": (axes @ jet.torque).tolist(),
            "lever_arm": jet.thrust and size / jet.thrust,
        }
    if isinstance(jet.valve, Measured):
        known["impulse_bit"] = [
            [time, full * (jet.thrust or 1.0), mean] for time, full, mean in jet.valve.rows
        ]
    elif isinstance(jet.valve, Trapezoid):
        known["valve"] = _values(jet.valve, "open_delay close_delay rise_time fall_time")
        known["valve"]["on_time_is"] = "effective" if jet.valve.effective else "command"
    return known


def _disturbances(spacecraft: Spacecraft) -> list[dict[str, Any]]:
    axes = spacecraft.inertia.axes
    rows = []
    for each in spacecraft.disturbances:
        across = axes @ [each.transverse.real, each.transverse.imag, 0.0]
        times = {"from": each.begin, "until": each.end if each.end < math.inf else None}
        rows.append({"torque": across.tolist(), "rate": each.rate or None, **times})
        rows.append({"torque": (axes[:, 2] * each.axial).tolist(), **times})
    return rows
