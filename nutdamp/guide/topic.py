"""What a topic of the guide is made of. Texts alone; `nutdamp.presentation.explain_tables` lays them out."""

from __future__ import annotations

from typing import NamedTuple


class Formula(NamedTuple):
    """Lines of a formula, in plain Unicode."""

    lines: tuple[str, ...]


class Rows(NamedTuple):
    """Names and what they are."""

    rows: tuple[tuple[str, str], ...]


class Commands(NamedTuple):
    """Command lines to copy: each may be broken into parts only between its entries."""

    lines: tuple[tuple[str, ...], ...]


Block = str | Formula | Rows | Commands
"""A paragraph, or one of the forms above."""


class Part(NamedTuple):
    """Blocks under a heading; the first part of a topic has none."""

    title: str
    blocks: tuple[Block, ...]


class Topic(NamedTuple):
    """One thing to explain: the ``name`` to request it by, one line about it, and its parts."""

    name: str
    summary: str
    parts: tuple[Part, ...]
