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

from nutdamp.figures import geometry
from nutdamp.figures.overview import NO_OUTLINES
from nutdamp.flight import propagation
from nutdamp.flight.propagation import Flight, Track
from nutdamp.page.document import (
    EDGES,
    Circle,
    Moving,
    NamedDirection,
    Panel,
    Scale,
    Strip,
    Workbench,
)
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

ROWS_A_TURN, LEAST_ROWS, MOST_ROWS = 24, 600, 2400
"""Even rows in the quickest nutation turn; least and largest number of them altogether."""

# rows in a turn below which a line from row to row is no picture of the path, and dots are drawn
COARSE = 12
STEEP = 25.0  # turns of the nutation from which lines are thin
SPHERE = 10_000  # length of a unit vector of the globe as whole numbers: 0.006 deg
ANGLE_DIGITS = 4  # decimals of degrees; more where the largest nutation has not so many figures
# largest distance of a target from H(0) in the panel of the axis track, as a multiple of the track
FAR = 4.0
APART = 10.0
"""Largest angle of the cones over the nutation that its scale has room for: of a despun body with a
wheel they measure 90 deg.
"""
END = 0.03  # radius of the mark of the end of the spin axis over half the side of that panel
NONE = -(10**8)  # entry of a row for an angle that does not exist
QUICK, UNHURRIED, SLOW = (
    4.0,
    15.0,
    120.0,
)  # seconds that playing takes at the quickest, at first, and at the slowest


def named_directions(spacecraft: Spacecraft) -> tuple[NamedDirection, ...]:
    """Directions of the globe besides the track: the target, the Sun, the cones that the spin axis
    keeps.
    """
    directions = []
    if spacecraft.goal.axis is not None:
        circles = [
            Circle(f"H at most {limit_text(bound.limit)} from target", bound.limit, "target")
            for bound in requirements.required(spacecraft)
            if bound.part is Part.DISTANCE
        ]
        directions.append(NamedDirection("target", spacecraft.goal.axis, "target", tuple(circles)))
    for keep in spacecraft.watched:
        if keep.direction is not None:
            bounds = [
                ("least", keep.least, "keep-out", keep.least > 0.0),
                ("most", keep.most, "keep-in", keep.most < math.pi),
            ]
            circles = [
                Circle(f"axis at {word} {limit_text(size)} from {keep.name}", size, kind)
                for word, size, kind, bounded in bounds
                if bounded
            ]
            directions.append(
                NamedDirection(keep.name, keep.direction, "watched", tuple(circles), watched=True)
            )
    return tuple(directions)


def moving_of(
    plan: Plan, craft: str = "SPACECRAFT", outlines: Mapping[str, Vector] = NO_OUTLINES
) -> Moving:
    """The view of a plan flown through the real pulse widths; ``craft``: words of a command for the
    spacecraft. ``outlines``: where H may end and ends in cases, degrees on the axis track.
    """
    spacecraft = plan.spacecraft
    named = named_directions(plan.spacecraft)
    # To the millisecond, so that the same rows can be had from ``simulate`` by a short number.
    until = math.ceil(1e3 * geometry.shown_until(spacecraft, plan.pulses)) / 1e3
    flown = propagation.flown(spacecraft, plan.pulses, until)
    turns = until / geometry.quickest(flown)
    samples = min(max(math.ceil(ROWS_A_TURN * turns), LEAST_ROWS), MOST_ROWS) + 1
    track = flown.sampled(samples, until)
    panels, columns, target, rooms = _panels(flown, track, named)
    end = geometry.sky_paths(flown, track)[0][-1] + END * rooms[1][1] * geometry.circle()
    lines = {**outlines, "end": end}.items()
    paths = tuple((kind, _path(placed(outline, *rooms[1]))) for kind, outline in lines)
    panels = (panels[0], panels[1]._replace(outlines=paths))
    strip, span = strip_of(flown, track, until)
    texts = {"none": 0}
    firing = []
    names = _pulse_names(flown)
    for time in track.t.tolist():  # the number of the text that names the firings at each row
        on = (
            name
            for name, (begins, ends) in zip(names, flown.spans, strict=True)
            if begins <= time <= ends
        )
        firing.append(texts.setdefault(" and ".join(on) or "none", len(texts)))
    largest = math.degrees(float(track.nutation.max()))
    # Four figures of the largest nutation.
    cone = (
        ANGLE_DIGITS
        if largest < geometry.LEAST
        else max(ANGLE_DIGITS, 3 - math.floor(math.log10(largest)))
    )
    clock = max(3, math.ceil(-math.log10(until / (samples - 1))) + 1)
    # The angles of the spin axis, as every table shows them, in units of their last decimal.
    angles = direction_columns(spacecraft)
    texts_of_angles = [[angle.shown(axis) for axis in track.axis] for angle in angles]
    pointing = [
        [NONE if text == MISSING else round(float(text) * 10**ANGLE_DIGITS) for text in column]
        for column in texts_of_angles
    ]
    columns |= {
        "t": _whole(track.t, clock),
        "theta": _whole(np.degrees(track.nutation), cone),
        "mu": _whole(np.degrees(track.body_cone), cone),
        "lambda": _whole(np.degrees(track.space_cone), cone),
        **_numbered("angle", pointing),
        "firing": firing,
    }
    if named:
        for name, ways in (("axis", track.axis), ("H", track.momentum)):
            unit = ways / np.linalg.norm(ways, axis=1, keepdims=True)
            columns |= _numbered(name, np.rint(SPHERE * unit.T).astype(int).tolist())
    watched = (
        np.degrees(attitude.angle_between(track.axis, each.axis)) for each in named if each.watched
    )
    columns |= _numbered("aspect", [_whole(angles, ANGLE_DIGITS) for angles in watched])
    utc = _dates(spacecraft, track, clock)
    absent = absence(spacecraft, flown.schedule)
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
        "firings": [*texts],
        "utc": utc,
        "target": target,
        "named": [
            {
                "name": direction.name,
                "kind": direction.kind,
                "axis": [round(part, 6) for part in direction.axis.tolist()],
                "circles": [
                    {"radius": circle.radius, "kind": circle.kind} for circle in direction.circles
                ],
            }
            for direction in named
        ],
        "look": _look(track, named),
        "dots": turns * COARSE > samples,
        "bench": None if absent else workbench_data(flown, track, *rooms, until),
    }
    return Moving(
        plan.scheme,
        panels,
        strip,
        *_speeds(until),
        (angles[0].heading, angles[1].heading),
        named,
        utc is not None,
        "azimuths" if spacecraft.attitude is None else f"{angles[0].heading}s",
        turns > STEEP,
        propagation.model_name([flown.schedule]),
        None if absent else workbench_of(flown, craft),
        absent,
        _command(plan, craft, until, samples),
        json.dumps(data, separators=(",", ":"), ensure_ascii=False).replace("<", "\\u003c"),
    )


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


def _panels(
    flown: Flight, track: Track, named: Sequence[NamedDirection]
) -> tuple[tuple[Panel, ...], dict[str, list[int]], list[int] | None, tuple[Room, Room]]:
    """Pole curve and axis track, the columns of their paths, the place of the target in the latter,
    and both rooms.
    """
    (sky, momentum), target = geometry.sky_paths(flown, track), geometry.sky_target(flown, track)
    # Only if the globe names it and it leaves room for the paths.
    reach = FAR * float(np.hypot(*np.vstack([sky, momentum]).T).max())
    if not (named and np.all(np.hypot(*target.T) <= reach)):
        target = np.empty((0, 2))
    pole = geometry.pole_path(track)
    rooms = (
        geometry.room(pole, 0.1, centre=True),
        geometry.room(np.vstack([sky, momentum, target]), 0.1),
    )
    x, y, _ = geometry.sky_names(flown)
    names = f"ω1, deg/s{geometry.pole_note(flown)}", "ω2, deg/s"
    panels = (
        panel("pole", "Pole curve: ω in the body", rooms[0], names),
        panel("sky", "Axis track, H towards you", rooms[1], (x, y)),
    )
    columns: dict[str, list[int]] = {}
    for name, path, room in zip(
        ("pole", "sky", "momentum"), (pole, sky, momentum), (*rooms, rooms[1]), strict=True
    ):
        columns |= _numbered(name, placed(path, *room))
    return (
        panels,
        columns,
        [column[0] for column in placed(target, *rooms[1]) if column] or None,
        rooms,
    )


def _path(columns: list[list[int]]) -> str:
    """A closed line as data of an SVG path."""
    return "M" + "L".join(f"{x} {y}" for x, y in zip(*columns, strict=True)) + "Z"


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


def _pulse_names(flown: Flight) -> tuple[str, ...]:
    return tuple(
        f"{number}: {channel_text(pulse, flown.spacecraft)}"
        for number, pulse in enumerate(flown.schedule, 1)
    )


def _look(track: Track, named: Sequence[NamedDirection]) -> list[float]:
    """Longitude and latitude in degrees of the viewer of the globe: the track in front, seen a
    little from the side.
    """
    middle = track.momentum[0] / np.linalg.norm(track.momentum[0])
    if named and float(middle @ named[0].axis) > -0.9:
        middle = middle + named[0].axis
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


EDGE = (
    0.03  # part of a scale at either end without a number: it would touch those of the other scale
)
LEAD = 0.012  # part of the axis of time before t = 0: motion at t = 0 is seen beside the cursor

PREFIXES = (("", 1.0), ("m", 1e3), ("µ", 1e6), ("n", 1e9))
SHORT = 0.05
"""Prefixes of units with their factors,
and the largest number of a scale that needs another one.
"""


def placed(points: Vector, middle: Vector, half: float) -> list[list[int]]:
    """Two columns: the places of ``points`` (n, 2) in a panel."""
    left, top, right, bottom = EDGES
    part = (points - middle + half) / (2.0 * half)
    across = left + part[:, 0] * (right - left), bottom - part[:, 1] * (bottom - top)
    return [np.rint(column).astype(int).tolist() for column in across]


def panel(part: str, title: str, room: tuple[Vector, float], names: tuple[str, str]) -> Panel:
    """A panel with ``room``: its middle (2,) and half its side; the ``names`` of its axes have deg
    as their unit.
    """
    middle, half = room
    prefix, factor = _prefix(half)
    scales = []
    inner = (1.0 - 2.0 * EDGE) * half
    for which, name in enumerate(names):
        values = np.array(
            geometry.ticks(float(middle[which]) - inner, float(middle[which]) + inner, 5)
        )
        places = placed(np.column_stack([values, values]), middle[[which, which]], half)[which]
        scales.append(
            _scale(
                name.replace(", deg", f", {prefix}deg"),
                map(float, places),
                (factor * values).tolist(),
            )
        )
    (across,), (along,) = placed(np.zeros((1, 2)), middle, half)
    described = f"{title}; {scales[0].name} to the right, {scales[1].name} upwards"
    return Panel(part, title, described, scales[0], scales[1], (across, along))


def _prefix(largest: float) -> tuple[str, float]:
    """The prefix of a unit that keeps numbers up to ``largest`` short, and the factor by which they
    grow.
    """
    return next(
        ((name, factor) for name, factor in PREFIXES if factor * largest >= SHORT), PREFIXES[-1]
    )


def _scale(name: str, places: Iterable[float], values: Iterable[float]) -> Scale:
    return Scale(
        name,
        tuple(
            (at, f"{value:.6g}".replace("-", "−")) for at, value in zip(places, values, strict=True)
        ),
    )


def strip_of(flown: Flight, track: Track, until: float) -> tuple[Strip, list[float]]:
    """Angles and firings over time, and the lowest and highest angle of the scale, deg."""
    spacecraft = flown.spacecraft
    cones = np.degrees(np.concatenate([track.body_cone, track.space_cone]))
    theta = np.degrees(track.nutation)
    apart = float(np.abs(cones).max()) > APART * max(float(theta.max()), geometry.LEAST)
    angles = np.concatenate([theta, [0.0]] if apart else [theta, cones, [0.0]])
    low, high = float(angles.min()), float(angles.max())
    margin = 0.06 * (high - low) if high - low > geometry.LEAST else 1.0
    low = low - margin
    high = high + margin
    width, height = 2000, 1000  # in units of the SVG

    def rise(angle: float) -> float:
        return round(height * (high - angle) / (high - low), 1)

    def across(time: float) -> float:
        return LEAD + (1.0 - LEAD) * time / until

    def spread(begins: float, ends: float) -> tuple[float, float]:
        return round(width * across(begins), 1), round(width * (across(ends) - across(begins)), 1)

    required = None if spacecraft.requirement is None else spacecraft.requirement.nutation
    level = math.inf if required is None else math.degrees(required)
    channels = tuple(geometry.channels_fired(flown))
    prefix, factor = _prefix(high - low)
    edge = EDGE * (high - low)
    marked, times = geometry.ticks(low + edge, high - edge, 5), geometry.ticks(0.0, until, 6)
    strip = Strip(
        times=_scale("time, s", (100.0 * across(time) for time in times), times),
        angles=_scale(
            f"{prefix}deg",
            (rise(angle) * 100.0 / height for angle in marked),
            (factor * angle for angle in marked),
        ),
        zero=rise(0.0),
        required=rise(level) if low < level < high else None,
        cones=not apart,
        outside="" if required is None or low < level < high else limit_text(math.radians(level)),
        channels=channels,
        bars=tuple(
            (channels.index(pulse.channel), *spread(*span))
            for pulse, span in zip(flown.schedule, flown.spans, strict=True)
        ),
        closed=tuple(spread(begins, ends) for begins, ends in geometry.closed(spacecraft, until)),
    )
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


def workbench_of(flown: Flight, craft: str) -> Workbench:
    """The workbench of a flight, which must have one by `absence`; ``craft`` as in `moving_of`."""
    spacecraft = flown.spacecraft
    limits = {bound.part: bound.limit for bound in requirements.required(spacecraft)}
    parts = [Part.NUTATION, Part.SHIFT]
    if spacecraft.goal.axis is not None:
        parts.append(Part.DISTANCE)
    rows = [
        (
            part.value,
            requirements.POINTING if part is Part.DISTANCE else part.label,
            f"≤ {limit_text(limits[part]).removesuffix(' deg')}°" if part in limits else "",
        )
        for part in parts
    ]
    if Part.SPIN in limits:
        rows.append((Part.SPIN.value, Part.SPIN.label, f"≤ {quantity(limits[Part.SPIN], 'rad/s')}"))
    command = " ".join(filter(None, ("nutdamp simulate", craft, f"--schedule {EDITED} --flown")))
    return Workbench(
        tuple(rows), _pulse_names(flown), spacecraft.inertia.symmetric, EDITED, command
    )


def workbench_data(
    flown: Flight, track: Track, pole: Room, sky: Room, until: float
) -> dict[str, Any]:
    """Data of the script, SI and rad in principal axes: body, pulses, limits, and the scales of the
    panels.

    ``pole`` and ``sky`` are the rooms of the panels, deg/s and deg; ``track`` is shown to ``until``
    s.
    """
    spacecraft, limits = flown.spacecraft, flown.spacecraft.limits
    target = spacecraft.goal.axis
    channels = geometry.channels_fired(flown)
    return {
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
            for pulse, channel in (
                (pulse, channel_of(spacecraft, pulse)) for pulse in flown.schedule
            )
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
        "pole": [*pole[0].tolist(), pole[1]],
        "sky": [*sky[0].tolist(), sky[1]],
        # Of times changed by hand, s: the decade of a two-thousandth of the time shown.
        "step": 10.0 ** math.floor(math.log10(until / 2000.0)),
    }
