"""Directions in words, and the motion at the end of a flight."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from nutdamp.errors import listed
from nutdamp.flight.end_state import Aspect
from nutdamp.flight.propagation import Flight
from nutdamp.physics import attitude
from nutdamp.spacecraft.model import Keep, Spacecraft, Vector
from nutdamp.views import verdicts
from nutdamp.views.layout import WIDTH, facts
from nutdamp.views.pulses import block_table
from nutdamp.views.text import RPM, degrees, longitude, mass, moment, most, pointing, quantity, short_angle

FRAME_N = "tilt from H(0); azimuth about it, from the side to which the spin axis leans at t = 0"
"""Frame of the two angles of a direction without an attitude in the file."""


def title(body: Spacecraft) -> list[Text]:
    """Name of a spacecraft and its motion at t = 0, on one line where they fit."""
    what = f"{body.inertia.shape}, {body.spin * RPM:.4g} rpm, nutation {short_angle(body.widest.nutation)} deg"
    name = Text(body.name, style="bold")
    fits = len(body.name) + len(what) + 3 <= WIDTH
    return [Text.assemble(name, f"   {what}")] if fits else [name, Text(what)]


def angle_names(body: Spacecraft) -> tuple[str, str]:
    """Names of the two angles of a direction: along and above the equator, or from H(0) and about it."""
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
    return f"{spin * RPM:.6g} rpm ({quantity(spin, 'rad/s')})"


def end_table(flown: Flight, watched: Iterable[Aspect]) -> Table:
    """Spin axis and angular momentum after the last pulse, beside the target, and the motion from then on.

    ``watched``: least distances of the axis from directions in space.
    """
    body, final = flown.spacecraft, flown.final
    table = facts()
    table.add_row("spin axis ends at", direction_text(body, final.axis))
    table.add_row("H ends at", direction_text(body, final.momentum))
    if body.goal.axis is not None:
        off = degrees(flown.residual.axis_error)
        table.add_row("target", f"{direction_text(body, body.goal.axis)}; H ends {off} off")
    table.add_row("after that", f"spin {spin_text(final.spin)}, nutation {degrees(final.nutation)}")
    if lasting(flown):
        table.add_row("", lasting(flown))
    add_aspects(table, watched)
    if body.attitude is None:
        table.add_row("", FRAME_N)
    elif body.attitude.frame is not None:
        table.add_row("frame", body.attitude.frame)
    return table


def lasting(flown: Flight) -> str:
    """Time of the end shown where the motion does not last, and the cause of its change; empty where it lasts."""
    body = flown.spacecraft
    causes = [*["dissipation"] * (body.growth != 0.0), *["disturbances"] * bool(body.disturbances)]
    end = "as the last pulse ends, at " + moment(flown.schedule.end)
    end = end if flown.until is None else f"at {moment(flown.until)}"
    return f"{end}; changed further by {' and '.join(causes)}" if causes else ""


def add_aspects(table: Table, aspects: Iterable[Aspect]) -> None:
    """Least angle of the spin axis from each direction that is watched, and its limit; ✗ where it is broken."""
    for aspect in aspects:
        keep = aspect.keep
        mark, bounds = "" if aspect.kept else "✗ ", bounds_text(keep)
        near, far = (f"{degrees(angle)} at {moment(at)}" for angle, at in (aspect[1:3], aspect[3:5]))
        moves = aspect.largest_at > 0.0 or aspect.least_at > 0.0
        seen = f"{near} to {far}" if moves else f"{degrees(aspect.least)} at t = 0"
        table.add_row(f"axis from {keep.name}", f"{mark}{seen}" + (f" ({bounds})" if bounds else ""))


def bounds_text(keep: Keep) -> str:
    """Limits of the spin axis to a direction; empty where it is only watched."""
    least = f"at least {most(keep.least)}" if keep.least > 0.0 else ""
    largest = f"at most {most(keep.most)}" if keep.most < math.pi else ""
    return " and ".join(filter(None, (least, largest)))


def requested(body: Spacecraft) -> str:
    """The requirement and the cones to keep, on one line; empty where there are none."""
    cones = [f"axis {bounds_text(keep)} from {keep.name}" for keep in body.keep]
    return listed([*filter(None, [verdicts.required(body)]), *cones])


def cone_margins(aspect: Aspect) -> Iterator[tuple[str, float, float]]:
    """Each bound of a cone, the angle that comes nearest to it, and its margin, rad."""
    keep = aspect.keep
    if keep.least > 0.0:
        yield f"≥ {most(keep.least)}", aspect.least, aspect.least - keep.least
    if keep.most < math.pi:
        yield f"≤ {most(keep.most)}", aspect.largest, keep.most - aspect.largest


def blocks_screen(flown: Flight, velocity: Vector | None) -> RenderableType:
    """The blocks of a flown schedule, its figures before and after, and its ``velocity`` change (3,) m/s."""
    table = block_table(flown)
    return Group(Text(table.title, style="bold"), table.screen("screen"), Text(), _effects(flown, velocity))


def _effects(flown: Flight, velocity: Vector | None) -> Table:
    body, schedule, final = flown.spacecraft, flown.schedule, flown.final
    before, after = flown.around_pulses()
    table = facts()
    for name, pulse in (("first pulse", schedule.pulses[0]), ("last pulse", schedule.pulses[-1])):
        start = pulse.loaded[0]
        dated = body.utc(start, 3)
        table.add_row(name, f"starts at {moment(start)}" + (f", {dated}" if dated else ""))
    for name, before_, after_ in zip(
        angle_names(body), angle_texts(body, body.momentum), angle_texts(body, final.momentum), strict=True
    ):
        table.add_row(f"H: {name}", f"{before_} to {after_}")
    table.add_row("Sun angle of H", f"{_sun_angle(body, body.momentum)} to {_sun_angle(body, final.momentum)}")
    table.add_row("spin", f"{spin_text(body.spin)} to {spin_text(final.spin)}")
    largest = float(max(before.nutation.max(), after.nutation.max()))
    table.add_row("nutation", f"{degrees(body.nutation)} to {degrees(final.nutation)}; largest {degrees(largest)}")
    used = schedule.propellant
    tank = body.tank
    left = "" if used is None or tank is None else f" of {mass(tank.propellant)}; {mass(tank.propellant - used)} left"
    weighs = "" if used is None or body.mass is None else f"; mass {body.mass:.6g} kg to {body.mass - used:.6g} kg"
    table.add_row("propellant", f"{mass(used)}{left}{weighs}")
    if velocity is not None:
        table.add_row("|ΔV|", quantity(float(np.linalg.norm(velocity)), "m/s"))
    return table


def _sun_angle(body: Spacecraft, direction: Vector) -> str:
    assert body.sun is not None
    return degrees(float(attitude.angle_between(direction, body.sun)))
