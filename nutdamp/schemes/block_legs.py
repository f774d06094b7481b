"""Schedules of several legs, each planned on what the ones before leave."""

from __future__ import annotations

from dataclasses import replace

from nutdamp.common.results import Note
from nutdamp.flight import propagation
from nutdamp.flight.dynamics import Supply
from nutdamp.schemes.block_model import fired, sun_pulses
from nutdamp.schemes.correction import FlownBuilder
from nutdamp.spacecraft.equipment import Block
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.schedule import Schedule


class Legs:
    """Schedules for a spacecraft, one after the other: pulses, or the ``blocks`` that fire them."""

    def __init__(self, spacecraft: Spacecraft) -> None:
        self.body, self.blocks = spacecraft, list[Block]()
        self._builder, self._supply = FlownBuilder(spacecraft), Supply(spacecraft)

    @property
    def here(self) -> Spacecraft:
        """Spacecraft after the legs so far, its time from there."""
        return self._supply.behind(self._builder.here)

    def fire(self, schedule: Schedule) -> None:
        """Take the schedule of one more leg, with times and Sun pulses counted from `here`."""
        now, builder = self._builder.now, self._builder
        if schedule.blocks and now > 0.0:
            passed = len(sun_pulses(propagation.flown(self.body, builder.schedule(), now), now))
            later = tuple(replace(block, first=block.first + passed) for block in schedule.blocks)
            schedule = replace(schedule, blocks=later)
        self.blocks += schedule.blocks
        builder.fire(schedule)
        self._supply.count(schedule)

    def schedule(self, *notes: Note) -> Schedule:
        """All of them in one, with the Sun pulses of the whole flight."""
        whole = fired(self.body, self.blocks) if self.blocks else self._builder.schedule()
        return replace(whole, notes=notes)
