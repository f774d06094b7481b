"""The screen of ``verify``: methods side by side, conservation, and effect of each imperfection."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from nutdamp.errors import listed
from nutdamp.flight.verification import AGREE, AS_FLOWN, IDEAL, WITHOUT, Conservation, Verification
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.views.layout import columns
from nutdamp.views.plan_tables import header
from nutdamp.views.text import MISSING, in_degrees

SHOWN = 1e-9 * math.pi / 180.0
"""rad; smaller differences are shown as rounding."""


BUDGET = "Error budget: what each imperfection leaves, alone"
"""The title of `budget_table`."""


def verification_screen(spacecraft: Spacecraft, name: str, verification: Verification) -> RenderableType:
    """All tables of ``verify`` for the schedule called ``name``."""
    note = budget_note(verification, aimed=spacecraft.goal.axis is not None)
    missing = [Text(f"{method.name}: {method.missing}") for method in verification.methods if method.missing]
    return Group(
        header(spacecraft),
        Text(),
        Text(f"{name}, flown by independent means; differences are the largest on the way", style="bold"),
        Text(),
        methods_table(verification),
        *missing,
        Text(),
        Text(verdict(verification)),
        Text(conservation(verification)),
        Text(),
        Text(BUDGET, style="bold"),
        Text(),
        budget_table(spacecraft, verification),
        *[Text(note, style="dim")] * bool(note),
    )


def verdict(verification: Verification) -> str:
    """Sentence whether the integrations from outside confirm the flown motion."""
    if not verification.checks:
        return "NOT CONFIRMED: no independent integration was flown to the end."
    names = verification.checks if verification.agree else verification.disagreeing
    how = f"agree (within {AGREE:g} rad)" if verification.agree else f"DO NOT AGREE (within {AGREE:g} rad)"
    return f"The flown motion and {' and '.join(names)} {how}."


def conservation(verification: Verification) -> str:
    """Sentence on the change of |H| and of the energy on coasts, and its cause."""
    both = verification.momentum, verification.energy
    if all(course.drift == 0.0 for course in both):
        return "On coasts |H| and the energy are constant to the last digit."
    momentum, energy = map(_course, both)
    return f"On coasts |H| {momentum}, the energy {energy}."


def _course(course: Conservation) -> str:
    if course.drift == 0.0 and not course.changed:
        return "is constant to the last digit"
    how = "is NOT constant" if course.kept is False else "is constant but for rounding"
    if course.changed:
        how = f"is changed by {' and '.join(course.changed)}"
    return f"{how} ({_difference(course.drift)} of itself at most)"


def methods_table(verification: Verification) -> Table:
    """One row a way to fly the schedule: its residuals, and its difference from the flown motion."""
    left = ("nutation\nleft, deg", "momentum shift\ndeg")
    table = columns("method\n", *left, "axis\ndiffers, rad", "H\nrad", "rates\nrelative")
    for method in verification.methods:
        if not method.missing:
            angles = map(in_degrees, (method.nutation, method.momentum_shift))
            table.add_row(method.name, *angles, *map(_difference, (method.axis, method.momentum, method.rate)))
    return table


def _difference(value: float | None) -> str:
    if value is None:
        return MISSING
    return "0" if value == 0.0 else "< 1e-12" if value < 1e-12 else f"{value:.1e}"


def budget_table(spacecraft: Spacecraft, verification: Verification) -> Table:
    """One row an imperfection: residuals with it alone; then residuals without each effect that plans include."""
    aimed = spacecraft.goal.axis is not None
    table = columns("imperfection\n", "nutation left\ndeg", "off the target\ndeg" if aimed else "momentum shift\ndeg")
    for row in verification.budget:
        table.add_row(row.name, *map(in_degrees, (row.nutation, row.axis_error)))
    return table


def budget_note(verification: Verification, *, aimed: bool) -> str:
    """Note on rows that leave an effect out, and on one that leaves more than all; empty where neither is."""
    names = [row.name.removeprefix(WITHOUT) for row in verification.budget if row.name.startswith(WITHOUT)]
    flown = next(row for row in verification.budget if row.name == AS_FLOWN)
    single = [row for row in verification.budget if row is not flown and not row.name.startswith(WITHOUT)]
    farther, notes = "H farther off the target" if aimed else "a larger momentum shift", []
    if len(verification.budget) == len({IDEAL, AS_FLOWN}):
        notes.append("Nothing is imperfect here: ideal impulses, no ticks, no disturbances.")
    for row in single:
        left = [("more nutation", row.nutation - flown.nutation), (farther, row.axis_error - flown.axis_error)]
        more = [what for what, by in left if by > SHOWN]
        if more:
            how = "As ideal impulses" if row.name == IDEAL else f"With {row.name} alone"
            notes.append(
                f"{how} the pulses leave {listed(more)} than as flown: plans are tuned to what is fired, so that "
                "the rows do not add up."
            )
            break
    if names:
        notes.append(_without(names))
    return " ".join(notes)


def _without(names: Sequence[str]) -> str:
    """Description of the rows without ``names``."""
    return (
        f"The other rows are flown with {listed(names)}. Plans are checked by such flights, on which most schemes "
        f"correct them; a row 'without' shows what the same pulses leave on a body without "
        f"{'them' if len(names) > 1 else 'it'}, which may be more or less."
    )
