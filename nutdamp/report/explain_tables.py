"""The screens of ``explain``."""

from __future__ import annotations

from rich.console import Group, RenderableType
from rich.text import Text

from nutdamp.equations import EQUATIONS, SOURCES
from nutdamp.report.layout import facts


def equations_screen() -> RenderableType:
    """Every numbered equation: where it stands, what differs from the print, which test checks it."""
    table = facts()
    for equation in EQUATIONS:
        lines = [f"{equation.subject}: {equation.place}"]
        if equation.note:
            lines.append(equation.note)
        lines.append(f"tests/{equation.test}")
        table.add_row(equation.number, Text("\n".join(lines)))
    return Group(*(Text(source) for source in SOURCES), Text(), table)
