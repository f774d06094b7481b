"""The view of the motion that the script of a page moves: its rows as whole numbers, scales,
workbench.

The script reads rows and draws them: each number that it shows is one row of the track, rounded
here. Only where the schedule is changed in the workbench it computes rows of its own, the motion of
`propagation.flown` for a rigid body and pulses of constant thrust; where the flight has more in it,
`absence` gives the reason, and there is no workbench.
"""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from nutdamp.figures import geometry, style
from nutdamp.figures.overview import NO_OUTLINES
from nutdamp.flight import propagation
from nutdamp.flight.propagation import Flight, Track
from nutdamp.page.document import Moving
from nutdamp.physics import attitude
from nutdamp.planning.plan import Plan
from nutdamp.schemes.catalogue import SCHEMES
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.constraints import channel_of
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.requirements import Part
from nutdamp.spacecraft.schedule import Schedule
from nutdamp.views.parts import channel_text, direction_columns
from nutdamp.views.text import MISSING, limit_text, quantity

# even rows in the quickest nutation turn; least and largest number of them altogether
ROWS_A_TURN, LEAST_ROWS, MOST_ROWS = 24, 600, 2400

# rows in a turn below which a line from row to row is no picture of the path, and dots are drawn
COARSE = 12
STEEP = 25.0  # turns of the nutation from which lines are thin
SPHERE = 10_000  # length of a unit vector of the globe as whole numbers: 0.006 deg
ANGLE_DIGITS = 4  # decimals of degrees; more where the largest nutation has not so many figures
# largest distance of a target from H(0) in the panel of the axis track, as a multiple of the track
FAR = 4.0
# largest angle of the cones over the nutation that its scale has room for: of a despun body with a
# wheel they measure 90 deg
APART = 10.0
END = 0.03  # radius of the mark of the end of the spin axis over half the side of that panel
NONE = -(10**8)  # entry of a row for an angle that does not exist
# frame of a square panel in units of its SVG, which is 2000 wide and high: left, top, right, bottom
EDGES = (350, 150, 1960, 1760)
# seconds that playing takes at the quickest, at first, and at the slowest
QUICK, UNHURRIED, SLOW = 4.0, 15.0, 120.0


def named_directions(spacecraft: Spacecraft) -> list[dict[str, Any]]:
    """Directions of the globe besides the track: the target, the Sun, the cones that the spin axis
    keeps; each with its circles, by their radius in rad. The angle of the axis to those ``watched``
    is shown.
    """
    directions = []
    if spacecraft.goal.axis is not None:
        ends = [each for each in requirements.required(spacecraft) if each.part is Part.DISTANCE]
        circles = [(f"H at most {limit_text(each.limit)} from target", each.limit, "target")
                   for each in ends]  # fmt: skip
        directions.append(("target", spacecraft.goal.axis, "target", circles))
    for keep in spacecraft.watched:
        if keep.direction is not None:
            bounds = (("least", keep.least, "keep-out"), ("most", keep.most, "keep-in"))
            circles = [
                (f"axis at {word} {limit_text(size)} from {keep.name}", size, kind)
                for word, size, kind in bounds
                if 0.0 < size < math.pi
            ]
            directions.append((keep.name, keep.direction, "watched", circles))
    return [
        {
            "name": name,
            "kind": kind,
            "watched": kind == "watched",
            "axis": [round(part, 6) for part in axis.tolist()],
            "circles": [
                {"name": circle, "radius": radius, "kind": look} for circle, radius, look in circles
            ],
        }
        for name, axis, kind, circles in directions
    ]


def moving_of(
    plan: Plan, craft: str = "SPACECRAFT", outlines: Mapping[str, Vector] = NO_OUTLINES
) -> Moving:
    """The view of a plan flown through the real pulse widths; ``craft``: words of a command for the
    spacecraft. ``outlines``: where H may end and ends in cases, degrees on the axis track.
    """
    spacecraft = plan.spacecraft
    named = named_directions(spacecraft)
    # To the millisecond, so that the same rows can be had from ``simulate`` by a short number.
    until = math.ceil(1e3 * geometry.shown_until(spacecraft, plan.pulses)) / 1e3
    flown = propagation.flown(spacecraft, plan.pulses, until)
    turns = until / geometry.quickest(flown)
    samples = min(max(math.ceil(ROWS_A_TURN * turns), LEAST_ROWS), MOST_ROWS) + 1
    track = flown.sampled(samples, until)
    pole = np.degrees(track.rates[:, :2])
    sky, momentum, target = geometry.sky_paths(flown, track)
    # Only if the globe names it and it leaves room for the paths.
    reach = FAR * float(np.hypot(*np.vstack([sky, momentum]).T).max())
    if not (named and np.all(np.hypot(*target.T) <= reach)):
        target = np.empty((0, 2))
    pole_room = style.room(pole, 0.1, centre=True)
    sky_room = style.room(np.vstack([sky, momentum, target]), 0.1)
    end = sky[-1] + END * sky_room[1] * geometry.circle()
    lines = [(kind, placed(line, *sky_room)) for kind, line in {**outlines, "end": end}.items()]
    x, y, _ = geometry.sky_names(flown)
    rates = f"ω1, deg/s{geometry.pole_note(flown)}", "ω2, deg/s"
    strip, span = strip_of(flown, track, until)
    # Whole numbers of the last decimal: four figures of the largest nutation.
    largest = math.degrees(float(track.nutation.max()))
    cone = ANGLE_DIGITS
    if largest >= style.LEAST:
        cone = max(ANGLE_DIGITS, 3 - math.floor(math.log10(largest)))
    clock = max(3, math.ceil(-math.log10(until / (len(track.t) - 1))) + 1)
    # The angles of the spin axis, as every table shows them.
    pointing = [
        [
            NONE if text == MISSING else round(float(text) * 10**ANGLE_DIGITS)
            for text in map(angle.shown, track.axis)
        ]
        for angle in direction_columns(spacecraft)
    ]
    names = [
        f"{number}: {channel_text(pulse, spacecraft)}"
        for number, pulse in enumerate(flown.schedule, 1)
    ]
    spans = [*zip(names, flown.spans, strict=True)]
    said = [
        " and ".join(name for name, (begins, ends) in spans if begins <= time <= ends) or "none"
        for time in track.t.tolist()
    ]
    texts = [*dict.fromkeys(["none", *said])]  # whose number stands in each row
    columns = {
        **_numbered("pole", placed(pole, *pole_room)),
        **_numbered("sky", placed(sky, *sky_room)),
        **_numbered("momentum", placed(momentum, *sky_room)),
        "t": _whole(track.t, clock),
        "theta": _whole(np.degrees(track.nutation), cone),
        "mu": _whole(np.degrees(track.body_cone), cone),
        "lambda": _whole(np.degrees(track.space_cone), cone),
        **_numbered("angle", pointing),
        "firing": [texts.index(text) for text in said],
    }
    if named:
        for name, ways in (("axis", track.axis), ("H", track.momentum)):
            unit = ways / np.linalg.norm(ways, axis=1, keepdims=True)
            columns |= _numbered(name, np.rint(SPHERE * unit.T).astype(int).tolist())
    watched = (
        np.degrees(attitude.angle_between(track.axis, np.array(each["axis"])))
        for each in named
        if each["watched"]
    )
    columns |= _numbered("aspect", [_whole(angles, ANGLE_DIGITS) for angles in watched])
    absent = absence(spacecraft, flown.schedule)
    bench = None if absent else workbench(flown, track, (pole_room, sky_room), until, craft)
    data: dict[str, Any] = {
        "digits": {"t": clock, "cone": cone, "angle": ANGLE_DIGITS},
        "until": until,
        "samples": samples,
        "lead": LEAD,
        "span": span,
        # The first number and the difference of each from the one before: short where little
        # changes.
        "columns": {name: np.diff(values, prepend=0).tolist() for name, values in columns.items()},
        "none": NONE,
        "firings": texts,
        "utc": _dates(spacecraft, track, clock),
        "target": [column[0] for column in placed(target, *sky_room) if column] or None,
        "named": named,
        "look": _look(track, named),
        "dots": turns * COARSE > samples,
        "bench": bench,
    }
    speeds, speed = _speeds(until)
    angles = [angle.heading for angle in direction_columns(spacecraft)]
    shown = {
        "scheme": plan.scheme,
        "panels": (
            panel("pole", "Pole curve: ω in the body", pole_room, rates),
            panel("sky", "Axis track, H towards you", sky_room, (x, y), lines),
        ),
        "strip": strip,
        "speeds": speeds,
        "speed": speed,
        "angles": angles,
        "named": named,
        "dated": data["utc"] is not None,
        "longitude": "azimuths" if spacecraft.attitude is None else f"{angles[0]}s",
        "steep": turns > STEEP,
        "how": propagation.model_name([flown.schedule]),
        "workbench": bench,
        "absent": absent,
        "command": _command(plan, craft, until, samples),
    }
    text = json.dumps(data, separators=(",", ":"), ensure_ascii=False).replace("<", "\\u003c")
    return Moving(shown, text)


def _command(plan: Plan, craft: str, until: float, samples: int) -> tuple[str, ...]:
    """Command that writes the rows of a plan; none where no scheme by its name and no file gives
    its pulses.
    """
    if plan._from_file:
        option = "--blocks" if plan.pulses.blocks else "--schedule"
        pulses = [f"{option} {shlex.quote(plan.scheme)}"]
    elif plan.scheme in SCHEMES and plan.spacecraft.goal.sun is None:
        pulses = [f"--scheme {plan.scheme}"]
        if plan.options.with_disturbances:
            pulses.append("--with-disturbances")
    else:
        return ()
    rows = ("--flown", f"--until {until:.12g}", f"--samples {samples}", "--csv FILE")
    return (f"nutdamp simulate {craft}".rstrip(), *pulses, *rows)


Room = tuple[Vector, float]  # middle (2,) and half the side of a square panel


def _numbered(name: str, columns: Sequence[list[int]]) -> dict[str, list[int]]:
    """Columns by a common name and their number, from 1."""
    return {f"{name}{number}": column for number, column in enumerate(columns, start=1)}


def _whole(values: Vector, digits: int) -> list[int]:
    """Numbers rounded to so many decimals, as whole numbers of the last one."""
    return [round(round(value, digits) * 10**digits) for value in values.tolist()]


def _dates(spacecraft: Spacecraft, track: Track, digits: int) -> dict[str, Any] | None:
    """UTC of each row: their common beginning, and the rest of each; None without an epoch."""
    every = (spacecraft.utc(time, digits) for time in track.t.tolist())
    dates = [date for date in every if date is not None]
    if len(dates) < len(track.t):
        return None
    # Dates are in order, so that the common beginning of the first and the last is that of all.
    pairs = enumerate(zip(dates[0], dates[-1], strict=False))
    common = next((place for place, (first, last) in pairs if first != last), len(dates[0]))
    return {"head": dates[0][:common], "tails": [date[common:] for date in dates]}


def _look(track: Track, named: Sequence[Mapping[str, Any]]) -> list[float]:
    """Longitude and latitude in degrees of the viewer of the globe: the track in front, seen a
    little from the side.
    """
    middle = track.momentum[0] / np.linalg.norm(track.momentum[0])
    if named and float(middle @ named[0]["axis"]) > -0.9:
        middle = middle + named[0]["axis"]
    longitude, latitude = attitude.sphere_angles(middle / np.linalg.norm(middle))
    turned = math.degrees(longitude or 0.0) - 20.0
    shown = math.degrees(latitude)
    return [round(turned, 1), round(shown - 25.0 if shown > 0.0 else shown + 25.0, 1)]


def _speeds(until: float) -> tuple[tuple[tuple[float, str], ...], float]:
    """Seconds of motion in a second of playing, as number and words; and the one to begin with."""
    decades = range(
        math.floor(math.log10(until / SLOW)) - 1, math.ceil(math.log10(until / QUICK)) + 1
    )
    every = [step * 10.0**decade for decade in decades for step in (1, 2, 5)]
    speeds = sorted({1.0, *(round(pace, 12) for pace in every if QUICK <= until / pace <= SLOW)})
    first = min(speeds, key=lambda pace: abs(math.log(until / pace / UNHURRIED)))
    return tuple((pace, "real time" if pace == 1.0 else f"× {pace:g}") for pace in speeds), first


# part of a scale at either end without a number: it would touch those of the other scale
EDGE = 0.03
LEAD = 0.012  # part of the axis of time before t = 0: motion at t = 0 is seen beside the cursor

# prefixes of units with their factors, and the largest number of a scale that needs another one
PREFIXES = (("", 1.0), ("m", 1e3), ("µ", 1e6), ("n", 1e9))
SHORT = 0.05


def placed(points: Vector, middle: Vector, half: float) -> list[list[int]]:
    """Two columns: the places of ``points`` (n, 2) in a panel."""
    left, top, right, bottom = EDGES
    part = (points - middle + half) / (2.0 * half)
    across = left + part[:, 0] * (right - left), bottom - part[:, 1] * (bottom - top)
    return [np.rint(column).astype(int).tolist() for column in across]


def panel(
    part: str,
    title: str,
    room: Room,
    names: tuple[str, str],
    outlines: Sequence[tuple[str, list[list[int]]]] = (),
) -> dict[str, Any]:
    """A panel with ``room``, whose ``part`` is its name for the script; the ``names`` of its axes
    have deg as their unit. ``outlines``: closed lines that stand still, by their kind.
    """
    middle, half = room
    # The prefix of the unit that keeps numbers short, and the factor by which they grow.
    prefix, factor = _prefix(half)
    inner = (1.0 - 2.0 * EDGE) * half
    scales = []
    for which, name in enumerate(names):
        at = float(middle[which])
        values = np.array(geometry.ticks(at - inner, at + inner, 5))
        places = placed(np.column_stack([values, values]), middle[[which, which]], half)[which]
        named = name.replace(", deg", f", {prefix}deg")
        scales.append(_scale(named, map(float, places), (factor * values).tolist()))
    x, y = scales
    return {
        "part": part,
        "title": title,
        "described": f"{title}; {x['name']} to the right, {y['name']} upwards",
        "x": x,
        "y": y,
        "zero": [column[0] for column in placed(np.zeros((1, 2)), middle, half)],
        "frame": EDGES,
        "outlines": [
            (kind, f"M{'L'.join(f'{one} {other}' for one, other in zip(*line, strict=True))}Z")
            for kind, line in outlines
        ],
    }


def _prefix(largest: float) -> tuple[str, float]:
    """The prefix of a unit that keeps numbers up to ``largest`` short, and the factor by which they
    grow.
    """
    return next(
        ((name, factor) for name, factor in PREFIXES if factor * largest >= SHORT), PREFIXES[-1]
    )


def _scale(name: str, places: Iterable[float], values: Iterable[float]) -> dict[str, Any]:
    """A scale with its ``name`` and marks: places with the numbers there."""
    texts = (f"{value:.6g}".replace("-", "−") for value in values)
    return {"name": name, "marks": list(zip(places, texts, strict=True))}


def strip_of(flown: Flight, track: Track, until: float) -> tuple[dict[str, Any], list[float]]:
    """Angles and firings over time, and the lowest and highest angle of the scale, deg.

    Marks are in per cent, all else in units of the SVG: ``required`` and ``zero``; row of the
    channel, left and width of the ``bars`` of firings; left and width of the times ``closed`` to
    them. ``cones``: the scale has room for their angles; ``outside``: a required nutation that lies
    beyond it.
    """
    spacecraft = flown.spacecraft
    cones = np.degrees(np.concatenate([track.body_cone, track.space_cone]))
    theta = np.degrees(track.nutation)
    apart = float(np.abs(cones).max()) > APART * max(float(theta.max()), style.LEAST)
    angles = np.concatenate([theta, [0.0]] if apart else [theta, cones, [0.0]])
    size = float(np.ptp(angles))
    margin = 0.06 * size if size > style.LEAST else 1.0
    low = float(angles.min()) - margin
    high = float(angles.max()) + margin
    width, height = 2000, 1000  # in units of the SVG

    def rise(angle: float) -> float:
        return round(height * (high - angle) / (high - low), 1)

    def across(time: float) -> float:
        return LEAD + (1.0 - LEAD) * time / until

    def spread(begins: float, ends: float) -> tuple[float, float]:
        return round(width * across(begins), 1), round(width * (across(ends) - across(begins)), 1)

    required = None if spacecraft.requirement is None else spacecraft.requirement.nutation
    level = math.inf if required is None else math.degrees(required)
    within = low < level < high
    channels = geometry.channels_fired(flown)
    prefix, factor = _prefix(high - low)
    edge = EDGE * (high - low)
    marked, times = geometry.ticks(low + edge, high - edge, 5), geometry.ticks(0.0, until, 6)
    strip = {
        "times": _scale("time, s", (100.0 * across(time) for time in times), times),
        "angles": _scale(
            f"{prefix}deg",
            (rise(angle) * 100.0 / height for angle in marked),
            (factor * angle for angle in marked),
        ),
        "zero": rise(0.0),
        "required": rise(level) if within else None,
        "cones": not apart,
        "outside": "" if required is None or within else limit_text(math.radians(level)),
        "channels": channels,
        "bars": [
            (channels.index(pulse.channel), *spread(*span))
            for pulse, span in zip(flown.schedule, flown.spans, strict=True)
        ],
        "closed": [spread(begins, ends) for begins, ends in geometry.closed(spacecraft, until)],
    }
    return strip, [low, high]


def absence(spacecraft: Spacecraft, schedule: Schedule) -> str:
    """Reason for which there is no workbench, a few words; empty where there is one."""
    kinds = (
        (not len(schedule), "no pulses"),
        (bool(schedule.blocks), "command blocks"),
        (spacecraft.inertia.wheel != 0.0, "a wheel"),
        (spacecraft.growth != 0.0, "energy dissipation"),
        (bool(spacecraft.disturbances), "disturbance torques"),
        (
            bool(spacecraft.thrust_laws) or schedule.shaped,
            ", ".join(spacecraft.thrust_laws) or "shaped pulses",
        ),
    )
    return next((reason for holds, reason in kinds if holds), "")


EDITED = "edited.csv"  # file that the command of the workbench flies


def workbench(
    flown: Flight, track: Track, rooms: tuple[Room, Room], until: float, craft: str
) -> dict[str, Any]:
    """The workbench of a flight, which must have one by `absence`; ``craft`` as in `moving_of`.

    Names of each quantity for the script and for people, with its bound in words, and the command
    that flies the pulses copied to a file. For the script body, pulses, limits and scales, SI and
    rad in principal axes: ``rooms`` are those of pole curve and axis track, deg/s and deg;
    ``track`` is shown to ``until`` s.
    """
    spacecraft, limits = flown.spacecraft, flown.spacecraft.limits
    target = spacecraft.goal.axis
    channels = geometry.channels_fired(flown)
    bounds = {bound.part: bound.limit for bound in requirements.required(spacecraft)}
    parts = [Part.NUTATION, Part.SHIFT]
    if target is not None:
        parts.append(Part.DISTANCE)
    rows = [
        (
            part.value,
            requirements.POINTING if part is Part.DISTANCE else part.label,
            f"≤ {limit_text(bounds[part]).removesuffix(' deg')}°" if part in bounds else "",
        )
        for part in parts
    ]
    if Part.SPIN in bounds:
        spin = f"≤ {quantity(bounds[Part.SPIN], 'rad/s')}"
        rows.append((Part.SPIN.value, Part.SPIN.label, spin))
    command = ("nutdamp simulate", craft, f"--schedule {EDITED} --flown")
    fired = [(pulse, channel_of(spacecraft, pulse)) for pulse in flown.schedule]
    return {
        "rows": rows,
        "rolling": spacecraft.inertia.symmetric,
        "file": EDITED,
        "command": " ".join(filter(None, command)),
        "body": {
            "moments": spacecraft.inertia.moments,
            "sense": math.copysign(1.0, spacecraft.spin),
            "target": None if target is None else target.tolist(),
        },
        "start": [*spacecraft.omega0.tolist(), *spacecraft.initial.quaternion.tolist()],
        "framed": spacecraft.attitude is not None,
        "axes": None if spacecraft.inertia.aligned else spacecraft.inertia.axes.tolist(),
        "pulses": [
            {
                "start": pulse.start,
                "on": pulse.on_time,
                "channel": pulse.channel,
                "row": channels.index(pulse.channel),
                "text": channel_text(pulse, spacecraft),
                "impulse": pulse.impulse.tolist(),
                "torque": None if pulse.torque is None else pulse.torque.tolist(),
                "least": 0.0 if channel is None else channel.min_on_time,
                "most": None
                if channel is None or math.isinf(channel.max_on_time)
                else channel.max_on_time,
            }
            for pulse, channel in fired
        ],
        "limits": {
            "earliest": limits.earliest,
            "horizon": spacecraft.horizon,
            "gap": limits.gap,
            "tick": limits.tick,
            "blackout": limits.blackout,
            "most": limits.max_pulses,
        },
        "spin": spacecraft.goal.spin,
        "frame": EDGES,
        "plane": geometry.sky_plane(flown, track.momentum[0]).tolist(),
        "pole": [*rooms[0][0].tolist(), rooms[0][1]],
        "sky": [*rooms[1][0].tolist(), rooms[1][1]],
        # Of times changed by hand, s: the decade of a two-thousandth of the time shown.
        "step": 10.0 ** math.floor(math.log10(until / 2000.0)),
    }
