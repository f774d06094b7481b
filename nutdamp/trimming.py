"""On-times of a robust plan shortened until just as many dispersed cases comply as must."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace

from nutdamp import planning
from nutdamp.errors import Infeasible
from nutdamp.limits import keeps_limits
from nutdamp.planning import Plan
from nutdamp.schedule import channel_pulse

SHORTEST = 0.8
"""Share of on-times that is left at least when they are shortened: together, and then each alone once more."""

HALVINGS, FINER = 7, 3
"""Steps in which all on-times are shortened together, and then each alone."""

FEW = 8
"""Pulses up to which each is shortened alone."""


def trimmed(plan: Plan, complies: Callable[[Plan], bool]) -> Plan:
    """The plan with on-times as short as `complies` lets them be; the same one where nothing is to be gained.

    Plans on ticks, of command blocks, or with pulses of no channel stay as they are.
    """
    channels = {one.name: one for one in plan.spacecraft.channels}
    fixed = plan.spacecraft.limits.tick is not None or bool(plan.pulses.blocks)
    if fixed or any(one.channel not in channels or one.on_time == 0.0 for one in plan.pulses):
        return plan
    everywhere = list(range(len(plan.pulses)))
    best = _shortened(plan, everywhere, HALVINGS, complies)
    for index in everywhere if len(everywhere) <= FEW else ():
        best = _shortened(best, [index], FINER, complies)
    return best


def _shortened(plan: Plan, which: list[int], halvings: int, complies: Callable[[Plan], bool]) -> Plan:
    """The pulses with the indices ``which`` shortened alike, by bisection."""
    low, high, best = SHORTEST, 1.0, plan
    for _ in range(halvings):
        middle = 0.5 * (low + high)
        shorter = _scaled(plan, which, middle)
        if shorter is not None and complies(shorter):
            best, high = shorter, middle
        else:
            low = middle
    return best


def _scaled(plan: Plan, which: list[int], share: float) -> Plan | None:
    """The plan with some of its on-times at a ``share``; None where it breaks a limit or its requirement."""
    body = plan.spacecraft
    channels = {one.name: one for one in body.channels}
    pulses = tuple(
        channel_pulse(channels[one.channel], one.t, share * one.on_time) if index in which else one
        for index, one in enumerate(plan.pulses)
    )
    with suppress(Infeasible):
        made = planning.judged(body, plan.scheme, replace(plan.pulses, pulses=pulses), plan.options)
        if made.feasible and made.meets_requirement is not False and keeps_limits(body, made.pulses):
            return made
    return None
