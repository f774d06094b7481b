"""Propagation of cases through real pulse widths, with the true tensor and the disturbances, many at once.

Command blocks fire in each case from the Sun pulses of its own nutating body.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.errors import Infeasible
from nutdamp.flight.dynamics import Dynamics, make_dynamics
from nutdamp.montecarlo.cases import (
    Cases,
    DispersedCases,
    DispersedModel,
    Thrusting,
    in_body,
    number_of,
    rotated,
    triple,
    watch_of,
)
from nutdamp.montecarlo.closed_form import Ends, carried
from nutdamp.physics import batch, sky
from nutdamp.physics.batch import Bodies, MotionStretch
from nutdamp.physics.sky import AxisWatch, SunPulseClock, TorqueRamp
from nutdamp.physics.thruster import Opened
from nutdamp.physics.triaxial import widest_cones
from nutdamp.schemes.block_model import fire, pushes

Array = NDArray[np.float64]


class FiredBlocks(NamedTuple):
    """Motion of cases at the end of their last pulse, and the fired pulses.

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
    model: DispersedModel,
    bodies: Bodies,
    rates: Array,
    quaternion: Array,
    cases: DispersedCases,
    nominal: Sequence[bool],
    watch: AxisWatch | None = None,
) -> FiredBlocks:
    """Fire the blocks of ``model`` in each case from its own Sun pulses; ``watch`` sees the motion.

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
    for begin in range(0, count, batch.BLOCK):
        rows = slice(begin, min(begin + batch.BLOCK, count))

        def part(value: object, rows: slice = rows) -> Array:
            return np.broadcast_to(np.asarray(value, dtype=float), count)[rows]

        start = MotionStretch(bodies.some(rows), np.zeros(len(starts[0, rows])), rates[:, rows], quaternion[:, rows])
        clock = SunPulseClock(start, sun[:, rows], math.copysign(1.0, body.spin), body.sun_sensor.azimuth)
        commanded = ((block, number) for block in model.schedule.blocks for number in block.sun_pulses)
        sees_all, before, alike = all(nominal), 0, np.ones(rows.stop - begin, dtype=bool)
        for index, (block, number) in enumerate(commanded):
            alike &= number <= len(passages)
            passage = int(passages[number - 1]) if number <= len(passages) else before + 1
            for between in () if sees_all else range(before + 1, passage):
                alike &= body.sun_sensor.sees(clock.angle(clock.sun_pulse(between))) == nominal[between - 1]
            sun_pulse, before = clock.sun_pulse(passage), passage
            alike &= body.sun_sensor.sees(clock.angle(sun_pulse)) & ~clock.lost
            seen[index, rows] = alike
            impulse = np.where(seen[index, rows], np.array([part(impulse) for impulse in cases.impulses[index]]), 0.0)
            if cases.thrust[index]:
                torques = _pushes(cases.thrust[index], seen[index, rows], part)
            else:
                torques = pushes(pulses[index], impulse / (pulses[index].on_time or 1.0))
            sheds = None
            if cases.per_kg is not None and cases.spent is not None:
                sheds = np.array([part(per_kg * cases.spent[index]) * seen[index, rows] for per_kg in cases.per_kg])
            fired = clock.fire(sun_pulse, block.delay + part(shifts[index]), block.width, torques, sheds)
            starts[index, rows] = fired + part(cases.leads[index])
            if watch is not None:
                for here, end in clock.passed:
                    watch.some(rows).motion(here, end - here.since)
        rates[:, rows], quaternion[:, rows], over[rows] = clock.here.rates, clock.here.quaternion, clock.here.since
    return FiredBlocks(rates, quaternion, starts, seen, over)


def seen_nominally(model: DispersedModel) -> list[bool]:
    """Flags of the Sun passages seen in the nominal flight; empty where that cannot be fired."""
    sensor, blocks = model.spacecraft.sun_sensor, model.schedule.blocks
    if sensor is not None and sensor.sees_all:
        return [True] * max((number for block in blocks for number in block.sun_pulses), default=0)
    try:
        return fire(model.spacecraft, model.schedule.blocks)[1]
    except Infeasible:
        return [False]


def _pushes(thrust: Sequence[Thrusting], seen: NDArray[np.bool_], part: Callable[[object], Array]) -> list[TorqueRamp]:
    """Torques of thrusters through valves of their own, together, between successive corners of their thrust."""
    torques = [np.array([part(component) for component in each.torque]) * seen for each in thrust]
    opened = [
        Opened(tuple(map(part, each.opened.corners)), part(each.opened.level))  # type: ignore[arg-type]  # four
        for each in thrust
    ]
    edges = np.sort(np.array([each.corners for each in opened]).reshape(-1, len(seen)), axis=0)
    pushes = []
    for begin, end in pairwise(edges):
        middle, first, last = 0.5 * (begin + end), np.zeros_like(torques[0]), np.zeros_like(torques[0])
        for each, torque in zip(opened, torques, strict=True):
            first = first + torque * each.within(middle, begin)
            last = last + torque * each.within(middle, end)
        pushes.append(TorqueRamp(begin, end, first, last))
    return pushes


def sun_seen(model: DispersedModel, cases: DispersedCases, count: int) -> Array:
    """Direction to the Sun in the true body axes of t = 0, (3, n)."""
    assert model.spacecraft.sun is not None
    return in_body(model.spacecraft, cases.tilt, count, model.spacecraft.sun)


CASE, STEPPED, LOOKED = 5e-3, 1e-2, 4e-3
"""Units of work: of a case and of each of its pulses, of a step of a numerical coast, of an observation of its axis."""


@dataclass(frozen=True, eq=False)
class RealWidths:
    """Flies cases of ``model`` by Euler's equations, see `nutdamp.physics.batch`.

    Disturbances and dissipation act as the estimate has them, whatever the moments of a case are.
    """

    model: DispersedModel

    @cached_property
    def _dynamics(self) -> Dynamics:
        return make_dynamics(self.model.spacecraft)

    @cached_property
    def _seen(self) -> list[bool]:
        return seen_nominally(self.model)

    @cached_property
    def effort(self) -> float:
        """Units of work of a case: its pulses, and where coasts are no arcs, its steps and looks at cones."""
        moments, rates = np.array(self._dynamics.moments)[:, None], self.model.spacecraft.initial.rates
        arcs = self._bodies(moments, 0.0).free
        turned = 0.0 if arcs else float(np.linalg.norm(rates)) * self.model.schedule.end
        looks = turned * sky.ROWS / sky.CIRCLE if self.model.spacecraft.keep else 0.0
        stepping = STEPPED * turned / batch.STRIDE + LOOKED * looks
        return CASE * (1.0 + len(self.model.schedule)) + stepping

    def __call__(self, cases: DispersedCases) -> Ends:
        """End states of the ``cases``. Raises Infeasible for motions too long to be integrated."""
        count = number_of(cases)
        watch = watch_of(self.model, cases) if self.model.spacecraft.keep else None
        moments, rates = _whole(cases.moments, count), _whole(cases.omega0, count)
        propellant, bodies = cases.propellant, self._bodies(moments, cases.wheel)
        if self.model.schedule.blocks:
            settled, turned, _, seen, over = fly(self.model, bodies, rates, _upright(count), cases, self._seen, watch)
            if cases.spent is not None:
                propellant = sum((kg * sees for kg, sees in zip(cases.spent, seen, strict=True)), 0.0)
        else:
            starts = _whole(cases.starts, count)
            impulses = np.array([_whole(impulse, count) for impulse in cases.impulses]).reshape(-1, 3, count)
            pulses = batch.Pulses(starts, np.array(self.model.on_times), impulses, sheds=_sheds(cases, count))
            if self.model.schedule.shaped:
                pulses = self._ramps(cases, starts, impulses)
            settled, turned = batch.fly(bodies, rates, _upright(count), pulses, watch)
            over = np.max(pulses.edges, axis=0, initial=0.0)
        shed = _sheds(cases, count)
        last = bodies if shed is None else bodies.lighter(shed.sum(axis=0))
        if watch is not None:
            watch.turn(batch.MotionStretch(last, over, settled, turned))
        momentum, (first, second, _) = triple(last.momentum(settled)), last.moments
        after = carried(tuple(turned), momentum)
        return Ends(
            momentum=momentum,
            before=triple(bodies.momentum(rates)),
            after=after,
            pointed=rotated(after, cases.tilt),
            spin=settled[2],
            spin_change=settled[2] - rates[2],
            propellant=propellant,
            nutation=None if np.array_equal(first, second) else self._largest(last, settled),
            aspects=None if watch is None else watch.angles,
            drained=cases.drained,
        )

    def _largest(self, bodies: batch.Bodies, rates: Array) -> Array:
        """Largest nutation (n,), rad, of the free motion from ``rates`` (3, n)."""
        return widest_cones(bodies.moments, rates, self.model.spacecraft.sense, bodies.forcing.wheel)[0]

    def _bodies(self, moments: Array, wheel: Cases) -> batch.Bodies:
        return batch.Bodies(moments, self._dynamics.constant, self._dynamics.forcing._replace(wheel=wheel))

    def _ramps(self, cases: DispersedCases, starts: Array, impulses: Array) -> batch.Pulses:
        """Pulses by the ramps of their thrust, each as a pulse of its own; as in `batch.Pulses`."""
        count, sheds = starts.shape[1], _sheds(cases, starts.shape[1])
        begins, lengths, parts, leans, falls = [], [], [], [], []

        def add(begin: Array, length: Cases, impulse: Array, lean: Cases, number: int, share: Cases) -> None:
            begins.append(begin)
            lengths.append(np.broadcast_to(length, count))
            parts.append(impulse)
            leans.append(np.broadcast_to(lean, count))
            falls.append(np.zeros((3, count)) if sheds is None else share * sheds[number])

        for number, (pulse, on_time, start, impulse) in enumerate(
            zip(self.model.schedule, self.model.on_times, starts, impulses, strict=True)
        ):
            ramps, thrust = None if pulse.command is None else pulse.command.ramps, cases.thrust[number]
            if ramps is None:
                add(start, on_time, impulse, 0.0, number, 1.0)
                continue
            if not thrust:
                for ramp in ramps:
                    share, lean = ramp.impulse / pulse.on_time, (ramp.last - ramp.first) / (ramp.last + ramp.first)
                    begin = start + (ramp.begin - (pulse.t - 0.5 * on_time))
                    add(begin, ramp.end - ramp.begin, impulse * share, lean, number, share)
                continue
            command = start - cases.leads[number]
            fall = 0.0 if pulse.command is None else pulse.command.fall  # of the nominal pulse, evenly
            for thruster in thrust:
                acts, passed = thruster.opened.acts[0], 0.0
                for begin, length, level, lean in thruster.opened.pieces:
                    area = level * length
                    part = area / np.where(acts == 0.0, 1.0, acts)
                    area = area * (1.0 + fall * (0.5 - passed - 0.5 * part))
                    lean = lean - 0.5 * fall * part
                    add(
                        command + begin, length, _whole(thruster.torque, count) * area, lean, number, part / len(thrust)
                    )
                    passed = passed + part
        return batch.Pulses(
            np.array(begins).reshape(-1, count),
            np.array(lengths).reshape(-1, count),
            np.array(parts).reshape(-1, 3, count),
            np.array(leans).reshape(-1, count),
            None if sheds is None else np.array(falls).reshape(-1, 3, count),
        )


def _sheds(cases: DispersedCases, count: int) -> Array | None:
    """Decrease of the moments by each pulse, (k, 3, n) kg m²; None where they stay."""
    if cases.per_kg is None or cases.spent is None:
        return None
    return np.array([_whole(cases.per_kg, count) * kg for kg in cases.spent]).reshape(-1, 3, count)


def _upright(count: int) -> Array:
    """Quaternions (4, n) of the true body axes at t = 0, which are where everything is seen from."""
    upright = np.zeros((4, count))
    upright[0] = 1.0
    return upright


def _whole(parts: tuple[object, ...], count: int) -> Array:
    """Numbers and arrays as rows of one array, (k, n)."""
    rows = np.empty((len(parts), count))
    for row, part in zip(rows, parts, strict=True):
        row[:] = part  # type: ignore[call-overload]
    return rows
