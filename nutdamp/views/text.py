"""Numbers as people read them (four digits, units, degrees), and notes in words.

The sentences of notes stand in ``guide/notes.md``. A value is shown by the unit in which its name
ends, so that the sentences hold no formats; one without, in the unit that the note names, if any.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from rich.text import Text

from nutdamp.common.numerics import MISSING as MISSING
from nutdamp.common.numerics import RPM as RPM
from nutdamp.common.numerics import cleaned
from nutdamp.common.results import Note, Value
from nutdamp.errors import listed
from nutdamp.schemes.catalogue import NAMES
from nutdamp.units import screen_unit

CATALOGUE = Path(__file__).parents[1] / "guide" / "notes.md"

LONG = (  # units of long times: their length, s, and the time, s, up to which they are used
    ("s", 1.0, 3600.0),
    ("hours", 3600.0, 172_800.0),
    ("days", 86_400.0, 63_115_200.0),
    ("years", 31_557_600.0, math.inf),
)


def quantity(value: float | None, unit: str, digits: int = 4) -> str:
    """A number with its unit, that of the screen for it, or the word for an unknown or infinite
    one.
    """
    if value is None or math.isnan(value):
        return MISSING
    if math.isinf(value):
        return "infinite" if value > 0 else "-infinite"
    unit, factor = screen_unit(unit)
    return f"{factor * value:.{digits}g} {unit}"


def digits(value: float, count: int) -> str:
    """A number to ``count`` figures, final zeros too, for columns and labels where the others have
    as many.
    """
    return f"{value:#.{count}g}".rstrip(".")


def sentence(clause: str) -> str:
    """A clause with a capital letter, unless it begins with a scheme or a key, and a full stop,
    unless it asks.
    """
    first, _, _ = clause.partition(" ")
    begun = (
        clause if "." in first or first.rstrip(":") in NAMES else clause[:1].upper() + clause[1:]
    )
    return begun if begun.endswith("?") else f"{begun}."


def degrees(angle: float | None) -> str:
    """An angle given in rad, in degrees; one below `ROUNDING` is 0."""
    if angle is None or math.isnan(angle):
        return MISSING
    shown = math.degrees(angle)
    return f"{shown:.4g} deg" if abs(shown) >= ROUNDING else "0 deg"


ROUNDING = 1e-9
"""Degrees below which an angle is rounding of the arithmetic: that of an hour of flight, 1e-11 rad.
"""


def small_angle(angle: float) -> str:
    """An angle given in degrees, without the unit and with final zeros; 0 below `ROUNDING`."""
    return digits(angle, 4) if abs(angle) >= ROUNDING else "0"


FINE = 0.01  # share of a limit below which what is left of it is shown as 0
COARSE = 5e-4  # degrees below which an angle without a limit is shown as 0


def short_angle(angle: float | None, largest: float = math.inf) -> str:
    """An angle given in rad, in degrees to three figures; "0" where it does not matter beside a
    ``largest`` (rad).
    """
    if angle is None or math.isnan(angle):
        return MISSING
    rounding = COARSE if math.isinf(largest) else min(COARSE, FINE * math.degrees(largest))
    return "0" if abs(math.degrees(angle)) < rounding else f"{math.degrees(angle):.3g}"


def limit_text(angle: float) -> str:
    """The bound of an angle, given in rad, in degrees: as it was given, however small."""
    return f"{math.degrees(angle):.4g} deg"


def mass(value: float | None) -> str:
    """Propellant given in kg, in g below a kilogram."""
    return (
        quantity(1e3 * value, "g") if value is not None and value < 1.0 else quantity(value, "kg")
    )


def cost(value: float | None, unit: str) -> str:
    """Propellant in kg as `mass` has it, an impulse with its ``unit``: four figures, final zeros
    too, for columns.
    """
    if value is None or value == 0.0 or not math.isfinite(value):
        return mass(value) if unit == "kg" else quantity(value, unit)
    size, unit = (1e3 * value, "g") if unit == "kg" and value < 1.0 else (value, unit)
    unit, factor = screen_unit(unit)
    return f"{digits(factor * size, 4)} {unit}"


LONG_TIME, LONGEST_TIME = 1e3, 3.6e6
"""Times, s, between which durations are written as h:mm:ss:
beyond a thousand hours these mislead.
"""


def duration(value: float | None) -> str:
    """A time given in s, in ms below a tenth of a second, from 1,000 s on in hours, minutes and
    seconds.
    """
    if value is not None and LONG_TIME <= value < LONGEST_TIME:
        whole = round(value)
        return f"{whole // 3600}:{whole // 60 % 60:02d}:{whole % 60:02d}"
    if value is None or not math.isfinite(value) or value == 0.0 or value >= 0.1:
        return quantity(value, "s")
    return quantity(1e3 * value, "ms")


def lasting(value: float | None) -> str:
    """A time given in s that may be long: in s, hours, days or years."""
    if value is None or not math.isfinite(value):
        return quantity(value, "s")
    unit, size = next(row for row in LONG if value < row[2])[:2]
    return quantity(value / size, unit)


def moment(value: float) -> str:
    """A point in time given in s, to the millisecond."""
    return f"{fixed(value, 3)} s"


def vector(components: Iterable[float]) -> str:
    """Components in brackets, with rounding as 0."""
    return "(" + ", ".join(f"{part:.4g}" for part in cleaned(list(components)).tolist()) + ")"


def pointing(angle: float) -> str:
    """An angle of a direction given in degrees, to four decimals, as every place shows it."""
    return fixed(angle, 4)


def longitude(angle: float) -> str:
    """A right ascension or azimuth given in degrees, from 0 to below 360."""
    return fixed(angle % 360.0, 4, 360.0)


def steering(impulse: Sequence[float]) -> str:
    """Direction of a transverse torque in the 1-2 plane, from axis 1 towards axis 2: 0 to below 360
    degrees.
    """
    return f"{fixed(math.degrees(math.atan2(impulse[1], impulse[0])) % 360.0, 2, 360.0)}°"


def fixed(value: float, digits: int, period: float = math.inf) -> str:
    """A number with so many decimals; one that rounds to 0, or up to ``period``, is 0."""
    rounded = round(value, digits)
    return f"{rounded:.{digits}f}" if 0.0 != rounded < period else "0"


WARNING, NOTE, REASON = "warning", "note", "reason"
"""Severities: a warning may change what is fired; a reason says why a plan is recommended."""

NAME = re.compile(r"\{(\w+)\}")
INSTEAD = re.compile(r"\{(\w+)\} instead of \{(than_\1)\}")
UNITS: dict[
    str, Callable[[float], str]
] = {  # texts of values by the end of their names, the first that fits
    "limit_deg": lambda value: limit_text(math.radians(value)),
    "_deg": lambda value: degrees(math.radians(value)),
    "_rad_s": lambda value: quantity(value, "rad/s"),
    "lasting_s": lasting,
    "_Nms": lambda value: quantity(value, "N m s"),
    "_rpm": lambda value: quantity(value, "rpm", 5),
    "_percent": lambda value: f"{value:.3g} %",
    "_share": lambda value: f"{value:.10g} %",
    "_bar": lambda value: quantity(value, "bar"),
    "_s": duration,
}


class NoteEntry(NamedTuple):
    """A code of the catalogue: its severity, its ``rank`` among notes if any, its sentence with
    names of values in braces, and what it means.
    """

    severity: str
    rank: str
    sentence: str
    paragraph: str


NOTE_ENTRY = re.compile(
    r"^## (\S+) \((\w+)(?:, (\w+))?\)\n\n((?:> [^\n]*\n)+)\n(.*?)(?=\n## |\Z)",
    re.MULTILINE | re.DOTALL,
)


@cache
def note_entries() -> dict[str, NoteEntry]:
    """All codes of the catalogue."""
    entries = NOTE_ENTRY.findall(CATALOGUE.read_text(encoding="utf-8"))
    return {
        code: NoteEntry(
            severity, rank, " ".join(quoted[2:-1].split("\n> ")), " ".join(paragraph.split())
        )
        for code, severity, rank, quoted, paragraph in entries
    }


def severity(note: Note) -> str:
    """Severity of a note."""
    return note_entries()[note.code].severity


CHOICE, DETAIL = "choice", "detail"
"""Ranks of notes: one that may change the choice of a plan; one for screens with all values."""


def rank(note: Note) -> int:
    """Place of a note among others by what it changes: warnings, then choices, details last."""
    entry = note_entries()[note.code]
    return [entry.severity == WARNING, entry.rank == CHOICE, entry.rank != DETAIL, True].index(True)


def is_detail(note: Note) -> bool:
    """True for a note that default screens leave out."""
    return note_entries()[note.code].rank == DETAIL


def text(note: Note) -> str:
    """The sentence of a note with its values, without a full stop."""
    entry = note_entries()[note.code]
    values = note.values
    unit, factor = screen_unit(str(values.get("unit", "")))
    shown = {name: _shown(name, value, factor) for name, value in values.items()} | {"unit": unit}
    first, *clauses = entry.sentence.removesuffix(".").split("; ")
    differing = [clause for clause in clauses if _compared(clause, shown) == clause]
    return NAME.sub(lambda name: shown[name[1]], "; ".join([_compared(first, shown), *differing]))


def _compared(clause: str, shown: Mapping[str, str]) -> str:
    """A clause without "instead of" the same value, as it is ``shown``."""
    return INSTEAD.sub(
        lambda pair: pair[0] if shown[pair[1]] != shown[pair[2]] else f"{{{pair[1]}}}", clause
    )


def _shown(name: str, value: Value, factor: float) -> str:
    if not isinstance(value, float):
        return str(value)
    unit = next((unit for end, unit in UNITS.items() if name.endswith(end)), None)
    return f"{factor * value:.4g}" if unit is None else unit(value)


def note_json(note: Note) -> dict[str, Any]:
    """A note for JSON files."""
    return {
        "code": note.code,
        "severity": severity(note),
        "values": note.values,
        "text": text(note),
    }


def screen_line(note: Note) -> Text:
    """A note for screens: severity, code, sentence."""
    level = severity(note)
    return Text.assemble(
        (f"{level}[{note.code}]: ", "bold red" if level == WARNING else "bold"), text(note)
    )


_screens: ContextVar[tuple[bool, str]] = ContextVar("screens", default=(False, ""))


def quiet() -> bool:
    """True where screens leave out notes and next steps, and warnings stay."""
    return _screens.get()[0]


def with_file(step: str) -> str:
    """A next step, with the spacecraft file of the command line if it is a command."""
    return f"{step} {_screens.get()[1]}".rstrip() if step.startswith("nutdamp ") else step


@contextmanager
def screens_of(file: str, *, hidden: bool) -> Iterator[None]:
    """Context in which screens are `quiet`, if notes are to be ``hidden``, and next steps have the
    ``file`` of the spacecraft.
    """
    token = _screens.set((hidden, file))
    try:
        yield
    finally:
        _screens.reset(token)


def ordered(notes: Iterable[Note]) -> list[Note]:
    """Notes without repetition, warnings first; those that say the same of several schemes are one,
    which names all.
    """
    merged: dict[Note, list[str]] = {}
    for entry in notes:
        alike = Note(entry.code, tuple(item for item in entry.items if item[0] != "scheme"))
        schemes = merged.setdefault(alike, [])
        scheme = entry.values.get("scheme")
        if scheme is not None and str(scheme) not in schemes:
            schemes.append(str(scheme))
    every = [alike.of(listed(schemes)) if schemes else alike for alike, schemes in merged.items()]
    shown = [entry for entry in every if severity(entry) == WARNING or not quiet()]
    return sorted(shown, key=lambda note: severity(note) != WARNING)


def joined(notes: Iterable[Note]) -> str:
    """Sentences of several notes in one line."""
    return "; ".join(map(text, notes))


def sentences(notes: Iterable[Note]) -> tuple[str, ...]:
    """Each note as a sentence."""
    return tuple(sentence(text(note)) for note in notes)
