"""What other schemes plan, as starts for the scheme optimal: they know large angles, and far targets."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial

from nutdamp import work
from nutdamp.errors import Infeasible
from nutdamp.limits import keeps_limits
from nutdamp.schedule import Schedule
from nutdamp.schemes.options import HalfConeOptions, RhumbLineOptions, SchemeOptions, TwoPulseOptions
from nutdamp.spacecraft import Spacecraft

CONES = (12, 6, 3)
"""Half cones in a row that are tried beside the number that the scheme takes."""


def by_other_schemes(spacecraft: Spacecraft, *, shift: bool) -> Iterator[Schedule]:
    """Schedules by the channels of the ``spacecraft`` for the same goal, one after the other; ``shift``: H counts.

    The later ones take longer to plan, and are rarely better.
    """
    from nutdamp.schemes import half_cone, one_pulse, rhumb_line, two_pulse

    # The Sun keeps the phase of trains alone.
    body = replace(spacecraft, steerable=None, goal=replace(spacecraft.goal, sun=None))
    plans: list[Callable[[], Schedule | Iterable[Schedule]]] = []
    if not shift:
        plans.append(partial(one_pulse.schedule, body, SchemeOptions()))
    elif body.goal.axis is None:
        plans.append(partial(two_pulse.alternatives, body, TwoPulseOptions()))
    else:
        plans.append(partial(two_pulse.schedule, body, TwoPulseOptions()))
        plans.append(partial(rhumb_line.schedule, body, RhumbLineOptions()))
        plans += [partial(half_cone.schedule, body, HalfConeOptions(cones=cones)) for cones in (None, *CONES)]
    for plan in plans:
        if work.exhausted():
            return
        try:
            made = plan()
            every = [made] if isinstance(made, Schedule) else list(made)
        except Infeasible:
            continue
        yield from (one for one in every if keeps_limits(spacecraft, one))
