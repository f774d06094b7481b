"""A train of short pulses at a fixed inertial phase, which walks H to the target; one or more in each spin turn.

Each pulse turns H by J/(C|ω3|) and gives the nutation a phasor, and from one pulse to the next that phasor turns by
2πC/(AK) for K pulses a turn. So N pulses leave (J/C|ω3|)|sin(Nφ/2)/sin(φ/2)| of nutation, φ = 2πC/(AK): N is
chosen so that they close, a nutation at t = 0 included. All pulses are equal, as the width is one command: it is chosen
so that they just reach the target, and phases do the rest. What is too much is bent away: the train heads a little to
one side of its course (a spiral), and on the flown motion the last pulses are moved until nothing is left. Near φ = 2π,
which is C = A for one pulse a turn, and C = 2A too, every pulse meets the nutation in the same phase.

The phase is that of the great circle to the target, or fixed against the Sun: then H follows a rhumb line.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from nutdamp import work
from nutdamp.errors import Infeasible
from nutdamp.physics import pointing
from nutdamp.schedule import Schedule
from nutdamp.schemes import one_pulse
from nutdamp.schemes.options import RhumbLineOptions
from nutdamp.schemes.tools import least_squares, predamping
from nutdamp.schemes.tools.flown_builder import ROUNDING, FlownBuilder, tolerable
from nutdamp.schemes.tools.pulse_train import LAST, Attempt, Train
from nutdamp.schemes.tools.reasons import expect_aim
from nutdamp.spacecraft import Spacecraft

MOVED = (6, 12, LAST)
"""How many of the last pulses are moved, one number after the other until nothing is left."""

SHORT = 60
"""Pulses up to which their size is corrected on the flown motion too: a longer train has little to spare."""

EXACT = 1e-10
"""rad of flown residual that counts as nothing."""

CLEARLY = 0.01
"""Share of the cost of a train that is worth more pulses."""

OTHERS = 4
"""Other lengths of the pulses that are tried where the one requested does not do."""


def schedule(spacecraft: Spacecraft, options: RhumbLineOptions) -> Schedule:
    """The train, after one pulse (or a train against ω) where there is more nutation than it can take along.

    ``options.on_time`` and ``per_turn`` as in `RhumbLineOptions`. Raises Infeasible with the reason.
    """
    expect_aim(spacecraft)
    if options.on_time is None:
        return _train(spacecraft, options)
    try:
        return _train(spacecraft, options)
    except Infeasible as why:
        raise Infeasible(f"{why}; {_another(spacecraft, options)}") from None


def _train(spacecraft: Spacecraft, options: RhumbLineOptions) -> Schedule:
    """The train from t = 0, or else after what damps the nutation. Raises Infeasible with the reason."""
    builder, reason = FlownBuilder(spacecraft), Infeasible("")
    train = Train(builder.here, options)
    if spacecraft.least_impulse <= 0.5 * train.strongest and train.way > ROUNDING:
        try:
            return _best(builder, train)
        except Infeasible as why:
            reason = why
    if spacecraft.least_impulse <= 1e-9 * train.h:
        raise reason
    builder = predamping.damped(builder, one_pulse.schedule)
    if builder.left <= ROUNDING:
        return builder.schedule("what damps the nutation brings H to the target already: no train is needed")
    return _best(builder, Train(builder.here, options))


def _another(spacecraft: Spacecraft, options: RhumbLineOptions) -> str:
    """Which pulse length would do instead of the one requested, the nearest first, in words."""
    builder, exact = FlownBuilder(spacecraft), 0.0 if spacecraft.limits.tick is None else tolerable(spacecraft)
    try:
        if spacecraft.least_impulse > 1e-9 * builder.here.inertia.C * abs(spacecraft.spin):
            builder = predamping.damped(builder, one_pulse.schedule)
        lengths = Train(builder.here, replace(options, on_time=None)).lengths_near(options.on_time or 0.0)
    except Infeasible:
        lengths = []
    for length in lengths[:OTHERS]:
        digits = 3 - math.floor(math.log10(length))
        rounded = math.ceil(length * 10.0**digits) / 10.0**digits  # up: so that no more pulses are needed
        try:
            made = _train(spacecraft, replace(options, on_time=rounded))
        except Infeasible:
            continue
        if float(np.linalg.norm(least_squares.misses(spacecraft, made))) > max(10.0 * EXACT, exact):
            continue
        return f"--on-time {rounded:.4g}s works, with {len(made)} pulses in all"
    return "no other length was found that works"


def _best(builder: FlownBuilder, train: Train) -> Schedule:
    """The train from where the ``builder`` is that leaves least; raises Infeasible where that is too much.

    Of those that leave nothing the first one, unless a later one costs clearly less.
    """
    best: tuple[float, Schedule] | None = None
    before = sum(pulse.magnitude for pulse in builder.pulses)
    for attempt in train.attempts():
        nothing = max(EXACT, train.rounding(attempt.size))
        if best is not None and best[0] <= nothing and not attempt.closes:
            continue  # it would cost no less
        made, left = _flown(builder.fork(), train, attempt)
        left = max(left, nothing)
        if best is None or left < 0.5 * best[0] or (left <= best[0] and _cheaper(made, best[1], before)):
            best = left, made
        cheap = best[1].total_impulse - before <= (1.0 + CLEARLY) * train.floor
        # Of pulses of a given length the trains come in the order of their cost.
        if work.exhausted() or (left <= nothing and (cheap or train.options.on_time is not None)):
            break
    if best is None or best[0] > tolerable(train.here):
        raise Infeasible(_reason(train, best))
    return best[1]


def _cheaper(made: Schedule, other: Schedule, before: float) -> bool:
    """Whether a train costs clearly less than another, ``before`` N m s that came before them apart."""
    return made.total_impulse - before < (1.0 - CLEARLY) * (other.total_impulse - before)


def _flown(builder: FlownBuilder, train: Train, attempt: Attempt) -> tuple[Schedule, float]:
    """The train, each pulse aimed from where H then is, the last ones moved; and what it leaves, rad."""
    count = attempt.pulses
    for remaining in range(count, 0, -1):
        pulse = train.next_pulse(builder.here, remaining, attempt)
        if pulse is None or work.exhausted():
            break
        builder.fire((pulse,))
    fired = min(count, len(builder.pulses))
    for last in MOVED:
        before = builder.left
        if before < EXACT or work.exhausted():
            break
        builder.correct(min(last, fired), resized=count if attempt.resizable and count <= SHORT else 0)
        if train.here.limits.tick is not None and builder.left > 0.5 * before:
            break  # what is left is the rounding of starts
    notes = (_note(builder, train, count),) if builder.pulses else ()
    return builder.schedule(*notes), builder.left


def _note(builder: FlownBuilder, train: Train, count: int) -> str:
    """What the train is, in words."""
    on_time = builder.pulses[-1].on_time
    efficiency = pointing.arc_efficiency(train.here.spin, on_time)
    line = "great circle" if train.sun is None else "rhumb line at a fixed Sun phase"
    names = ", ".join(channel.name for channel in train.channels)
    damped = len(builder.pulses) - count
    return (
        (f"{damped} pulse{'s' if damped > 1 else ''} to damp the nutation, then " if damped > 0 else "")
        + f"{count} equal pulses"
        + (f" of {names}" if names else "")
        + (f", {on_time:.4g} s each," if on_time > 0.0 else "")
        + f" along the {line} of {math.degrees(train.way):.4g}°, arc efficiency {efficiency:.4f}"
    )


def _reason(train: Train, best: tuple[float, Schedule] | None) -> str:
    """Why the ``best`` train found, with what it leaves (rad), is none."""
    requested = train.options.on_time
    held = "" if requested is None else f" of {requested:.4g} s"
    text = f"no train of equal pulses{held} was found that ends on the target within the limits"
    return text if best is None else f"{text}; the best would leave {math.degrees(best[0]):.3g}°"
