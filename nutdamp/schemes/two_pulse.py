"""Two pulses half an inertial nutation turn apart, Magnus 1970 (22): no nutation, and H back where
it was.

The first halves the nutation; half a turn later the spin axis is where H was, and the second brings
H back there. A steerable torquer fires both against ω, exact at any angle. Pairs of channels are
those of `channel_pairs`, and with a target axis the two pulses are those of `pulse_pairs`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress

from nutdamp.errors import Infeasible, TooShort
from nutdamp.physics import body as rigid_body
from nutdamp.schemes import correction
from nutdamp.schemes.catalogue import TwoPulseOptions
from nutdamp.schemes.correction import model_of, tolerable
from nutdamp.spacecraft.constraints import Windows, keeps_limits
from nutdamp.spacecraft.equipment import Steerable
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.schedule import Schedule

MOST_HALF_TURNS = 4000  # half turns that the second pulse may wait for, at most


def schedule(spacecraft: Spacecraft, options: TwoPulseOptions) -> Schedule:
    """Two pulses, and a note on the cost or residual of fixed channels.

    ``options.literal``: equal halves and the wait as printed, not corrected, and the target left
    alone. Raises Infeasible with the reason.
    """
    most = spacecraft.limits.max_pulses
    if most is not None and most < 2:
        raise Infeasible(f"two pulses are needed, and limits.max_pulses allows {most}")
    if spacecraft.goal.axis is None or options.literal:
        return _damping(spacecraft, options)
    try:
        from nutdamp.schemes import pulse_pairs  # here, because few plans have a target

        return pulse_pairs.schedule(spacecraft)
    except Infeasible:
        # Pulses as wide as a large part of a spin turn hardly turn H and still take nutation out:
        # damping, corrected, may end on a target nearby that they cannot turn to.
        if spacecraft.to_turn < spacecraft.nutation:
            with suppress(Infeasible):
                damping = _damping(spacecraft, options)
                if correction.left(spacecraft, damping) <= tolerable(spacecraft):
                    return damping
        raise


def halves(spacecraft: Spacecraft, *, literal: bool) -> rigid_body.HalfPulses:
    """Half pulses and the wait between them, ``literal``: as printed."""
    form = rigid_body.half_pulses_as_printed if literal else rigid_body.half_pulses
    inertia, omega = spacecraft.inertia, spacecraft.transverse_rate
    return form(inertia.A, inertia.C, omega, inertia.equivalent(spacecraft.spin))


def _damping(spacecraft: Spacecraft, options: TwoPulseOptions) -> Schedule:
    """Two pulses that leave H where it was."""
    literal = options.literal
    parts = halves(spacecraft, literal=literal)
    if spacecraft.torquer is not None:
        return _steered(spacecraft, spacecraft.torquer, parts, literal=literal)
    from nutdamp.schemes import channel_pairs  # here, because a torquer needs none

    return channel_pairs.damping(spacecraft, parts, literal=literal)


def _steered(
    spacecraft: Spacecraft, torquer: Steerable, parts: rigid_body.HalfPulses, *, literal: bool
) -> Schedule:
    """The pulses of least wait, an odd number of half turns, and of those the first to start."""
    from nutdamp.schemes.sequential import ImpulseBuilder  # a steerable torquer
    from nutdamp.spacecraft.constraints import bounded_by

    windows = Windows(spacecraft)
    long, longer = (
        ImpulseBuilder(spacecraft).on_time_to_steer(torquer, half) for half in parts[:2]
    )
    if long is None or longer is None:
        times = 0.5 * abs(spacecraft.nutation_rate) * max(parts[:2]) / (torquer.torque or math.inf)
        raise Infeasible(
            "the torquer is too weak: half the nutation within half a body nutation period "
            f"takes more than {times:.4g} times its torque"
        )
    earliest = windows.limits.earliest
    ends = [end for _, end in windows.limits.blackout]
    half_turns = min(max(int(windows.horizon / parts.wait), 1), MOST_HALF_TURNS)
    for number in range(1, half_turns + 1, 2):
        to_second = number * parts.wait + 0.5 * (long - longer)  # from start to start
        # Both find room at once, or as a window ends for either of them.
        for start in sorted({earliest, *ends, *(end - to_second for end in ends)}):
            first = windows.tick_after(start)
            second = windows.nearest_tick(first + to_second)
            ready = first + long + windows.limits.gap
            if second <= first or not (
                windows.allows(first, long, earliest) and windows.allows(second, longer, ready)
            ):
                continue
            builder = ImpulseBuilder(spacecraft)
            builder.fire(builder.steered(torquer, first, parts.first, long))
            builder.fire(builder.steered(torquer, second, parts.second, longer))
            schedule = Schedule(tuple(builder.pulses))
            if not keeps_limits(spacecraft, schedule):
                continue
            if literal or (torquer.torque is None and model_of(spacecraft).exact):
                return schedule
            return correction.correct(spacecraft, schedule, chosen=(0, 1), momentum=True)
    raise TooShort(
        f"the pulses must be {parts.wait:.4g} s apart, or an odd multiple of that, and are "
        f"{long + longer:.4g} s long together; they do not fit within {bounded_by(spacecraft)}"
    )


def alternatives(spacecraft: Spacecraft, options: TwoPulseOptions) -> Iterator[Schedule]:
    """Schedules of channels among which `schedule` chooses, within the limits; none where there is
    no nutation.
    """
    if (
        spacecraft.torquer is None
        and spacecraft.least_impulse > 0.0
        and (spacecraft.limits.max_pulses or 2) >= 2
    ):
        from nutdamp.schemes import channel_pairs  # here, because a torquer needs none

        parts = halves(spacecraft, literal=options.literal)
        for pair in channel_pairs.damping_pairs(spacecraft, parts, literal=options.literal):
            yield pair.schedule
