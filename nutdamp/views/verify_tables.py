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


def verification_screen(spacecraft: Spacecraft, name: str, found: Verification) -> RenderableType:
    """All tables of ``verify`` for the schedule called ``name``."""
    missing = [Text(f"{method.name}: {method.missing}") for method in found.methods if method.missing]
    return Group(
        header(spacecraft),
        Text(),
        Text(f"{name}, flown by independent means; differences are the largest on the way", style="bold"),
        Text(),
        methods_table(found),
        *missing,
        Text(),
        Text(verdict(found)),
        Text(conservation(found)),
        Text(),
        Text(BUDGET, style="bold"),
        Text(),
        budget_table(spacecraft, found),
        *[Text(note, style="dim") for note in (budget_note(found, aimed=spacecraft.goal.axis is not None),) if note],
    )


def verdict(found: Verification) -> str:
    """Sentence whether the integrations from outside confirm the flown motion."""
    if not found.checks:
        return "NOT CONFIRMED: no independent integration was flown to the end."
    names = found.checks if found.agree else found.disagreeing
    how = f"agree (within {AGREE:g} rad)" if found.agree else f"DO NOT AGREE (within {AGREE:g} rad)"
    return f"The flown motion and {' and '.join(names)} {how}."


def conservation(found: Verification) -> str:
    """Sentence on the change of |H| and of the energy on coasts, and its cause."""
    both = found.momentum, found.energy
    if all(one.drift == 0.0 for one in both):
        return "On coasts |H| and the energy are constant to the last digit."
    momentum, energy = map(_course, both)
    return f"On coasts |H| {momentum}, the energy {energy}."


def _course(one: Conservation) -> str:
    if one.drift == 0.0 and not one.changed:
        return "is constant to the last digit"
    how = "is NOT constant" if one.kept is False else "is constant but for rounding"
    if one.changed:
        how = f"is changed by {' and '.join(one.changed)}"
    return f"{how} ({_difference(one.drift)} of itself at most)"


def methods_table(found: Verification) -> Table:
    """One row a way to fly the schedule: its residuals, and its difference from the flown motion."""
    left = ("nutation\nleft, deg", "shift of H\ndeg")
    table = columns("method\n", *left, "axis\ndiffers, rad", "H\nrad", "rates\nrelative")
    for method in found.methods:
        if not method.missing:
            angles = map(in_degrees, (method.nutation, method.momentum_shift))
            table.add_row(method.name, *angles, *map(_difference, (method.axis, method.momentum, method.rate)))
    return table


def _difference(value: float | None) -> str:
    if value is None:
        return MISSING
    return "0" if value == 0.0 else "< 1e-12" if value < 1e-12 else f"{value:.1e}"


def budget_table(spacecraft: Spacecraft, found: Verification) -> Table:
    """One row an imperfection: residuals with it alone; then residuals without each effect that plans include."""
    aimed = spacecraft.goal.axis is not None
    table = columns("imperfection\n", "nutation left\ndeg", "off the target\ndeg" if aimed else "shift of H\ndeg")
    for row in found.budget:
        table.add_row(row.name, *map(in_degrees, (row.nutation, row.axis_error)))
    return table


def budget_note(found: Verification, *, aimed: bool) -> str:
    """Note on rows that leave an effect out, and on one that leaves more than all; empty where neither is."""
    names = [row.name.removeprefix(WITHOUT) for row in found.budget if row.name.startswith(WITHOUT)]
    flown = next(row for row in found.budget if row.name == AS_FLOWN)
    single = [row for row in found.budget if row is not flown and not row.name.startswith(WITHOUT)]
    farther, notes = "H farther off the target" if aimed else "a larger shift of H", []
    if len(found.budget) == len({IDEAL, AS_FLOWN}):
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
