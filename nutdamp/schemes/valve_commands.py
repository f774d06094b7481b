"""Valve commands: translation of rectangular pulses into commands of valves; schedules of several
legs.

A command is known by its effective on-time and the centroid of its thrust (`thruster`). Schemes
plan for the body *without valves*, which fires rectangles of full thrust within the effective
bounds of its channels, and keeps limits that leave room for the delays. Each of its pulses becomes
the command with the same impulse and centroid, cold and blowdown included; further effects of the
shape of the thrust are corrected on the flown motion.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from nutdamp.common import work
from nutdamp.common.results import note
from nutdamp.errors import Infeasible
from nutdamp.flight.dynamics import Supply, lightened, shed, supplied
from nutdamp.schemes import correction
from nutdamp.schemes.catalogue import SchemeOptions
from nutdamp.schemes.correction import TAIL, Correction
from nutdamp.spacecraft.constraints import (
    commandable,
    effective_on_time,
    effective_on_times,
    keeps_limits,
    shortest_on_time,
)
from nutdamp.spacecraft.equipment import Channel
from nutdamp.spacecraft.model import Inertia, Limits, Spacecraft
from nutdamp.spacecraft.roles import with_limits
from nutdamp.spacecraft.schedule import (
    Pulse,
    Schedule,
    channel_pulse,
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

    A fixed point in a few rounds: each plans with what the commands of the one before need.
    """
    weakest, strongest, room, used = 1.0, 1.0, 0.0, 0.0
    tried: list[tuple[bool, float, Schedule]] = []
    for _ in range(PLANS):
        without = without_valves(spacecraft, weakest, strongest, room, used)
        try:
            schedule = plan(without)
        except Infeasible as reason:
            if tried:
                break
            raise type(reason)(f"{reason}{EFFECTIVE}") from None
        try:
            levels, longer = _demands(spacecraft, schedule, without.inertia, correct)
            commands = as_commands(spacecraft, schedule, correct, without.inertia)
        except Infeasible:
            if tried:
                break
            raise
        broken = not keeps_limits(spacecraft, commands.pulses)
        left = _left(spacecraft, commands, correct)
        tried.append((broken, left, commands))
        halfway = used if shed(spacecraft) is None else 0.5 * (schedule.propellant or 0.0)
        fed = not levels and (used > 0.0 or halfway == 0.0)  # as strong, and with moments half-way
        near = spacecraft.limits.tick is not None or (
            left <= NEARLY * _left(without, schedule, correct) + EXACT
        )
        if work.exhausted() or not schedule.pulses or (fed and near and not broken):
            break
        if fed:
            # What is longer than planned, or has been moved, met its neighbour or a window.
            room = max(2.0 * room, longer, ROOM * max(pulse.on_time for pulse in schedule))
        weakest, strongest = min([weakest, *levels]), max([strongest, *levels])
        used = used or halfway
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
    fired = [pulse for pulse, each in zip(schedule, commands, strict=True) if each.magnitude > 0.0]
    notes = list(firing.notes)
    tank = spacecraft.tank
    lengths = [
        (pulse.on_time, command.loaded[1])
        for pulse, command in zip(fired, corrected, strict=True)
        if command.magnitude > 0.0
    ]
    if correct.options.equal and lengths:
        alike = [length for on_time, length in lengths if on_time == lengths[-1][0]]
        if f"{min(alike):.4g}" != f"{max(alike):.4g}":
            notes.append(note("unequal-commands", shortest_s=min(alike), longest_s=max(alike)))
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


def _demands(
    spacecraft: Spacecraft, schedule: Schedule, inertia: Inertia, correct: Correction
) -> tuple[list[float], float]:
    """Levels of pulses too weak or too strong for any command; s by which one becomes longer at
    each end.
    """
    channels = {channel.name: channel for channel in spacecraft.channels}
    levels = list[float]()
    longer = 0.0
    translated = _translated(spacecraft, schedule, inertia, correct, unbounded=True)
    for planned_, pulse in zip(schedule, translated, strict=True):
        longer = max(longer, 0.5 * (pulse.on_time - planned_.on_time))
        channel = channels.get(pulse.channel)
        if channel is None:
            continue
        least, most = effective_on_times(channel)
        if not least * (1.0 - ROUNDING) <= pulse.on_time <= most * (1.0 + ROUNDING):
            levels.append(planned_.on_time / pulse.on_time)
    return levels, longer


def _on_ticks(spacecraft: Spacecraft, made: Schedule, correct: Correction) -> Schedule:
    """Schedule on the ticks of its commands: its last pulses are rounded in turn, and those behind
    corrected.
    """
    smooth = with_limits(spacecraft, tick=None)
    made = correct(smooth, made, TAIL)
    for behind in range(min(TAIL, len(made)) - 1, -1, -1):
        pulses = (
            commandable(spacecraft, pulse) if index < len(made) - behind else pulse
            for index, pulse in enumerate(made)
        )
        made = replace(made, pulses=supplied(spacecraft, pulses))
        if behind > 0:
            made = correct(smooth, made, behind)
    return made
