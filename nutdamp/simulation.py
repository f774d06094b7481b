"""The pulses of a plan propagated to a given time by both models: what ``simulate`` shows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

from nutdamp import flight
from nutdamp.decision import Decision
from nutdamp.flight import Flight
from nutdamp.outcome import seen_at
from nutdamp.planning import Plan
from nutdamp.track import Extremes, Track, extremes


@dataclass(frozen=True, eq=False)
class Simulation:
    """A ``plan`` propagated to ``until`` s; ``real``: through real widths is what is shown, else the impulse sum (17).

    Its track has ``samples`` rows.
    """

    plan: Plan
    until: float
    real: bool
    samples: int

    @cached_property
    def _both(self) -> tuple[Flight, Flight]:
        body, pulses = self.plan.spacecraft, self.plan.pulses
        return flight.by_impulses(body, pulses, self.until), flight.flown(body, pulses, self.until)

    @cached_property
    def impulses(self) -> Flight:
        """The flight by the impulse sum (17) as it has come by ``until``."""
        return seen_at(self._both[0], self.until)

    @cached_property
    def flown(self) -> Flight:
        """The flight through the real widths as it has come by ``until``."""
        return seen_at(self._both[1], self.until)

    @cached_property
    def shown(self) -> Flight:
        """Whichever of these is shown."""
        return replace(self.flown if self.real else self.impulses, scheme=self.plan.scheme)

    @cached_property
    def decision(self) -> Decision:
        """How the flight through the real widths meets the requirement."""
        return Decision(self.plan, seen=self.flown)

    @cached_property
    def extremes(self) -> Extremes:
        """Of the axis track."""
        return extremes(self.pieces())

    def pieces(self) -> Iterator[Track]:
        """The track of the flight shown, in pieces."""
        return self._both[self.real].pieces(self.samples, self.until)

    def track(self, samples: int, until: float) -> Track:
        """Another track of it, to another end in s."""
        return self._both[self.real].sampled(samples, until)
