"""The screen of ``trade``: one table of schedules for each front."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from rich.console import Group, RenderableType
from rich.text import Text

from nutdamp.errors import listed
from nutdamp.planning.plan import Plan
from nutdamp.planning.recommendation import SAME_ANGLE
from nutdamp.planning.tradeoff import Front, Point, numbered
from nutdamp.schemes.catalogue import OPTIMAL
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.requirements import DAMPED_ANGLE, SAME_COST
from nutdamp.spacecraft.schedule import STEERABLE
from nutdamp.views.layout import columns
from nutdamp.views.plan_tables import header
from nutdamp.views.schemes import NOT
from nutdamp.views.text import cost, degrees, duration, moment
from nutdamp.views.verdicts import FARTHER


def trade_screen(spacecraft: Spacecraft, fronts: Sequence[Front]) -> RenderableType:
    """All tables of ``trade``."""
    return Group(header(spacecraft), *front_parts(spacecraft, fronts))


def front_parts(spacecraft: Spacecraft, fronts: Sequence[Front]) -> list[RenderableType]:
    """The table of each front under its name."""
    parts: list[RenderableType] = []
    pointing, by_others = spacecraft.goal.axis is not None, schemes_of(fronts) != [OPTIMAL.name]
    for front in fronts:
        parts += [Text(), Text(front_name(front, pointing=pointing), style="bold")]
        if front.why is not None:
            parts.append(Text(_without_optimal(front)))
        if front.points:
            parts.append(_table(fronts, front, by_others=by_others))
    if any(_below(front, point) for _, front, point in numbered(fronts)):
        parts += [Text(), Text(BELOW, style="dim")]
    if any(_off(front, point) for front in fronts for point in front.points):
        parts += [Text(), Text(OFF, style="dim")]
    if any(fails(point) for _, _, point in numbered(fronts)):
        parts += [Text(), Text(f"{NOT} {FAILS}")]
    return parts


BELOW = (
    "The first-order least holds for small angles and for plans that leave no nutation: where a cost is below it, the "
    "plan leaves a little, or its flight at larger angles needs less than first order says."
)
"""Note on points that cost less than their first-order least."""


def _off(front: Front, point: Point) -> bool:
    """True where H ends visibly beside its target of the front."""
    return front.shift == 0.0 and point.plan.flight.residual.axis_error > DAMPED_ANGLE


OFF = (
    "With real widths, ticks and on-time limits H ends slightly off the direction that the schedules were planned for."
)
"""Note on points whose H ends a little beside its target."""


def _below(front: Front, point: Point) -> bool:
    """True where it costs less than its first-order least, as the table writes both."""
    least = front.least(point)
    return least is not None and point.cost < least and cost(point.cost, point.unit) != cost(least, point.unit)


FAILS = "does not meet the requirement with nominal values"
"""Note on points that do not meet the requirement of the file, or break a cone."""


def fails(point: Point) -> bool:
    """True where it does not meet the requirement of the file, or breaks a cone."""
    return point.plan.meets_requirement is False


TOGETHER = 1e-3
"""s between ends that count as one."""


class _Better(NamedTuple):
    """A point better than the recommended plan: share of the cost saved, and s by which it ends earlier.

    ``only``: it meets the requirement, and the recommended plan does not.
    """

    saved: float
    earlier: float
    number: int
    front: Front
    point: Point
    only: bool

    @property
    def how(self) -> str:
        """Words for its advantage."""
        if self.only:
            return "meets the requirement with nominal values, which the recommended plan does not"
        if self.saved:
            ends = f"{duration(self.earlier)} earlier" if self.earlier > TOGETHER else "at the same time"
            return f"costs {100.0 * self.saved:.2g} % less than the recommended plan and ends {ends}"
        return f"costs as much as the recommended plan and ends {duration(self.earlier)} earlier"


def _better(fronts: Sequence[Front], chosen: Plan) -> _Better | None:
    """The point that meets the requirement, and costs less and ends no later, or ends sooner and is not worse.

    Any that meets it, where the ``chosen`` plan does not. The cheapest, of those that cost as much the one that ends
    first.
    """
    until, misses = chosen.pulses.end, chosen.meets_requirement is False
    better = [
        _Better(
            saved if misses or saved > SAME_COST else 0.0, until - point.plan.pulses.end, index, front, point, misses
        )
        for index, front, point in numbered(fronts)
        if point.plan.meets_requirement
        for saved in [1.0 - point.cost / chosen.pulses.cost_in(point.unit)]
        if misses or (saved > SAME_COST and point.plan.pulses.end <= until) or _sooner(point.plan, chosen, saved)
    ]
    return max(better, key=lambda entry: entry[:2], default=None)


def outdone(fronts: Sequence[Front], chosen: Plan) -> str:
    """Headline that a schedule of the fronts is better than the ``chosen`` one; or nothing."""
    better = _better(fronts, chosen)
    return "" if better is None else f"“Time against cost” has a schedule that {better.how}."


def beats(fronts: Sequence[Front], chosen: Plan) -> str:
    """The schedule of a front that is better than the ``chosen`` one, with its command, in a sentence; or nothing."""
    better = _better(fronts, chosen)
    if better is None:
        return ""
    front, point = better.front, better.point
    off = [plan.flight.residual.axis_error for plan in (point.plan, chosen)]
    options = "--free-axis " if math.isinf(front.shift) else f'--shift "{degrees(front.shift)}" ' * (front.shift > 0.0)
    within = f'--set "limits.horizon={point.horizon:.6g} s"'
    pointing = chosen.spacecraft.goal.axis is not None
    where = "leaves H {} off the target" if pointing else "shifts H by {}"
    asides = []
    if abs(off[0] - off[1]) > SAME_ANGLE:
        asides.append(f"{where.format(degrees(off[0]))} instead of {degrees(off[1])}")
    counts = [len(plan.pulses) for plan in (point.plan, chosen)]
    if counts[0] != counts[1]:
        asides.append(f"takes {counts[0]} pulse{'s' * (counts[0] != 1)} instead of {counts[1]}")
    aside = f"; it {listed(asides)}" * bool(asides)
    return (
        f"point {better.number} {'meets the requirement with nominal values too, ' * (not better.only)}{better.how} "
        f"({front_name(front, pointing=pointing)}){aside}: "
        f"nutdamp plan SPACECRAFT --scheme {point.plan.scheme} {options}{within}."
    )


def apart(fronts: Sequence[Front], chosen: Plan) -> str:
    """The reason why the ``chosen`` plan may cost less than the schedules traded, by another scheme; or nothing."""
    points = {
        number: point
        for number, _, point in numbered(fronts)
        if point.plan.pulses.end <= chosen.pulses.end and not fails(point)
    }
    if not points:
        return ""
    number, nearest = min(points.items(), key=lambda item: item[1].cost)
    spent, cheapest = chosen.pulses.cost_in(nearest.unit), nearest.cost
    if spent >= cheapest * (1.0 - SAME_COST):
        alike = spent < cheapest and cost(spent, nearest.unit) != cost(cheapest, nearest.unit)
        return ALIKE * alike
    if chosen.scheme in schemes_of(fronts):
        return ""
    reasons = []
    if any(pulse.channel == STEERABLE for pulse in chosen.pulses):
        impulses = " with ideal impulses" * chosen.pulses.idealised
        reasons.append(f"it fires the steerable torquer{impulses}, which the schedules of the trade do not")
    left = max(point.plan.flight.residual.nutation for point in points.values())
    if chosen.flight.residual.nutation > left + SAME_ANGLE:
        reasons.append(
            f"it leaves {degrees(chosen.flight.residual.nutation)} of nutation, they at most {degrees(left)}"
        )
    because = f": {listed(reasons)}" if reasons else ""
    return (
        f"the recommended plan, by {chosen.scheme}, costs {100.0 * (1.0 - spent / cheapest):.2g} % less than "
        f"point {number}, the cheapest of the trade that meets the requirement and ends no later{because}."
    )


ALIKE = (
    "the cheapest point that ends no later costs as much as the recommended plan within 0.1 %, which counts as equal."
)
"""Share of the cost by which a plan may be cheaper than the points and still count as equal."""


def _sooner(plan: Plan, chosen: Plan, saved: float) -> bool:
    """True where a plan that saves that share of the cost, about none, ends clearly sooner with H about as near."""
    shifts = [flown.flight.residual.axis_error for flown in (plan, chosen)]
    ends_sooner = plan.pulses.end < (1.0 - SOONER) * chosen.pulses.end
    return abs(saved) <= SAME_COST and ends_sooner and shifts[0] <= FARTHER * shifts[1] + SAME_ANGLE


SOONER = 0.05
"""Share of its time by which a plan that costs as much has to end sooner to be worth a remark."""


def _table(fronts: Sequence[Front], front: Front, *, by_others: bool) -> RenderableType:
    """A row for each point; ``by_others``: with its scheme."""
    names = ("ends at", "cost", "first-order least", "pulses", "momentum shift")
    first = next(index for index, owner, _ in numbered(fronts) if owner is front)
    schemes = ("scheme",) * by_others
    table = columns("point", *names, f"against point {first}", *schemes, text=("scheme",))
    dearest = front.points[0].cost
    for index, owner, point in numbered(fronts):
        if owner is front:
            spent, least = (cost(value, point.unit) for value in (point.cost, front.least(point)))
            plan, more = point.plan, round(100.0 * (point.cost / dearest - 1.0), 1) + 0.0  # no negative zero
            shift = degrees(plan.flight.residual.momentum_shift)
            cells = moment(plan.pulses.end), spent, least, str(len(plan.pulses)), shift, f"{more:.1f} %"
            table.add_row(f"{index} {NOT}" if fails(point) else str(index), *cells, *[plan.scheme] * by_others)
    return table


def _without_optimal(front: Front) -> str:
    """The reason why a front has no points, or none of the scheme optimal."""
    return f"{'no schedule of optimal' if front.points else 'none'}: {front.why}"


def missing(spacecraft: Spacecraft, traded: Sequence[Front]) -> list[str]:
    """Sentences on fronts and points that a picture lacks, with the reasons."""
    pointing = spacecraft.goal.axis is not None
    fronts: dict[str, list[str]] = {}
    for entry in traded:
        if entry.why is not None:
            fronts.setdefault(_without_optimal(entry), []).append(front_name(entry, pointing=pointing))
    return [f"{', '.join(names)} \N{EN DASH} {reason}" for reason, names in fronts.items()]


def schemes_of(fronts: Sequence[Front]) -> list[str]:
    """Schemes of all points, by name; optimal where there are none."""
    return sorted({point.plan.scheme for _, _, point in numbered(fronts)}) or [OPTIMAL.name]


def front_name(front: Front, *, pointing: bool) -> str:
    """The requirement on H, in words."""
    if math.isinf(front.shift):
        return "H may end anywhere"
    if front.shift == 0.0:
        return "H ends on its target" if pointing else "H ends where it was"
    return f"H ends within {degrees(front.shift)} of " + ("its target" if pointing else "where it was")
