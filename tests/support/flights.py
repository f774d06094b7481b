"""Flights that several packages look at, and one case as a spacecraft of its own."""

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from support import reference
from support.builders import channel, cross, events, spinner
from support.dispersed import normal
from support.spinners import commanded

from nutdamp.flight import propagation
from nutdamp.flight.dynamics import make_dynamics
from nutdamp.montecarlo import propagated
from nutdamp.montecarlo.cases import DispersedCases, DispersedModel, Thrusting
from nutdamp.montecarlo.inputs import Draws
from nutdamp.physics import attitude, motion
from nutdamp.physics.thruster import Ramp
from nutdamp.schemes.block_model import fired
from nutdamp.spacecraft.equipment import Block
from nutdamp.spacecraft.model import Attitude, Disturbance, Spacecraft
from nutdamp.spacecraft.schedule import Command, Pulse, Schedule
from nutdamp.spacecraft.tolerances import Dispersions

# --- flights that several packages look at: the spin axis on its way, dispersed command blocks

Array = NDArray[np.float64]


def axis_path(spacecraft: Spacecraft, made: Schedule, until: float, dense: int = 60) -> Array:
    """The spin axis (n, 3) from 0 to ``until`` s by the reference integrator.

    It is asked ``dense`` times in each turn of the axis, and between two edges of pulses.
    """
    moments = spacecraft.inertia.moments
    sense = math.copysign(1.0, spacecraft.spin)
    motion = reference.Motion(spacecraft.omega0, attitude.matrix(spacecraft.initial.quaternion))
    edges = sorted({0.0, until, *(edge for one in made for edge in (one.start, one.end))})
    turns = [
        (begin, end, max(1, math.ceil((end - begin) / spacecraft.inertial_period)))
        for begin, end in pairwise(edge for edge in edges if edge <= until)
    ]
    times = [np.linspace(begin, end, dense * count + 1) for begin, end, count in turns]
    path = reference.path(moments, motion, events(made), np.concatenate(times))
    return np.array([one.rotation[:, 2] * sense for one in path])


BODY_ERRORS = Dispersions(
    A=normal(0.03, relative=True),
    C=normal(0.03, relative=True),
    omega0=(normal(0.01), normal(0.01), normal(0.05)),
)
"""Errors of the body alone: then `sun_pulses.fired` fires the same pulses."""


def by_blocks(
    dispersions: Dispersions = BODY_ERRORS,
    *,
    spin: float = -2.0,
    moments: tuple[float, float, float] = (110.0, 110.0, 150.0),
    interleaved: bool = False,
    **fields: Any,
) -> DispersedModel:
    """Three blocks of two thrusters, one with axial torque, of an oblate body with 2 deg;
    ``interleaved``: all in the same turns, by angles.
    """
    body = spinner(
        moments=moments, spin=spin, degrees=2.0, channels=(channel("T", 8.0, 3.0, 2.0), *cross(9.0))
    )
    turn = 2.0 * math.pi / abs(spin)
    blocks = (
        Block("T", 2, 0.3 * turn, 0.05 * turn, 6, 1),
        Block("+1", 19, 0.96 * turn, 0.07 * turn, 4, 1),  # still on when the next Sun pulse comes
        Block("-2", 26, 0.1 * turn, 0.03 * turn, 5, 2),
    )
    if interleaved:
        blocks = (
            Block("T", 2, 0.0, 0.05 * turn, 6, 1, angle=4.0),
            Block("+1", 3, 0.0, 0.07 * turn, 4, 1, angle=0.4),
            Block("-2", 1, 0.02 * turn, 0.03 * turn, 5, 2, angle=2.0),
        )
    body = replace(commanded(body, np.array([1.0, 0.3, -0.4])), dispersions=dispersions, **fields)
    return DispersedModel(body, fired(body, blocks))


# --- one case as a spacecraft and a schedule of its own, for everything that flies those


def timed(model: DispersedModel, cases: DispersedCases) -> DispersedCases:
    """The ``cases`` with starts and impulses by their own Sun pulses, else as they are."""
    if not model.schedule.blocks:
        return cases
    dynamics = make_dynamics(model.spacecraft)
    upright = np.tile([[1.0], [0.0], [0.0], [0.0]], cases.count)
    forcing = dynamics.forcing._replace(wheel=cases.wheel)
    bodies = motion.Bodies(cases.moments, dynamics.constant, forcing)
    nominal = propagated.RealWidths(model).seen_nominally
    _, starts, fires = propagated.fly(model, bodies, upright, cases, nominal)
    return replace(cases, starts=starts, impulses=cases.impulses * fires[:, None])


def realised(model: DispersedModel, draws: Draws) -> tuple[Spacecraft, Schedule]:
    """The true spacecraft, its attitude in the estimate's frame, and the pulses that it gets."""
    body = model.spacecraft
    case = timed(model, model.cases(draws))
    pulses = []
    spent = (None,) * len(case.starts) if case.spent is None else case.spent
    for number, (planned, used) in enumerate(zip(model.schedule, spent, strict=True)):
        start = float(case.starts[number, 0])
        impulse = case.impulses[number, :, 0]
        torque = None if planned.on_time == 0.0 else impulse / planned.on_time
        propellant = None if used is None else float(np.squeeze(used))
        t = planned.t + start - planned.loaded[0]
        if case.thrust[number]:
            pulses += [
                _thrusting(planned, start, one, propellant, len(case.thrust[number]))
                for one in case.thrust[number]
            ]
        elif planned.command is not None:
            moved = planned.moved(t - planned.t)
            pulses.append(replace(moved, impulse=impulse, torque=torque, propellant=propellant))
        else:
            pulses.append(
                Pulse(t, planned.on_time, planned.channel, impulse, torque, propellant=propellant)
            )
    tilt = np.array([*case.tilt[:, 0], 0.0])
    angle = float(np.linalg.norm(tilt))
    turn = np.array([np.cos(0.5 * angle), *(0.5 * np.sinc(0.5 * angle / np.pi) * tilt)])
    axes = body.inertia.axes
    quaternion = attitude.multiply(
        attitude.multiply(body.initial.quaternion, turn), attitude.from_matrix(axes.T)
    )
    first, second, third = case.moments[:, 0].tolist()
    per_kg = None
    if case.per_kg is not None:
        one, two, three = case.per_kg[:, 0].tolist()
        per_kg = one, two, three
    own = np.eye(3) if case.turn is None else case.turn[:, :, 0]
    true = replace(
        in_own_axes(body, own),
        inertia=replace(
            body.inertia,
            moments=(first, second, third),
            wheel=float(np.squeeze(case.wheel)),
            axes=axes @ own,
        ),
        omega0=case.omega0[:, 0],
        attitude=Attitude(quaternion),
        tank=None if body.tank is None else replace(body.tank, inertia_per_kg=per_kg),
    )
    return true, Schedule(tuple(pulses))


def in_own_axes(spacecraft: Spacecraft, own: Array) -> Spacecraft:
    """The spacecraft with vectors in other body axes, the columns of ``own`` (3, 3), but for its
    Sun sensor.
    """

    def disturbance(one: Disturbance) -> Disturbance:
        x, y, z = np.array([one.transverse.real, one.transverse.imag, one.axial]) @ own
        return replace(one, transverse=complex(x, y), axial=float(z))

    channels = [
        one.of(torque=one.torque @ own) if one.thrusters else one for one in spacecraft.channels
    ]
    return replace(
        spacecraft,
        channels=tuple(channels),
        disturbances=tuple(map(disturbance, spacecraft.disturbances)),
    )


def _thrusting(
    planned: Pulse, start: float, one: Thrusting, propellant: float | None, count: int
) -> Pulse:
    """One of ``count`` thrusters' share of a pulse, as a pulse that begins at ``start`` s."""
    acts, centroid, _ = (float(np.squeeze(part)) for part in one.opened.acts)
    ramps = []
    for begin, length, level, lean in (
        tuple(float(np.squeeze(part)) for part in piece) for piece in one.opened.pieces
    ):
        if start + begin + length > start + begin:
            ramps.append(
                Ramp(
                    start + begin,
                    start + begin + length,
                    level * (1.0 - lean),
                    level * (1.0 + lean),
                )
            )
    torque = np.array([float(np.squeeze(part)) for part in one.torque])
    assert planned.command is not None
    command = Command(start, planned.command.on_time, tuple(ramps))
    used = None if propellant is None else propellant / count
    return Pulse(
        start + centroid,
        acts,
        planned.channel,
        acts * torque,
        torque,
        propellant=used,
        command=command,
    )


def flown_outputs(model: DispersedModel, draws: Draws) -> Array:
    """The outputs (5,) of one case with real widths and true moments, by `propagation.flown`."""
    true, schedule = realised(model, draws)
    made = propagation.flown(true, schedule)
    settled, left = made.settled, made.residual
    momentum = made.last_momentum
    target = attitude.rotate(model.spacecraft.initial.quaternion, model.target)
    propellant = model.cases(draws).propellant
    return np.array(
        [
            left.nutation,
            left.momentum_shift,
            float(attitude.angle_between(momentum, target)),
            settled.spin - true.spin,
            np.nan if propellant is None else float(propellant[0]),
        ]
    )
