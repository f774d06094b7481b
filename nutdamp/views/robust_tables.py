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
from nutdamp.views.plan_tables import derived_table
from nutdamp.views.pulses import pulse_table
from nutdamp.views.text import in_degrees

MOST_ROWS = 12
"""Largest number of candidates in the table."""


def robust_screen(robust: RobustComparison) -> RenderableType:
    """All tables of ``plan --robust``."""
    body, decided = robust.comparison.spacecraft, robust.decision
    reason = robust_verdicts.robust_reason(robust)
    infeasible = [plan for plan in robust.comparison.plans if not plan.feasible]
    reasons = [Text.assemble((f"{plan.scheme}: ", "bold"), _why(plan)) for plan in infeasible]
    if decided is None or robust.chosen is None:
        none = Text(f"No recommendation: {reason}.", style="bold")
        return Group(Text(body.name, style="bold"), none, *reasons, Text(), derived_table(body))
    named = f"{decided.plan.scheme}, {robust.chosen.variant}"
    parts: list[RenderableType] = [
        Text(body.name, style="bold"),
        Text.assemble("Robust plan: ", (named, "bold"), f" – {reason}."),
        *requirement(decided),
        *(Text(text) for text in filter(None, [_fresh(robust)])),
        Text(robust_verdicts.robust_cost(robust)),
        *(Text(text) for text in filter(None, [robust_verdicts.tightened(robust)])),
        *figures(decided),
        *(Text(), derived_table(body), Text()),
        Text(
            f"{'Up to ' * bool(_fewer(robust))}{robust.samples:,} dispersed cases of each plan, "
            f"flown through real widths, seed {robust.seed}",
            style="bold",
        ),
        *(Text(), _candidates(robust), *reasons),
    ]
    if len(decided.plan.pulses):
        parts += [Text(), pulse_table(decided.plan.flight).screen("full")]
    return Group(*parts)


def _fresh(robust: RobustComparison) -> str:
    """Result of the plan in new cases; nothing where none were flown."""
    if robust.fresh is None or robust.chosen is None:
        return ""
    cases = robust.fresh.cases
    shares = (robust.fresh.met, *robust.fresh.interval)
    met, low, high = (verdicts.percent(share, robust.probability) for share in shares)
    few = f", fewer than the {verdicts.exact_percent(robust.probability)} required" * robust.lucky
    new = f"{cases.samples:,} new cases (seed {cases.seed}), not used for the choice"
    return f"Of {new}, {met} comply{few}; 95 % interval {low} to {high}."


def _why(plan: Plan) -> str:
    return f"infeasible: {infeasibility(plan)}" if plan.failure is None else f"{infeasibility(plan)}"


def _fewer(robust: RobustComparison) -> list[int]:
    """Numbers of cases after which plans were given up."""
    return sorted({candidate.cases.samples for candidate in robust.candidates} - {robust.samples})


def _candidates(robust: RobustComparison) -> RenderableType:
    level = verdicts.exact_percent(robust.probability)
    counted = requirements.judged(robust.comparison.spacecraft)
    propellant = all(candidate.plan.pulses.propellant is not None for candidate in robust.candidates)
    cost = "propellant\ng" if propellant else "impulse\nN m s"
    cones = bool(robust.comparison.spacecraft.keep)
    heads = ("plan\n", "variant\n", "ends at\ns", cost, "nominal\ndeg", f"{level}\ndeg", *["nominal\ncones"] * cones)
    table = columns(*heads, *["cases that\ncomply"] * counted, text=("variant\n",))
    named = list(robust.candidates[:MOST_ROWS])
    named += [entry for entry in (robust.chosen, robust.usual) if entry is not None and entry not in named]
    for candidate in named:
        plan, pulses = candidate.plan, candidate.plan.pulses
        spent = 1e3 * (pulses.propellant or 0.0) if propellant else pulses.total_impulse
        table.add_row(
            Text(plan.scheme, style="bold" if candidate is robust.chosen else ""),
            candidate.variant + " *" * (candidate is robust.usual),
            f"{pulses.end:.3f}",
            f"{spent:.4g}",
            *(in_degrees(angle) for angle in (candidate.nominal, candidate.left)),
            *[KEPT[plan.kept is not False]] * cones,
            *[verdicts.share_text(candidate.share)] * counted,
        )
    what = robust_verdicts.left_name(robust.comparison.spacecraft)
    rest = len(robust.candidates) - len(named)
    more = f"{rest} more plan{'s rank' if rest > 1 else ' ranks'} below these. " if rest else ""
    fewer = [f"{count:,}" for count in _fewer(robust)]
    if fewer:
        more += f"Plans that could not be chosen any more after {listed(fewer, 'or')} cases flew no more of them. "
    note = f"{more}nominal, {level}: the {what} left with nominal values, and not exceeded in so many cases."
    star = " * is recommended without --robust." if robust.usual is not None else ""
    return Group(table, Text(note + star, style="dim"))
