"""One case as a spacecraft and a schedule of its own, so that everything that flies those can fly it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from nutdamp import flight
from nutdamp.dispersion.cases import Model
from nutdamp.dispersion.draws import Draws
from nutdamp.dispersion.flown import RealWidths
from nutdamp.physics import attitude
from nutdamp.schedule import Pulse, Schedule
from nutdamp.spacecraft import Attitude, Spacecraft

Array = NDArray[np.float64]


def realised(model: Model, draws: Draws) -> tuple[Spacecraft, Schedule]:
    """The true spacecraft, its attitude in the frame of the estimate, and the pulses that it really gets."""
    body, case = model.spacecraft, RealWidths(model).timed(model.cases(draws))
    pulses = []
    for planned, width, start, parts in zip(model.schedule, model.on_times, case.starts, case.impulses, strict=True):
        impulse = np.array(parts, dtype=float).reshape(3)
        torque = None if planned.on_time == 0.0 else impulse / planned.on_time
        t = float(np.squeeze(start)) + 0.5 * width
        if planned.command is not None:
            pulses.append(replace(planned.moved(t - planned.t), impulse=impulse, torque=torque))
        else:
            pulses.append(Pulse(t, planned.on_time, planned.channel, impulse, torque))
    tilt = np.array([*case.tilt, 0.0], dtype=float)
    angle = float(np.linalg.norm(tilt))
    turn = np.array([np.cos(0.5 * angle), *(0.5 * np.sinc(0.5 * angle / np.pi) * tilt)])
    axes = body.inertia.axes
    quaternion = attitude.multiply(attitude.multiply(body.initial.quaternion, turn), attitude.from_matrix(axes.T))
    first, second, third = (float(moment) for moment in case.moments)
    true = replace(
        body,
        inertia=replace(body.inertia, moments=(first, second, third)),
        omega0=np.array(case.omega0, dtype=float),
        attitude=Attitude(quaternion),
    )
    return true, Schedule(tuple(pulses))


def flown_outputs(model: Model, draws: Draws) -> Array:
    """The outputs (5,) of one case with real pulse widths, true moments and disturbances, by `flight.flown`."""
    true, schedule = realised(model, draws)
    made = flight.flown(true, schedule)
    settled, left = made.settled, made.residual
    momentum = attitude.rotate(settled.quaternion, settled.rates * np.asarray(made.moments))
    target = attitude.rotate(model.spacecraft.initial.quaternion, model.target)
    propellant = model.cases(draws).propellant
    return np.array(
        [
            left.nutation,
            left.momentum_shift,
            float(attitude.angle_between(momentum, target)),
            settled.spin - true.spin,
            np.nan if propellant is None else float(propellant),
        ]
    )
