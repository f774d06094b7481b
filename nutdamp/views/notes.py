"""Notes in words: the catalogue of their sentences, ``guide/notes.md``, and notes for screens and JSON files.

A value is shown by the unit in which its name ends, so that the sentences hold no formats; one without, in the unit
that the note names, if any.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from rich.text import Text

from nutdamp.common.results import Note, Value
from nutdamp.units import screen_unit
from nutdamp.views.guide import note_entries
from nutdamp.views.text import degrees, duration, lasting, quantity, sentence

WARNING, NOTE, REASON = "warning", "note", "reason"
"""Severities: a warning may change what is fired; a reason says why a plan is recommended."""

NAME = re.compile(r"\{(\w+)\}")

INSTEAD = re.compile(r"\{(\w+)\} instead of \{(than_\1)\}")

UNITS: dict[str, Callable[[float], str]] = {
    "_deg": lambda value: degrees(math.radians(value)),
    "_rad_s": lambda value: quantity(value, "rad/s"),
    "lasting_s": lasting,
    "_s": duration,
    "_Nms": lambda value: quantity(value, "N m s"),
    "_rpm": lambda value: quantity(value, "rpm", 5),
    "_percent": lambda value: f"{value:.3g} %",
    "_share": lambda value: f"{value:.10g} %",
    "_bar": lambda value: quantity(value, "bar"),
}
"""Texts of values by the end of their names."""


def severity(note: Note) -> str:
    """Severity of a note."""
    return note_entries()[note.code].severity


def text(note: Note) -> str:
    """The sentence of a note with its values, without a full stop."""
    entry, values = note_entries()[note.code], note.values
    unit, factor = screen_unit(str(values.get("unit", "")))
    shown = {name: _shown(name, value, factor) for name, value in values.items()} | {"unit": unit}
    first, *clauses = entry.sentence.removesuffix(".").split("; ")
    differing = [clause for clause in clauses if _compared(clause, shown) == clause]
    return NAME.sub(lambda name: shown[name[1]], "; ".join([_compared(first, shown), *differing]))


def _compared(clause: str, shown: Mapping[str, str]) -> str:
    """A clause without "instead of" the same value, as it is ``shown``."""
    return INSTEAD.sub(lambda pair: pair[0] if shown[pair[1]] != shown[pair[2]] else f"{{{pair[1]}}}", clause)


def _shown(name: str, value: Value, factor: float) -> str:
    if not isinstance(value, float):
        return str(value)
    unit = next((unit for end, unit in UNITS.items() if name.endswith(end)), None)
    return f"{factor * value:.4g}" if unit is None else unit(value)


def note_json(note: Note) -> dict[str, Any]:
    """A note for JSON files."""
    return {"code": note.code, "severity": severity(note), "values": note.values, "text": text(note)}


def screen_line(note: Note) -> Text:
    """A note for screens: severity, code, sentence."""
    level = severity(note)
    return Text.assemble((f"{level}[{note.code}]: ", "bold red" if level == WARNING else "bold"), text(note))


def message(note: Note) -> str:
    """A note for standard error: severity, code, sentence."""
    return screen_line(note).plain


def ordered(notes: Iterable[Note]) -> list[Note]:
    """Notes without repetition, warnings first."""
    return sorted(dict.fromkeys(notes), key=lambda note: severity(note) != WARNING)


def joined(notes: Iterable[Note]) -> str:
    """Sentences of several notes in one line."""
    return "; ".join(map(text, notes))


def sentences(notes: Iterable[Note]) -> tuple[str, ...]:
    """Each note as a sentence."""
    return tuple(sentence(text(note)) for note in notes)
