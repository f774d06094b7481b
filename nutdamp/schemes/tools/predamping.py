"""Taking the nutation out before H is turned: at a moment at which the spin axis, where H goes, is near the target."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from nutdamp import work
from nutdamp.errors import Infeasible, TooShort
from nutdamp.schedule import Schedule
from nutdamp.schemes.options import SchemeOptions
from nutdamp.schemes.tools.flown_builder import FlownBuilder
from nutdamp.spacecraft import Spacecraft

MOMENTS = 16
"""Earliest starts that are tried."""

INTEGRATED = 20_000
"""Steps of integration after which no more of them are tried."""

Scheme = Callable[[Spacecraft, SchemeOptions], Schedule]

IN_REACH = 0.5
"""Share of the horizon within which the damping begins: the rest is for the turn."""


def damped(start: FlownBuilder, scheme: Scheme) -> FlownBuilder:
    """The ``start``, after the damping by a ``scheme``, such as one-pulse, from which the rest of the way costs least.

    H then goes to the momentary spin axis. Its pulses cost A|ω0| whenever they come, but the turn that is left,
    C|ω3| times its angle, differs by the cone.
    Raises Infeasible where no channel can damp, or where the budget ends while the damping is flown.
    """
    here = start.here
    h = here.inertia.C * abs(here.spin)
    # A torquer can fire at any point of the cone; channels at their alignments, which come by the body period.
    span = here.inertial_period if here.torquer is not None else 4.0 * min(here.body_period, 0.1 * here.horizon)
    best: tuple[float, FlownBuilder] | None = None
    reason: Infeasible | None = None
    steps = 0
    for number in range(MOMENTS):
        earliest = here.limits.earliest + number * span / MOMENTS
        if number > 0 and earliest > IN_REACH * here.horizon:
            break
        try:
            made = scheme(replace(here, limits=replace(here.limits, earliest=earliest)), SchemeOptions())
        except Infeasible as why:
            reason = why
            continue
        builder = start.fork()
        try:
            builder.fire(made, bounded=True)
        except Infeasible as why:
            reason = why
            break
        cost = made.total_impulse + h * (builder.here.to_turn + 2.0 * builder.here.nutation)
        if best is None or cost < best[0]:
            best = cost, builder
        steps += builder.steps
        if steps > INTEGRATED or work.exhausted():
            break
    if best is None:
        text = "the nutation is to be taken out first, and"
        # Its cure, where it has one, is for the damping alone.
        raise TooShort(f"{text} {reason.why}") if isinstance(reason, TooShort) else Infeasible(f"{text} {reason}")
    return best[1]
