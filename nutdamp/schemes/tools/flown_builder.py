"""A schedule laid stage by stage along the flown motion: what the schemes that point the spin axis share."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable
from dataclasses import replace

from nutdamp import flight, work
from nutdamp.errors import Infeasible
from nutdamp.physics import attitude
from nutdamp.schedule import Pulse, Schedule
from nutdamp.schemes.tools import least_squares
from nutdamp.spacecraft import Attitude, Spacecraft

LEFT_OVER = 0.05
"""Share of nutation and turn together above which what is left makes a schedule no way to the target."""

LEFT_OVER_BY_TICKS = 0.5
"""The same where the resolution of commands may be to blame."""


ROUNDING = 1e-12
"""rad; where the spin axis is that near the target already, no pulses are needed."""


class FlownBuilder:
    """The pulses chosen so far, and the spacecraft as it is after them.

    ``here`` is the spacecraft at ``now`` s, the end of the last pulse, as if its time began there: attitude, rates,
    limits and disturbances are those of that moment, its goal is where the builder is to end. ``steps``: of integration
    that the flight took so far.
    """

    def __init__(self, spacecraft: Spacecraft) -> None:
        self.here = replace(
            spacecraft,
            goal=replace(spacecraft.goal, axis=spacecraft.target_axis),
            limits=replace(spacecraft.limits, horizon=spacecraft.horizon),
        )
        self.now = 0.0
        self.steps = 0
        self.pulses: list[Pulse] = []
        self._before: list[tuple[float, Spacecraft]] = []

    @property
    def allowed(self) -> float:
        """How many pulses the limits still allow."""
        most = self.here.limits.max_pulses
        return math.inf if most is None else most

    @property
    def left(self) -> float:
        """What is left, rad: nutation and distance of H from the target, whichever is more."""
        return max(self.here.nutation, self.here.to_turn)

    def fork(self) -> FlownBuilder:
        """Another builder that goes on from here."""
        other = FlownBuilder(self.here)
        other.now, other.pulses, other._before = self.now, list(self.pulses), list(self._before)
        return other

    def fire(self, pulses: Iterable[Pulse], *, bounded: bool = False) -> None:
        """Take ``pulses``, in order and with times from ``now``, into the schedule and fly them.

        Raises Infeasible where they are ``bounded`` by the budget of work and it ends before them.
        """
        base = self.now
        for pulse in pulses:
            if bounded and work.exhausted():
                raise Infeasible("the flight of the pulses for that was not finished")
            self._before.append((self.now, self.here))
            timed = pulse.moved(base)
            self.here, steps = _after(self.here, timed.moved(-self.now))
            self.steps += steps
            self.pulses.append(timed)
            self.now = timed.over

    def correct(self, last: int, *, resized: int = 0) -> None:
        """Move the ``last`` pulses on the flown motion until neither nutation nor distance from the target is left.

        Their sizes stay, but that of the last ``resized`` pulses, which are equal, may change as one.
        """
        taken = min(max(last, resized), len(self.pulses))
        if last == 0 or taken == 0:
            return
        self.now, self.here = self._before[-taken]
        made = Schedule(tuple(pulse.moved(-self.now) for pulse in self.pulses[-taken:]))
        del self.pulses[-taken:], self._before[-taken:]
        chosen = range(max(taken - last, 0), taken)
        self.fire(
            least_squares.correct(self.here, made, chosen=chosen, momentum=True, equal=True, resizable=resized > 0)
        )

    def schedule(self, *notes: str) -> Schedule:
        """What has been chosen."""
        return Schedule(tuple(self.pulses), notes)


def tolerable(spacecraft: Spacecraft) -> float:
    """What a schedule may leave, rad, and still count as having reached the target: more where commands have ticks."""
    share = LEFT_OVER if spacecraft.limits.tick is None else LEFT_OVER_BY_TICKS
    return max(share * (spacecraft.nutation + spacecraft.to_turn), ROUNDING)


def _after(spacecraft: Spacecraft, pulse: Pulse) -> tuple[Spacecraft, int]:
    """The spacecraft as it is when ``pulse`` ends, with its time counted from there; and the steps that it took."""
    flown = flight.flown(spacecraft, Schedule((pulse,)))
    settled, since, limits = flown.settled, pulse.over, spacecraft.limits
    to_principal = attitude.from_matrix(spacecraft.inertia.axes.T)
    given = spacecraft.attitude or Attitude(settled.quaternion)
    after = replace(
        spacecraft,
        omega0=settled.rates,
        attitude=replace(given, quaternion=attitude.multiply(settled.quaternion, to_principal), epoch=None),
        disturbances=tuple(
            replace(one, transverse=one.transverse * cmath.exp(1j * one.rate * since))
            for one in spacecraft.disturbances
        ),
        limits=replace(
            limits,
            horizon=spacecraft.horizon - since,
            earliest=limits.gap,
            max_pulses=None if limits.max_pulses is None else limits.max_pulses - 1,
            blackout=tuple((begins - since, ends - since) for begins, ends in limits.blackout if ends > since),
        ),
    )
    return after, flown.steps
