"""Results as the tables of pages and notebooks: one unit a column, so that they sort."""

from __future__ import annotations

from nutdamp.flight.propagation import Residual
from nutdamp.page.document import Sheet
from nutdamp.planning.decision import Decision
from nutdamp.spacecraft.schedule import Schedule
from nutdamp.views.decisions import KEPT
from nutdamp.views.end_tables import bounds_text
from nutdamp.views.tables import Heading
from nutdamp.views.text import MISSING, in_degrees


def on_times(pulses: Schedule) -> tuple[Heading, list[str]]:
    """The column of on-times to be loaded; its name tells where valves change them."""
    name = "on-time, commanded" if pulses.through_valves else "on-time"
    return Heading(name, "s"), ["ideal" if pulse.loaded[1] == 0.0 else f"{pulse.loaded[1]:.4f}" for pulse in pulses]


def aspects_sheet(decided: Decision) -> Sheet:
    """One row a direction that is watched: least and largest angle of the spin axis from it, and the limits of both."""
    rows = tuple(
        (
            aspect.keep.name,
            *(cell for angle, at in (aspect[1:3], aspect[3:5]) for cell in (in_degrees(angle), f"{at:.3f}")),
            bounds_text(aspect.keep) or "none",
            KEPT[aspect.kept] if aspect.keep in decided.plan.spacecraft.keep else MISSING,
        )
        for aspect in decided.aspects
    )
    names = ("direction", ""), ("least angle", "deg"), ("at", "s"), ("largest angle", "deg"), ("at", "s")
    heads = [Heading(name, unit, bool(unit)) for name, unit in (*names, ("limit", ""), ("verdict", ""))]
    title = "The spin axis from directions that the file names, to one nutation period after the last pulse"
    return Sheet(title, tuple(heads), rows, sortable=False, stacked=True)


def residual_sheet(title: str, left: Residual) -> Sheet:
    """Residual motion at the end of a flight."""
    names = {
        "nutation": "nutation",
        "body cone": "body_cone",
        "space cone": "space_cone",
        "momentum shift": "momentum_shift",
    }
    rows = tuple((name, in_degrees(getattr(left, key))) for name, key in names.items())
    return Sheet(title, (Heading("at the end", number=False), Heading("angle", "deg")), rows)
