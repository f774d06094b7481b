"""Quantities: units, parsing and ranges; checks of the arguments of Python users.

A quantity is a number, which is SI, or a text with a unit of the table `KINDS`. Any other unit is
refused, and the message names those allowed: revolutions are left out on purpose, and Hz is for
sampling rates alone, since nobody can tell whether they count turns or radians.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from numbers import Integral, Real
from os import PathLike, fspath
from types import UnionType
from typing import Any, NamedTuple, TypeVar, cast, get_args, get_origin, get_type_hints

from nutdamp.errors import BadRequest


@dataclass(frozen=True, slots=True)
class Kind:
    """One kind of quantity: its name with article, and its units with their factors to SI."""

    noun: str
    factors: dict[str, float]

    @property
    def si(self) -> str:
        """The SI unit; empty for a ratio and for plain numbers."""
        return next((unit for unit, factor in self.factors.items() if factor == 1.0), "")

    @property
    def units(self) -> str:
        """The units allowed, for messages: ``rad/s, deg/s or rpm``."""
        *others, last = self.factors
        return f"{', '.join(others)} or {last}" if others else last

    @property
    def expected(self) -> str:
        """The forms allowed, for messages: ``a number in kg, or a text in kg or g``."""
        if not self.factors:
            return "no unit, no quotes"
        number = f"a number in {self.si}" if self.si else "a number"
        return f"{number}, or a text in {self.units}"


POUND, FOOT, STANDARD_GRAVITY = 0.45359237, 0.3048, 9.80665
"""International pound, kg, and foot, m (yard and pound agreement of 1959); gravity, m/s² (3rd CGPM,
1901).
"""

POUND_FORCE = POUND * STANDARD_GRAVITY
"""N."""

ANGLES = {
    "rad": 1.0,
    "mrad": 1e-3,
    "deg": math.pi / 180.0,
    "arcmin": math.pi / 10800.0,
    "arcsec": math.pi / 648000.0,
}

KINDS: dict[str, Kind] = {
    "mass": Kind("a mass", {"kg": 1.0, "g": 1e-3, "lbm": POUND, "slug": POUND_FORCE / FOOT}),
    "length": Kind(
        "a length", {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "km": 1e3, "ft": FOOT, "in": FOOT / 12.0}
    ),
    "time": Kind("a time", {"s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0, "days": 86400.0}),
    "force": Kind("a force", {"N": 1.0, "mN": 1e-3, "lbf": POUND_FORCE}),
    "torque": Kind(
        "a torque",
        {
            "N m": 1.0,
            "mN m": 1e-3,
            "ft lbf": POUND_FORCE * FOOT,
            "in lbf": POUND_FORCE * FOOT / 12.0,
        },
    ),
    "inertia": Kind(
        "a moment of inertia",
        {"kg m^2": 1.0, "slug ft^2": POUND_FORCE * FOOT, "lbm in^2": POUND * (FOOT / 12.0) ** 2},
    ),
    "momentum": Kind(
        "an angular momentum",
        {
            "N m s": 1.0,
            "kg m^2/s": 1.0,
            "ft lbf s": POUND_FORCE * FOOT,
            "in lbf s": POUND_FORCE * FOOT / 12.0,
        },
    ),
    "shed": Kind("a moment of inertia for each kg", {"kg m^2/kg": 1.0, "m^2": 1.0}),
    "travel": Kind("a length for each kg", {"m/kg": 1.0, "mm/kg": 1e-3}),
    "angle": Kind("an angle", ANGLES),
    "right ascension": Kind("a right ascension", {**ANGLES, "h": math.pi / 12.0}),
    "rate": Kind(
        "an angular rate", {"rad/s": 1.0, "deg/s": math.pi / 180.0, "rpm": math.pi / 30.0}
    ),
    "speed": Kind("a speed", {"m/s": 1.0, "km/s": 1e3, "ft/s": FOOT}),
    "pressure": Kind(
        "a pressure", {"Pa": 1.0, "bar": 1e5, "psi": POUND_FORCE / (FOOT / 12.0) ** 2}
    ),
    "impulse": Kind("an impulse", {"N s": 1.0, "lbf s": POUND_FORCE}),
    "acceleration": Kind("an acceleration", {"m/s^2": 1.0, "mm/s^2": 1e-3, "ft/s^2": FOOT}),
    "frequency": Kind("a sampling rate", {"Hz": 1.0}),
    "ratio": Kind("a ratio", {"%": 0.01}),
    "number": Kind("a plain number", {}),
}
"""The kinds of quantity by name; ``number`` has no unit, such as the parts of a quaternion. In a
right ascension h is an angle, and `HOURS` are read too.
"""

HOURS = r"([01]?[0-9]|2[0-3])\s*h\s*([0-5]?[0-9])\s*m\s*(([0-5]?[0-9](\.[0-9]*)?)\s*s)?"
"""Regular expression (ECMA 262 and Python) of a right ascension such as 18h 12m 33s."""

LARGEST = 1e15
"""Largest magnitude in SI: nothing physical is larger,
and results of larger values could overflow.
"""

FASTEST = 100.0
"""rad/s; no spacecraft spins faster: a larger number without unit is more likely one of rpm."""

LARGEST_SEED = 2**64 - 1
"""Largest seed of random numbers."""

_QUANTITY = re.compile(
    r"\s*([-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)\s*(.*?)\s*", re.DOTALL
)
_EXPONENT = re.compile(r"[-+]?[0-9]+[eE][-+]?[0-9]+")
"""A number of YAML 1.2, such as 42e-3, that ``yaml.safe_load``, of YAML 1.1, leaves a text."""
_DECIMAL_COMMA = re.compile(r"[^,.]*[0-9],[0-9][^,.]*")
# sign, whole hours or degrees, the mark behind them, minutes and seconds, in range or not
_SEXAGESIMAL = re.compile(
    r"([-+]?)([0-9]+)\s*(h|d|deg|°|:)\s*([0-9]+)\s*[m'′:]?\s*([0-9]*\.?[0-9]*)\s*[s\"″]?"
)
_TURNS = re.compile(r"k?hz|rev.*|r/(s|min)|cps|turns?.*", re.IGNORECASE)

_WORDS = {
    "deg": "(deg(rees?)?|°)",
    "s": "s(ec)?",
    "h": "h(ours?)?",
    "days": "d(ays?)?",
    "rpm": "[rR][pP][mM]",
}
"""Regular expressions of words within units that are spelt in several ways."""


def _spellings(unit: str) -> str:
    """Regular expression (ECMA 262 and Python) of all that is read as ``unit``."""
    words = (_WORDS.get(word, word) for word in re.split(r"([ /])", unit))
    # "Nm" and "kg-m^2" are as clear as "N m" and "kg m^2", and much used.
    return "".join("[ *·-]*" if word == " " else word.replace("^2", "(\\^2|²)") for word in words)


_UNITS = [
    (re.compile(_spellings(unit)), name, factor)
    for name, kind in KINDS.items()
    for unit, factor in kind.factors.items()
]
"""Spellings of each unit, its kind and its factor to SI."""


class Bare(float):
    """A number that was written without a unit."""


class Angles(NamedTuple):
    """Two angles in rad that name a direction."""

    first: float
    second: float

    @property
    def readings(self) -> tuple[str, ...]:
        """Readings of unitless numbers that are likely degrees: whole, and more than a turn."""
        doubtful = [
            angle
            for angle in self
            if isinstance(angle, Bare)
            if angle and (angle.is_integer() or abs(angle) > 2.0 * math.pi)
        ]
        return tuple(reading(angle, "angle", "deg") for angle in doubtful)


def word(value: object, kind: str) -> float:
    """SI value of a number, or of a word of a command line, `Bare` without a unit; raises
    ValueError.
    """
    if isinstance(value, Bare):
        return value
    if not isinstance(value, str):
        return parse(float(value) if is_number(value) else value, kind)  # type: ignore[arg-type]
    number = parse(value, kind, bare=True)
    match = _QUANTITY.fullmatch(value)
    return Bare(number) if match and not match[2] else number


def angles(value: object, kind: str = "angle") -> Angles:
    """Two angles in a sequence, or in a text with a comma between them, the first of a ``kind``;
    raises ValueError.
    """
    if isinstance(value, Angles):
        return value
    entries = value.split(",") if isinstance(value, str) else value
    parts = [*entries] if isinstance(entries, Iterable) else []
    if len(parts) != 2:
        point = "; decimals take a point" if isinstance(value, str) and len(parts) > 2 else ""
        raise ValueError(f"{shown(value)} is not two angles, such as 10deg,45deg{point}")
    return Angles(word(parts[0], kind), word(parts[1], "angle"))


def parse(value: object, kind: str, *, bare: bool = False) -> float:
    """SI value of a quantity: a number, or a text with a unit of ``kind``.

    ``bare`` accepts a text that is only a number, as command lines give it; in a file that is a
    slip. Raises ValueError, with a message on the fault and the values allowed; also for NaN,
    infinite and unphysically large values.
    """
    expected = KINDS[kind]
    if isinstance(value, str):
        number, factor = _split(value, kind, bare)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        number = value
        factor = 1.0
    else:
        raise ValueError(f"expected {expected.noun} ({expected.expected}), got {shown(value)}")
    try:
        result = float(number) * factor
    except OverflowError:
        result = math.inf
    if not math.isfinite(result):
        raise ValueError(f"{shown(value)} is not a finite number")
    if abs(result) > LARGEST:
        largest = f"{LARGEST:g} {expected.si}".rstrip()
        raise ValueError(f"{shown(value)} is beyond anything physical; at most {largest}")
    return result


def _split(text: str, kind: str, bare: bool) -> tuple[float, float]:
    """Number and factor of a text with a unit of ``kind``."""
    expected = KINDS[kind]
    if _DECIMAL_COMMA.fullmatch(text):
        point = shown(text.replace(",", "."))
        cure = f"{point}, with a decimal point"
        if re.search(r",\d{3}(\D|$)", text):  # or one between thousands, as in 1,250 kg
            cure += f", or {shown(text.replace(',', ''))}"
        raise ValueError(f"{shown(text)} has a decimal comma; write {cure}")
    hours = re.fullmatch(HOURS, text.strip()) if kind == "right ascension" else None
    if hours is not None:
        late = float(hours[2]) + float(hours[4] or 0.0) / 60.0
        return float(hours[1]) + late / 60.0, expected.factors["h"]
    parts = _SEXAGESIMAL.fullmatch(text.strip())
    if parts is not None and kind in ("angle", "right ascension"):
        sign, whole, mark, minutes, seconds = parts.groups()
        if kind == "right ascension" and mark in "h:":
            raise ValueError(
                f"{shown(text)} is not a right ascension: expected hours from 0 to 23, minutes "
                "from 0 to 59, seconds from 0 to below 60, as in 18h 12m 33s"
            )
        angle = int(whole) + int(minutes) / 60.0 + float(seconds.strip(".") or 0.0) / 3600.0
        raise ValueError(
            f"{shown(text)} has minutes; write decimal degrees: "
            f"{sign}{angle * (15.0 if mark == 'h' else 1.0):.8g} deg (a declination is from -90 "
            "deg to 90 deg)"
        )
    match = _QUANTITY.fullmatch(text)
    # A "unit" that starts like the rest of a number has a thousands separator before it.
    if match is None or re.match(r"[0-9.,_']", match[2]):
        raise ValueError(f"{shown(text)} is not {expected.noun}: {expected.expected}")
    number = float(match[1])
    unit = re.sub(r"\s+", " ", match[2])
    if not unit and (bare or _EXPONENT.fullmatch(text)):
        return number, 1.0
    if not expected.factors:
        raise ValueError(f"{shown(text)} is not {expected.noun}: {expected.expected}")
    if not unit:
        raise ValueError(
            f"{shown(text)} has no unit; add {expected.units}, or leave the quotes out"
        )
    meanings = {name: factor for spelling, name, factor in _UNITS if spelling.fullmatch(unit)}
    if kind in meanings:
        return number, meanings[kind]
    if not meanings or "frequency" in meanings:
        noun = expected.noun.partition(" ")[2]
        turns = kind in ("rate", "angle", "right ascension") and _TURNS.fullmatch(unit)
        hint = f" ({match[2]} hides a factor 2π)" if turns else ""
        raise ValueError(
            f"{shown(text)}: {shown(match[2])} is not a unit of {noun}; use {expected.units}{hint}"
        )
    other = KINDS[next(iter(meanings))]
    raise ValueError(
        f"{shown(text)} is {other.noun}; expected {expected.noun}: {expected.expected}"
    )


def pattern(kind: str) -> str:
    """Regular expression (ECMA 262 and Python) of the texts that `parse` takes for ``kind``; for
    JSON Schema.
    """
    units = "|".join(map(_spellings, KINDS[kind].factors))
    quantity = rf"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?\s*({units})"
    if kind == "right ascension":
        quantity = f"({quantity}|{HOURS})"
    return rf"^\s*{quantity}\s*$"


SI, US = "si", "us"
"""Systems of units of screens; files are SI."""

_US_UNITS = {
    "N m": "ft lbf",
    "kg m²": "slug ft²",
    "kg": "lbm",
    "g": "lbm",
    "N": "lbf",
    "mm": "in",
    "m": "ft",
    "bar": "psi",
}
"""Units of screens, and the US customary ones in their place."""

_CUSTOMARY = re.compile(rf"({'|'.join(_US_UNITS)})(?= s$|/|$)")
"""The part of a unit to be replaced: that of N m s, kg/year or m/s²."""

_system = ContextVar("system of units", default=SI)


@contextmanager
def screen_units(system: str) -> Iterator[None]:
    """Context in which `screen_unit` is of a ``system``."""
    token = _system.set(system)
    try:
        yield
    finally:
        _system.reset(token)


def screen_unit(unit: str, scale: float = 1.0) -> tuple[str, float]:
    """The unit of screens for a unit of SI, and ``scale``, a factor to the latter, as one to the
    former.
    """
    replaced = _CUSTOMARY.match(unit) if _system.get() == US else None
    if replaced is None:
        return unit, scale
    factors = {
        name.replace("^2", "²"): factor
        for kind in KINDS.values()
        for name, factor in kind.factors.items()
    }
    customary = _US_UNITS[replaced[0]]
    return customary + unit[replaced.end() :], scale * factors[replaced[0]] / factors[customary]


def reading(value: float, kind: str, meant: str) -> str:
    """The reading of a bare number, and the text to write where ``meant`` is its likelier unit."""
    number = f"{value:.12g}"
    si = KINDS[kind].si
    unit = f"rad ({math.degrees(value):.4g} deg)" if kind == "angle" else si
    cure = f"write {number} {meant} if that is meant"
    if meant == "m/s":  # speed of the exhaust, which is no unit of a specific impulse
        cure = f"write {value / STANDARD_GRAVITY:.4g} {si} if m/s is meant"
    return f"{number} is read as {number} {unit}; {cure}, else {number} {si}"


def bar(pressure: float) -> str:
    """A pressure given in Pa as people read it."""
    return f"{1e-5 * pressure:.4g} bar"


def shown(value: object) -> str:
    """A value as messages show it: one line, short, in the words of YAML."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict | list):
        return "a mapping" if isinstance(value, dict) else "a list"
    if value is None:
        return "nothing"
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:40]}…{text[-10:]}"


Instance = TypeVar("Instance")
Record = TypeVar("Record", bound=Any)


def expect(fits: bool, name: str, value: Any, expected: str) -> Any:
    """The ``value`` of an argument; raises BadRequest where it does not fit."""
    if not fits:
        raise BadRequest(f"{name}: expected {expected}, got {as_given(value)}")
    return value


def instance(name: str, value: Any, kind: type[Instance], expected: str) -> Instance:
    """``value``, where it is of the ``kind``; raises BadRequest."""
    return cast("Instance", expect(isinstance(value, kind), name, value, expected))


def path(name: str, value: str | PathLike[str], expected: str = "the name of a file") -> str:
    """The name of a file; raises BadRequest."""
    named = fspath(value) if isinstance(value, PathLike) else value
    return instance(name, named, str, expected)


def changes(value: Any) -> Mapping[str, object]:
    """Keys and their new values; raises BadRequest."""
    keys = {} if value is None else value
    fits = isinstance(keys, Mapping) and all(isinstance(key, str) for key in keys)
    expect(fits, "set", value, "a mapping such as {'limits.horizon': '300 s'}")
    return cast("Mapping[str, object]", keys)


def end_of_flight(value: Any) -> float:
    """A time in s after t = 0; raises BadRequest."""
    fits = is_number(value) and value > 0.0
    return float(expect(fits, "until", value, "a time after t = 0, in s"))


def seed(value: Any) -> int:
    """Seed of random numbers; raises BadRequest."""
    fits = isinstance(value, int) and 0 <= value <= LARGEST_SEED
    return int(expect(fits, "seed", value, "a whole number from 0 to 2**64 - 1"))


def tilt(value: Any, name: str = "largest") -> float:
    """An angle in rad between 0 and a right angle; raises BadRequest."""
    fits = is_number(value) and 0.0 < value < 0.5 * math.pi
    return float(expect(fits, name, value, "an angle in rad between 0 and a right angle"))


def count(name: str, value: Any, least: int = 1) -> int:
    """A whole number of at least ``least``, which is no less than 1; raises BadRequest."""
    fits = is_count(value) and value >= least
    return int(expect(fits, name, value, f"a whole number of at least {least}"))


def shifts(value: Any) -> tuple[float, ...]:
    """Angles in rad, infinite where any will do; raises BadRequest."""
    angles = tuple(value) if isinstance(value, Iterable) and not isinstance(value, str) else ()
    fits = [(is_number(angle) or angle == math.inf) and angle >= 0.0 for angle in angles]
    expect(
        all(fits) and fits != [],
        "allow",
        value,
        "angles of at least 0, in rad, such as (0.0, math.inf)",
    )
    return tuple(map(float, angles))


def thresholds(value: Any) -> tuple[tuple[float, float], ...]:
    """Pairs of angles (start, stop) in rad, stop the smaller; raises BadRequest."""
    what = "angles in rad below a right angle, the second smaller, such as [(0.01, 0.002)]"
    pairs = []
    for pair in value if isinstance(value, Iterable) else (value,):
        angles = tuple(pair) if isinstance(pair, Sequence) and not isinstance(pair, str) else ()
        fits = len(angles) == 2 and all(map(is_number, angles))
        fits = fits and 0.0 <= angles[1] < angles[0] < 0.5 * math.pi
        expect(fits, "thresholds", pair, f"pairs of {what}")
        pairs.append((float(angles[0]), float(angles[1])))
    return tuple(pairs)


def one_of(name: str, value: Any, names: tuple[str, ...]) -> str:
    """One of the ``names``; raises BadRequest."""
    fits = isinstance(value, str) and value in names
    return str(expect(fits, name, value, f"one of {', '.join(names)}"))


def is_number(value: Any) -> bool:
    """True for a real number of Python or numpy, of sensible size."""
    return issubclass(type(value), Real) and type(value) is not bool and abs(value) <= LARGEST


def is_count(value: Any) -> bool:
    """True for a whole number of at least 1."""
    return issubclass(type(value), Integral) and type(value) is not bool and value >= 1


def as_given(value: object) -> str:
    """A value as a message names it: short ones in full, others by their type."""
    text = repr(value) if isinstance(value, str | Real | None) else ""
    if 0 < len(text) <= 60:
        return text
    kind = type(value)
    return f"a {kind.__module__}.{kind.__qualname__}".replace("builtins.", "")


def replaced(value: Record, fields: Mapping[str, object], types: dict[str, Any]) -> Record:
    """A dataclass with some of its fields replaced, looked at by their types, some of which only
    ``types`` has; raises BadRequest.
    """
    import numpy as np

    kinds = get_type_hints(type(value), localns=types)
    declared = {field.name: str(field.type) for field in dataclasses.fields(value) if field.init}
    values: dict[str, Any] = {}
    for name, entry in fields.items():
        if name not in declared:
            raise BadRequest(f"replace: there is no {name!r}; there are {', '.join(declared)}")
        vector = declared[name].startswith("Vector") and entry is not None
        if vector:
            expect(_is_vector(entry), name, entry, "three numbers")
            values[name] = np.array(entry, dtype=float)
        else:
            values[name] = expect(_fits(entry, kinds[name]), name, entry, declared[name])
    return dataclasses.replace(value, **values)


def _fits(value: object, hint: Any) -> bool:
    """True for a value of a type hint; arrays are not looked at."""
    origin, parts = get_origin(hint), get_args(hint)
    if origin is UnionType:
        return any(_fits(value, part) for part in parts)
    if origin is tuple:
        return isinstance(value, tuple) and all(isinstance(entry, parts[0]) for entry in value)
    return is_number(value) if hint is float else isinstance(value, origin or hint)


def _is_vector(value: Any) -> bool:
    sized = isinstance(value, Sequence) or getattr(value, "ndim", 0) == 1
    return sized and len(value) == 3 and all(map(is_number, value))
