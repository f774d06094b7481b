"""The globe of the overview, and the body cone rolling on the space cone in the film."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nutdamp.figures import geometry, style
from nutdamp.figures.geometry import DrawnCones
from nutdamp.figures.style import FAINT, GREY, INK, MOMENTUM, MOTION, PULSE
from nutdamp.flight.propagation import Flight, Track
from nutdamp.physics import attitude
from nutdamp.spacecraft.model import Keep, Vector

if TYPE_CHECKING:
    from matplotlib.axes import Axes


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
RIM = 0.7

# marks in the plane picture, colours and names of the three directions that lie in one plane
DIRECTIONS = (("+", MOMENTUM, "H"), ("o", INK, "ω"), ("s", MOTION, "spin axis"))


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
    plane = geometry.sky_plane(flight, track.momentum[0])
    first = geometry.cones(flight, track.rates[0], track.quaternion[0])
    local = first.axis @ plane.T
    shown = np.vstack([track.axis, track.momentum, first.body, first.space, geometry.aimed(flight)])
    angles = np.radians(np.hypot(*geometry.on_sky(plane, shown).T))
    return View(plane, math.atan2(local[1], local[0]) - ASIDE, magnification(float(angles.max())))


def magnification(widest: float) -> float:
    """Magnification of angles from H(0) where the ``widest`` is so many rad: 1, 2, 5, 10, …"""
    if widest >= WIDE or widest < geometry.NO_CONE:
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
    return moved > MOVES and bool(len(geometry.aimed(flight)) or directed(flight))


def draw_globe(axes: Axes, flight: Flight, track: Track) -> None:
    """Path of the spin axis on the sphere, with target, Sun and cones to keep on its front: the
    direction of each, and the circles between which the spin axis is to stay.
    """
    cones = directed(flight)
    plane = geometry.sky_plane(flight, track.momentum[0])
    directions = [direction for _, direction in cones]
    shown = np.vstack([track.axis[:1], geometry.aimed(flight), *directions])
    across, aside, along = (plane @ shown.sum(axis=0)).tolist()
    rise = math.atan2(along, math.hypot(across, aside))
    looked = View(plane, math.atan2(aside, across), elevation=min(max(rise, ELEVATION), STEEPEST))
    draw_ground(axes, looked, track)
    thin = style.thickness(looked.seen(track.axis)[0]) / style.LINE
    for rows, pulse in geometry.stretches(flight, track):
        colour, width = (MOTION, thin) if pulse is None else (PULSE, 1.8 * thin)
        draw_line(axes, looked, track.axis[rows], colour, width)
    style.target(axes, looked.seen(geometry.aimed(flight))[0], "_target")
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
                rim = geometry.around(direction, edge)
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
        circle = geometry.circle(181)
        axes.plot(*circle.T, color=GREY, linewidth=0.7)
        for height in (0.0, 0.5, math.sqrt(0.75)):
            ring = np.insert(math.sqrt(1.0 - height * height) * circle, 2, height, axis=1)
            draw_line(axes, looked, ring @ looked.plane, FAINT, 0.6, back=False)
    size = np.linalg.norm(track.momentum, axis=1, keepdims=True)
    axes.plot(*looked.seen(track.momentum / size)[0].T, **style.PATH_OF_H)


def draw_cones(axes: Axes, looked: View, rolling: DrawnCones) -> None:
    """Space cone, body cone, and the three directions that lie in one plane."""
    for rim, within, colour, alpha in _rims(rolling):
        # From the centre to its rim: its area on paper filled and outlined, rim drawn.
        covered = geometry.hull(np.vstack([looked.seen(np.vstack([rim, within]))[0], [[0.0, 0.0]]]))
        axes.fill(*covered.T, facecolor=(colour, alpha), edgecolor=colour, linewidth=RIM)
        axes.plot(*looked.seen(rim)[0].T, color=colour, linewidth=RIM)
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
        filled = geometry.hull(geometry.on_sky(plane, np.vstack([rim, within])))
        axes.fill(*filled.T, facecolor=colour, alpha=alpha, edgecolor="none")
        axes.plot(*geometry.on_sky(plane, rim).T, color=colour, linewidth=1.0)
        if within is not rim:  # a rim that does not close: its filled circle has its own outline
            axes.plot(*geometry.on_sky(plane, within).T, color=colour, linewidth=0.5)
    places = geometry.on_sky(plane, _directions(rolling))
    axes.plot(*places.T, color=GREY, linewidth=0.8, label="plane of H, ω and spin axis")
    for place, (mark, colour, _) in zip(places, DIRECTIONS, strict=True):
        axes.plot(
            *place, mark, color=colour, markersize=8 if mark == "+" else 4.5, markeredgewidth=1.4
        )
