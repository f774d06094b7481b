"""What must hold for the correlated inputs of a spacecraft file."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from nutdamp.dispersion.correlation import Pair, grouped, positive_definite
from nutdamp.errors import nearest
from nutdamp.files.dispersion_models import BY_THRUSTER
from nutdamp.files.facts import Facts, Finding
from nutdamp.loop_settings import ACCELEROMETER
from nutdamp.schedule import STEERABLE
from nutdamp.units import shown

if TYPE_CHECKING:
    from nutdamp.files.dispersion_rules import Entry

PARTS = {"thrust_direction": ("direction", "ab"), "position": ("position", "xyz"), "attitude": ("attitude", "xy")}
"""Tolerances of which several inputs are drawn: their first word and their last letters."""

EACH_PULSE = ("thrust_per_pulse", "timing")
"""Tolerances that each pulse draws anew."""


def correlation_findings(facts: Facts, entries: Iterable[Entry], thrusters: Iterable[str]) -> Iterator[Finding]:
    """Pairs of what is not drawn, or of one input, pairs given twice, and numbers that cannot be correlations.

    ``entries`` are the tolerances of the file, ``thrusters`` the names that may have some of their own.
    """
    path = ("dispersions", "correlation")
    pairs: dict[frozenset[str], Pair] = {}
    drawn, sound = _drawn(facts, entries, list(thrusters)), True
    for index, node in facts.children(*path):
        names = [facts.text(*path, index, place) for place in (0, 1)]
        size = facts.number("ratio", *path, index, 2)
        if len(node.value if isinstance(node.value, list) else ()) != 3 or None in names or size is None:
            sound = False
            continue  # said already
        first, second = (name or "" for name in names)
        for place, name in enumerate((first, second)):
            problem = _unknown(name, drawn)
            if problem:
                yield Finding((*path, index, place), problem)
        if first == second:
            yield Finding((*path, index, 1), f"{shown(first)} again; expected two different inputs")
        elif frozenset((first, second)) in pairs:
            yield Finding((*path, index), f"{first} and {second} are given before; keep one of the two")
        elif abs(size) == 1.0:
            yield Finding((*path, index, 2), f"{size:g}: one would follow from the other; expected less than 1 in size")
        elif abs(size) < 1.0:
            pairs[frozenset((first, second))] = (first, second, size)
            continue
        sound = False
    for group in grouped(pairs.values()) if sound else ():
        if not positive_definite(group):
            problem = f"not positive definite for {', '.join(group.names)}: no numbers have these correlations"
            yield Finding(path, f"{problem}; pairs that are not given count as 0")


def _unknown(name: str, drawn: dict[str, bool]) -> str:
    """Why an input cannot be correlated; empty where it can. ``drawn``: whether it varies, by name."""
    if name in drawn:
        return "" if drawn[name] else f"{shown(name)} is a fixed offset (bias), which does not vary"
    if name.replace(" ", "_") in EACH_PULSE:
        return f"{shown(name)} is drawn by each pulse anew; expected an input that is the same for all pulses"
    close = nearest(name, list(drawn))
    known = f"did you mean {shown(close)}?" if close else f"known here: {', '.join(drawn) or 'none'}"
    return f"the dispersions have no input called {shown(name)}; {known}"


def _drawn(facts: Facts, entries: Iterable[Entry], thrusters: list[str]) -> dict[str, bool]:
    """Names of all inputs that any schedule could draw once, as `dispersion.inputs` has them, and whether they vary."""
    found = {}
    for entry in entries:
        key, *rest = entry.path[1:]
        node = facts.root.get(*entry.path)
        varies = node is not None and isinstance(node.value, dict) and "bias" not in node.value
        for name in _names(facts, str(key), rest, thrusters):
            found[name] = varies
    return found


def _names(facts: Facts, key: str, one: list[str | int], thrusters: list[str]) -> list[str]:
    """Of a tolerance, which may be of ``one`` thruster or axis alone."""
    if key in EACH_PULSE:
        return []
    if key == "omega0":
        return [f"omega0_{int(axis) + 1}" for axis in one or range(3)]
    word, letters = PARTS.get(key, (key, ""))
    if key in BY_THRUSTER:
        return [
            f"{word} {name} {letter}".rstrip()
            for name in one or thrusters
            for letter in (letters if name != STEERABLE else "") or " "
        ]
    if key in ("sensor_bias", "sensor_scale") and facts.text("loop", "sensor", "kind") != ACCELEROMETER:
        return [f"{key.replace('_', ' ')} {axis}" for axis in (1, 2)]
    if letters:
        return [f"{word} {letter}" for letter in letters]
    spaced = key.startswith(("tank_", "sensor_", "timing_"))
    return [key.replace("_", " ", 1) if spaced else key]
