"""The spacecraft on the page: mass properties, actuators, initial motion, directions before and after a plan."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from nutdamp.flight.propagation import Flight
from nutdamp.page.document import Block, FactList, Prose, Sheet, facts_of, sheet_of
from nutdamp.physics import attitude
from nutdamp.planning import capability
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.equipment import Thruster
from nutdamp.spacecraft.model import Spacecraft, Vector, required_share
from nutdamp.views.check import (
    channel_table,
    cold_text,
    disturbance_table,
    sun_pulse_facts,
    tank_table,
    valve_table,
)
from nutdamp.views.end_tables import FRAME_N, angle_names, angle_texts
from nutdamp.views.plan_tables import derived_table
from nutdamp.views.tables import Heading
from nutdamp.views.text import MISSING, RPM, degrees, digits, duration, mass, moment, quantity, sentence, vector
from nutdamp.views.verdicts import exact_percent


def spacecraft_blocks(body: Spacecraft) -> Iterator[Block]:
    """Spacecraft data, actuators, disturbances."""
    yield spacecraft_facts(body)
    if body.channels:
        yield thruster_sheet(body)
        steps = "Channels, and the nutation that their shortest and longest pulse takes"
        yield sheet_of(steps, channel_table(body).screen("screen"))
    if capability.acting(body):
        yield sheet_of(
            "Valves: what the shortest and the longest command of each channel give", valve_table(body).screen("screen")
        )
    if body.cold is not None:
        yield Prose(sentence(cold_text(body)))
    if body.tank is not None:
        yield sheet_of("Tank", tank_table(body.tank).screen("screen"))
    if body.disturbances:
        yield sheet_of("Disturbances, and what each does alone", disturbance_table(body).screen("screen"))


def spacecraft_facts(
    spacecraft: Spacecraft, title: str = "At t = 0, what is required of the end, and the limits of a plan"
) -> FactList:
    """The spacecraft at t = 0, its requirement, and the limits of its plans."""
    return facts_of(
        title, derived_table(spacecraft, (*_body(spacecraft), *_limits(spacecraft), *sun_pulse_facts(spacecraft)))
    )


def _body(body: Spacecraft) -> Iterator[tuple[str, str]]:
    yield "mass", "not in the file" if body.mass is None else mass(body.mass)
    if not body.inertia.aligned:
        rows = "; ".join(vector(row) for row in body.inertia.tensor)
        yield "inertia tensor", f"{rows} kg m², in the axes of the file"
    steerable = body.steerable
    if steerable is not None:
        isp, arm = quantity(steerable.isp, "s"), quantity(steerable.lever_arm, "m")
        strength = "ideal impulses" if steerable.torque is None else quantity(steerable.torque, "N m")
        yield "steerable", f"{strength}, isp {isp}, lever arm {arm}"
    if body.attitude is not None:
        yield "epoch", _epoch(body.attitude.epoch, body.utc(0.0))
        yield "frame", body.attitude.frame or MISSING
    else:
        yield "epoch, frame", f"none in the file; {FRAME_N}"


def _epoch(given: str | None, utc: str | None) -> str:
    """The epoch as the file gives it, and in UTC, in which the tables are, where that is written otherwise."""
    if given is None:
        return MISSING
    return given if utc is None or given.endswith("Z") else f"{given} = {utc}"


def _limits(spacecraft: Spacecraft) -> Iterator[tuple[str, str]]:
    limits, required = spacecraft.limits, spacecraft.requirement
    if spacecraft.dispersions is not None and requirements.judged(spacecraft):
        given = required is not None and required.probability is not None
        default = "" if given else " (the default: the file has no requirement.probability)"
        yield "dispersed cases", f"{exact_percent(required_share(required))} must comply{default}"
    default = " (the default)" * (limits.horizon is None)
    yield "horizon", f"{duration(spacecraft.horizon)}{default}"
    kept = []
    if limits.earliest > 0.0:
        kept.append(f"nothing before {duration(limits.earliest)}")
    if limits.gap > 0.0:
        kept.append(f"{duration(limits.gap)} between pulses")
    if limits.tick is not None:
        kept.append(f"commands in steps of {duration(limits.tick)}")
    if limits.max_pulses is not None:
        kept.append(f"at most {limits.max_pulses} pulses")
    kept += [f"no pulse from {moment(begin)} to {moment(end)}" for begin, end in limits.blackout]
    if kept:
        yield "limits", "; ".join(kept)


def thruster_sheet(body: Spacecraft) -> Sheet:
    """One row a thruster that can fire: its place, force, torque, specific impulse and on-times."""
    thrusters = {thruster.name: thruster for channel in body.channels for thruster in channel.thrusters}
    names = ("position", "m"), ("force", "N"), ("torque", "N m")
    columns = [Heading("thruster", number=False), *(Heading(name, unit, number=False) for name, unit in names)]
    columns += [Heading("isp", "s"), Heading("on-time", number=False), Heading("channels", number=False)]
    rows = tuple((*_thruster(thruster, body), _channels(thruster, body)) for thruster in thrusters.values())
    return Sheet("Thrusters of the channels, in the axes of the file", tuple(columns), rows)


def _thruster(thruster: Thruster, body: Spacecraft) -> tuple[str, ...]:
    at, force, torque = (_vector(part, body) for part in (thruster.position, thruster.force, thruster.torque))
    if thruster.force is None and thruster.thrust is not None:
        force = f"{thruster.thrust:.4g}"
    isp = MISSING if thruster.isp is None else f"{thruster.isp:.4g}"
    longest = "any" if math.isinf(thruster.max_on_time) else duration(thruster.max_on_time)
    return (thruster.name, at, force, torque, isp, f"{duration(thruster.min_on_time)} to {longest}")


def _vector(principal: Vector | None, body: Spacecraft) -> str:
    return MISSING if principal is None else vector(body.inertia.in_file(principal))


def _channels(thruster: Thruster, body: Spacecraft) -> str:
    fired = {channel.name: {member.name for member in channel.thrusters} for channel in body.channels}
    return ", ".join(name for name, members in fired.items() if thruster.name in members)


def ends_sheet(flown: Flight) -> Sheet:
    """Spin axis, H, spin and nutation at t = 0 and after the last pulse, beside the target."""
    body, final = flown.spacecraft, flown.final
    target = body.goal.axis
    start, state = body.momentum, flown.settled
    end = np.asarray(state.rates * np.asarray(body.inertia.moments))
    size = float(np.linalg.norm(start))
    directions = ("spin axis", body.axis, final.axis), ("H", start / size, final.momentum)
    rows: list[tuple[str, ...]] = []
    for what, before, after in directions:
        for which, name in enumerate(angle_names(body)):
            ways = (before, after, target)
            cells = (MISSING if way is None else angle_texts(body, way)[which] for way in ways)
            rows.append((f"{what}: {name}", *cells))
    sizes = (f"{digits(value, 4)} N m s" for value in (size, float(np.linalg.norm(end))))
    rows.append(("|H|", *sizes, MISSING))
    spins = body.spin, final.spin, body.goal.spin
    rows.append(("spin", *(MISSING if spin is None else f"{digits(spin * RPM, 6)} rpm" for spin in spins)))
    largest = body.nutation, final.nutation
    if body.inertia.symmetric:
        rows.append(("nutation", *map(degrees, largest), MISSING))
    else:
        now = body.tilt, float(attitude.angle_between(final.axis, final.momentum))
        rows.append(("nutation at that time", *map(degrees, now), MISSING))
        rows.append(("largest nutation from then on, without pulses", *map(degrees, largest), MISSING))
    heads: tuple[Heading, ...] = (Heading("quantity", number=False), Heading("t = 0"), Heading("after the last pulse"))
    if target is None and body.goal.spin is None:
        rows = [row[:-1] for row in rows]
    else:
        heads = (*heads, Heading("target"))
    return Sheet("Where it points", heads, tuple(rows), sortable=False, stacked=True)


def ends_note(flown: Flight) -> Prose:
    """Note on the frame of the directions."""
    given = flown.spacecraft.attitude
    if given is None:
        return Prose(f"Directions: {FRAME_N}.")
    return Prose(f"Directions: right ascension and declination in {given.frame or 'the frame of the file'}.")
