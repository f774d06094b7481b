"""The finder of ``explain``: pages, their topics and sections, words with a paragraph each, and keys of the file."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from functools import partial

from nutdamp.errors import BadRequest
from nutdamp.views import file_guide, guide
from nutdamp.views.guide import FILE, Topic, TopicPart, TopicRows

WORDS: tuple[tuple[str, Callable[[], Iterable[tuple[str, str]]]], ...] = (
    ("glossary", partial(guide.rows, "glossary")),
    ("column of CSV", partial(guide.rows, "csv")),
    ("name in JSON", partial(guide.rows, "json")),
    ("symbol", partial(guide.rows, "symbols")),
)
"""Sources of words, each with its kind: pairs of names, separated by commas, and their paragraph."""

_UNIT = re.compile(r"[-,]*(deg|s|g|kg|%|sigmas?|rad|mrad/s|rpm|1/day|kg/year|%/day|≤|≥|,)$")


def explained(requested: str) -> Topic:
    """Everything that is known by that name, as one topic.

    Raises BadRequest, which names a near one, where there is nothing.
    """
    name, _, below = requested.partition(".")
    if name.casefold() == FILE:
        return file_guide.file_topic(below)
    for simplified in (str, _folded, _bare):
        texts, paths = _texts(requested, simplified), _keys(requested, simplified)
        topic = _known(requested)
        if texts or topic or paths:
            return _joined(requested, texts, topic, paths)
    return next(_sections(requested), None) or _missing(requested)


def names() -> Iterator[str]:
    """Every name that `explained` finds, but for sections of pages."""
    yield from guide.NAMES
    for _, source in WORDS:
        for listed, _ in source():
            yield from listed.split(", ")
    yield from (key.path for key in _plain_keys())


def _folded(name: str) -> str:
    return re.sub(r"[\s_]+", "-", name.strip().casefold())


def _bare(name: str) -> str:
    """A heading without its unit."""
    folded = _folded(name)
    while (bare := _UNIT.sub("", folded)) not in ("", folded):
        folded = bare
    return folded


def _texts(requested: str, simplified: Callable[[str], str]) -> list[tuple[str, str]]:
    """Kinds and paragraphs of the words of that name."""
    wanted = simplified(requested)
    return [
        (kind, text)
        for kind, source in WORDS
        for listed, text in source()
        if wanted in map(simplified, listed.split(", "))
    ]


def _plain_keys() -> Iterator[file_guide.KeyGuide]:
    """Keys of the file, but for those within a tolerance, which are all alike."""
    return (key for key in file_guide.keys() if not key.parent.startswith("dispersions."))


def _keys(requested: str, simplified: Callable[[str], str]) -> list[file_guide.KeyGuide]:
    """Keys of the file of that name, or of that path."""
    wanted = simplified(requested)
    return [key for key in _plain_keys() if wanted in (simplified(key.name), simplified(key.path))]


def _known(requested: str) -> Topic | None:
    """The page, topic or equation of that name."""
    try:
        return guide.found(requested)
    except BadRequest:
        return None


def _joined(
    requested: str, texts: list[tuple[str, str]], topic: Topic | None, paths: list[file_guide.KeyGuide]
) -> Topic:
    """What is known from all sides: the words first, then the page, then the keys of the file."""
    if topic is None and not texts and len(paths) == 1:
        return file_guide.file_topic(paths[0].path)
    parts: list[TopicPart] = []
    alone = topic is None and len(texts) == 1
    if texts and not alone:
        parts.append(TopicPart("", (TopicRows(tuple(texts)),)))
    if topic is not None:
        parts += topic.parts
    if paths:
        about = tuple((f"{FILE}.{key.path}", key.field.description) for key in paths)
        parts.append(TopicPart("In the spacecraft file", (TopicRows(about),)))
    if topic is not None:
        return topic._replace(parts=tuple(parts))
    summary = texts[0][1] if alone else "in the guide" if texts else "keys of the spacecraft file"
    return Topic(requested, summary, tuple(parts))


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
    raise BadRequest(f"there is no topic {requested!r}; {guide.meant(_folded(requested), tuple(names()))}")
