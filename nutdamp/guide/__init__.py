"""The guide that ``nutdamp explain`` shows: topics by name. Texts only, so that it loads fast."""

from __future__ import annotations

import re

from nutdamp.errors import BadRequest, nearest
from nutdamp.guide.equation import Equation
from nutdamp.guide.kreisel import KREISEL, OWN, SOURCES
from nutdamp.guide.magnus import MAGNUS
from nutdamp.guide.motion import DISSIPATION, FIGURES, NUTATION
from nutdamp.guide.schemes import SCHEMES
from nutdamp.guide.topic import Topic
from nutdamp.guide.units import units_topic

__all__ = ["EQUATIONS", "FILE", "NAMES", "OVERVIEW", "SOURCES", "SUMMARIES", "equation", "found", "meant"]

EQUATIONS: tuple[Equation, ...] = (*MAGNUS, *KREISEL, *OWN)

FILE = "file"
"""Name of the topic on the spacecraft file, which is made from the models that read it (`nutdamp.files.file_guide`)."""

OVERVIEW = "equations"
"""Name of the table of all equations."""

SUMMARIES: tuple[tuple[str, tuple[tuple[str, str], ...]], ...] = (
    ("Schemes", tuple((topic.name, topic.summary) for topic in SCHEMES)),
    (
        "Motion",
        (
            *((topic.name, topic.summary) for topic in (NUTATION, DISSIPATION, FIGURES)),
            (OVERVIEW, "the numbered equations of the sources, and where they stand in the code"),
            ("17", "one of them: M(1) to M(27) as 1 to 27, K(5) to K(15) as K5 to K15, 24.4"),
        ),
    ),
    (
        "Files",
        (
            (FILE, "every key of the spacecraft file; file.thrusters, file.limits.tick: a part of it"),
            ("units", "units of the spacecraft file and of options"),
        ),
    ),
)
"""All topics with a line about each, in groups."""

NAMES = tuple(name for _, group in SUMMARIES for name, _ in group)

_NUMBER = re.compile(r"(?P<source>m|k|§)?\s*\(?\s*(?P<number>[0-9]+(\.[0-9]+)?)\s*\)?")
_FIGURE = re.compile(r"(abb|fig)[a-z]*\.?-?[0-9]*")


def found(asked: str) -> Topic:
    """The topic that is asked for by its name or by the number of an equation, but for `FILE` and `OVERVIEW`.

    Raises BadRequest, which names what is near, where there is none.
    """
    name = re.sub(r"[\s_]+", "-", asked.strip().casefold())
    topics = {topic.name: topic for topic in (*SCHEMES, NUTATION, DISSIPATION, FIGURES)}
    if name in topics:
        return topics[name]
    if name == "units":
        return units_topic()
    if name == "energy-sink":
        return DISSIPATION
    if _FIGURE.fullmatch(name):
        return FIGURES
    if match := _NUMBER.fullmatch(asked.strip().casefold()):
        return equation(match["source"] or "", match["number"]).topic
    raise BadRequest(f"there is no topic {asked!r}; {meant(name, NAMES)}")


def equation(source: str, number: str) -> Equation:
    """The equation of that ``source`` (m, k or §, empty: Magnus) and ``number``; raises BadRequest."""
    section = "." in number
    name = number if section else f"{source.upper() if source == 'k' else 'M'}({number})"
    for one in EQUATIONS:
        if one.number == name:
            return one
    raise BadRequest(f"there is no equation {name}; there are M(1) to M(27), K(5) to K(15) and 24.4")


def meant(name: str, known: tuple[str, ...], listed: str = "nutdamp explain") -> str:
    """``did you mean 'nutation'?``, or the command by which they are ``listed``."""
    close = nearest(name, known)
    return f"did you mean {close!r}?" if close else f"`{listed}` lists them"
