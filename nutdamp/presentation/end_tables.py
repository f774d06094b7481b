"""Where it points: directions in words, and how a flight leaves the body."""

from __future__ import annotations

import math
from collections.abc import Iterable

from rich.table import Table

from nutdamp.aspect import Aspect, aspects
from nutdamp.flight import Flight
from nutdamp.presentation.layout import facts
from nutdamp.presentation.text import degrees, longitude, moment, pointing, quantity
from nutdamp.spacecraft import Spacecraft, Vector

FRAME_N = "tilt from H(0); azimuth about it, from the side to which the spin axis leans at t = 0"
"""What the two angles of a direction are without an attitude in the file."""


def angle_names(body: Spacecraft) -> tuple[str, str]:
    """What the two angles of a direction are called: along and above the equator, or from H(0) and about it."""
    return ("tilt", "azimuth") if body.attitude is None else ("right ascension", "declination")


def angle_texts(body: Spacecraft, direction: Vector) -> tuple[str, str]:
    """The two angles of an inertial direction (3,), in the order of `angle_names`."""
    around, other = body.angles_of(direction)
    return (pointing(other), longitude(around)) if body.attitude is None else (longitude(around), pointing(other))


def direction_text(body: Spacecraft, direction: Vector) -> str:
    """An inertial direction (3,) by name and number of its angles."""
    names, texts = angle_names(body), angle_texts(body, direction)
    return ", ".join(f"{name} {text}" for name, text in zip(names, texts, strict=True))


def spin_text(spin: float) -> str:
    """A spin rate given in rad/s, in rpm too."""
    return f"{spin * 30 / math.pi:.4g} rpm ({quantity(spin, 'rad/s')})"


def end_table(flown: Flight) -> Table:
    """Spin axis and angular momentum after the last pulse, beside the target, and what the body does from then on."""
    body, final = flown.spacecraft, flown.final
    table = facts()
    table.add_row("spin axis ends at", direction_text(body, final.axis))
    table.add_row("H ends at", direction_text(body, final.momentum))
    if body.goal.axis is not None:
        table.add_row("target", direction_text(body, body.goal.axis))
    table.add_row("after that", f"spin {spin_text(final.spin)}, nutation {degrees(final.nutation)}")
    lasting = [*["dissipation"] * (body.growth != 0.0), *["disturbances"] * bool(body.disturbances)]
    if lasting:
        end = moment(flown.schedule.end)
        table.add_row("", f"as the last pulse ends, at {end}; changed further by {' and '.join(lasting)}")
    add_aspects(table, aspects(flown))
    if body.attitude is None:
        table.add_row("", FRAME_N)
    elif body.attitude.frame is not None:
        table.add_row("frame", body.attitude.frame)
    return table


def add_aspects(table: Table, found: Iterable[Aspect]) -> None:
    """How near the spin axis comes to each direction that is watched, and what it is to keep; ✗ where it does not."""
    for one in found:
        keep = one.keep
        least = f"at least {degrees(keep.least)}" if keep.least > 0.0 else ""
        most = f"at most {degrees(keep.most)}" if keep.most < math.pi else ""
        bounds = " and ".join(filter(None, (least, most)))
        mark = "" if one.kept else "✗ "
        near, far = (f"{degrees(angle)} at {moment(at)}" for angle, at in (one[1:3], one[3:5]))
        table.add_row(f"axis from {keep.name}", f"{mark}{near} to {far}" + (f" ({bounds})" if bounds else ""))
