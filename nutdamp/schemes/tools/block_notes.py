"""What is said of command blocks: what was searched, which steps are too coarse and which limits are used up."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from nutdamp.commands import Commands
from nutdamp.compliance import Left, Part
from nutdamp.lightening import shed
from nutdamp.limits import OFF_TICK, commandable_widths
from nutdamp.schedule import Schedule
from nutdamp.schemes.tools.block_model import BlockModel
from nutdamp.schemes.tools.sun_pulses import spin_turn
from nutdamp.spacecraft import Channel, Spacecraft
from nutdamp.words import listed

ANY = "finer steps of delay and width in commands, or a longer limits.horizon"
"""What may help where nothing is known to hinder."""


def searched(compared: str, form: Left, flown: Left, *, first: bool) -> str:
    """That nothing ``compared`` is better, and how far flight and closed form are apart.

    ``first``: what was flown is the best in closed form.
    """
    nutation, end = (math.degrees(abs(float(one) - other)) for one, other in zip(form[:2], flown[:2], strict=True))
    scope = f"{compared} does better in closed form" if first else "of those flown none does better"
    return (
        f"{scope}; flown from the Sun pulses of the nutating body, nutation differs by {nutation:.2g}° and the end "
        f"of H by {end:.2g}°"
    )


def off_ticks(tick: float | None, commands: Commands) -> tuple[str, ...]:
    """That blocks are on no ``tick`` (s), where their steps are others than those."""
    if tick is None:
        return ()
    steps = np.array([commands.delay_step, *commands.widths]) / tick
    if np.abs(steps - np.rint(steps)).max() <= OFF_TICK:
        return ()
    return (
        f"limits.tick = {tick:g} s is not kept: blocks have the steps of commands, delays of {commands.delay_step:g} s",
    )


def cures(
    model: BlockModel, channels: Sequence[Channel], missed: Mapping[Part, float], made: Schedule, more: list[str]
) -> str:
    """What of the file keeps the blocks ``made`` from leaving less, besides ``more``; ``missed``: bounds, rad."""
    named = [*more, *too_coarse(model, channels, missed), *used_up(model.body, made)]
    if shed(model.body) is not None:  # with other blocks the moments fall otherwise: no cure is sure to help
        return "what limits these blocks, if the moments of inertia did not fall: " + listed(named or [ANY])
    return "to leave less: " + listed(named or [ANY])


def too_coarse(model: BlockModel, channels: Sequence[Channel], missed: Mapping[Part, float]) -> Iterator[str]:
    """Steps of the commands that may, half of each, cost more than the bounds that are ``missed`` (rad) allow."""
    body, commands = model.body, model.body.commands
    assert commands is not None
    way, half = body.to_turn if body.goal.axis is not None else 0.0, 0.5 * commands.delay_step
    spin, damped = abs(body.spin), abs(model.rate * body.spin)
    aside = {Part.DISTANCE: half * spin * way, Part.NUTATION: half * damped * math.tan(body.nutation)}
    steps = [step for one in channels for step in _steps(model, one)]
    along = 0.5 * min(steps, default=0.0)
    for part, what in ((Part.DISTANCE, "the end of H"), (Part.NUTATION, "the nutation")):
        most = missed.get(part, math.inf)
        if aside[part] > most:
            angle = f"{math.degrees(2.0 * aside[part]):.2g}°"
            yield f"a finer commands.delay_step ({commands.delay_step:g} s changes {what} by {angle})"
    if along > min(missed.values(), default=math.inf):
        yield f"finer widths in commands.width (one step of one pulse turns H by {math.degrees(2.0 * along):.2g}°)"


def _steps(model: BlockModel, channel: Channel) -> Iterator[float]:
    """By how much one pulse of a channel turns H more than one of the width before, or than none, rad: the least."""
    assert model.body.commands is not None
    widths = commandable_widths(model.body.commands, channel)
    if len(widths):
        turned = np.sort(model.turned_by(channel, widths, model.body.spin))
        yield float(np.diff(turned, prepend=0.0).min())


def used_up(body: Spacecraft, made: Schedule) -> Iterator[str]:
    """Limits that the blocks of a schedule use up."""
    commands, limits = body.commands, body.limits
    assert commands is not None
    if body.horizon - made.end < 2.0 * spin_turn(body):
        yield f"a longer limits.horizon (the blocks end at {made.end:.4g} s of {body.horizon:.4g} s)"
    if limits.max_pulses is not None and len(made) >= limits.max_pulses:
        yield f"more limits.max_pulses ({limits.max_pulses})"
    if any(block.count == commands.max_count for block in made.blocks):
        yield f"a larger commands.max_count ({commands.max_count})"
