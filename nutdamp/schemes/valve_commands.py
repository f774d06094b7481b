"""Valve commands: translation of rectangular pulses into commands of valves; schedules of several
legs.

A command is known by its effective on-time and the centroid of its thrust (`thruster`). Schemes
plan for the body *without valves*, which fires rectangles of full thrust within the effective
bounds of its channels, and keeps limits that leave room for the delays. Each of its pulses becomes
the command with the same impulse and centroid, cold and blowdown included; further effects of the
shape of the thrust are corrected on the flown motion.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from nutdamp.common import work
from nutdamp.common.results import Note, note
from nutdamp.errors import Infeasible, TooShort
from nutdamp.flight import propagation
from nutdamp.flight.dynamics import Supply, lightened, shed, supplied
from nutdamp.physics import attitude
from nutdamp.schemes import correction
from nutdamp.schemes.block_model import fired, sun_pulses
from nutdamp.schemes.catalogue import SchemeOptions
from nutdamp.schemes.correction import TAIL, Correction
from nutdamp.spacecraft.constraints import (
    commandable,
    effective_on_time,
    effective_on_times,
    keeps_limits,
    shortest_on_time,
)
from nutdamp.spacecraft.equipment import Block, Channel
from nutdamp.spacecraft.model import Attitude, Inertia, Limits, Spacecraft, disturbing_after
from nutdamp.spacecraft.roles import with_limits
from nutdamp.spacecraft.schedule import (
    STEERABLE,
    Pulse,
    Schedule,
    channel_pulse,
    steerable_pulse,
)

ROUNDING = 1e-12  # share by which an on-time may pass its bounds
# share of the longest pulse that the next plan leaves at either end of all, where there was too
# little room
ROOM = 0.02
# times what the plan leaves on the body without valves, that commands may leave without another
# plan
NEARLY = 1.1
EXACT = 1e-10  # rad, the same
PLANS = (
    6  # plans, at most, each with on-times that leave room for the weakest pulse of the one before
)

# Addition to the reasons of schemes, which know nothing of valves.
EFFECTIVE = (
    " (on-times and gaps here are those of the thrust, with room for the delays of the valves)"
)


def without_valves(
    spacecraft: Spacecraft,
    weakest: float = 1.0,
    strongest: float = 1.0,
    room: float = 0.0,
    used: float = 0.0,
) -> Spacecraft:
    """Body that schemes plan for: rectangles of full thrust within the capability of the channels.

    Pulses may be ``weakest`` to ``strongest`` times as strong, and ``room`` s longer at either end;
    ``used`` is in kg.
    """
    limits = spacecraft.limits
    channels = list[Channel]()
    leads = list[float]()
    lags = list[float]()
    for channel in spacecraft.channels:
        shortest, longest = effective_on_times(channel)
        if channel.valve is not None:
            lead, lag = channel.valve.reaches(shortest, longest)
            leads, lags = [*leads, lead], [*lags, lag]
        least = effective_on_time(channel, shortest_on_time(spacecraft, channel)) * max(
            strongest, 1.0
        )
        channels.append(
            channel.of(valve=None, min_on_time=least, max_on_time=longest * min(weakest, 1.0))
        )
    lead, lag = max(leads, default=0.0) + room, max(lags, default=0.0) + room
    return replace(
        spacecraft,
        channels=tuple(channels),
        cold=None,
        tank=None,
        center_of_mass_per_kg=None,
        inertia=lightened(spacecraft, used),
        limits=Limits(
            horizon=spacecraft.horizon - lag,
            earliest=limits.earliest + lead,
            gap=limits.gap + lead + lag,
            max_pulses=limits.max_pulses,
            blackout=tuple(
                (max(begins - lag, 0.0), ends + lead) for begins, ends in limits.blackout
            ),
        ),
    )


def options(spacecraft: Spacecraft, chosen: SchemeOptions) -> SchemeOptions:
    """Options of a scheme for the body without valves: a requested on-time is a command.

    Raises Infeasible where the channels make different pulses of it.
    """
    requested = getattr(chosen, "on_time", None)
    if requested is None:
        return chosen
    valves = [channel.valve for channel in spacecraft.channels]
    on_times = {requested if valve is None else valve.thrust(requested).on_time for valve in valves}
    if len(on_times) > 1:
        text = (
            f"an on-time of {requested:.4g} s is for channels with the same valve; "
            "these give pulses of different"
        )
        raise Infeasible(f"{text} length")
    return replace(chosen, on_time=on_times.pop()) if on_times else chosen  # type: ignore[call-arg]


def planned(
    spacecraft: Spacecraft, plan: Callable[[Spacecraft], Schedule], correct: Correction
) -> Schedule:
    """Schedule that ``plan`` gives for the body without valves, as commands for the true one; see
    `as_commands`.
    """
    weakest, strongest, room, used = 1.0, 1.0, 0.0, 0.0
    tried: list[tuple[bool, float, Schedule]] = []
    schedule: Schedule | None = None
    for _ in range(PLANS):
        without = without_valves(spacecraft, weakest, strongest, room, 0.5 * used)
        try:
            schedule = plan(without)
        except Infeasible as reason:
            if schedule is not None:
                break
            if isinstance(reason, TooShort):
                raise TooShort(reason.why + EFFECTIVE, reason.cure) from None
            raise type(reason)(f"{reason}{EFFECTIVE}") from None
        too_weak, too_strong, longer = _outside(spacecraft, schedule, without.inertia, correct)
        if too_weak or too_strong:
            weakest = min([weakest, *too_weak])
            strongest = max([strongest, *too_strong])
            continue
        if used == 0.0 and shed(spacecraft) is not None and schedule.propellant:
            used = schedule.propellant  # once more with the moments half-way
            continue
        try:
            commands = as_commands(spacecraft, schedule, correct, without.inertia)
        except Infeasible:
            if not tried:
                raise
            break
        kept = keeps_limits(spacecraft, commands.pulses)
        left = _left(spacecraft, commands, correct)
        tried.append((not kept, left, commands))
        if work.exhausted() or not schedule.pulses:
            break
        if kept and (
            spacecraft.limits.tick is not None
            or left <= NEARLY * _left(without, schedule, correct) + EXACT
        ):
            break
        # What is longer than planned, or has been moved, met its neighbour or a window: the next
        # one leaves room.
        room = max(2.0 * room, longer, ROOM * max(pulse.on_time for pulse in schedule))
    assert schedule is not None
    if not tried:
        return as_commands(spacecraft, schedule, correct, without.inertia)
    return min(tried, key=lambda trial: trial[:2])[2]


def _left(spacecraft: Spacecraft, schedule: Schedule, correct: Correction) -> float:
    """Residual of the bounded parts of a schedule, rad."""
    return correction.left(spacecraft, schedule, momentum=correct.momentum)


def as_commands(
    spacecraft: Spacecraft, schedule: Schedule, correct: Correction, inertia: Inertia | None = None
) -> Schedule:
    """A schedule of the body without valves as commands; ``correct`` brings them to what is left on
    the flown motion.

    ``inertia`` is that of the body without valves, default that at t = 0. Commands that give no
    thrust are left out. Raises Infeasible where the propellant does not last.
    """
    commands = _translated(spacecraft, schedule, inertia, correct)
    first = _firing(replace(schedule.without_proof, pulses=commands))
    ticks = spacecraft.limits.tick is not None and first.pulses
    corrected = _on_ticks(spacecraft, first, correct) if ticks else correct(spacecraft, first, TAIL)
    firing = _firing(corrected)
    if firing.pulses:
        supply = Supply(spacecraft)
        channels = {channel.name: channel for channel in spacecraft.channels}
        for pulse in (
            firing
        ):  # as commanded: what an empty tank has weakened would never be more than it has
            if pulse.channel in channels:
                supply.take(channels[pulse.channel], pulse.on_time)
            else:
                supply.count((pulse,))
        if supply.shortage is not None:
            raise Infeasible(supply.shortage)
    fired = [
        pulse for pulse, command in zip(schedule, commands, strict=True) if command.magnitude > 0.0
    ]
    notes = list(firing.notes)
    tank = spacecraft.tank
    if correct.options.equal and fired:
        pairs = [
            pair
            for pair in zip(fired, corrected, strict=True)
            if pair[0].on_time == fired[-1].on_time
        ]
        alike = [command.loaded[1] for _, command in pairs if command.magnitude > 0.0]
        shortest = min(alike, default=0.0)
        longest = max(alike, default=0.0)
        if f"{shortest:.4g}" != f"{longest:.4g}":
            notes.append(note("unequal-commands", shortest_s=shortest, longest_s=longest))
    if tank is not None and firing.pulses:
        full, left = 1e-5 * tank.pressure, 1e-5 * tank.pressure_after(firing.propellant or 0.0)
        if f"{full:.4g}" != f"{left:.4g}":
            notes.append(note("pressure-falls", full_bar=full, left_bar=left))
    return replace(firing, notes=tuple(notes))


def _firing(schedule: Schedule) -> Schedule:
    """Schedule without pulses of no impulse."""
    return replace(schedule, pulses=tuple(pulse for pulse in schedule if pulse.magnitude > 0.0))


def _translated(
    spacecraft: Spacecraft,
    schedule: Schedule,
    inertia: Inertia | None,
    correct: Correction,
    *,
    unbounded: bool = False,
) -> tuple[Pulse, ...]:
    """Pulses as the commands of their impulse and centroid; ``unbounded``: as rectangles of any
    length.

    Where moments fall it changes ω, or the direction of H, as the pulse did with the ``inertia`` of
    the plan, and where H does not count it comes as the nutation has turned in the body as far.
    Raises Infeasible where one is too weak.
    """
    supply = Supply(spacecraft)
    channels = {channel.name: channel for channel in spacecraft.channels}
    pulses = []
    planned_ = inertia or spacecraft.inertia
    before = 0.0
    late = 0.0
    for pulse_ in schedule:
        here = lightened(spacecraft, supply.since)
        pulse = pulse_
        if here.moments != planned_.moments:
            rate = here.nutation_rate(spacecraft.spin)
            slower = (
                1.0
                if correct.momentum or rate == 0.0
                else planned_.nutation_rate(spacecraft.spin) / rate
            )
            late += (slower - 1.0) * (pulse_.t - before)
            size = here.C / planned_.C if correct.momentum else here.A / planned_.A
            pulse = replace(
                pulse_.moved(late), on_time=size * pulse_.on_time, impulse=size * pulse_.impulse
            )
        before = pulse_.t
        channel = channels.get(pulse.channel)
        if channel is None:
            pulses.append(supply.fire(pulse, None))
            continue
        on_time = supply.on_time_for(channel, pulse.on_time)
        if on_time > spacecraft.horizon:
            level = pulse.on_time / on_time
            text = (
                f"a pulse at {level:.2g} times the thrust, cold or at low pressure, "
                f"would take {on_time:.4g} s"
            )
            raise Infeasible(f"{text}, longer than limits.horizon")
        given = (
            replace(pulse, on_time=on_time)
            if unbounded
            else channel_pulse(channel, pulse.t, on_time)
        )
        fired = supply.fire(given, channel)
        pulses.append(fired.moved(pulse.t - fired.t))
    return tuple(pulses)


def _outside(
    spacecraft: Spacecraft, schedule: Schedule, inertia: Inertia, correct: Correction
) -> tuple[list[float], list[float], float]:
    """Levels of pulses too weak, and too strong, for any command; s by which one becomes longer at
    each end.
    """
    channels = {channel.name: channel for channel in spacecraft.channels}
    weak = []
    strong = []
    longer = 0.0
    translated = _translated(spacecraft, schedule, inertia, correct, unbounded=True)
    for planned_, pulse in zip(schedule, translated, strict=True):
        longer = max(longer, 0.5 * (pulse.on_time - planned_.on_time))
        channel = channels.get(pulse.channel)
        if channel is None or pulse.torque is None:
            continue
        least, most = effective_on_times(channel)
        level = float(np.linalg.norm(pulse.torque) / np.linalg.norm(channel.torque))
        level = level if shed(spacecraft) is None else planned_.on_time / pulse.on_time
        if pulse.on_time > most * (1.0 + ROUNDING):
            weak.append(level)
        if pulse.on_time < least * (1.0 - ROUNDING):
            strong.append(level)
    return weak, strong, longer


def _on_ticks(spacecraft: Spacecraft, made: Schedule, correct: Correction) -> Schedule:
    """Schedule on the ticks of its commands: the better of rounding all at once, and the last
    pulses in turn.
    """
    smooth = with_limits(spacecraft, tick=None)
    made = correct(smooth, made, TAIL)

    def rounded(schedule: Schedule, count: int) -> Schedule:
        """Copy with the first ``count`` pulses on ticks."""
        pulses = (
            commandable(spacecraft, pulse) if index < count else pulse
            for index, pulse in enumerate(schedule)
        )
        return replace(schedule, pulses=supplied(spacecraft, pulses))

    in_turn = made
    for behind in range(min(TAIL, len(made)) - 1, 0, -1):
        in_turn = correct(smooth, rounded(in_turn, len(made) - behind), behind)
    roundings = [rounded(schedule, len(made)) for schedule in (made, in_turn)]
    kept = [
        schedule for schedule in roundings if keeps_limits(spacecraft, schedule.pulses)
    ] or roundings
    return min(kept, key=lambda schedule: _left(spacecraft, schedule, correct))


class FlownBuilder:
    """Pulses chosen so far, and the spacecraft after them.

    ``at_leg`` is the spacecraft at ``now`` s, the end of the last pulse, as if its time began
    there, with the goal of the whole. ``steps``: of integration that the flight took so far.
    """

    def __init__(self, spacecraft: Spacecraft) -> None:
        self.at_leg = replace(
            spacecraft,
            goal=replace(spacecraft.goal, axis=spacecraft.target_axis),
            limits=replace(spacecraft.limits, horizon=spacecraft.horizon),
        )
        self.now = 0.0
        self.steps = 0
        self.pulses: list[Pulse] = []
        self._before: list[tuple[float, Spacecraft]] = []

    @property
    def left(self) -> float:
        """Residual, rad: nutation or distance of H from the target, whichever is larger."""
        return max(self.at_leg.nutation, self.at_leg.to_turn)

    def fork(self) -> FlownBuilder:
        """Another builder that goes on from here."""
        other = FlownBuilder(self.at_leg)
        other.now, other.pulses, other._before = self.now, list(self.pulses), list(self._before)
        return other

    def fire(self, pulses: Iterable[Pulse], *, bounded: bool = False) -> None:
        """Take and fly ``pulses``, in order, timed from ``now``; Infeasible where they are
        ``bounded`` by work left.
        """
        base = self.now
        for pulse in pulses:
            if bounded and work.exhausted():
                raise Infeasible("the flight of the pulses for that was not finished")
            self._before.append((self.now, self.at_leg))
            timed = pulse.moved(base)
            at_leg = self.at_leg
            pulse_ = timed.moved(-self.now)
            flown = propagation.flown(at_leg, Schedule((pulse_,)))
            settled, since, limits = flown.settled, pulse_.over, at_leg.limits
            to_principal = attitude.from_matrix(at_leg.inertia.axes.T)
            given = at_leg.attitude or Attitude(settled.quaternion)
            self.at_leg = replace(
                at_leg,
                inertia=lightened(at_leg, pulse_.propellant or 0.0),
                omega0=settled.rates,
                attitude=replace(
                    given,
                    quaternion=attitude.multiply(settled.quaternion, to_principal),
                    epoch=None,
                ),
                disturbances=disturbing_after(at_leg.disturbances, since),
                limits=replace(
                    limits,
                    horizon=at_leg.horizon - since,
                    earliest=limits.gap,
                    max_pulses=None if limits.max_pulses is None else limits.max_pulses - 1,
                    blackout=tuple(
                        (begins - since, ends - since)
                        for begins, ends in limits.blackout
                        if ends > since
                    ),
                ),
            )
            self.steps += flown.steps
            self.pulses.append(timed)
            self.now = timed.over

    def correct(self, last: int, *, resized: int = 0) -> None:
        """Move the ``last`` pulses until nothing is left; sizes stay, but those of ``resized``
        equal ones, as one.
        """
        taken = min(max(last, resized), len(self.pulses))
        if last == 0 or taken == 0:
            return
        self.now, self.at_leg = self._before[-taken]
        made = Schedule(tuple(pulse.moved(-self.now) for pulse in self.pulses[-taken:]))
        del self.pulses[-taken:], self._before[-taken:]
        chosen = range(max(taken - last, 0), taken)
        self.fire(
            correction.correct(
                self.at_leg, made, chosen=chosen, momentum=True, equal=True, resizable=resized > 0
            )
        )

    def schedule(self, *notes: Note) -> Schedule:
        """Chosen pulses; ideal ones of a steerable torquer at one moment as their sum."""
        pulses = list[Pulse]()
        torquer = self.at_leg.torquer
        for pulse in self.pulses:
            ideal = pulse.channel == STEERABLE and pulse.on_time == 0.0
            if torquer is not None and ideal and pulses and pulses[-1].t == pulse.t:
                first, second, _ = (pulses.pop().impulse + pulse.impulse).tolist()
                angle = math.atan2(second, first)
                size = math.hypot(first, second)
                pulses.append(steerable_pulse(torquer, pulse.t, angle, impulse=size))
            else:
                pulses.append(pulse)
        return Schedule(tuple(pulses), notes)


class Legs:
    """Schedules for a spacecraft, one after the other: pulses, or the ``blocks`` that fire them."""

    def __init__(self, spacecraft: Spacecraft) -> None:
        self.spacecraft, self.blocks = spacecraft, list[Block]()
        self._builder, self._supply = FlownBuilder(spacecraft), Supply(spacecraft)

    @property
    def at_leg(self) -> Spacecraft:
        """Spacecraft after the legs so far, its time from there."""
        return self._supply.behind(self._builder.at_leg)

    def fire(self, schedule: Schedule) -> None:
        """Take the schedule of one more leg, with times and Sun pulses counted from `at_leg`."""
        now, builder = self._builder.now, self._builder
        if schedule.blocks and now > 0.0:
            passed = len(
                sun_pulses(propagation.flown(self.spacecraft, builder.schedule(), now), now)
            )
            later = tuple(replace(block, first=block.first + passed) for block in schedule.blocks)
            schedule = replace(schedule, blocks=later)
        self.blocks += schedule.blocks
        builder.fire(schedule)
        self._supply.count(schedule)

    def schedule(self, *notes: Note) -> Schedule:
        """All of them in one, with the Sun pulses of the whole flight."""
        whole = fired(self.spacecraft, self.blocks) if self.blocks else self._builder.schedule()
        return replace(whole, notes=notes)
