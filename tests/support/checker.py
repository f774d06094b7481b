"""Whether a schedule keeps the limits of its spacecraft, by the contract; plans that must."""

import itertools

import numpy as np

from nutdamp.flight import propagation
from nutdamp.planning import plan as planning
from nutdamp.planning.causes import infeasibility
from nutdamp.schemes.catalogue import Options
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.schedule import Schedule

ROUNDING = 2e-9
"""s; far below any resolution of commands."""


def violations(spacecraft: Spacecraft, made: Schedule) -> list[str]:
    """Everything that a schedule does and may not do; none where it keeps all limits."""
    limits = spacecraft.limits
    found = [f"a pulse starts at {pulse.start!r}" for pulse in made if pulse.start < 0.0]
    for pulse in made:
        where = f"{pulse.channel} from {pulse.start!r} for {pulse.on_time!r} s"
        if not np.isfinite([pulse.t, pulse.on_time, *pulse.impulse]).all():
            found.append(f"not a number: {where}")
        if pulse.start < limits.earliest - ROUNDING:
            found.append(f"before {limits.earliest!r}: {where}")
        if pulse.end > spacecraft.horizon + ROUNDING:
            found.append(f"after {spacecraft.horizon!r}: {where}")
        for begin, end in limits.blackout:
            if pulse.start < end - ROUNDING and pulse.end > begin + ROUNDING:
                found.append(f"in the blackout {begin!r} to {end!r}: {where}")
        for value in (pulse.start, pulse.on_time):
            if (
                limits.tick is not None
                and abs(value - round(value / limits.tick) * limits.tick) > ROUNDING
            ):
                found.append(f"off the ticks of {limits.tick!r}: {where}")
        for channel in spacecraft.channels:
            if channel.name == pulse.channel:
                if (
                    not channel.min_on_time - ROUNDING
                    <= pulse.on_time
                    <= channel.max_on_time + ROUNDING
                ):
                    found.append(
                        f"not {channel.min_on_time!r} to {channel.max_on_time!r} s: {where}"
                    )
                if not np.array_equal(pulse.impulse, channel.torque * pulse.on_time):
                    found.append(f"impulse is not torque times on-time: {where}")
    for before, after in itertools.pairwise(sorted(made, key=lambda pulse: pulse.start)):
        if after.start < before.end + limits.gap - ROUNDING:
            found.append(f"less than {limits.gap!r} s between {before.end!r} and {after.start!r}")
    if limits.max_pulses is not None and len(made) > limits.max_pulses:
        found.append(f"{len(made)} pulses, allowed are {limits.max_pulses}")
    return found


def feasible_by(
    scheme: str, spacecraft: Spacecraft, options: Options | None = None
) -> planning.Plan:
    plan = planning.plan(spacecraft, scheme, options)
    assert plan.feasible, infeasibility(plan)
    assert violations(spacecraft, plan.pulses) == []
    return plan


def left(plan: planning.Plan) -> propagation.Residual:
    assert plan.flown is not None
    return plan.flown
