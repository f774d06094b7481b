"""The numbered equations of the sources: `equations.md`, and the symbols that they share: `symbols.md`."""

from __future__ import annotations

from typing import NamedTuple, cast

from nutdamp.guide.texts import topics
from nutdamp.guide.topic import Block, Formula, Part, Rows, Topic


class Equation(NamedTuple):
    """A numbered equation as printed, and what nutdamp makes of it.

    ``symbols`` are names of `SYMBOLS`; ``changed`` says what differs from the print, with the formula used instead
    where there is one; ``place`` is the dotted name of the code that holds it.
    """

    number: str
    subject: str
    formula: Formula
    symbols: tuple[str, ...]
    place: str
    changed: tuple[Block, ...]

    @classmethod
    def of(cls, topic: Topic) -> Equation:
        """The equation of a topic of `equations.md`: its formula, symbols and place, and what is changed."""
        ((_, (formula, rows, *changed)),) = topic.parts
        facts = dict(cast("Rows", rows).rows)
        symbols = tuple(facts["symbols"].split())
        return cls(topic.name, topic.summary, cast("Formula", formula), symbols, facts["place"], tuple(changed))

    @property
    def remarks(self) -> tuple[str, ...]:
        """What differs from the print, in words."""
        return tuple(block for block in self.changed if isinstance(block, str))

    @property
    def topic(self) -> Topic:
        """The equation as a topic of the guide."""
        parts = (
            Part("", (self.formula,)),
            Part("Symbols", (Rows(tuple((name, SYMBOLS[name]) for name in self.symbols)),)),
            Part("What nutdamp changes", self.changed or ("Nothing: it is used as printed.",)),
            Part("In the code", (self.place,)),
        )
        return Topic(self.number, self.subject, parts)


(_symbols,) = topics("symbols.md")
SYMBOLS = dict(cast("Rows", _symbols.parts[0].blocks[0]).rows)
"""Symbols of the sources with their units."""

EQUATIONS = tuple(map(Equation.of, topics("equations.md")))
"""Those of Magnus 1970, of the lecture texts "Kreisel-Bewegungen" and "Kreiseltheorie", and of nutdamp itself."""
