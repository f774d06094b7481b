"""Results of ``verify``: methods side by side, conserved quantities, and the effect of each imperfection."""

from __future__ import annotations

import math
from collections.abc import Iterator
from operator import attrgetter
from typing import Any

from rich.console import Group, RenderableType
from rich.text import Text

from nutdamp.flight.propagation import Flight
from nutdamp.flight.verification import AGREE, AS_FLOWN, IDEAL, WITHOUT, Conservation, Verification
from nutdamp.planning.plan import Plan
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.requirements import Part
from nutdamp.views import decisions
from nutdamp.views.decisions import coloured, size
from nutdamp.views.pulses import final_json, heading, target_json
from nutdamp.views.spacecraft import derived_table, requested
from nutdamp.views.summary import summary
from nutdamp.views.tables import TEXT, Column, DataTable, FittedColumns, angle_of
from nutdamp.views.text import MISSING, degrees, small_angle

SHOWN = 1e-9 * math.pi / 180.0
"""rad; smaller differences are shown as rounding."""

BUDGET = "Error budget: what each imperfection leaves, alone"
"""The title of `budget_table`."""

BUDGET_NOTE = (
    "Plans are tuned to what is fired, so that the rows do not add up. A row 'without' shows what the same pulses "
    "leave without that effect, more or less."
)
"""Note on `budget_table`."""


def verification_brief(plan: Plan, verification: Verification) -> RenderableType:
    """The default screen of ``verify``: verdict, requirement, methods."""
    notes = [conservation(verification), *_largest(verification), *_missing(verification)]
    return summary([*_head(plan, verification)], lambda **_: methods_table(verification), notes, "--json verified.json")


def _head(plan: Plan, verification: Verification) -> Iterator[Text]:
    """Title, verdict, and the residual of the flown motion beside the requirement."""
    body = plan.spacecraft
    yield Text.assemble((body.name, "bold"), f": {plan.scheme}; Δ: maximum difference from the flown motion")
    yield coloured(verdict(verification), verification.agree)
    if required := requested(body):
        left = "; ".join(f"{line.bound.part.label} {size(line.bound, line.left)}" for line in plan.held)
        met = coloured(decisions.VERDICT[plan.meets_requirement], plan.meets_requirement)
        yield Text.assemble(("Requirement ", "bold"), f"({required}) ", met, f" with nominal values: {left}.")


def verification_screen(plan: Plan, verification: Verification) -> RenderableType:
    """All tables of ``verify``."""
    body = plan.spacecraft
    parts: list[RenderableType] = [*_head(plan, verification), Text(), derived_table(body)]
    parts += [Text(), methods_table(verification), *map(Text, _missing(verification))]
    parts += [Text(), Text(conservation(verification)), Text(), Text(BUDGET, "bold"), Text()]
    return Group(*parts, budget_table(body, verification), Text(BUDGET_NOTE, "dim"))


def verification_json(flown: Flight, name: str, verification: Verification) -> dict[str, Any]:
    """Methods with their differences from the motion of ``flown`` (rad), conservation, error budget."""
    spacecraft = flown.spacecraft
    return {
        **heading(spacecraft),
        "scheme": name,
        "agree": verification.agree if verification.checks else None,
        "disagreeing": list(verification.disagreeing),
        "final": final_json(flown),
        "target": target_json(spacecraft),
        "methods": DataTable("", METHODS, verification.methods).json(),
        "momentum_drift": verification.momentum.drift,
        "momentum_kept": verification.momentum.kept,
        "energy_drift": verification.energy.drift,
        "energy_kept": verification.energy.kept,
        "budget": DataTable("", IMPERFECTIONS, verification.budget, spacecraft).json(),
    }


def _difference(value: float | None) -> str:
    if value is None:
        return MISSING
    return "0" if value == 0.0 else "< 1e-12" if value < 1e-12 else f"{value:.1e}"


METHODS = (
    Column("name", "method", "", attrgetter("name"), where="json screen", kind=TEXT),
    Column("nutation_deg", Part.NUTATION.label, "deg", angle_of("nutation"), small_angle, "json screen"),
    Column("momentum_shift_deg", Part.SHIFT.label, "deg", angle_of("momentum_shift"), small_angle, "json screen"),
    Column("axis_difference_rad", "Δaxis", "rad", attrgetter("axis"), _difference, "json screen"),
    Column("momentum_difference_rad", "ΔH", "rad", attrgetter("momentum"), _difference, "json screen"),
    Column("rate_difference", "Δrates", "relative", attrgetter("rate"), _difference, "json screen"),
    Column("missing", "", "", lambda row: row.missing or None, where="json", kind=TEXT),
)
IMPERFECTIONS = (
    Column("imperfection", "imperfection", "", attrgetter("name"), where="json screen", kind=TEXT),
    Column("nutation_deg", Part.NUTATION.label, "deg", angle_of("nutation"), small_angle, "json screen"),
    Column("momentum_shift_deg", "", "", angle_of("momentum_shift"), where="json"),
    Column("", Part.SHIFT.label, "deg", angle_of("momentum_shift"), small_angle, "screen",
           lambda body: body.goal.axis is None),
    Column("axis_error_deg", "", "", angle_of("axis_error"), where="json"),
    Column("", Part.DISTANCE.label, "deg", angle_of("axis_error"), small_angle, "screen",
           lambda body: body.goal.axis is not None),
)  # fmt: skip


def methods_table(verification: Verification) -> FittedColumns:
    """One row a way to fly the schedule: its residuals, and its difference from the flown motion."""
    rows = [method for method in verification.methods if not method.missing]
    return DataTable("Methods", METHODS, rows).screen("screen")


def budget_table(spacecraft: Spacecraft, verification: Verification) -> FittedColumns:
    """One row an imperfection: residuals with it alone; then residuals without each effect that plans include."""
    return DataTable(BUDGET, IMPERFECTIONS, verification.budget, spacecraft).screen("screen")


def _missing(verification: Verification) -> list[str]:
    """Methods that were not flown, with the reason."""
    return [f"{method.name}: {method.missing}" for method in verification.methods if method.missing]


def verdict(verification: Verification) -> str:
    """Sentence whether the integrations from outside confirm the flown motion."""
    if not verification.checks:
        return "NOT CONFIRMED: no independent integration was flown to the end."
    names = verification.checks if verification.agree else verification.disagreeing
    how = f"agree (within {AGREE:g} rad)" if verification.agree else f"DO NOT AGREE (within {AGREE:g} rad)"
    return f"The flown motion and {' and '.join(names)} {how}."


def conservation(verification: Verification) -> str:
    """Sentence on the change of |H| and of the energy on coasts, and its cause."""
    momentum, energy = map(_course, (verification.momentum, verification.energy))
    return f"On coasts |H| is {momentum}, the energy {energy}."


def _course(course: Conservation) -> str:
    how = f"changed by {' and '.join(course.changed)}" if course.changed else "constant to rounding"
    how = "NOT constant" if course.kept is False else how
    return f"{how} (by {_difference(course.drift)} of itself at most)" if course.drift else how


def _largest(verification: Verification) -> list[str]:
    """The imperfection that leaves the most nutation alone; empty where none leaves more than ideal impulses."""
    single = [row for row in verification.budget if row.name not in (IDEAL, AS_FLOWN) and WITHOUT not in row.name]
    most = max(single, key=lambda row: row.nutation, default=None)
    if most is None or most.nutation - verification.budget[0].nutation <= SHOWN:
        return []
    return [f"Largest single imperfection: {most.name}, which alone leaves {degrees(most.nutation)} of nutation."]
