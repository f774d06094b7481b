"""Results as the tables of pages and notebooks: one unit a column, so that they sort."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from nutdamp import compliance
from nutdamp.flight import Residual
from nutdamp.planning import Comparison, Plan
from nutdamp.presentation import verdicts
from nutdamp.presentation.end_tables import angle_names, angle_texts
from nutdamp.presentation.page.document import Column, Facts, Sheet, facts_of, sheet_of
from nutdamp.presentation.plan_tables import derived_table, pulse_table
from nutdamp.presentation.text import MISSING, degrees, duration, moment
from nutdamp.spacecraft import Spacecraft


def spacecraft_facts(spacecraft: Spacecraft, title: str = "At t = 0, and what a plan must keep") -> Facts:
    """The spacecraft at t = 0, its requirement, and the limits of its plans."""
    return facts_of(title, derived_table(spacecraft, _limits(spacecraft)))


def _limits(spacecraft: Spacecraft) -> Iterator[tuple[str, str]]:
    limits = spacecraft.limits
    yield "horizon", duration(spacecraft.horizon)
    kept = []
    if limits.earliest > 0.0:
        kept.append(f"nothing before {duration(limits.earliest)}")
    if limits.gap > 0.0:
        kept.append(f"{duration(limits.gap)} between pulses")
    if limits.tick is not None:
        kept.append(f"commands in steps of {duration(limits.tick)}")
    if limits.max_pulses is not None:
        kept.append(f"at most {limits.max_pulses} pulses")
    kept += [f"no pulse from {moment(begin)} to {moment(end)}" for begin, end in limits.blackout]
    if kept:
        yield "limits", "; ".join(kept)


Cell = Callable[[Plan], str]


def comparison_sheet(compared: Comparison) -> Sheet:
    """One row a scheme; the recommended one is marked."""
    columns = _columns(compared)
    rows = []
    for plan in compared.plans:
        cells = [cell(plan) if plan.feasible else "" for _, cell in columns]
        rows.append((plan.scheme, *(cells if plan.feasible else [verdicts.no_plan(plan), *cells[1:]])))
    mark = next((index for index, plan in enumerate(compared.plans) if plan is compared.recommended), None)
    names = (Column("scheme", number=False), *(column for column, _ in columns))
    return Sheet(
        "What each scheme costs and leaves with nominal values, flown through the real pulse widths",
        names,
        tuple(rows),
        mark,
    )


def _columns(compared: Comparison) -> list[tuple[Column, Cell]]:
    least = compared.spacecraft.least_impulse
    columns: list[tuple[Column, Cell]] = [
        (Column("pulses"), lambda plan: str(len(plan.pulses))),
        (Column("ends at", "s"), lambda plan: f"{plan.pulses.end:.3f}"),
        (Column("impulse", "N m s"), lambda plan: _number(plan.pulses.total_impulse)),
        (
            Column("× least"),
            lambda plan: f"{plan.pulses.total_impulse / least:.4f}" if least > 0.0 else MISSING,
        ),
    ]
    if any(plan.feasible and plan.pulses.propellant is not None for plan in compared.plans):
        columns.append((Column("propellant", "g"), lambda plan: _number(plan.pulses.propellant, 1e3)))
    columns += [
        (Column("nutation left", "deg"), lambda plan: _angle(plan.flown, "nutation")),
        (Column("shift of H", "deg"), lambda plan: _angle(plan.flown, "momentum_shift")),
    ]
    body = compared.spacecraft
    if body.goal.axis is not None:
        columns.append((Column("off the target", "deg"), lambda plan: _angle(plan.flown, "axis_error")))
    columns += [
        (Column(f"axis: {angle_names(body)[0]}", "deg"), lambda plan: _pointing(plan, 0)),
        (Column(f"axis: {angle_names(body)[1]}", "deg"), lambda plan: _pointing(plan, 1)),
    ]
    if any(plan.spin_change for plan in compared.plans):
        columns.append((Column("spin change", "rad/s"), lambda plan: _number(plan.spin_change)))
    if any(plan.delta_v is not None for plan in compared.plans):
        columns.append(
            (Column("ΔV", "m/s"), lambda plan: _number(None if plan.delta_v is None else math.hypot(*plan.delta_v)))
        )
    if compliance.required(compared.spacecraft):
        columns.append((Column("requirement", number=False), lambda plan: verdicts.VERDICT[plan.meets_requirement]))
    return columns


def _number(value: float | None, scale: float = 1.0) -> str:
    return MISSING if value is None else f"{scale * value:.4g}"


def _pointing(plan: Plan, which: int) -> str:
    return angle_texts(plan.spacecraft, plan.flight.final.axis)[which].removesuffix(" deg")


def _angle(left: Residual | None, name: str) -> str:
    return MISSING if left is None else degrees(getattr(left, name)).removesuffix(" deg")


def pulse_sheet(plan: Plan) -> Sheet:
    """One row a pulse."""
    return sheet_of(f"Pulses of {plan.scheme}", pulse_table(plan))


def residual_sheet(title: str, left: Residual) -> Sheet:
    """What a flight leaves."""
    names = {
        "nutation": "nutation",
        "body cone": "body_cone",
        "space cone": "space_cone",
        "shift of H": "momentum_shift",
    }
    rows = tuple((name, _angle(left, key)) for name, key in names.items())
    return Sheet(title, (Column("at the end", number=False), Column("angle", "deg")), rows)
