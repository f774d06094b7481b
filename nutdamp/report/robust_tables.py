"""The screen of ``plan --robust``: candidates by what dispersed truths leave, the one to fly and what it costs."""

from __future__ import annotations

from rich.console import Group, RenderableType
from rich.text import Text

from nutdamp.report.layout import columns
from nutdamp.report.plan_tables import header, pulse_table
from nutdamp.report.text import MISSING, degrees, mass, moment, quantity
from nutdamp.robust import RobustComparison

MOST_ROWS = 12
"""Candidates that the table names."""


def robust_screen(found: RobustComparison) -> RenderableType:
    """Everything that ``plan --robust`` shows."""
    parts: list[RenderableType] = [header(found.comparison.spacecraft), Text()]
    infeasible = [plan for plan in found.comparison.plans if plan.why is not None]
    reasons = [Text.assemble((f"{plan.scheme}: ", "bold"), f"infeasible: {plan.why}") for plan in infeasible]
    chosen = found.chosen
    if chosen is None:
        return Group(*parts, *reasons, Text(f"No recommendation: {found.reason}.", style="bold"))
    how = "flown through real widths" if found.flown else "by the impulse sum (17)"
    parts.append(Text(f"{found.samples:,} dispersed truths (seed {found.seed}) fly each plan, {how}", style="bold"))
    parts += [Text(), _candidates(found), *reasons, Text()]
    title = Text.assemble("Robust plan: ", (f"{chosen.plan.scheme}, {chosen.variant}", "bold"), f" – {found.reason}.")
    parts += [title, Text(_cost(found))]
    if len(chosen.plan.pulses):
        parts += [Text(), pulse_table(chosen.plan)]
    return Group(*parts)


def _candidates(found: RobustComparison) -> RenderableType:
    level = f"{100 * found.probability:.6g} %"
    requirement = found.comparison.spacecraft.requirement is not None
    propellant = all(one.plan.pulses.propellant is not None for one in found.candidates)
    cost = "propellant\ng" if propellant else "impulse\nN m s"
    heads = ("plan\n", "variant\n", "ends at\ns", cost, "nominal\ndeg", f"{level}\ndeg")
    table = columns(*heads, *["requirement\nkept by"] * requirement, text=("variant\n",))
    named = list(found.candidates[:MOST_ROWS])
    named += [one for one in (found.chosen, found.usual) if one is not None and one not in named]
    for one in named:
        plan, pulses = one.plan, one.plan.pulses
        spent = 1e3 * (pulses.propellant or 0.0) if propellant else pulses.total_impulse
        nominal = None if plan.flown is None else plan.flown.nutation
        table.add_row(
            Text(plan.scheme, style="bold" if one is found.chosen else ""),
            one.variant + " *" * (one is found.usual),
            f"{pulses.end:.3f}",
            f"{spent:.4g}",
            *(degrees(angle).removesuffix(" deg") for angle in (nominal, one.nutation)),
            *[MISSING if one.met is None else f"{100 * one.met:.4g} %"] * requirement,
        )
    rest = len(found.candidates) - len(named)
    more = f"{rest} more come behind. " if rest else ""
    note = f"{more}nominal, {level}: the nutation left for the estimate, and not exceeded by so many truths."
    star = " * is what is recommended for the estimate." if found.usual is not None else ""
    return Group(table, Text(note + star, style="dim"))


def _cost(found: RobustComparison) -> str:
    """The robust plan against the one that is recommended for the estimate."""
    chosen, usual, cost = found.chosen, found.usual, found.cost
    if chosen is None or usual is None or cost is None:
        return "There is nothing to compare it with."
    if chosen is usual:
        return "It is the plan that is recommended for the estimate too: robustness costs nothing."
    level = f"{100 * found.probability:.6g} %"
    if cost.propellant is None:
        spent = _more(cost.impulse, quantity(abs(cost.impulse), "N m s"), "impulse")
    else:
        spent = _more(cost.propellant, mass(abs(cost.propellant)), "propellant")
    when = "as early" if cost.end == 0.0 else f"{moment(abs(cost.end))} {'later' if cost.end > 0 else 'earlier'}"
    return (
        f"Against {usual.plan.scheme}, recommended for the estimate: {degrees(chosen.nutation)} instead of "
        f"{degrees(usual.nutation)} of nutation within {level}; it takes {spent} and ends {when}."
    )


def _more(difference: float, shown: str, what: str) -> str:
    if difference == 0.0:
        return f"as much {what}"
    return f"{shown} {'more' if difference > 0 else 'less'} {what}"
