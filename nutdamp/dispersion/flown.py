"""Cases flown through real pulse widths, with the true tensor and the disturbances, many at once."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from nutdamp.dispersion import sun_fired
from nutdamp.dispersion.cases import DispersedCases, Model
from nutdamp.dispersion.elementwise import Cases, Triple, rotated, triple
from nutdamp.dispersion.kernel import Ends, carried
from nutdamp.dispersion.watched import number_of, watch_of
from nutdamp.dynamics import Dynamics, make_dynamics
from nutdamp.physics import axis_watch, rigid_cases
from nutdamp.physics.arc_cones import arc_cones

Array = NDArray[np.float64]

CASE, STEPPED, LOOKED = 2e-3, 1e-2, 4e-3
"""Units of work: of a case and of each of its pulses, of a step of a coast that is no arc, of a look at its axis."""


@dataclass(frozen=True, eq=False)
class RealWidths:
    """Flies cases of ``model`` by Euler's equations, see `nutdamp.physics.rigid_cases`.

    Disturbances and dissipation act as the estimate has them, whatever the moments of a case are.
    """

    model: Model

    @cached_property
    def _dynamics(self) -> Dynamics:
        return make_dynamics(self.model.spacecraft)

    @cached_property
    def _seen(self) -> list[bool]:
        return sun_fired.seen_nominally(self.model)

    @cached_property
    def effort(self) -> float:
        """Units of work of a case: its pulses, and where coasts are no arcs, its steps and looks at cones."""
        moments, rates = np.array(self._dynamics.moments)[:, None], self.model.spacecraft.initial.rates
        arcs = self._bodies(moments).free
        turned = 0.0 if arcs else float(np.linalg.norm(rates)) * self.model.schedule.end
        looks = turned * axis_watch.ROWS / axis_watch.CIRCLE if self.model.spacecraft.keep else 0.0
        stepping = STEPPED * turned / rigid_cases.STRIDE + LOOKED * looks
        return CASE * (1.0 + len(self.model.schedule)) + stepping

    def __call__(self, cases: DispersedCases) -> Ends:
        """How the ``cases`` end. Raises Infeasible for motions too long to be integrated."""
        count = number_of(cases)
        watch = watch_of(self.model, cases) if self.model.spacecraft.keep else None
        moments, rates = _whole(cases.moments, count), _whole(cases.omega0, count)
        propellant = cases.propellant
        if self.model.schedule.blocks:
            settled, turned, _, seen, over = sun_fired.fly(
                self.model, self._bodies(moments), rates, _upright(count), cases, self._seen, watch
            )
            if cases.spent is not None:
                propellant = sum((kg * sees for kg, sees in zip(cases.spent, seen, strict=True)), 0.0)
        else:
            starts = _whole(cases.starts, count)
            impulses = np.array([_whole(impulse, count) for impulse in cases.impulses]).reshape(-1, 3, count)
            pulses = rigid_cases.Pulses(starts, np.array(self.model.on_times), impulses, sheds=_sheds(cases, count))
            if self.model.schedule.through_valves:
                pulses = self._ramps(cases, starts, impulses)
            settled, turned = rigid_cases.fly(self._bodies(moments), rates, _upright(count), pulses, watch)
            over = np.max(pulses.edges, axis=0, initial=0.0)
        shed = _sheds(cases, count)
        last = moments if shed is None else moments - shed.sum(axis=0)
        if watch is not None:
            watch.turn(rigid_cases.Stretch(self._bodies(last), over, settled, turned))
        momentum = triple(last * settled)
        after = carried(tuple(turned), momentum)
        sense = math.copysign(1.0, self.model.spacecraft.spin)
        return Ends(
            momentum=momentum,
            before=triple(moments * rates),
            after=after,
            pointed=rotated(after, cases.tilt),
            spin=settled[2],
            spin_change=settled[2] - rates[2],
            propellant=propellant,
            nutation=None if np.array_equal(last[0], last[1]) else largest_nutation(last, momentum, sense),
            aspects=None if watch is None else watch.angles,
            drained=cases.drained,
        )

    def _bodies(self, moments: Array) -> rigid_cases.Bodies:
        return rigid_cases.Bodies(moments, self._dynamics.constant, self._dynamics.forcing)

    def _ramps(self, cases: DispersedCases, starts: Array, impulses: Array) -> rigid_cases.Pulses:
        """The pulses by the ramps of their thrust, each as one of its own; as in `rigid_cases.Pulses`."""
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
            for one in thrust:
                acts = one.opened.acts[0]
                for begin, length, level, lean in one.opened.pieces:
                    area = level * length
                    part = area / np.where(acts == 0.0, 1.0, acts) / len(thrust)
                    add(command + begin, length, _whole(one.torque, count) * area, lean, number, part)
        return rigid_cases.Pulses(
            np.array(begins).reshape(-1, count),
            np.array(lengths).reshape(-1, count),
            np.array(parts).reshape(-1, 3, count),
            np.array(leans).reshape(-1, count),
            None if sheds is None else np.array(falls).reshape(-1, 3, count),
        )


def _sheds(cases: DispersedCases, count: int) -> Array | None:
    """What each pulse takes off the moments, (k, 3, n) kg m²; None where they stay."""
    if cases.per_kg is None or cases.spent is None:
        return None
    return np.array([_whole(cases.per_kg, count) * kg for kg in cases.spent]).reshape(-1, 3, count)


def _upright(count: int) -> Array:
    """Quaternions (4, n) of the true body axes at t = 0, which are where everything is seen from."""
    upright = np.zeros((4, count))
    upright[0] = 1.0
    return upright


def largest_nutation(moments: Array, momentum: Triple, sense: float) -> Array:
    """Largest angle (n,) in rad between H and the spin axis on the torque-free motions through ``momentum``.

    ``moments`` (3, n) kg m². What u1 (1/I1 - 1/I3) + u2 (1/I2 - 1/I3) is, u the squared components of H, stays
    (2T - H²/I3), as do the other two sums of its kind: so the components where one of H1, H2 vanishes follow without
    differences of large numbers. Motions about another axis than the third go one by one, by `arc_cones`.
    """
    u1, u2, u3 = (part * part for part in momentum)
    first, second, third = 1.0 / moments
    across = u1 * (first - third) + u2 * (second - third)
    with np.errstate(divide="ignore", invalid="ignore"):
        # Where H2 = 0 there are H1 and H3, and where H1 = 0 there are H2 and H3.
        ends = [
            (across / (first - third), u3 + u2 * (first - second) / (first - third)),
            (across / (second - third), u3 + u1 * (second - first) / (second - third)),
        ]
        angles = [np.arctan2(np.sqrt(transverse), np.sqrt(axial)) for transverse, axial in ends]
        largest = np.maximum(*angles)
        plain = (first - third) * (second - third) > 0.0
        for transverse, axial in ends:
            plain &= (transverse >= 0.0) & (axial > 0.0)
    plain &= sense * momentum[2] > 0.0
    for case in np.flatnonzero(~plain):
        first_, second_, third_ = (float(moment) for moment in moments[:, case])
        rates = np.array([part[case] for part in momentum]) / moments[:, case]
        largest[case] = arc_cones((first_, second_, third_), rates, sense).nutation
    return np.asarray(largest)


def _whole(parts: tuple[object, ...], count: int) -> Array:
    """Numbers and arrays as rows of one array, (k, n)."""
    rows = np.empty((len(parts), count))
    for row, part in zip(rows, parts, strict=True):
        row[:] = part  # type: ignore[call-overload]
    return rows
