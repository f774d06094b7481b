"""The guide that ``nutdamp explain`` shows: topics by name. Texts alone, from the Markdown files here."""

from __future__ import annotations

import re

from nutdamp.errors import BadRequest, nearest
from nutdamp.guide.texts import topics
from nutdamp.guide.topic import Topic
from nutdamp.guide.units import units_topic

__all__ = ["FILE", "NAMES", "OVERVIEW", "SOURCES", "SUMMARIES", "found", "limits", "meant"]

SCHEMES, MOTION = topics("schemes.md"), topics("motion.md")

SOURCES = (
    'M(n): K. Magnus, "Untersuchungen über zeitabhängig selbsterregte, symmetrische Kreisel", 1970',
    'K(n): lecture text "Kreisel-Bewegungen"',
    '24.4: lecture text "Kreiseltheorie", section 24.4',
)

FILE = "file"
"""Name of the topic on the spacecraft file, which is made from the models that read it (`nutdamp.files.file_guide`)."""

OVERVIEW = "equations"
"""Name of the table of all equations."""

SUMMARIES: tuple[tuple[str, tuple[tuple[str, str], ...]], ...] = (
    ("Schemes", tuple((topic.name, topic.summary) for topic in SCHEMES)),
    (
        "Motion",
        (
            *((topic.name, topic.summary) for topic in MOTION),
            (OVERVIEW, "the numbered equations of the sources, and where they are in the code"),
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


def found(requested: str) -> Topic:
    """The topic by its name or by the number of an equation, but for `FILE` and `OVERVIEW`.

    Raises BadRequest, which names what is near, where there is none.
    """
    name = re.sub(r"[\s_]+", "-", requested.strip().casefold())
    known = {topic.name: topic for topic in (*SCHEMES, *MOTION)}
    if name in known:
        return known[name]
    if name == "units":
        return units_topic()
    if name == "energy-sink":
        return known["dissipation"]
    if _FIGURE.fullmatch(name):
        return known["figures"]
    if match := _NUMBER.fullmatch(requested.strip().casefold()):
        return _equation(match["source"] or "", match["number"])
    raise BadRequest(f"there is no topic {requested!r}; {meant(name, NAMES)}")


def _equation(source: str, number: str) -> Topic:
    """The topic of the equation of that ``source`` (m, k or §, empty: Magnus) and ``number``; raises BadRequest."""
    from nutdamp.guide.equation import EQUATIONS

    section = "." in number
    name = number if section else f"{source.upper() if source == 'k' else 'M'}({number})"
    for one in EQUATIONS:
        if one.number == name:
            return one.topic
    raise BadRequest(f"there is no equation {name}; there are M(1) to M(27), K(5) to K(15) and 24.4")


def meant(name: str, known: tuple[str, ...], listed: str = "nutdamp explain") -> str:
    """``did you mean 'nutation'?``, or the command by which they are ``listed``."""
    close = nearest(name, known)
    return f"did you mean {close!r}?" if close else f"`{listed}` lists them"


def limits() -> tuple[str, ...]:
    """Assumptions and limits, a paragraph each; the README has the same ones."""
    from pkgutil import get_data

    text = (get_data("nutdamp.guide", "limits.md") or b"").decode("utf-8")
    return tuple(" ".join(part.split()) for part in re.split(r"^- ", text, flags=re.MULTILINE) if part.strip())
