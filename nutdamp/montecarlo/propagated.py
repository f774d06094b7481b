"""Cases flown, many at once, through real pulse widths."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from nutdamp.errors import Infeasible
from nutdamp.flight.dynamics import forced, make_dynamics, torques_of
from nutdamp.montecarlo.cases import (
    Cases,
    DispersedCases,
    DispersedModel,
    Thrusting,
    Triple,
    in_body,
    number_of,
    rotated,
    triple,
    watch_over,
)
from nutdamp.physics import motion, sky
from nutdamp.physics.motion import MotionStretch, advance
from nutdamp.physics.series import Bodies
from nutdamp.physics.sky import AxisWatch, SunPulseClock, TorqueRamp
from nutdamp.physics.thruster import Opened
from nutdamp.physics.triaxial import widest_cones
from nutdamp.schemes.block_model import fire_all, pushes
from nutdamp.spacecraft.equipment import firings

Array = NDArray[np.float64]

# standard deviations of times that the effort of cases counts with
FAR = 8.0


@dataclass(frozen=True, slots=True)
class Ends:
    """End states of cases; H in N m s, in the axes named, of which those of t = 0 are fixed in
    space.
    """

    momentum: Triple  # H in the frame that turns with the nutation: (AΩ1, AΩ2, Cω3)
    before: Triple  # H at t = 0 in the true body axes of t = 0
    after: Triple  # H in the true body axes of t = 0
    pointed: Triple  # H in the estimated body axes of t = 0
    spin: Cases  # ω3, rad/s
    spin_change: Cases  # gain of ω3, rad/s
    propellant: Cases | None  # kg
    nutation: Cases | None = None  # rad; None: the angle of ``momentum``, as for I1 = I2
    aspects: Array | None = (
        None  # least and largest angle from spin axis to each cone on the way, (m, 2, n) rad
    )
    drained: Cases = 0.0  # as of `cases.supplied`
    disturbed: Ends | None = None  # when the last disturbance has begun or ended, if later


def carried(turn: tuple[Cases, ...], vector: Triple) -> Triple:
    """``vector`` turned by the quaternion ``turn``, which rounding has left a little off unit
    length.
    """
    w, a, b, c = turn
    x, y, z = vector
    scale = 2.0 / (w * w + a * a + b * b + c * c)
    i, j, k = b * z - c * y, c * x - a * z, a * y - b * x
    return (
        x + scale * (w * i + b * k - c * j),
        y + scale * (w * j + c * i - a * k),
        z + scale * (w * k + a * j - b * i),
    )


def fly(
    model: DispersedModel,
    bodies: Bodies,
    rates: Array,
    quaternion: Array,
    cases: DispersedCases,
    nominal: Sequence[bool],
    watch: AxisWatch | None = None,
) -> tuple[Array, Array, Array, NDArray[np.bool_], Array]:
    """Fire the blocks of ``model`` in each case from its own Sun pulses; ``watch`` sees the motion.

    ``nominal``: `RealWidths.seen_nominally`. Returns rates (3, n) rad/s and quaternions (4, n) at
    the end of the last pulse; starts (k, n) s of the pulses; whether they fire (k, n): not once the
    sensor has seen the Sun in other turns than in the nominal flight; when the last pulse ends
    (n,), s.
    """
    count = rates.shape[1]
    spacecraft = model.spacecraft
    assert spacecraft.sun_sensor is not None
    assert spacecraft.sun is not None
    starts, seen = (
        np.empty((len(model.schedule), count)),
        np.empty((len(model.schedule), count), dtype=bool),
    )
    over = np.zeros(count)
    rates = rates.copy()
    quaternion = quaternion.copy()
    sun = in_body(spacecraft, cases.tilt, count, spacecraft.sun, cases.turn)
    passages = np.flatnonzero(nominal) + 1  # those that the sensor sees of the passages of the Sun
    pulses = model.schedule.pulses
    begins = zip(model.schedule, cases.starts, cases.leads, strict=True)
    shifts = [start - lead - pulse.loaded[0] for pulse, start, lead in begins]
    for begin in range(0, count, motion.BLOCK):
        rows = slice(begin, min(begin + motion.BLOCK, count))

        def part(value: object, rows: slice = rows) -> Array:
            return np.broadcast_to(np.asarray(value, dtype=float), count)[rows]

        start = MotionStretch(
            bodies.some(rows), np.zeros(len(starts[0, rows])), rates[:, rows], quaternion[:, rows]
        )
        clock = SunPulseClock(
            start,
            sun[:, rows],
            math.copysign(1.0, spacecraft.spin),
            spacecraft.sun_sensor.azimuth,
            None if cases.turn is None else cases.turn[:, :, rows],
        )
        sees_all = all(nominal)
        before = 0
        alike = np.ones(rows.stop - begin, dtype=bool)
        for index, (number, _, block) in enumerate(firings(model.schedule.blocks)):
            alike &= number <= len(passages)
            passage = int(passages[number - 1]) if number <= len(passages) else before + 1
            for between in () if sees_all else range(before + 1, passage):
                alike &= (
                    spacecraft.sun_sensor.sees(clock.angle(clock.sun_pulse(between)))
                    == nominal[between - 1]
                )
            sun_pulse = clock.sun_pulse(passage)
            before = passage
            alike &= spacecraft.sun_sensor.sees(clock.angle(sun_pulse)) & ~clock.lost
            seen[index, rows] = alike
            impulse = np.where(
                seen[index, rows],
                np.array([part(impulse) for impulse in cases.impulses[index]]),
                0.0,
            )
            if cases.thrust[index]:
                torques = _pushes(cases.thrust[index], seen[index, rows], part)
            else:
                torques = pushes(pulses[index], impulse / (pulses[index].on_time or 1.0))
            sheds = None
            if cases.per_kg is not None and cases.spent is not None:
                sheds = np.array(
                    [
                        part(per_kg * cases.spent[index]) * seen[index, rows]
                        for per_kg in cases.per_kg
                    ]
                )
            delay = block.delay + clock.turning(part(block.angle)) + part(shifts[index])
            fired = clock.fire(sun_pulse, delay, block.width, torques, sheds)
            starts[index, rows] = fired + part(cases.leads[index])
            if watch is not None:
                for here, end in clock.passed:
                    watch.some(rows).motion(here, end - here.since)
        rates[:, rows], quaternion[:, rows], over[rows] = (
            clock.here.rates,
            clock.here.quaternion,
            clock.here.since,
        )
    return rates, quaternion, starts, seen, over


def _pushes(
    thrust: Sequence[Thrusting], seen: NDArray[np.bool_], part: Callable[[object], Array]
) -> list[TorqueRamp]:
    """Torques of thrusters through valves of their own, together, between successive corners of
    their thrust.
    """
    torques = [np.array([part(component) for component in each.torque]) * seen for each in thrust]
    corners = [tuple(map(part, each.opened.corners)) for each in thrust]
    pairs = zip(corners, thrust, strict=True)
    opened = [Opened(four, part(each.opened.level)) for four, each in pairs]  # type: ignore[arg-type]
    edges = np.sort(np.array(corners).reshape(-1, len(seen)), axis=0)
    ramps = []
    for begin, end in pairwise(edges):
        levels = [
            [each.within(0.5 * (begin + end), edge) for each in opened] for edge in (begin, end)
        ]
        first, last = (sum(map(operator.mul, torques, level), np.zeros(())) for level in levels)
        ramps.append(TorqueRamp(begin, end, first, last))
    return ramps


CASE, STEPPED, LOOKED = 5e-3, 1e-2, 4e-3
"""Units of work: of a case and of each of its pulses, of a step of a numerical coast, of an
observation of its axis.
"""


class RealWidths:
    """Flies cases of ``model`` by Euler's equations, with the disturbances and dissipation of the
    estimate.
    """

    def __init__(self, model: DispersedModel) -> None:
        self.model, self._dynamics = model, make_dynamics(model.spacecraft)

    @cached_property
    def seen_nominally(self) -> list[bool]:
        """Flags of the Sun passages seen in the nominal flight;
        empty where that cannot be fired.
        """
        spacecraft, blocks = self.model.spacecraft, self.model.schedule.blocks
        if spacecraft.sun_sensor is not None and spacecraft.sun_sensor.sees_all:
            return [True] * max(
                (number for block in blocks for number in block.sun_pulses), default=0
            )
        try:
            (schedule,), sun_pulses = fire_all(spacecraft, [blocks])
        except Infeasible:
            return [False]
        if isinstance(schedule, Infeasible):
            return [False]
        return [bool(sees[0]) for sees in sun_pulses.seen]

    @cached_property
    def effort(self) -> float:
        """Units of work of a case: its pulses, and steps and looks at cones in them and in coasts
        that are no arcs.
        """
        moments = np.array(self._dynamics.moments)[:, None]
        rates = self.model.spacecraft.initial.rates
        arcs = self._bodies(moments, 0.0).free
        # Cases are flown together, from one edge to the next as long as the longest coast takes.
        late = max(
            (FAR * row.sigma for row in self.model.inputs.drawn if row.name.startswith("timing")),
            default=0.0,
        )
        edges = self.model.spacecraft.edges
        lasts = max(self.model.schedule.end + late * len(self.model.schedule), *edges, 0.0)
        in_steps = min(float(np.sum(self.model.on_times)), lasts) if arcs else lasts
        turned = float(np.linalg.norm(rates)) * in_steps
        looks = turned * sky.ROWS / sky.CIRCLE if self.model.spacecraft.keep else 0.0
        stepping = STEPPED * turned / motion.STRIDE + LOOKED * looks
        return CASE * (1.0 + len(self.model.schedule)) + stepping

    def __call__(self, cases: DispersedCases) -> Ends:
        """End states of the ``cases``. Raises Infeasible for motions too long to be integrated."""
        count = number_of(cases)
        spacecraft = self.model.spacecraft
        sheds = None
        watch = None
        if spacecraft.keep:
            watch = watch_over(spacecraft, cases.tilt, count, cases.turn)
        rates = _whole(cases.omega0, count)
        propellant = cases.propellant
        bodies = self._bodies(_whole(cases.moments, count), cases.wheel, cases.turn)
        upright = np.eye(4, 1).repeat(
            count, axis=1
        )  # the true body axes at t = 0 are where everything is seen from
        if cases.per_kg is not None and cases.spent is not None:
            sheds = np.array([_whole(cases.per_kg, count) * kg for kg in cases.spent]).reshape(
                -1, 3, count
            )
        if self.model.schedule.blocks:
            settled, turned, _, seen, over = fly(
                self.model, bodies, rates, upright, cases, self.seen_nominally, watch
            )
            if cases.spent is not None:
                propellant = sum(
                    (kg * sees for kg, sees in zip(cases.spent, seen, strict=True)), 0.0
                )
        else:
            starts = _whole(cases.starts, count)
            impulses = np.array([_whole(impulse, count) for impulse in cases.impulses]).reshape(
                -1, 3, count
            )
            if self.model.schedule.shaped:
                pulses = self._ramps(cases, starts, impulses, sheds)
            else:
                pulses = Pulses(
                    starts, np.array(self.model.on_times).reshape(-1, 1), impulses, sheds=sheds
                )
            settled, turned = fly_pulses(bodies, rates, upright, pulses, watch)
            over = np.max(pulses.edges, axis=0, initial=0.0)
        last = bodies if sheds is None else bodies.lighter(sheds.sum(axis=0))
        if watch is not None:
            watch.turn(MotionStretch(last, over, settled, turned), spacecraft.beats_until)
        before = cases.of_estimate(triple(bodies.momentum(rates)))

        def ends(here: MotionStretch, disturbed: Ends | None) -> Ends:
            momentum = triple(last.momentum(here.rates))
            after = cases.of_estimate(carried(tuple(here.quaternion), momentum))
            nutation = None
            if not np.array_equal(last.moments[0], last.moments[1]):
                wheel = last.forcing.wheel
                nutation = widest_cones(last.moments, here.rates, spacecraft.sense, wheel)[0]
            return Ends(
                momentum=cases.untwisted(momentum),
                before=before,
                after=after,
                pointed=rotated(after, cases.tilt),
                spin=here.rates[2],
                spin_change=here.rates[2] - rates[2],
                propellant=propellant,
                nutation=nutation,
                aspects=None if watch is None else watch.angles,
                drained=cases.drained,
                disturbed=disturbed,
            )

        here = MotionStretch(last, over, settled, turned)
        edge = max(spacecraft.edges, default=0.0)
        later = ends(here.moved(np.maximum(over, edge)), None) if np.any(over < edge) else None
        return ends(here, later)

    def _bodies(self, moments: Array, wheel: Cases, turn: Any = None) -> Bodies:
        torques = torques_of(self.model.spacecraft)
        if turn is not None:
            axes = np.broadcast_to(turn, (3, *moments.shape))
            own = (np.einsum("ijn,i->jn", axes, each.vector) for each in torques)
            torques = [each._replace(vector=one) for each, one in zip(torques, own, strict=True)]
        forcing = self._dynamics.forcing._replace(wheel=wheel, turning=())
        return Bodies(moments, *forced(torques, forcing))

    def _ramps(
        self, cases: DispersedCases, starts: Array, impulses: Array, sheds: Array | None
    ) -> Pulses:
        """Pulses by the ramps of their thrust, each as a pulse of its own."""
        pieces = list(self._pieces(cases, starts, impulses))
        count = starts.shape[1]
        begins, lengths, parts, leans, numbers, shares = (
            zip(*pieces, strict=True) if pieces else ((),) * 6
        )
        falls = None
        if sheds is not None:
            falls = np.array(
                [share * sheds[number] for number, share in zip(numbers, shares, strict=True)]
            )
            falls = falls.reshape(-1, 3, count)
        impulses = np.array(parts).reshape(-1, 3, count)
        return Pulses(
            _whole(begins, count), _whole(lengths, count), impulses, _whole(leans, count), falls
        )

    def _pieces(
        self, cases: DispersedCases, starts: Array, impulses: Array
    ) -> Iterator[tuple[Array, Cases, Array, Cases, int, Cases]]:
        """Begin, length, impulse and lean of each ramp, the number of its pulse, and its share of
        it.
        """
        pulses = zip(self.model.schedule, self.model.on_times, starts, impulses, strict=True)
        for number, (pulse, on_time, start, impulse) in enumerate(pulses):
            thrust = cases.thrust[number]
            if pulse.command is None:
                yield start, on_time, impulse, 0.0, number, 1.0
                continue
            for ramp in () if thrust else pulse.command.ramps:
                share, lean = (
                    ramp.impulse / pulse.on_time,
                    (ramp.last - ramp.first) / (ramp.last + ramp.first),
                )
                begin = start + (ramp.begin - (pulse.t - 0.5 * on_time))
                yield begin, ramp.end - ramp.begin, impulse * share, lean, number, share
            for thruster in thrust:
                # of the nominal pulse, evenly
                acts = thruster.opened.acts[0]
                passed = 0.0
                fall = pulse.command.fall
                for begin, length, level, lean in thruster.opened.pieces:
                    part = level * length / np.where(acts == 0.0, 1.0, acts)
                    area = level * length * (1.0 + fall * (0.5 - passed - 0.5 * part))
                    begin = start - cases.leads[number] + begin
                    impulse = _whole(thruster.torque, len(start)) * area
                    yield (
                        begin,
                        length,
                        impulse,
                        lean - 0.5 * fall * part,
                        number,
                        part / len(thrust),
                    )
                    passed = passed + part


def _whole(parts: tuple[object, ...], count: int) -> Array:
    """Numbers and arrays as rows of one array, (k, n)."""
    rows = np.empty((len(parts), count))
    for row, part in zip(rows, parts, strict=True):
        row[:] = part  # type: ignore[call-overload]
    return rows


# --- flights of many bodies through pulses


@dataclass(frozen=True, slots=True)
class Pulses:
    """Rectangular pulses; the moments fall half as one begins and half as it ends, which errs in
    second order.
    """

    starts: Array  # (k, n) s
    on_times: Array  # (k, n) s, or (k, 1) for all cases; 0: an ideal impulse
    impulses: Array  # torque × on-time, (k, 3, n) N m s
    leans: Array | None = (
        None  # (k, n): torques run evenly from 1 - lean to 1 + lean times their mean
    )
    sheds: Array | None = None  # decrease of the moments, (k, 3, n) kg m²

    def some(self, cases: Any) -> Pulses:
        """Subset of ``cases`` (an index of arrays)."""
        on_times = self.on_times if self.on_times.shape[1] == 1 else self.on_times[:, cases]
        leans = None if self.leans is None else self.leans[:, cases]
        sheds = None if self.sheds is None else self.sheds[:, :, cases]
        return Pulses(self.starts[:, cases], on_times, self.impulses[:, :, cases], leans, sheds)

    @property
    def slopes(self) -> Array | None:
        """Slope of each torque, (k, 3, n) N m/s; None where all are constant."""
        if self.leans is None or not self.leans.any():
            return None
        lasts = np.where(self.on_times == 0.0, 1.0, self.on_times)
        return np.asarray(self.impulses * (2.0 * self.leans / lasts**2)[:, None])

    @property
    def edges(self) -> Array:
        """Starts and ends in turn, (2k, n) s."""
        ends = self.starts + self.on_times
        return np.stack([self.starts, ends], axis=1).reshape(-1, self.starts.shape[1])

    @property
    def torques(self) -> tuple[Array, Array]:
        """Torque as each pulse begins and as it ends, (k, 3, n) N m each; 0 of ideal impulses."""
        on_times = self.on_times[:, None]
        ideal = on_times == 0.0
        mean = np.where(ideal, 0.0, self.impulses / np.where(ideal, 1.0, on_times))
        if self.leans is None:
            return mean, mean
        leans = self.leans[:, None]
        return (1.0 - leans) * mean, (1.0 + leans) * mean


class Observer(Protocol):
    """Observer of the motion of cases; see `sky`."""

    def some(self, cases: Any) -> Observer:
        """Observer of a subset of ``cases`` (an index of arrays)."""

    def motion(self, here: MotionStretch, duration: Array) -> None:
        """Receive the motion that `advance` is about to make with the same arguments."""


def fly_pulses(
    bodies: Bodies, rates: Array, quaternion: Array, pulses: Pulses, watch: Observer | None = None
) -> tuple[Array, Array]:
    """Rates (3, n) rad/s and unit quaternions (4, n), body -> inertial, as the last pulse of each
    case ends.

    ``rates`` and ``quaternion`` at t = 0; ``watch`` sees the motion until then. Exact to some 1e-13
    rad for each hundred radians flown. Pulses may overlap and come in any order. Raises Infeasible
    beyond `LONGEST` rad.
    """
    rates, quaternion = np.array(rates, dtype=float), np.array(quaternion, dtype=float)
    for begin in range(0, rates.shape[1], motion.BLOCK):
        cases = slice(begin, begin + motion.BLOCK)
        seen = None if watch is None else watch.some(cases)
        _fly_block(
            bodies.some(cases), rates[:, cases], quaternion[:, cases], pulses.some(cases), seen
        )
    return rates, quaternion


def _fly_block(
    bodies: Bodies, rates: Array, quaternion: Array, pulses: Pulses, watch: Observer | None
) -> None:
    """Fly one block, in place, from edge to edge of the pulses of each case.

    Those that coast from one edge to the next go on in closed form: with times widely dispersed one
    coast may be long where another case has a pulse on, whose steps it would take.
    """
    edges, slopes = pulses.edges, pulses.slopes
    firsts, lasts = pulses.torques
    ideal = np.broadcast_to(pulses.on_times == 0.0, pulses.starts.shape)
    order = np.argsort(edges, axis=0, kind="stable")
    on = np.cumsum(1 - 2 * (order % 2), axis=0)  # pulses that are on behind each edge
    now = np.zeros(rates.shape[1])
    torque = np.zeros_like(rates)
    slope = None
    for number, edge_of_each in enumerate(order):
        edge = _of_each(edges, edge_of_each)
        coasts = on[number - 1] == 0 if number else np.ones(len(now), dtype=bool)
        here = MotionStretch(bodies, now, rates, quaternion, torque, slope)
        if coasts.all():
            _advance(here._replace(torque=None, slope=None), edge - now, watch)
        elif not (bodies.free and coasts.any()):
            _advance(here, edge - now, watch)
        else:
            for cases, coasting in ((coasts, True), (~coasts, False)):
                part = here.some(np.flatnonzero(cases))
                if coasting:
                    part = part._replace(torque=None, slope=None)
                _advance(part, (edge - now)[cases], watch and watch.some(np.flatnonzero(cases)))
                rates[:, cases], quaternion[:, cases] = part.rates, part.quaternion
        if slope is not None:
            torque = torque + slope * (edge - now)
        pulse, ends = np.divmod(edge_of_each, 2)
        torque = torque + np.where(ends, -_of_each(lasts, pulse), _of_each(firsts, pulse))
        now = edge
        if slopes is not None:
            bend = np.where(ends, -1.0, 1.0) * _of_each(slopes, pulse)
            slope = bend if slope is None else slope + bend
        if pulses.sheds is not None:
            bodies = bodies.lighter(0.5 * _of_each(pulses.sheds, pulse))
        kicked = _of_each(ideal, pulse) & (ends == 0)
        if kicked.any():
            rates += np.where(kicked, _of_each(pulses.impulses, pulse), 0.0) / bodies.moments


def _of_each(values: Any, rows: NDArray[np.intp]) -> Any:
    """Values (m, …, n) of one row of each case, (…, n)."""
    if (rows == rows[0]).all():
        return values[rows[0]]
    index = rows.reshape(1, *(1,) * (values.ndim - 2), len(rows))
    return np.take_along_axis(values, index, axis=0)[0]


def _advance(here: MotionStretch, duration: Array, watch: Observer | None) -> None:
    """Propagate in place; ``watch`` sees the motion before that."""
    if watch is not None:
        watch.motion(here, duration)
    advance(here, duration)
