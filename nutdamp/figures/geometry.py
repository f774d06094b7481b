"""Geometry of the pictures of a flight: directions as angles, rolling cones, stretches of the
track; the globe of the overview, and the body cone rolling on the space cone in the film.

Only `ticks` loads matplotlib.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nutdamp.figures import style
from nutdamp.figures.style import FAINT, GREY, INK, MOMENTUM, MOTION, PULSE
from nutdamp.flight.propagation import Flight, Track
from nutdamp.physics import attitude, triaxial
from nutdamp.spacecraft.model import Keep, Spacecraft, Vector
from nutdamp.spacecraft.schedule import Pulse, Schedule

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ROWS_A_TURN = 60  # rows in a nutation period from which a polygon looks like the curve
# largest number of rows of a picture; a longer track is drawn as far as they reach
MOST_ROWS = 30_000
RIM = 121  # points around the rim of a cone

# part of the time shown below which firings cannot be distinguished: 4 points on a sheet
CLOSE = 1.0 / 125.0
MANY = 3  # least number of firings drawn as one

NO_CONE = 1e-10  # half-angle in rad below which a cone is not distinguished from its axis

# direction from which the sphere is seen: above the plane square to H(0)
ELEVATION = math.radians(28.0)
STEEPEST = math.radians(65.0)  # elevation of the globe where all that it shows is near H(0)
# the spin axis leans to the right at t = 0, this far round from the viewer
ASIDE = math.radians(65.0)
MOVES = math.radians(2.0)  # motion of the spin axis below which it is a point on the globe

# below the first angle from H(0) everything is magnified, to the second one at most
WIDE, DRAWN = math.radians(20.0), math.radians(42.0)
STEPS = (1.0, 2.0, 3.0, 5.0)

SPACE, BODY = 0.28, 0.15  # opacity of the cones: distinguished in grey print too
# width of rims and edges of cones, points: thinner than the path of the spin axis, which shares
# their colour
RIM_WIDTH = 0.7

# marks in the plane picture, colours and names of the three directions that lie in one plane
DIRECTIONS = (("+", MOMENTUM, "H"), ("o", INK, "ω"), ("s", MOTION, "spin axis"))


def shown_until(spacecraft: Spacecraft, schedule: Schedule) -> float:
    """End of the time axis of pictures and films, s: the motion after the last pulse is seen, and
    fills no sheet.

    One inertial nutation period after the last pulse, but no more than a quarter of the time until
    then, or of a period as seen in the body where that is more. Without pulses, the inertial
    period.
    """
    last = max([schedule.end, *spacecraft.edges])
    if not (len(schedule) or spacecraft.edges):
        return spacecraft.inertial_period
    return last + min(spacecraft.inertial_period, 0.25 * max(last, spacecraft.body_period))


def drawn(flight: Flight, track: Track) -> Track:
    """``track`` in as many rows as its curves need; a shorter one from t = 0 where these are more
    than `MOST_ROWS`.
    """
    until = float(track.t[-1])
    step = quickest(flight) / ROWS_A_TURN
    if until / step <= len(track.t):
        return track
    reach = min(until, max(MOST_ROWS * step, flight.schedule.end))
    return flight.sampled(min(math.ceil(reach / step) + 1, MOST_ROWS), reach)


def quickest(flight: Flight) -> float:
    """The shortest period of the nutation, seen in the body or in space, s."""
    size = float(np.linalg.norm(flight.spacecraft.momentum))
    return float(min(flight.spacecraft.body_period, 2 * math.pi * min(flight.moments) / size))


def channels_fired(flight: Flight) -> list[str]:
    """Channels that fire, in the order of the file."""
    order = [channel.name for channel in flight.spacecraft.channels]
    used = dict.fromkeys(pulse.channel for pulse in flight.schedule)
    return sorted(used, key=lambda name: order.index(name) if name in order else -1)


def stretches(flight: Flight, track: Track) -> Iterator[tuple[slice, int | None]]:
    """Rows of the track cut where pulses begin and end, in order, each with the number of the pulse
    that fires in them, from 0. Neighbours share a row; an impulse has two of its own.
    """
    now = 0
    last = len(track.t) - 1
    for number, (begins, ends) in enumerate(flight.spans):
        if begins > track.t[last]:
            break
        first = max(now, int(np.searchsorted(track.t, begins, side="left")))
        until = max(first, min(last, int(np.searchsorted(track.t, ends, side="right")) - 1))
        if first > now:
            yield slice(now, first + 1), None
        yield slice(first, until + 1), number
        now = until
    if now < last:
        yield slice(now, last + 1), None


class FiredBlock(NamedTuple):
    """Firings from pulse ``first`` on, numbered from 1, that are drawn as one: how ``many``, their
    numbers as text, from ``begins`` to ``ends`` s; ``on`` s of it something fires.
    """

    first: int
    many: int
    name: str
    begins: float
    ends: float
    on: float


def blocks(flight: Flight, until: float, channel: str | None = None) -> list[FiredBlock]:
    """The firings of a channel, or of all, up to ``until`` s; `MANY` or more that begin `CLOSE`
    together are one.
    """
    groups: list[list[tuple[int, Pulse]]] = []
    for number, pulse in enumerate(flight.schedule, start=1):
        if pulse.start <= until and channel in (None, pulse.channel):
            if not groups or pulse.start - groups[-1][-1][1].start >= CLOSE * until:
                groups.append([])
            groups[-1].append((number, pulse))
    fired = []
    for group in groups:
        for part in [group] if len(group) >= MANY else [[alone] for alone in group]:
            numbers, pulses = zip(*part, strict=True)
            between = "–" if len(part) == numbers[-1] - numbers[0] + 1 else " … "
            name = between.join(map(str, dict.fromkeys((numbers[0], numbers[-1]))))
            ends = max(pulse.end for pulse in pulses)
            on = sum(pulse.on_time for pulse in pulses)
            fired.append(FiredBlock(numbers[0], len(part), name, pulses[0].start, ends, on))
    return fired


def sky_plane(flight: Flight, momentum: Vector) -> Vector:
    """Rows: two directions square to ``momentum``, and its own. In a celestial frame east and
    north, in N its x, y.
    """
    up = momentum / np.linalg.norm(momentum)
    x = np.array([1.0, 0.0, 0.0])
    first = x if flight.spacecraft.attitude is None else np.cross([0.0, 0.0, 1.0], up)
    if np.linalg.norm(first) < 1e-9:  # H at the pole: there is no east
        first = x
    first = first - up * (first @ up)
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(up, first), up])


def sky_names(flight: Flight, centre: str = "H(0)") -> tuple[str, str, str]:
    """Names of the two angles of `on_sky` in a view centred on ``centre``, and the sense of the
    view.
    """
    if flight.spacecraft.attitude is None:
        return (
            "towards inertial x, °",
            "towards inertial y, °",
            "H towards you, inertial x to the right",
        )
    return f"east of {centre}, °", f"north of {centre}, °", "H towards you, east to the right"


def on_sky(plane: Vector, directions: Vector) -> Vector:
    """Directions (n, 3) as angles from H(0) in degrees, true to scale along every radius (azimuthal
    equidistant).
    """
    local = directions @ plane.T
    across = np.hypot(local[:, 0], local[:, 1])
    scale = np.divide(
        np.degrees(np.arctan2(across, local[:, 2])),
        across,
        out=np.zeros_like(across),
        where=across > 0,
    )
    return np.asarray(local[:, :2] * scale[:, None], dtype=np.float64)


def off_sky(plane: Vector, angles: Vector) -> Vector:
    """Directions (n, 3) of ``angles`` (n, 2) in degrees, the inverse of `on_sky`."""
    turns = np.radians(angles)
    away = np.hypot(*turns.T)[:, None]
    return np.asarray(np.cos(away) * plane[2] + np.sinc(away / math.pi) * turns @ plane[:2])


def pole_note(flight: Flight) -> str:
    """Words behind the names of the axes of the pole curve;
    empty where they are those of the file.
    """
    spacecraft = flight.spacecraft
    axes = "" if spacecraft.inertia.aligned else ", principal axes"
    return f"{axes}, spin about −3" if spacecraft.spin < 0.0 else axes


def aimed(flight: Flight) -> Vector:
    """(n, 3): the target axis, or none."""
    goal = flight.spacecraft.goal.axis
    return np.empty((0, 3)) if goal is None else goal[None]


def sky_paths(flight: Flight, track: Track) -> tuple[Vector, Vector, Vector]:
    """(n, 2) each: spin axis, H and target, if any, as angles from H(0) in degrees (Magnus 1970
    fig. 6-8).
    """
    plane = sky_plane(flight, track.momentum[0])
    return on_sky(plane, track.axis), on_sky(plane, track.momentum), on_sky(plane, aimed(flight))


def hull(points: Vector) -> Vector:
    """Corners (m, 2) of the convex hull of ``points`` (n, 2), counterclockwise; of points on a line
    its ends.
    """
    from scipy.spatial import ConvexHull, QhullError

    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except (QhullError, ValueError):
        ends = points[np.lexsort(points.T[::-1])[[0, -1]]]
        return np.unique(ends, axis=0)


def ticks(low: float, high: float, most: int) -> list[float]:
    """At most ``most`` + 1 round numbers from ``low`` to ``high``, 1, 2 or 5 times a power of ten
    apart.
    """
    from matplotlib.ticker import MaxNLocator

    edge = 1e-9 * (high - low)
    values = MaxNLocator(most, steps=[1, 2, 5, 10]).tick_values(low, high)
    return [float(value) for value in values if low - edge <= value <= high + edge]


class DrawnCones(NamedTuple):
    """Body cone and space cone at one moment, as unit vectors in the inertial frame.

    (3,) each: spin axis, H and ω. ``body`` and ``space`` (n, 3) are the rims of the cones, which
    touch along ``rotation``; empty where there is no cone. ``swept`` (m, 3) is the circle that the
    space cone fills: its rim, and where I1 ≠ I2 the one about a rim that never closes.
    """

    axis: Vector
    momentum: Vector
    rotation: Vector
    body: Vector
    space: Vector
    swept: Vector


def cones(flight: Flight, rates: Vector, quaternion: Vector) -> DrawnCones:
    """The cones that would roll on each other if the torque ended now: rates (3,) rad/s, quaternion
    (4,).

    Polhode and herpolhode of the free motion: circles for a symmetric body (Magnus 1970 fig. 4).
    Without rims where they do not close, and for a body with a wheel and three moments.
    """
    moments = np.asarray(flight.moments)
    wheel = flight.spacecraft.inertia.wheel
    axis = attitude.rotate(quaternion, np.array([0.0, 0.0, flight.spacecraft.sense]))
    turning = attitude.rotate(quaternion, rates)
    momentum = attitude.rotate(quaternion, moments * rates + np.array([0.0, 0.0, wheel]))
    direction = momentum / np.linalg.norm(momentum)
    # A despun body at rest has H in its wheel alone, and no ω: cones without rims.
    rotation = turning / np.linalg.norm(turning) if turning.any() else direction
    if moments[0] == moments[1]:
        space = around(direction, rotation)
        return DrawnCones(axis, direction, rotation, around(axis, rotation), space, space)
    period = math.inf if wheel else triaxial.nutation_period(flight.moments, rates)
    if not math.isfinite(period):
        return DrawnCones(axis, direction, rotation, *np.empty((3, 0, 3)))
    times = np.linspace(0.0, period, 4 * RIM)
    polhode = triaxial.free_rates(flight.moments, rates, times)
    turns = triaxial.free_attitude(flight.moments, rates, quaternion, times)
    size = np.linalg.norm(polhode, axis=1, keepdims=True)
    body, space = (
        attitude.rotate(quaternion, polhode / size),
        attitude.rotate(turns, polhode / size),
    )
    return DrawnCones(
        axis,
        direction,
        rotation,
        body,
        space,
        around(direction, space[np.argmin(space @ direction)]),
    )


def body_mark(rolling: DrawnCones, quaternion: Vector) -> Vector:
    """The point (3,) of the body cone's rim over body axis 1, which shows the turn of the body. NaN
    without a rim.
    """
    if not len(rolling.body):
        return np.full(3, np.nan)
    in_body = attitude.rotate(attitude.conjugate(quaternion), rolling.body)
    azimuth = np.arctan2(in_body[:, 1], in_body[:, 0])
    order = np.argsort(azimuth)
    return np.array(
        [np.interp(0.0, azimuth[order], rolling.body[order, part]) for part in range(3)]
    )


def around(axis: Vector, start: Vector) -> Vector:
    """Unit vectors (RIM, 3) on the circle that ``start`` describes about ``axis``, both unit; none
    on the axis.
    """
    square = start - axis * (axis @ start)
    if np.linalg.norm(square) < NO_CONE:
        return np.empty((0, 3))
    cosine, sine = circle().T[..., None]
    return np.asarray(
        axis * (axis @ start) + cosine * square + sine * np.cross(axis, square), dtype=np.float64
    )


def circle(count: int = RIM) -> Vector:
    """``count`` points (n, 2) from (1, 0) once around the unit circle, back to where they began."""
    turn = np.linspace(0.0, 2.0 * math.pi, count)
    return np.column_stack([np.cos(turn), np.sin(turn)])


def closed(spacecraft: Spacecraft, until: float) -> list[tuple[float, float]]:
    """Begin and end, s, of the times to ``until`` s in which no pulse may be on."""
    windows = [(0.0, spacecraft.limits.earliest), *spacecraft.limits.blackout]
    return [
        (begins, min(ends, until)) for begins, ends in windows if begins < until and ends > begins
    ]


class View(NamedTuple):
    """Orthographic view of directions: ``plane`` rows are two directions square to H(0) and its
    own.

    ``magnified`` stretches directions square to H(0): straight lines, tangents and coplanar lines
    remain so.
    """

    plane: Vector
    azimuth: float
    magnified: float = 1.0
    elevation: float = ELEVATION

    @property
    def scale(self) -> str:
        """Words on the magnification in a title."""
        return f" (angles × {self.magnified:g})" if self.magnified != 1.0 else ""

    def seen(self, directions: Vector) -> tuple[Vector, Vector]:
        """Places on paper (n, 2), and heights towards the viewer (n,)."""
        local = (
            np.atleast_2d(directions)
            @ self.plane.T
            * np.array([self.magnified, self.magnified, 1.0])
        )
        sine = math.sin(self.azimuth)
        cosine = math.cos(self.azimuth)
        level = math.cos(self.elevation)
        rise = math.sin(self.elevation)
        right, near = np.array([-sine, cosine, 0.0]), np.array([level * cosine, level * sine, rise])
        places = np.column_stack([local @ right, local @ np.cross(near, right)])
        return places, np.asarray(local @ near, dtype=np.float64)


def view(flight: Flight, track: Track) -> View:
    """The view that holds all that moves on ``track``."""
    plane = sky_plane(flight, track.momentum[0])
    first = cones(flight, track.rates[0], track.quaternion[0])
    local = first.axis @ plane.T
    shown = np.vstack([track.axis, track.momentum, first.body, first.space, aimed(flight)])
    angles = np.radians(np.hypot(*on_sky(plane, shown).T))
    return View(plane, math.atan2(local[1], local[0]) - ASIDE, magnification(float(angles.max())))


def magnification(widest: float) -> float:
    """Magnification of angles from H(0) where the ``widest`` is so many rad: 1, 2, 5, 10, …"""
    if widest >= WIDE or widest < NO_CONE:
        return 1.0
    room = math.tan(DRAWN) / math.tan(widest)
    decade = 10.0 ** math.floor(math.log10(room))
    return decade * max(step for step in STEPS if step * decade <= room * (1.0 + 1e-12))


def directed(flight: Flight) -> list[tuple[Keep, Vector]]:
    """The Sun and the cones to keep about inertial directions, and these directions, (3,) each."""
    watched = flight.spacecraft.watched
    return [(cone, cone.direction) for cone in watched if cone.direction is not None]


def has_globe(flight: Flight, track: Track) -> bool:
    """True where there is a direction to be shown, and the spin axis moves by more than `MOVES`."""
    moved = float(attitude.angle_between(track.axis, track.axis[0]).max())
    return moved > MOVES and bool(len(aimed(flight)) or directed(flight))


def draw_globe(axes: Axes, flight: Flight, track: Track) -> None:
    """Path of the spin axis on the sphere, with target, Sun and cones to keep on its front: the
    direction of each, and the circles between which the spin axis is to stay.
    """
    cones = directed(flight)
    plane = sky_plane(flight, track.momentum[0])
    directions = [direction for _, direction in cones]
    shown = np.vstack([track.axis[:1], aimed(flight), *directions])
    across, aside, along = (plane @ shown.sum(axis=0)).tolist()
    rise = math.atan2(along, math.hypot(across, aside))
    looked = View(plane, math.atan2(aside, across), elevation=min(max(rise, ELEVATION), STEEPEST))
    draw_ground(axes, looked, track)
    thin = style.thickness(looked.seen(track.axis)[0]) / style.LINE
    for rows, pulse in stretches(flight, track):
        colour, width = (MOTION, thin) if pulse is None else (PULSE, 1.8 * thin)
        draw_line(axes, looked, track.axis[rows], colour, width)
    style.target(axes, looked.seen(aimed(flight))[0], "_target")
    (start,), _ = looked.seen(track.axis[0])
    axes.plot(*start, "o", color=MOTION, markersize=4.5)
    labels = [("t = 0", start)]
    for cone, direction in cones:
        (place,), (height,) = looked.seen(direction)
        axes.plot(*place, "o", color=INK, markersize=7, markerfacecolor="none", zorder=4)
        axes.plot(*place, ".", color=INK, markersize=3, zorder=4)  # as astronomers mark the Sun
        labels.append((f"{cone.name} (behind)" if height < 0.0 else cone.name, place))
        square = attitude.square_to(direction)
        for sign, angle in (("≥", cone.least), ("≤", cone.most)):
            if 0.0 < angle < math.pi:
                edge = math.cos(angle) * direction + math.sin(angle) * square
                rim = around(direction, edge)
                draw_line(axes, looked, rim, GREY, 1.0)
                places, heights = looked.seen(rim)
                front = places[heights >= min(0.0, heights.max())]
                lowest = front[np.argmin(front[:, 1])]
                labels.append((f"{sign} {math.degrees(angle):.4g}° from {cone.name}", lowest))
    frame(axes, looked, track.axis)
    for name, place in labels:
        style.add(axes, name, place, INK, role="vital")
    axes.set_title("Spin axis on the globe\nrings 30°, 60°, 90° from H(0)")


def draw_ground(axes: Axes, looked: View, track: Track) -> None:
    """The sphere, where nothing is magnified, and the path of H."""
    if looked.magnified == 1.0:
        outline = circle(181)
        axes.plot(*outline.T, color=GREY, linewidth=0.7)
        for height in (0.0, 0.5, math.sqrt(0.75)):
            ring = np.insert(math.sqrt(1.0 - height * height) * outline, 2, height, axis=1)
            draw_line(axes, looked, ring @ looked.plane, FAINT, 0.6, back=False)
    size = np.linalg.norm(track.momentum, axis=1, keepdims=True)
    axes.plot(*looked.seen(track.momentum / size)[0].T, **style.PATH_OF_H)


def draw_cones(axes: Axes, looked: View, rolling: DrawnCones) -> None:
    """Space cone, body cone, and the three directions that lie in one plane."""
    for rim, within, colour, alpha in _rims(rolling):
        # From the centre to its rim: its area on paper filled and outlined, rim drawn.
        covered = hull(np.vstack([looked.seen(np.vstack([rim, within]))[0], [[0.0, 0.0]]]))
        axes.fill(*covered.T, facecolor=(colour, alpha), edgecolor=colour, linewidth=RIM_WIDTH)
        axes.plot(*looked.seen(rim)[0].T, color=colour, linewidth=RIM_WIDTH)
    for tip, (_, colour, _) in zip(looked.seen(_directions(rolling))[0], DIRECTIONS, strict=True):
        axes.plot(*np.outer(tip, [0.0, 0.97]), color=colour, linewidth=1.2)
        style.head(axes, np.outer([0.9, 1.0], tip), 1, colour)


def name_directions(axes: Axes) -> None:
    """The marks of `draw_circles` for the legend."""
    for mark, colour, name in (*DIRECTIONS, ("D", MOTION, "body axis 1")):
        axes.plot([], [], mark, color=colour, markersize=5, markeredgewidth=1.4, label=name)


def _directions(rolling: DrawnCones) -> Vector:
    """(3, 3): the `DIRECTIONS` at one moment."""
    return np.array([rolling.momentum, rolling.rotation, rolling.axis])


def _rims(rolling: DrawnCones) -> list[tuple[Vector, Vector, str, float]]:
    """Rim, circle about it, colour and density of the cones that there are."""
    both = (
        (rolling.space, rolling.swept, MOMENTUM, SPACE),
        (rolling.body, rolling.body, MOTION, BODY),
    )
    return [cone for cone in both if len(cone[0])]


def draw_line(
    axes: Axes, looked: View, directions: Vector, colour: str, width: float, *, back: bool = True
) -> None:
    """A line on the sphere: where it runs behind it, dotted, or not at all."""
    points, height = looked.seen(directions)
    front = height >= 0.0 if looked.magnified == 1.0 else np.ones(len(height), dtype=bool)
    axes.plot(*np.where(front[:, None], points, np.nan).T, color=colour, linewidth=width)
    if back and not front.all():
        axes.plot(
            *np.where(front[:, None], np.nan, points).T,
            color=colour,
            linewidth=0.7 * width,
            linestyle=":",
        )


def frame(axes: Axes, looked: View, directions: Vector) -> None:
    """Equal scales, and room for the centre and all ``directions`` (n, 3); no ticks: it has no
    scale to read.
    """
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    points = np.vstack([[[0.0, 0.0]], looked.seen(unit)[0]])
    if looked.magnified == 1.0:
        points = np.vstack([points, [[-1.0, -1.0], [1.0, 1.0]]])
    style.square(axes, points, margin=0.12)
    axes.set_axis_off()


def draw_circles(axes: Axes, plane: Vector, rolling: DrawnCones) -> None:
    """Rims of the cones with their axes and line of contact, on the sky."""
    for rim, within, colour, alpha in _rims(rolling):
        filled = hull(on_sky(plane, np.vstack([rim, within])))
        axes.fill(*filled.T, facecolor=colour, alpha=alpha, edgecolor="none")
        axes.plot(*on_sky(plane, rim).T, color=colour, linewidth=1.0)
        if within is not rim:  # a rim that does not close: its filled circle has its own outline
            axes.plot(*on_sky(plane, within).T, color=colour, linewidth=0.5)
    places = on_sky(plane, _directions(rolling))
    axes.plot(*places.T, color=GREY, linewidth=0.8, label="plane of H, ω and spin axis")
    for place, (mark, colour, _) in zip(places, DIRECTIONS, strict=True):
        axes.plot(
            *place, mark, color=colour, markersize=8 if mark == "+" else 4.5, markeredgewidth=1.4
        )
