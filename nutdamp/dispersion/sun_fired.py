"""Command blocks in dispersed cases: each case fires from the Sun pulses of its own nutating body, many at once."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.dispersion.cases import DispersedCases, Model
from nutdamp.dispersion.watched import in_body
from nutdamp.physics import rigid_cases
from nutdamp.physics.axis_watch import AxisWatch
from nutdamp.physics.rigid_cases import Bodies
from nutdamp.physics.sun_clock import Stretch, SunClock

Array = NDArray[np.float64]


class Fired(NamedTuple):
    """How cases move as their last pulse ends, and what was fired.

    ``rates`` (3, n) rad/s, ``quaternion`` (4, n); ``starts`` (k, n) s of the pulses; ``seen`` (k, n): whether the
    sensor saw the Sun, without which nothing fires; ``over`` (n,) s: when the last pulse ends.
    """

    rates: Array
    quaternion: Array
    starts: Array
    seen: NDArray[np.bool_]
    over: Array


def fly(
    model: Model,
    bodies: Bodies,
    rates: Array,
    quaternion: Array,
    cases: DispersedCases,
    watch: AxisWatch | None = None,
) -> Fired:
    """The pulses of the blocks of ``model``, fired in each case from its own Sun pulses; ``watch`` sees the motion.

    A pulse that is due while the one before is on begins as that ends.
    """
    count, body = rates.shape[1], model.spacecraft
    assert body.sun_sensor is not None
    starts, seen = np.empty((len(model.schedule), count)), np.empty((len(model.schedule), count), dtype=bool)
    over = np.zeros(count)
    rates, quaternion, sun = rates.copy(), quaternion.copy(), sun_seen(model, cases, count)
    pulses, shifts, leads, ramps = model.schedule.pulses, [], [], []
    for pulse, width, start in zip(pulses, model.on_times, cases.starts, strict=True):
        begins = pulse.start if pulse.command is None else pulse.t - 0.5 * width
        shifts.append(start - begins)
        leads.append(begins - pulse.loaded[0])
        thrust = None if pulse.command is None else pulse.command.ramps
        back = -pulse.loaded[0]
        ramps.append(thrust and [one._replace(begin=one.begin + back, end=one.end + back) for one in thrust])
    for begin in range(0, count, rigid_cases.BLOCK):
        rows = slice(begin, min(begin + rigid_cases.BLOCK, count))

        def part(value: object, rows: slice = rows) -> Array:
            return np.broadcast_to(np.asarray(value, dtype=float), count)[rows]

        start = Stretch(np.zeros(len(starts[0, rows])), rates[:, rows], quaternion[:, rows])
        sense = math.copysign(1.0, body.spin)
        clock = SunClock(bodies.some(rows), start, sun[:, rows], sense, body.sun_sensor.azimuth)
        commanded = ((block, number) for block in model.schedule.blocks for number in block.sun_pulses)
        for index, (block, number) in enumerate(commanded):
            impulse, found = np.array([part(one) for one in cases.impulses[index]]), clock.sun_pulse(number)
            seen[index, rows] = body.sun_sensor.sees(clock.angle(found)) & ~clock.lost
            torque = np.where(seen[index, rows], impulse, 0.0) / (pulses[index].on_time or 1.0)
            delay = block.delay + part(shifts[index])
            starts[index, rows] = clock.fire(found, delay, block.width, torque, ramps[index]) + leads[index]
            if watch is not None:
                for here, end in clock.passed:
                    lasts = end - here.since
                    watch.some(rows).motion(clock.bodies, here.rates, here.quaternion, here.since, lasts, *here[3:])
        rates[:, rows], quaternion[:, rows], over[rows] = clock.here.rates, clock.here.quaternion, clock.here.since
    return Fired(rates, quaternion, starts, seen, over)


def sun_seen(model: Model, cases: DispersedCases, count: int) -> Array:
    """The direction to the Sun in the true body axes of t = 0, (3, n)."""
    assert model.spacecraft.sun is not None
    return in_body(model, cases, count, model.spacecraft.sun)
