"""The screen of ``plan --robust``: candidates by the share of cases that comply, the one to fly and its cost."""

from __future__ import annotations

from rich.console import Group, RenderableType
from rich.text import Text

from nutdamp.errors import listed
from nutdamp.planning.decision import infeasibility
from nutdamp.planning.plan import Plan
from nutdamp.planning.robust import RobustComparison
from nutdamp.spacecraft import requirements
from nutdamp.views import robust_verdicts, verdicts
from nutdamp.views.decisions import KEPT, figures, requirement
from nutdamp.views.layout import columns
from nutdamp.views.plan_tables import derived_table, pulse_table
from nutdamp.views.text import in_degrees

MOST_ROWS = 12
"""Largest number of candidates in the table."""


def robust_screen(found: RobustComparison) -> RenderableType:
    """All tables of ``plan --robust``."""
    body, decided, reason = found.comparison.spacecraft, found.decision, robust_verdicts.robust_reason(found)
    infeasible = [plan for plan in found.comparison.plans if not plan.feasible]
    reasons = [Text.assemble((f"{plan.scheme}: ", "bold"), _why(plan)) for plan in infeasible]
    if decided is None or found.chosen is None:
        none = Text(f"No recommendation: {reason}.", style="bold")
        return Group(Text(body.name, style="bold"), none, *reasons, Text(), derived_table(body))
    named = f"{decided.plan.scheme}, {found.chosen.variant}"
    parts: list[RenderableType] = [
        Text(body.name, style="bold"),
        Text.assemble("Robust plan: ", (named, "bold"), f" – {reason}."),
        *requirement(decided),
        *(Text(one) for one in filter(None, [_fresh(found)])),
        Text(robust_verdicts.robust_cost(found)),
        *(Text(one) for one in filter(None, [robust_verdicts.tightened(found)])),
        *figures(decided),
        *(Text(), derived_table(body), Text()),
        Text(
            f"{'Up to ' * bool(_fewer(found))}{found.samples:,} dispersed cases of each plan, "
            f"flown through real widths, seed {found.seed}",
            style="bold",
        ),
        *(Text(), _candidates(found), *reasons),
    ]
    if len(decided.plan.pulses):
        parts += [Text(), pulse_table(decided.plan)]
    return Group(*parts)


def _fresh(found: RobustComparison) -> str:
    """Result of the plan in new cases; nothing where none were flown."""
    if found.fresh is None or found.chosen is None:
        return ""
    cases = found.fresh.cases
    met, low, high = (verdicts.percent(one, found.probability) for one in (found.fresh.met, *found.fresh.interval))
    few = f", fewer than the {verdicts.exact_percent(found.probability)} required" * found.lucky
    new = f"{cases.samples:,} new cases (seed {cases.seed}), not used for the choice"
    return f"Of {new}, {met} comply{few}; 95 % interval {low} to {high}."


def _why(plan: Plan) -> str:
    return f"infeasible: {infeasibility(plan)}" if plan.failure is None else f"{infeasibility(plan)}"


def _fewer(found: RobustComparison) -> list[int]:
    """Numbers of cases after which plans were given up."""
    return sorted({one.cases.samples for one in found.candidates} - {found.samples})


def _candidates(found: RobustComparison) -> RenderableType:
    level = verdicts.exact_percent(found.probability)
    counted = requirements.judged(found.comparison.spacecraft)
    propellant = all(one.plan.pulses.propellant is not None for one in found.candidates)
    cost = "propellant\ng" if propellant else "impulse\nN m s"
    cones = bool(found.comparison.spacecraft.keep)
    heads = ("plan\n", "variant\n", "ends at\ns", cost, "nominal\ndeg", f"{level}\ndeg", *["nominal\ncones"] * cones)
    table = columns(*heads, *["cases that\ncomply"] * counted, text=("variant\n",))
    named = list(found.candidates[:MOST_ROWS])
    named += [one for one in (found.chosen, found.usual) if one is not None and one not in named]
    for one in named:
        plan, pulses = one.plan, one.plan.pulses
        spent = 1e3 * (pulses.propellant or 0.0) if propellant else pulses.total_impulse
        table.add_row(
            Text(plan.scheme, style="bold" if one is found.chosen else ""),
            one.variant + " *" * (one is found.usual),
            f"{pulses.end:.3f}",
            f"{spent:.4g}",
            *(in_degrees(angle) for angle in (one.nominal, one.left)),
            *[KEPT[plan.kept is not False]] * cones,
            *[verdicts.share_text(one.share)] * counted,
        )
    what = robust_verdicts.left_name(found.comparison.spacecraft)
    rest = len(found.candidates) - len(named)
    more = f"{rest} more plan{'s rank' if rest > 1 else ' ranks'} below these. " if rest else ""
    fewer = [f"{count:,}" for count in _fewer(found)]
    if fewer:
        more += f"Plans that could not be chosen any more after {listed(fewer, 'or')} cases flew no more of them. "
    note = f"{more}nominal, {level}: the {what} left with nominal values, and not exceeded in so many cases."
    star = " * is recommended without --robust." if found.usual is not None else ""
    return Group(table, Text(note + star, style="dim"))
