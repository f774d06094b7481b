"""The two forms that every screen is made of."""

from __future__ import annotations

from rich.table import Table


def facts() -> Table:
    """Names to the left, what they are to the right."""
    table = Table.grid(padding=(0, 2))
    table.add_column(style="dim")
    table.add_column(overflow="fold")
    return table


def columns(*names: str, text: tuple[str, ...] = ()) -> Table:
    """A table of numbers, flush right under their headings, but for the first column and those named ``text``."""
    table = Table(box=None, pad_edge=False, header_style="bold", padding=(0, 2, 0, 0))
    for index, name in enumerate(names):
        table.add_column(name, justify="left" if index == 0 or name in text else "right")
    return table
