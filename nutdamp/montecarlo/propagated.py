"""Cases flown, many at once, through real pulse widths."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nutdamp.errors import Infeasible
from nutdamp.flight.dynamics import forced, make_dynamics, torques_of
from nutdamp.montecarlo.cases import (
    DispersedCases,
    DispersedModel,
    Thrusting,
    in_body,
    rotated,
    watch_over,
)
from nutdamp.physics import attitude, motion, sky
from nutdamp.physics.motion import Bodies, MotionStretch, advance
from nutdamp.physics.sky import AxisWatch, SunPulseClock, TorqueRamp
from nutdamp.physics.triaxial import widest_cones
from nutdamp.schemes.block_model import fire_all, pushes
from nutdamp.spacecraft.equipment import firings

Array = NDArray[np.float64]

# standard deviations of times that the effort of cases counts with
FAR = 8.0


@dataclass(frozen=True, slots=True)
class Ends:
    """End states of n cases; H (3, n) N m s, in the axes named, of which those of t = 0 are fixed
    in space.
    """

    momentum: Array  # H in the frame that turns with the nutation: (AΩ1, AΩ2, Cω3)
    before: Array  # H at t = 0 in the true body axes of t = 0
    after: Array  # H in the true body axes of t = 0
    pointed: Array  # H in the estimated body axes of t = 0
    spin: Array  # ω3, (n,) rad/s
    spin_change: Array  # gain of ω3, (n,) rad/s
    propellant: Array | None  # (n,) kg
    nutation: Array | None = None  # rad; None: the angle of ``momentum``, as for I1 = I2
    # least and largest angle from spin axis to each cone on the way, (m, 2, n) rad
    aspects: Array | None = None
    drained: Any = 0.0  # as of `DispersedCases`
    disturbed: Ends | None = None  # when the last disturbance has begun or ended, if later


def fly(
    model: DispersedModel,
    bodies: Bodies,
    quaternion: Array,
    cases: DispersedCases,
    nominal: Sequence[bool],
    watch: AxisWatch | None = None,
) -> tuple[MotionStretch, Array, NDArray[np.bool_]]:
    """Fire the blocks of ``model`` in each case from its own Sun pulses; ``watch`` sees the motion.

    ``nominal``: `RealWidths.seen_nominally`. Returns the motion from the end of the last pulse on;
    starts (k, n) s of the commands; whether they fire (k, n): not once the sensor has seen the Sun
    in other turns than in the nominal flight.
    """
    spacecraft, pulses = model.spacecraft, model.schedule.pulses
    sensor = spacecraft.sun_sensor
    assert sensor is not None
    assert spacecraft.sun is not None
    starts, seen = np.empty(cases.starts.shape), np.empty(cases.starts.shape, dtype=bool)
    clock = SunPulseClock(
        MotionStretch(bodies, np.zeros(cases.count), cases.omega0.copy(), quaternion.copy()),
        in_body(spacecraft, cases.tilt, cases.count, spacecraft.sun, cases.turn),
        math.copysign(1.0, spacecraft.spin),
        sensor.azimuth,
        cases.turn,
    )
    passages = np.flatnonzero(nominal) + 1  # those that the sensor sees of the passages of the Sun
    sees_all = all(nominal)
    before = 0
    alike = np.ones(cases.count, dtype=bool)
    for index, (number, _, block) in enumerate(firings(model.schedule.blocks)):
        alike &= number <= len(passages)
        passage = int(passages[number - 1]) if number <= len(passages) else before + 1
        for between in () if sees_all else range(before + 1, passage):
            sees = sensor.sees(clock.angle(clock.sun_pulse(between)))
            alike &= sees == nominal[between - 1]
        sun_pulse = clock.sun_pulse(passage)
        before = passage
        alike &= sensor.sees(clock.angle(sun_pulse)) & ~clock.lost
        seen[index] = alike
        if cases.thrust[index]:
            torques = _pushes(cases.thrust[index], alike)
        else:
            mean = cases.impulses[index] / (pulses[index].on_time or 1.0)
            torques = pushes(pulses[index], mean * alike)
        sheds = None
        if cases.per_kg is not None and cases.spent is not None:
            sheds = cases.per_kg * (cases.spent[index] * alike)
        shift = cases.starts[index] - pulses[index].loaded[0]
        delay = block.delay + clock.turning(np.full(cases.count, block.angle)) + shift
        starts[index] = clock.fire(sun_pulse, delay, block.width, torques, sheds)
        if watch is not None:
            for stretch, end in clock.passed:
                watch.motion(stretch, end - stretch.since)
    return clock.here, starts, seen


def _pushes(thrust: Sequence[Thrusting], seen: NDArray[np.bool_]) -> list[TorqueRamp]:
    """Torques of thrusters through valves of their own, together, between successive corners of
    their thrust.
    """
    corners = [np.broadcast_to(part, seen.shape) for each in thrust for part in each.opened.corners]
    ramps = []
    for begin, end in pairwise(np.sort(corners, axis=0)):
        first, last = (
            sum(
                each.torque * seen * each.opened.within(0.5 * (begin + end), edge)
                for each in thrust
            )
            for edge in (begin, end)
        )
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
        spacecraft = self.model.spacecraft
        watch = None
        if spacecraft.keep:
            watch = watch_over(spacecraft, cases.tilt, cases.count, cases.turn)
        bodies = self._bodies(cases.moments, cases.wheel, cases.turn)
        # the true body axes at t = 0 are where everything is seen from
        upright = np.eye(4, 1).repeat(cases.count, axis=1)
        propellant, sheds = cases.propellant, None
        if cases.per_kg is not None and cases.spent is not None:
            sheds = cases.per_kg * cases.spent[:, None]
        last = bodies if sheds is None else bodies.lighter(sheds.sum(axis=0))
        if self.model.schedule.blocks:
            end, _, seen = fly(self.model, bodies, upright, cases, self.seen_nominally, watch)
            end = end._replace(bodies=last)
            if cases.spent is not None:
                propellant = (cases.spent * seen).sum(axis=0)
        else:
            pulses = self._pulses(cases, sheds)
            over = np.max(pulses.edges, axis=0, initial=0.0)
            end = MotionStretch(
                last, over, *fly_pulses(bodies, cases.omega0, upright, pulses, watch)
            )
        if watch is not None:
            watch.turn(end, spacecraft.beats_until)
        before = cases.of_estimate(bodies.momentum(cases.omega0))

        def ends(here: MotionStretch, disturbed: Ends | None) -> Ends:
            momentum = last.momentum(here.rates)
            after = cases.of_estimate(np.array(attitude.turned(here.quaternion, momentum)))
            nutation = None
            if not last.symmetric:
                wheel = last.forcing.wheel
                nutation = widest_cones(last.moments, here.rates, spacecraft.sense, wheel)[0]
            return Ends(
                momentum=cases.untwisted(momentum),
                before=before,
                after=after,
                pointed=rotated(after, cases.tilt),
                spin=here.rates[2],
                spin_change=here.rates[2] - cases.omega0[2],
                propellant=propellant,
                nutation=nutation,
                aspects=None if watch is None else watch.angles,
                drained=cases.drained,
                disturbed=disturbed,
            )

        edge = max(spacecraft.edges, default=0.0)
        later = None
        if np.any(end.since < edge):
            later = ends(end.moved(np.maximum(end.since, edge)), None)
        return ends(end, later)

    def _bodies(self, moments: Array, wheel: Any, turn: Any = None) -> Bodies:
        torques = torques_of(self.model.spacecraft)
        if turn is not None:
            axes = np.broadcast_to(turn, (3, *moments.shape))
            own = (np.einsum("ijn,i->jn", axes, each.vector) for each in torques)
            torques = [each._replace(vector=one) for each, one in zip(torques, own, strict=True)]
        forcing = self._dynamics.forcing._replace(wheel=wheel, turning=())
        return Bodies(moments, *forced(torques, forcing))

    def _pulses(self, cases: DispersedCases, sheds: Array | None) -> Pulses:
        """Pulses of the cases, those through valves by the ramps of their thrust, each as a pulse
        of its own.
        """
        if not self.model.schedule.shaped:
            on_times = np.array(self.model.on_times).reshape(-1, 1)
            return Pulses(cases.starts, on_times, cases.impulses, sheds=sheds)
        columns = list(zip(*self._pieces(cases), strict=True)) or [()] * 6
        begins, lengths, leans = (
            np.array([np.broadcast_to(part, cases.count) for part in columns[at]]).reshape(
                -1, cases.count
            )
            for at in (0, 1, 3)
        )
        falls = None
        if sheds is not None:
            shares = zip(columns[4], columns[5], strict=True)
            falls = np.array([share * sheds[number] for number, share in shares])
            falls = falls.reshape(-1, 3, cases.count)
        impulses = np.array(columns[2]).reshape(-1, 3, cases.count)
        return Pulses(begins, lengths, impulses, leans, falls)

    def _pieces(self, cases: DispersedCases) -> Iterator[tuple[Any, ...]]:
        """Begin, length, impulse and lean of each ramp, the number of its pulse, and its share of
        it.
        """
        for number, pulse in enumerate(self.model.schedule):
            start, impulse, thrust = (
                cases.starts[number],
                cases.impulses[number],
                cases.thrust[number],
            )
            if pulse.command is None:
                yield start, pulse.on_time, impulse, 0.0, number, 1.0
                continue
            for ramp in () if thrust else pulse.command.ramps:
                share = ramp.impulse / pulse.on_time
                lean = (ramp.last - ramp.first) / (ramp.last + ramp.first)
                begin = start + (ramp.begin - pulse.command.start)
                yield begin, ramp.end - ramp.begin, impulse * share, lean, number, share
            for thruster in thrust:
                # of the nominal pulse, evenly
                acts = thruster.opened.acts[0]
                passed = 0.0
                fall = pulse.command.fall
                for begin, length, level, lean in thruster.opened.pieces:
                    part = level * length / np.where(acts == 0.0, 1.0, acts)
                    area = level * length * (1.0 + fall * (0.5 - passed - 0.5 * part))
                    impulse = np.broadcast_to(thruster.torque * area, (3, cases.count))
                    lean = lean - 0.5 * fall * part
                    yield start + begin, length, impulse, lean, number, part / len(thrust)
                    passed = passed + part


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


def fly_pulses(
    bodies: Bodies, rates: Array, quaternion: Array, pulses: Pulses, watch: AxisWatch | None = None
) -> tuple[Array, Array]:
    """Rates (3, n) rad/s and unit quaternions (4, n), body -> inertial, as the last pulse of each
    case ends.

    ``rates`` and ``quaternion`` at t = 0; ``watch`` sees the motion until then. Exact to some 1e-13
    rad for each hundred radians flown. Pulses may overlap and come in any order. Raises Infeasible
    beyond `motion.LONGEST` rad.

    All fly from edge to edge of the pulses of each case. Those that coast from one edge to the next
    go on in closed form: with times widely dispersed one coast may be long where another case has a
    pulse on, whose steps it would take.
    """
    rates, quaternion = np.array(rates, dtype=float), np.array(quaternion, dtype=float)
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
            for coasting in (True, False):
                cases = np.flatnonzero(coasts == coasting)
                part = here.some(cases)
                if coasting:
                    part = part._replace(torque=None, slope=None)
                _advance(part, (edge - now)[cases], watch and watch.some(cases))
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
    return rates, quaternion


def _of_each(values: Any, rows: NDArray[np.intp]) -> Any:
    """Values (m, …, n) of one row of each case, (…, n)."""
    if (rows == rows[0]).all():
        return values[rows[0]]
    index = rows.reshape(1, *(1,) * (values.ndim - 2), len(rows))
    return np.take_along_axis(values, index, axis=0)[0]


def _advance(here: MotionStretch, duration: Array, watch: AxisWatch | None) -> None:
    """Propagate in place; ``watch`` sees the motion before that."""
    if watch is not None:
        watch.motion(here, duration)
    advance(here, duration)
