"""Half cones in a row: the spin axis swings along the great circle to the target, half a nutation
turn at a time.

From a pure spin n half cones cost 2n C|ω3| tan(β/2n) in n + 1 pulses: one puts H half-way ahead of
the spin axis, each further one half a turn later puts it ahead again, the last stops it on the
target. A nutation at t = 0 is damped first only where one pulse cannot take it out: else the first
one jumps straight onto its first cone.
"""

from __future__ import annotations

import math

import numpy as np

from nutdamp.common import work
from nutdamp.common.results import note
from nutdamp.errors import Infeasible, TooShort
from nutdamp.flight.dynamics import free_coast
from nutdamp.physics import attitude, precession
from nutdamp.schemes import pulse_pairs
from nutdamp.schemes.catalogue import HalfConeOptions
from nutdamp.schemes.legs import Legs, damped
from nutdamp.schemes.pulse_pairs import SteerablePair
from nutdamp.schemes.sequential import expect_aim, reach, strongest_turn
from nutdamp.spacecraft.constraints import Windows, commandable, usable
from nutdamp.spacecraft.equipment import Channel
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.schedule import Pulse, Schedule, channel_pulse

PATIENCE = 5  # numbers of cones that may fail before the search ends
# sizes of a body-fixed pulse that are looked at, as shares of the one that an equal cone needs
SHARES = np.linspace(0.6, 1.3, 15)
WORTH_WAITING = 0.05  # share of one pulse that waiting for a better phase must save
# largest relative difference of a cone from equal ones: enough for a channel to be in phase
UNEQUAL = 0.3
# largest ratio of the remaining cones to equal ones after a pulse; beyond, the last have too much
# to do
LAGGING = 1.1
SAMPLES = 96  # moments looked at in each turn of the body
LONGEST_SEARCH = 6000  # moments looked at for one pulse, at most
# units of `work` of each moment at which a channel is looked at for the first pulse of a row
PLACE = 1e-3

MOST_CONES = 60  # cones tried at most where their number is not given


def schedule(spacecraft: Spacecraft, options: HalfConeOptions) -> Schedule:
    """So many half cones as requested, or the fewest of which one more saves less than 1 %; raises
    Infeasible.
    """
    expect_aim(spacecraft)
    legs = Legs(spacecraft)
    if math.tan(spacecraft.nutation) > reach(spacecraft) / abs(spacecraft.axial):
        legs = damped(legs)
    if options.cones is not None:
        return _row(legs, options.cones)
    at_leg = legs.at_leg
    limits = at_leg.limits
    turn = max(at_leg.to_turn - at_leg.nutation, 0.0)
    most_turned = reach(at_leg) / abs(at_leg.axial)
    fewest = 1 if math.tan(0.5 * turn) <= most_turned else MOST_CONES
    if fewest > 1 and most_turned > 0.0:
        fewest = min(max(math.ceil(turn / (2.0 * math.atan(0.5 * most_turned))), 2), MOST_CONES)
    half_turn = math.pi * at_leg.inertia.A / abs(at_leg.axial)
    most = min(MOST_CONES, int(max(at_leg.horizon - limits.earliest, 0.0) / half_turn) + 1)
    if limits.max_pulses is not None:
        most = min(most, limits.max_pulses - 1)
    if limits.max_pulses is not None and limits.max_pulses <= fewest:
        raise Infeasible(
            f"{fewest} half cones take {fewest + 1} pulses at least, "
            f"and limits.max_pulses allows {limits.max_pulses}"
        )
    best: Schedule | None = None
    reason: Infeasible = TooShort(
        f"the target takes at least {fewest} half cones, each half a nutation turn of "
        f"{half_turn:.4g} s, and there are at most {max(most, 0)} within the limits; "
        f"{strongest_turn(at_leg)}"
    )
    cones = fewest
    failed = 0
    while cones <= most and failed <= PATIENCE:
        try:
            row = _row(legs.fork(), cones)
        except Infeasible as why:
            reason = why
            failed = failed + 1 if best is None else PATIENCE + 1
        else:
            if best is not None and row.cost > 0.99 * best.cost:  # fewer cones end earlier
                break
            best = row
        if work.exhausted():
            break
        cones += 1 + cones // 6  # where there are many, in steps of a sixth
    if best is None:
        raise reason
    return best


def _row(legs: Legs, cones: int) -> Schedule:
    """Row of half cones, each planned from the motion that the one before leaves."""
    spacecraft = legs.at_leg
    damped = len(legs.pulses)
    most = spacecraft.limits.max_pulses
    if most is not None and most < cones + 1:
        raise Infeasible(
            f"{cones} half cones take {cones + 1} pulses, and limits.max_pulses leaves {most}"
        )
    for remaining in range(cones, 1, -1):
        at_leg = legs.at_leg
        steered = (
            None if at_leg.torquer is None else SteerablePair(at_leg, at_leg.torquer).one(remaining)
        )
        legs.fire(steered or (_fixed(at_leg, remaining),))
    legs.fire(pulse_pairs.schedule(legs.at_leg))
    angle = spacecraft.to_turn
    schedule = legs.schedule()
    if (
        len(schedule) == cones + 1
        and not damped
        and spacecraft.nutation < 1e-9
        and 0.0 < angle < cones * math.pi
    ):
        ideal = precession.half_cones_impulse(abs(spacecraft.axial), angle, cones)
        ratio = f"{schedule.total_impulse / ideal:.4f}"
        return legs.schedule(note("half-cones-ideal", cones=cones, ideal_Nms=ideal, ratio=ratio))
    return legs.schedule(note("half-cones", cones=cones, damping=damped))


def _fixed(at_leg: Spacecraft, cones: int) -> Pulse:
    """Earliest firing of a channel from which the row costs hardly more than from the best one."""
    # Seldom is one in phase at the far end of its cone: what it misses is made up for by the cones
    # that follow.
    windows = Windows(at_leg)
    channels = usable(at_leg)
    step = 2.0 * math.pi / at_leg.fastest / SAMPLES  # so many moments in each turn of the body
    room = windows.horizon - at_leg.limits.earliest
    span = min(max(room / (cones + 1), at_leg.inertial_period), room)
    count = min(int(max(span, 0.0) / step) + 1, LONGEST_SEARCH)
    times = np.asarray(at_leg.limits.earliest + np.arange(count) * step, dtype=np.float64)
    _, quaternions = free_coast(at_leg.inertia, at_leg.initial).motion(times)
    # Half-angle, rad, of equal cones from the best point of the present one, and the pulse for it,
    # N m s.
    equal = min((at_leg.to_turn + at_leg.nutation) / (2 * cones), 1.0)
    h = abs(at_leg.axial)
    nominal = h * (math.tan(at_leg.nutation) + math.tan(equal))
    most = reach(at_leg)
    sizes = np.unique(np.minimum(nominal * SHARES, 0.999 * most))
    strongest = max((abs(each.transverse) for each in channels), default=0.0)
    widest = 0.999 * precession.reach(strongest, at_leg.spin, math.inf)

    def spent(jumps: Vector) -> Vector:
        """Impulse (n,) N m s of later ``jumps`` (n,), with their widths as that of the first."""
        reached = np.minimum(jumps, widest)
        return strongest * precession.on_times_to_turn(reached, strongest, at_leg.spin)

    choices: list[tuple[Vector, Vector, Channel]] = []
    work.spend(PLACE * count * len(channels))
    for channel in channels:
        torque = abs(channel.transverse)
        direction = channel.transverse / torque
        push = attitude.rotate(quaternions, np.array([direction.real, direction.imag, 0.0]))
        # Cost of the row, N m s, that begins at each moment, and on-time of its first pulse, s.
        best, on_times = np.full(count, np.inf), np.zeros(count)
        lasting = precession.on_times_to_turn(sizes, torque, at_leg.spin)
        for size, on_time in zip(sizes.tolist(), lasting.tolist(), strict=True):
            if not channel.min_on_time <= on_time <= channel.max_on_time:
                continue
            momentum = at_leg.momentum + size * push
            half_angle = np.arccos(np.minimum(h / np.linalg.norm(momentum, axis=1), 1.0))
            apart = attitude.angle_between(momentum, at_leg.target_axis)
            rest = np.abs(apart - half_angle) / (2 * (cones - 1))
            ahead, last = h * np.tan(half_angle), h * np.tan(rest)
            costs = torque * on_time + spent(ahead + last) + spent(last)
            costs += (cones - 2) * spent(2.0 * last)
            # Cones may differ by so much for a channel to be in phase, but the last must not have
            # too much to do.
            unlike = np.abs(half_angle - equal) > UNEQUAL * equal
            costs[unlike | (rest > LAGGING * equal) | (ahead + last > 1.02 * most)] = np.inf
            better = costs < best
            best[better], on_times[better] = costs[better], on_time
        best[~windows.allowed(times - 0.5 * on_times, on_times, at_leg.limits.earliest)] = np.inf
        choices.append((best, on_times, channel))
    least = min((float(costs.min(initial=np.inf)) for costs, _, _ in choices), default=math.inf)
    if not math.isfinite(least):
        names = ", ".join(channel.name for channel in channels)
        raise Infeasible(
            f"{cones} half cones remain, and in the {span:.4g} s left no channel ({names}) "
            "has an allowed pulse in phase; try another --cones, or rhumb-line"
        )
    near = least + WORTH_WAITING * nominal
    pulses = [
        (float(costs[row]), channel_pulse(channel, float(times[row]), float(on_times[row])))
        for costs, on_times, channel in choices
        for row in np.flatnonzero(costs <= near)[:1]
    ]
    return commandable(at_leg, min(pulses, key=lambda choice: (choice[1].end, choice[0]))[1])
