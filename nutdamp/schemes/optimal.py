"""Least propellant over channels and firing times: no nutation left, and H back where it was.

The linear program of `program` finds the burns; what small angles neglect is measured on the flown schedule and given
back to the program as a target; then moments and on-times are trimmed on the true motion. Two bounds go with the
plan: the program's own least cost, to first order, and the rigorous one of the first equation alone.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np

from nutdamp import flight
from nutdamp.errors import Infeasible
from nutdamp.physics import attitude
from nutdamp.schedule import Bounds, Schedule, channel_pulse
from nutdamp.schemes import Options, trim
from nutdamp.schemes.advice import no_channels
from nutdamp.schemes.program import Burn, Program, Solution
from nutdamp.schemes.windows import SLACK, Windows, usable
from nutdamp.spacecraft import Channel, Spacecraft, Vector

REPAIRS = 40
"""Rounds in which burns that break a limit are moved elsewhere."""

AIMS = 5
"""Rounds in which the program's target is corrected by the shift of H that was flown."""

DEAR = 0.01
"""Share above the program's least cost from which another round may find a cheaper schedule."""

UNMET = 1e-7
"""Share of A|ω0| that slots may fail to supply: the program's own tolerance."""

THRIFT = 0.004
"""Share of the least cost that is given away for fewer pulses."""

HASTE = 0.002
"""How much dearer the end of the horizon seems than its beginning, so that of equals the early burns are taken."""

LEFT = math.radians(1e-6)
"""rad of nutation and shift of H below which a plan has been found."""

KNOBS = 8
"""Pulses that are trimmed at most, two numbers each for four equations."""


def schedule(spacecraft: Spacecraft, options: Options) -> Schedule:
    """The cheapest schedule found, with its bounds.

    Raises Infeasible where the program has no solution, naming the limit to relax, or where no schedule was found.
    """
    channels = tuple(usable(spacecraft))
    if not channels:
        raise Infeasible(no_channels(spacecraft))
    costs, unit = _costs(channels, options)
    momentum = not options.free_axis
    target = np.zeros(2)
    first: Solution | None = None
    found: list[tuple[bool, float, Schedule]] = []
    for _ in range(AIMS):
        program = Program(spacecraft, channels, costs, momentum, target)
        solution = program.solve()
        if first is None:
            if solution.unmet > UNMET:
                raise Infeasible(_unreachable(spacecraft, channels, costs, momentum))
            first = solution
        aimed = _repaired(spacecraft, program, _thinned(program, solution))
        made = _trimmed(spacecraft, aimed, momentum)
        left = _left(spacecraft, made, momentum)
        price = _price(made, channels, costs)
        found.append((left > LEFT, price if left <= LEFT else left, made))
        if not momentum or (left <= LEFT and price <= first.cost * (1.0 + DEAR)):
            break
        target = target - _shift(spacecraft, aimed)
    missed, left, best = min(found, key=lambda entry: entry[:2])
    if spacecraft.limits.tick is None and missed:
        raise Infeasible(
            "not found: the refinement on the true motion did not converge "
            f"(it leaves {math.degrees(left):.2g}°); a longer horizon may help"
        )
    assert first is not None
    rigorous = Program(spacecraft, channels, costs, momentum=False, ideal=True).solve().cost
    return Schedule(best.pulses, best.notes, Bounds(first.cost, min(rigorous, first.cost), unit))


def _costs(channels: tuple[Channel, ...], options: Options) -> tuple[Vector, str]:
    """Cost of one N m s of each channel's transverse impulse, and its unit."""
    flows = [channel.mass_flow for channel in channels]
    strengths = np.array([abs(channel.transverse) for channel in channels])
    known = [flow for flow in flows if flow is not None]
    if options.least == "propellant" and len(known) == len(flows):
        return np.array(known) / strengths, "kg"
    return np.array([float(np.linalg.norm(channel.torque)) for channel in channels]) / strengths, "N m s"


def _price(made: Schedule, channels: tuple[Channel, ...], costs: Vector) -> float:
    """What a schedule costs by the program's own prices."""
    price = {channel.name: cost for channel, cost in zip(channels, costs, strict=True)}
    return math.fsum(price[pulse.channel] * math.hypot(*pulse.impulse[:2]) for pulse in made)


def _left(spacecraft: Spacecraft, made: Schedule, momentum: bool) -> float:
    """Largest of what the flown schedule leaves, rad."""
    residual = flight.flown(spacecraft, made).residual
    return max(residual.nutation, residual.momentum_shift) if momentum else residual.nutation


def _shift(spacecraft: Spacecraft, made: Schedule) -> Vector:
    """Δh of the flown schedule in the inertial directions e1(0), e2(0), N m s."""
    start, moments = spacecraft.initial, np.asarray(spacecraft.inertia.moments)
    end = flight.flown(spacecraft, made).settled
    before = attitude.rotate(start.quaternion, start.rates * moments)
    after = attitude.rotate(end.quaternion, end.rates * moments)
    in_body = attitude.matrix(start.quaternion).T @ (after - before)
    return np.asarray(in_body[:2])


def _thinned(program: Program, solution: Solution) -> Solution:
    """As few burns as cost hardly more: the longest are kept and may grow, as many as it takes.

    The optimum itself has a burn at every alignment, for the shorter a burn the less it loses to its width.
    """
    everywhere, most = program.forbidden, solution.cost * (1.0 + THRIFT)
    program.haste = HASTE
    solution = program.solve()
    allowed, best = everywhere, solution
    order = sorted(solution.burns, key=lambda burn: -burn.on_time * abs(burn.channel.transverse))
    low, high = 1, len(order)
    while low < high:
        middle = (low + high) // 2
        program.forbidden = everywhere.copy()
        program.keep(order[:middle])
        found = program.solve()
        if found.unmet <= UNMET and found.cost <= most:
            allowed, best, high = program.forbidden, found, middle
        else:
            low = middle + 1
    program.forbidden = allowed
    return best


def _repaired(spacecraft: Spacecraft, program: Program, solution: Solution) -> Schedule:
    """The burns as pulses, once none of them breaks a limit: where one does, its slots are forbidden."""
    for _ in range(REPAIRS):
        broken = next(_broken(spacecraft, program, solution.burns), None)
        if broken is None:
            break
        program.forbid(*broken)
        solution = program.solve()
        if solution.unmet > UNMET:
            raise Infeasible("not found: on-times, gap and max_pulses leave no burns that the program can use")
    else:
        raise Infeasible("not found: no burns were found that keep on-times, gap and max_pulses all at once")
    windows = Windows(spacecraft)
    pulses = []
    for burn in solution.burns:
        on_time = windows.on_time(burn.on_time, burn.channel.min_on_time, burn.channel.max_on_time)
        start = windows.nearest_tick(max(burn.t - 0.5 * on_time, spacecraft.limits.earliest))
        start = min(start, spacecraft.horizon - on_time)
        pulses.append(channel_pulse(burn.channel, start + 0.5 * on_time, on_time))
    return Schedule(tuple(pulses))


Span = tuple[Channel | None, float, float]


def _broken(spacecraft: Spacecraft, program: Program, burns: tuple[Burn, ...]) -> Iterator[Span]:
    """What to forbid: ends of too long burns, too short ones, the shorter of two too near, the least of too many."""
    limits, width = spacecraft.limits, program.width
    for burn in burns:
        longest, shortest = burn.channel.max_on_time, burn.channel.min_on_time
        if burn.on_time > longest + SLACK:
            reach = burn.on_time + width
            yield burn.channel, burn.t - reach, burn.t - 0.5 * longest + 0.5 * width
            yield burn.channel, burn.t + 0.5 * longest - 0.5 * width, burn.t + reach
        if burn.on_time < 0.5 * shortest:
            yield burn.channel, burn.t - 2.0 * width, burn.t + 2.0 * width
    for one, two in itertools.pairwise(burns):
        near = two.t - 0.5 * two.on_time < one.t + 0.5 * one.on_time + limits.gap - SLACK
        if near:
            less = min(one, two, key=lambda burn: burn.on_time)
            reach = 0.5 * less.on_time + width
            yield less.channel, less.t - reach, less.t + reach
    if limits.max_pulses is not None and len(burns) > limits.max_pulses:
        least = min(burns, key=lambda burn: burn.on_time * abs(burn.channel.transverse))
        reach = 0.5 * least.on_time + 2.0 * width
        yield least.channel, least.t - reach, least.t + reach


def _trimmed(spacecraft: Spacecraft, made: Schedule, momentum: bool) -> Schedule:
    """The schedule with the pulses that have most room trimmed on the flown motion."""
    most = {channel.name: channel.max_on_time for channel in spacecraft.channels}

    def stiffness(index: int) -> tuple[bool, float]:
        """Pulses that may still grow first, and of them the longest."""
        pulse = made.pulses[index]
        return pulse.on_time > 0.95 * most[pulse.channel], -pulse.magnitude

    chosen = sorted(sorted(range(len(made)), key=stiffness)[:KNOBS])
    return trim.refine(spacecraft, made, chosen=chosen, momentum=momentum)


def _unreachable(spacecraft: Spacecraft, channels: tuple[Channel, ...], costs: Vector, momentum: bool) -> str:
    """Which limit to relax where the program has no solution."""
    left = Program(spacecraft, channels, costs, momentum=False).solve().unmet
    if momentum and left <= UNMET:
        return (
            f"within {spacecraft.horizon:.4g} s the nutation can be taken out, but H not be kept where it is; "
            "set limits.horizon later, or use --free-axis"
        )
    names = ", ".join(channel.name for channel in channels)
    share = 100.0 * min(left, 1.0)
    return (
        f"within {spacecraft.horizon:.4g} s the channels ({names}) cannot take out the nutation, {share:.2g} % of it "
        "stays; set limits.horizon later, shorten blackout windows, or allow longer pulses"
    )
