"""The units of files and options, from the table that reads them."""

from __future__ import annotations

from nutdamp.guide.topic import Part, Rows, Topic
from nutdamp.units import KINDS, Kind


def _line(kind: Kind) -> str:
    """The SI unit first, then the others and what they are in it."""
    if not kind.factors:
        return "no unit"
    named = ((unit, "" if factor == 1.0 else f" = {factor:.6g} {kind.si}") for unit, factor in kind.factors.items())
    others = [f"{unit}{worth}".rstrip() for unit, worth in named if unit != kind.si]
    return "; ".join([kind.si, *others] if kind.si else others)


def units_topic() -> Topic:
    """Every unit that is taken."""
    rows = tuple((kind.noun.partition(" ")[2], _line(kind)) for kind in KINDS.values())
    return Topic(
        "units",
        "units of the spacecraft file and of options",
        (
            Part(
                "",
                (
                    "A value is a number in SI (the first unit of a line) or a text with a unit, such as 60 rpm, 20 ms "
                    "or 5 deg. On the command line the blank may be left out: --until 90s, --set state.spin=60rpm.",
                    Rows(rows),
                    "Blanks within a unit may be left out or written as * or ·, and ^2 as ²: kgm², N*m. degrees, "
                    "degree and ° are read as deg, sec as s, hour as hours, rpm in any case. A unit of another kind, "
                    "or one that is not listed, is an error that names those allowed; Hz is for sampling rates "
                    "alone, and revolutions are no unit here, since nobody can tell whether they count turns or "
                    "radians.",
                    "Reports show degrees, CSV and JSON name the unit in the column or key, such as t_s, nutation_deg.",
                ),
            ),
            Part("See also", ("explain file",)),
        ),
    )
