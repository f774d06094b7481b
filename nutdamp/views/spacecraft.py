"""The spacecraft in words: name, derived quantities at t = 0, requirement, and directions as angles."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np
from rich.table import Table
from rich.text import Text

from nutdamp.errors import listed
from nutdamp.flight.end_state import Aspect, at_start
from nutdamp.planning.plan import NO_NUTATION
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.model import Keep, Spacecraft, Vector
from nutdamp.spacecraft.requirements import Part
from nutdamp.units import screen_unit
from nutdamp.views.tables import WIDTH, facts
from nutdamp.views.text import RPM, degrees, duration, longitude, moment, most, pointing, quantity, short_angle

FRAME_N = "tilt from H(0); azimuth about it, from the initial tilt direction"
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


def aspect_facts(aspects: Iterable[Aspect]) -> Iterator[tuple[str, str]]:
    """Least angle of the spin axis from each direction that is watched, and its limit; ✗ where it is broken."""
    for aspect in aspects:
        keep = aspect.keep
        mark, bounds = "" if aspect.kept else "✗ ", bounds_text(keep)
        near, far = (f"{degrees(angle)} at {moment(at)}" for angle, at in (aspect[1:3], aspect[3:5]))
        moves = aspect.largest_at > 0.0 or aspect.least_at > 0.0
        seen = f"{near} to {far}" if moves else f"{degrees(aspect.least)} at t = 0"
        yield f"axis from {keep.name}", f"{mark}{seen}" + (f" ({bounds})" if bounds else "")


def bounds_text(keep: Keep) -> str:
    """Limits of the spin axis to a direction; empty where it is only watched."""
    least = f"at least {most(keep.least)}" if keep.least > 0.0 else ""
    largest = f"at most {most(keep.most)}" if keep.most < math.pi else ""
    return " and ".join(filter(None, (least, largest)))


def requested(body: Spacecraft) -> str:
    """The requirement and the cones to keep, on one line; empty where there are none."""
    cones = [f"axis {bounds_text(keep)} from {keep.name}" for keep in body.keep]
    return listed([*filter(None, [required(body)]), *cones])


def cone_margins(aspect: Aspect) -> Iterator[tuple[str, float, float]]:
    """Each bound of a cone, the angle that comes nearest to it, and its margin, rad."""
    keep = aspect.keep
    if keep.least > 0.0:
        yield f"≥ {most(keep.least)}", aspect.least, aspect.least - keep.least
    if keep.most < math.pi:
        yield f"≤ {most(keep.most)}", aspect.largest, keep.most - aspect.largest


def required(spacecraft: Spacecraft) -> str:
    """The requirement, on one line; empty where there is none."""
    texts = []
    for bound in requirements.required(spacecraft):
        if bound.part is Part.SPIN:
            tolerance, spin = 100.0 * requirements.SPIN_TOLERANCE, (spacecraft.goal.spin or 0.0) * RPM
            texts.append(f"spin within {tolerance:g} % of {spin:.5g} rpm")
        else:
            texts.append(f"{bound.part.label} within {most(bound.most)}")
    return listed(texts)


def beyond_floors(spacecraft: Spacecraft) -> str:
    """Actions that break the floors A|ω0| and C|ω3|β, in words; empty where they hold."""
    causes = [
        *["I1 ≠ I2"] * (not spacecraft.inertia.symmetric),
        *["dissipation"] * (spacecraft.growth != 0.0),
        *["disturbances"] * bool(spacecraft.disturbances),
    ]
    return " and ".join(causes)


def turn_floor(spacecraft: Spacecraft) -> str:
    """Symbol of the least impulse that turns H to its target."""
    return "|H3|β" if spacecraft.inertia.wheel else "C|ω3|β"


def turning(spacecraft: Spacecraft) -> float:
    """C |ω3| β in N m s, |H3| β with a wheel; 0 where H points at the target already, but for rounding."""
    return 0.0 if spacecraft.to_turn < NO_NUTATION else spacecraft.turning_impulse


def derived_table(spacecraft: Spacecraft, more: Iterable[tuple[str, str]] = ()) -> Table:
    """Derived quantities of the spacecraft at t = 0, and ``more`` of them (name, value)."""
    return facts([*_derived(spacecraft), *aspect_facts(at_start(spacecraft)), *more])


def _derived(spacecraft: Spacecraft) -> Iterator[tuple[str, str]]:
    inertia = spacecraft.inertia
    motion = spacecraft.widest
    moments = f"A = {quantity(inertia.A, 'kg m²', 6)}, C = {quantity(inertia.C, 'kg m²', 6)}"
    yield "inertia", f"{moments}: {inertia.shape}, a = {inertia.a:.4g}"
    if not inertia.symmetric:
        unit, factor = screen_unit("kg m²")
        first, second, _ = factor * np.asarray(inertia.moments)
        yield "", f"I1 = {first:.6g}, I2 = {second:.6g} {unit}; planned on the equivalent symmetric body"
    if inertia.wheel:
        whole = f"H3 = C ω3 + h = {quantity(spacecraft.axial, 'N m s')}"
        yield "wheel", f"h = {quantity(inertia.wheel, 'N m s')} along axis 3: {whole}"
    yield "spin", spin_text(spacecraft.spin) + ": the spin axis is body axis -3" * (spacecraft.sense < 0.0)
    now = "" if inertia.symmetric else f"{degrees(spacecraft.tilt)} at t = 0, at most "
    cones = f"body cone {degrees(motion.body)} + space cone {degrees(motion.space)}"
    yield "nutation", f"{now}{degrees(motion.nutation)} = {cones}"
    still = math.isinf(spacecraft.body_period)
    in_body = "none in the body, where ω does not turn" if still else f"{duration(spacecraft.body_period)} in the body"
    yield "nutation period", f"{in_body}, {duration(spacecraft.inertial_period)} inertially"
    if spacecraft.dissipation is not None:
        yield "dissipation", _dissipation(spacecraft, spacecraft.dissipation)
    beyond = beyond_floors(spacecraft)
    floor = f"no least impulse with {beyond}" if beyond else "lower bound"
    name = "impulse" if beyond else "least impulse"
    yield name, f"A|ω0| = {quantity(spacecraft.least_impulse, 'N m s')}; {floor}"
    if spacecraft.goal.axis is not None:
        turn = quantity(turning(spacecraft), "N m s")
        least = "" if beyond else ", the least to turn H"
        yield "target", direction_text(spacecraft, spacecraft.goal.axis)
        yield "", f"β = {degrees(spacecraft.to_turn)} from H; {turn_floor(spacecraft)} = {turn}{least}"
    if spacecraft.goal.spin is not None:
        yield "final spin", spin_text(spacecraft.goal.spin)
    actuators, torquer = [], spacecraft.torquer
    if torquer is not None:
        strength = "an ideal impulse" if torquer.torque is None else quantity(torquer.torque, "N m")
        assumed = " (assumed: the file names no actuator)" if spacecraft.steerable is None else ""
        actuators.append(f"steerable torquer, {strength}{assumed}")
    if spacecraft.channels:
        actuators.append("channels " + " ".join(channel.name for channel in spacecraft.channels))
    yield "actuators", "; ".join(actuators)
    if text := required(spacecraft):
        yield "requirement", text
    if any(bound.part is Part.DISTANCE for bound in requirements.required(spacecraft)):
        yield "", "momentum_shift bounds the axis error: the angle of H from the target"


def _dissipation(spacecraft: Spacecraft, time_constant: float) -> str:
    """Effect of energy dissipation on the nutation, and a note where it is too fast for its model."""
    if spacecraft.growth == 0.0:
        return "none: a sphere has no energy to lose"
    what = "grows" if spacecraft.growth > 0.0 else "decays"
    slow = time_constant >= spacecraft.inertial_period
    rough = "" if slow else "; less than one inertial period: results are rough"
    return f"the nutation {what} e-fold in {duration(time_constant)}{rough}"
