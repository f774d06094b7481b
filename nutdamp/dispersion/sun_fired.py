"""Command blocks in dispersed cases: each case fires from the Sun pulses of its own nutating body, many at once."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.dispersion.cases import DispersedCases, Model, Thrusting
from nutdamp.dispersion.watched import in_body
from nutdamp.errors import Infeasible
from nutdamp.physics import rigid_cases
from nutdamp.physics.axis_watch import AxisWatch
from nutdamp.physics.rigid_cases import Bodies, Stretch
from nutdamp.physics.sun_clock import Push, SunClock
from nutdamp.physics.valve import Opened
from nutdamp.schemes.tools.sun_pulses import fire, pushes

Array = NDArray[np.float64]


class Fired(NamedTuple):
    """How cases move as their last pulse ends, and what was fired.

    ``rates`` (3, n) rad/s, ``quaternion`` (4, n); ``starts`` (k, n) s of the pulses; ``seen`` (k, n): whether they
    fire, which needs the sensor to have seen the Sun up to then in the same turns as in the nominal flight: another
    count of Sun pulses is another plan; ``over`` (n,) s: when the last pulse ends.
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
    nominal: Sequence[bool],
    watch: AxisWatch | None = None,
) -> Fired:
    """The pulses of the blocks of ``model``, fired in each case from its own Sun pulses; ``watch`` sees the motion.

    ``nominal``: `seen_nominally`. A pulse that is due while the one before is on begins as that ends.
    """
    count, body = rates.shape[1], model.spacecraft
    assert body.sun_sensor is not None
    starts, seen = np.empty((len(model.schedule), count)), np.empty((len(model.schedule), count), dtype=bool)
    over = np.zeros(count)
    rates, quaternion, sun = rates.copy(), quaternion.copy(), sun_seen(model, cases, count)
    pulses, shifts = model.schedule.pulses, []
    passages = np.flatnonzero(nominal) + 1  # those that the sensor sees of the passages of the Sun
    for pulse, start, lead in zip(pulses, cases.starts, cases.leads, strict=True):
        shifts.append(start - lead - pulse.loaded[0])
    for begin in range(0, count, rigid_cases.BLOCK):
        rows = slice(begin, min(begin + rigid_cases.BLOCK, count))

        def part(value: object, rows: slice = rows) -> Array:
            return np.broadcast_to(np.asarray(value, dtype=float), count)[rows]

        start = Stretch(bodies.some(rows), np.zeros(len(starts[0, rows])), rates[:, rows], quaternion[:, rows])
        sense = math.copysign(1.0, body.spin)
        clock = SunClock(start, sun[:, rows], sense, body.sun_sensor.azimuth)
        commanded = ((block, number) for block in model.schedule.blocks for number in block.sun_pulses)
        sees_all, before, alike = all(nominal), 0, np.ones(rows.stop - begin, dtype=bool)
        for index, (block, number) in enumerate(commanded):
            alike &= number <= len(passages)
            passage = int(passages[number - 1]) if number <= len(passages) else before + 1
            for between in () if sees_all else range(before + 1, passage):
                alike &= body.sun_sensor.sees(clock.angle(clock.sun_pulse(between))) == nominal[between - 1]
            found, before = clock.sun_pulse(passage), passage
            alike &= body.sun_sensor.sees(clock.angle(found)) & ~clock.lost
            seen[index, rows] = alike
            impulse = np.where(seen[index, rows], np.array([part(one) for one in cases.impulses[index]]), 0.0)
            if cases.thrust[index]:
                torques = _pushes(cases.thrust[index], seen[index, rows], part)
            else:
                torques = pushes(pulses[index], impulse / (pulses[index].on_time or 1.0))
            sheds = None
            if cases.per_kg is not None and cases.spent is not None:
                sheds = np.array([part(one * cases.spent[index]) * seen[index, rows] for one in cases.per_kg])
            fired = clock.fire(found, block.delay + part(shifts[index]), block.width, torques, sheds)
            starts[index, rows] = fired + part(cases.leads[index])
            if watch is not None:
                for here, end in clock.passed:
                    watch.some(rows).motion(here, end - here.since)
        rates[:, rows], quaternion[:, rows], over[rows] = clock.here.rates, clock.here.quaternion, clock.here.since
    return Fired(rates, quaternion, starts, seen, over)


def seen_nominally(model: Model) -> list[bool]:
    """Whether the sensor sees each passage of the Sun in the nominal flight; none, where that cannot be fired."""
    sensor, blocks = model.spacecraft.sun_sensor, model.schedule.blocks
    if sensor is not None and sensor.sees_all:
        return [True] * max((number for block in blocks for number in block.sun_pulses), default=0)
    try:
        return fire(model.spacecraft, model.schedule.blocks)[1]
    except Infeasible:
        return [False]


def _pushes(thrust: Sequence[Thrusting], seen: NDArray[np.bool_], part: Callable[[object], Array]) -> list[Push]:
    """The torques of thrusters through valves of their own, together, from one corner of any of them to the next."""
    torques = [np.array([part(one) for one in each.torque]) * seen for each in thrust]
    opened = [
        Opened(tuple(map(part, each.opened.corners)), part(each.opened.level))  # type: ignore[arg-type]  # four
        for each in thrust
    ]
    edges = np.sort(np.array([each.corners for each in opened]).reshape(-1, len(seen)), axis=0)
    found = []
    for begin, end in pairwise(edges):
        middle, first, last = 0.5 * (begin + end), np.zeros_like(torques[0]), np.zeros_like(torques[0])
        for each, torque in zip(opened, torques, strict=True):
            first = first + torque * each.within(middle, begin)
            last = last + torque * each.within(middle, end)
        found.append(Push(begin, end, first, last))
    return found


def sun_seen(model: Model, cases: DispersedCases, count: int) -> Array:
    """The direction to the Sun in the true body axes of t = 0, (3, n)."""
    assert model.spacecraft.sun is not None
    return in_body(model.spacecraft, cases.tilt, count, model.spacecraft.sun)
