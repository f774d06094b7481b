"""The workbench of the moving view: what its script needs to change a schedule and fly it by impulses, (17).

The script computes the motion of `propagation.by_impulses` for a symmetric body between ideal coasts; where the flight
has more in it, `absence` gives the reason, and the page has no workbench.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from nutdamp.figures import geometry
from nutdamp.flight.propagation import Flight, Track
from nutdamp.page.scales import EDGES
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.constraints import channel_of
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.requirements import Part
from nutdamp.spacecraft.schedule import Pulse, Schedule
from nutdamp.views.pulses import channel_text
from nutdamp.views.text import most, quantity

RATIO, THRUST = 1.0, 5.0
"""Largest change of C/A and of the thrust by the sliders, per cent."""

Room = tuple[Vector, float]
"""Middle (2,) and half the side of a square panel."""


class Workbench(NamedTuple):
    """Fixed parts of the workbench: quantities at the end, and the pulses by number and channel.

    ``rows``: name of each quantity for the script and for people, and its bound in words.
    """

    rows: tuple[tuple[str, str, str], ...]
    pulses: tuple[str, ...]
    ratio: float = RATIO
    thrust: float = THRUST


def absence(body: Spacecraft, schedule: Schedule) -> str:
    """Reason for which there is no workbench, a few words; empty where there is one."""
    kinds = (
        (not len(schedule), "no pulses"),
        (not body.inertia.symmetric, "I1 ≠ I2"),
        (body.inertia.wheel != 0.0, "a wheel"),
        (body.growth != 0.0, "energy dissipation"),
        (bool(body.disturbances), "disturbance torques"),
        (bool(body.thrust_laws) or schedule.shaped, ", ".join(body.thrust_laws) or "shaped pulses"),
    )
    return next((reason for holds, reason in kinds if holds), "")


def workbench_of(flown: Flight) -> Workbench:
    """The workbench of a flight; there must be one by `absence`."""
    body = flown.spacecraft
    limits = {bound.part: bound for bound in requirements.required(body)}
    names = [(Part.NUTATION, "nutation"), (Part.SHIFT, "momentum shift")]
    if body.goal.axis is not None:
        names.append((Part.DISTANCE, "axis error"))
    rows = [(part.value, name, _bound(limits[part].most) if part in limits else "") for part, name in names]
    if Part.SPIN in limits:
        rows.append(("spin", "spin error", f"≤ {quantity(limits[Part.SPIN].most, 'rad/s')}"))
    pulses = (f"{number}: {channel_text(pulse, body)}" for number, pulse in enumerate(flown.schedule, start=1))
    return Workbench(tuple(rows), tuple(pulses))


def _bound(angle: float) -> str:
    """An upper bound given in rad, with the sign of degrees."""
    return f"≤ {most(angle).removesuffix(' deg')}°"


def workbench_data(flown: Flight, track: Track, pole: Room, sky: Room, until: float) -> dict[str, Any]:
    """Data of the script, SI and rad in principal axes: body, pulses, limits, and the scales of the panels.

    ``pole`` and ``sky`` are the rooms of the panels, deg/s and deg; ``track`` is shown to ``until`` s.
    """
    body, limits, start = flown.spacecraft, flown.spacecraft.limits, flown.spacecraft.initial
    target, channels = body.goal.axis, geometry.channels_fired(flown)
    return {
        "body": {
            "A": body.inertia.A,
            "C": body.inertia.C,
            "sense": math.copysign(1.0, body.spin),
            "target": None if target is None else target.tolist(),
        },
        "start": {"omega": body.omega0[:2].tolist(), "spin": start.spin, "turn": start.quaternion.tolist()},
        "framed": body.attitude is not None,
        "axes": None if body.inertia.aligned else body.inertia.axes.tolist(),
        "pulses": [_pulse(body, pulse, channels.index(pulse.channel)) for pulse in flown.schedule],
        "limits": {
            "earliest": limits.earliest,
            "horizon": body.horizon,
            "gap": limits.gap,
            "tick": None if flown.schedule.blocks else limits.tick,
            "blackout": limits.blackout,
            "most": limits.max_pulses,
        },
        "required": {bound.part.value: bound.most for bound in requirements.required(body)},
        "spin": body.goal.spin,
        "frame": EDGES,
        "plane": geometry.sky_plane(flown, track.momentum[0]).tolist(),
        "pole": _room(pole),
        "sky": _room(sky),
        "step": _step(until),
    }


def _pulse(body: Spacecraft, pulse: Pulse, row: int) -> dict[str, Any]:
    channel = channel_of(body, pulse)
    longest = math.inf if channel is None else channel.max_on_time
    return {
        "t": pulse.t,
        "on": pulse.on_time,
        "channel": pulse.channel,
        "row": row,
        "text": channel_text(pulse, body),
        "impulse": pulse.impulse.tolist(),
        "torque": None if pulse.torque is None else pulse.torque.tolist(),
        "least": 0.0 if channel is None else channel.min_on_time,
        "most": None if math.isinf(longest) else longest,
    }


def _room(room: Room) -> list[float]:
    middle, half = room
    return [*np.asarray(middle, dtype=float).tolist(), half]


def _step(until: float) -> float:
    """Steps of times changed by hand, s: the decade of a two-thousandth of the time shown."""
    return float(10.0 ** math.floor(math.log10(until / 2000.0)))
