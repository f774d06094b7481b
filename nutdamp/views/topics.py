"""The finder of ``explain``: pages, their topics and sections, words with a paragraph each, and keys of the file."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from functools import partial

from nutdamp.errors import BadRequest, nearest
from nutdamp.views import guide
from nutdamp.views.file_guide import KeyGuide, file_topic
from nutdamp.views.file_guide import keys as file_keys
from nutdamp.views.guide import FILE, Topic, TopicPart, TopicRows


def _notes() -> Iterator[tuple[str, str]]:
    """Codes of notes, with their sentences and paragraphs; values of a case stand in brackets."""
    for code, entry in guide.note_entries().items():
        sentence = re.sub(r"\{(\w+?)(_[a-zA-Z]+)?\}", lambda name: f"[{name[1].replace('_', ' ')}]", entry.sentence)
        yield code, f"{sentence} {entry.paragraph}"


WORDS: tuple[tuple[str, Callable[[], Iterable[tuple[str, str]]]], ...] = (
    ("glossary", partial(guide.rows, "glossary")),
    ("column of CSV", partial(guide.rows, "csv")),
    ("name in JSON", partial(guide.rows, "json")),
    ("symbol", partial(guide.rows, "symbols")),
    ("note", _notes),
)
"""Sources of words, each with its kind: pairs of names, separated by commas, and their paragraph."""

ALIKE = ("glossary", "symbol")
"""Kinds whose names of one paragraph mean the same."""


_UNIT = re.compile(
    r"([-,]+(N-m(-s)?|kg-m²|deg(/s)?|m?rad(/s)?|rpm|s|m|N|g|kg|%|relative|sigmas?|(1|%|kg)/(day|year)))$|[-,≤≥]+$"
)
"""End of a heading with hyphens for blanks: its unit."""


def explained(requested: str) -> Topic:
    """Everything that is known by that name, as one topic: words first, then the page, then the keys of the file.

    Raises BadRequest, which names a near one, where there is nothing.
    """
    name, _, below = requested.partition(".")
    if name.casefold() == FILE:
        return file_topic(below)
    texts, topic, keys = list(_texts(requested)), _known(requested), _keys(requested)
    if topic is None and not texts:
        if not keys:
            return next(_sections(requested), None) or _missing(requested)
        if len(keys) == 1:
            return file_topic(keys[0].path)
    summary = "keys of the spacecraft file"
    if topic is not None:
        summary = topic.summary
    elif texts:
        (_, summary), *texts = texts
    parts = [TopicPart("", (TopicRows(tuple(texts)),))] if texts else []
    parts += [] if topic is None else topic.parts
    if keys:
        rows = tuple((f"{FILE}.{key.path}", key.field.description) for key in keys)
        parts.append(TopicPart("In the spacecraft file", (TopicRows(rows),)))
    return Topic(requested if topic is None else topic.name, summary, tuple(parts))


def names() -> Iterator[str]:
    """Every name that `explained` finds, but for sections of pages."""
    yield from guide.NAMES
    for _, source in WORDS:
        for listed, _ in source():
            yield from listed.split(", ")
    yield from (key.path for key in _plain_keys())


def _folded(name: str) -> str:
    """A name in small letters with hyphens; a single letter, which is a symbol, as it is."""
    return re.sub(r"[\s_]+", "-", name.strip() if len(name.strip()) == 1 else name.strip().casefold())


def _bare(name: str) -> str:
    """A heading without its unit."""
    hyphened = re.sub(r"[\s_]+", "-", name.strip())
    while (bare := _UNIT.sub("", hyphened)) not in ("", hyphened):
        hyphened = bare
    return _folded(hyphened)


def _texts(requested: str) -> Iterator[tuple[str, str]]:
    """Kinds and paragraphs of the words of that name: as written, else folded, else without unit; no text twice.

    Where the glossary has it, only names as written are looked for besides.
    """
    seen: set[str] = set()
    for kind, source in WORDS:
        words = [(_spelt(listed), listed, text) for listed, text in source()]
        forms = (str,) if seen else (str, _folded, _bare)
        tiers = ([word for word in words if form(requested) in map(form, word[0])] for form in forms)
        for _, listed, text in next(filter(None, tiers), []):
            if text not in seen:
                seen.add(text)
                yield kind, text if kind in ALIKE or ", " not in listed else f"{listed}: {text}"


def _spelt(listed: str) -> list[str]:
    """The names of a list; some have a comma of their own."""
    names = listed.split(", ")
    spans = ((first, last) for first in range(len(names)) for last in range(first + 1, len(names) + 1))
    return [", ".join(names[first:last]) for first, last in spans]


def _plain_keys() -> Iterator[KeyGuide]:
    """Keys of the file, but for those within a tolerance, which are all alike."""
    return (key for key in file_keys() if not key.parent.startswith("dispersions."))


def _keys(requested: str) -> list[KeyGuide]:
    """Keys of the file of that name, or of that path."""
    wanted = _folded(requested)
    return [key for key in _plain_keys() if wanted in (_folded(key.name), _folded(key.path))]


def _known(requested: str) -> Topic | None:
    """The page, topic or equation of that name."""
    try:
        return guide.found(requested)
    except BadRequest:
        return None


def _sections(requested: str) -> Iterator[Topic]:
    """Sections of pages of that title, or whose title begins so."""
    wanted = _folded(requested)
    for begins in (False, True):
        for name in guide.NAMES:
            for part in guide.found(name).parts if name not in (FILE, guide.OVERVIEW) else ():
                title = _folded(part.title)
                if title == wanted or (begins and len(wanted) > 3 and title.startswith(wanted)):
                    yield Topic(part.title, f"in explain {name}", (TopicPart("", part.blocks),))


def _missing(requested: str) -> Topic:
    """Raise BadRequest: there is no topic of that name."""
    if re.fullmatch(r"[mk(]*[0-9]+\)?", requested.casefold()):
        return guide.found(requested)  # raises, and says which equations there are
    close = nearest(_folded(requested), guide.NAMES)
    raise BadRequest(f"there is no topic {requested!r}; {guide.meant(close or _folded(requested), tuple(names()))}")
