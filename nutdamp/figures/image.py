"""Pictures and films written to files: formats, sizes, and the frames of ``animate``."""

from __future__ import annotations

import hashlib
import io
import math
import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from html import escape
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.common import work
from nutdamp.errors import BadRequest, CannotWrite
from nutdamp.figures import geometry, overview, style
from nutdamp.figures.style import INK, MOTION, PAPER
from nutdamp.flight.propagation import Flight
from nutdamp.spacecraft.model import Spacecraft, Vector

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure

FORMATS = ("png", "svg", "pdf")

# No dates in the file, so that the same flight gives the same picture.
_METADATA: dict[str, dict[str, Any]] = {
    "png": {"Software": "nutdamp"},
    "svg": {"Date": None, "Creator": "nutdamp"},
    "pdf": {"CreationDate": None, "Creator": "nutdamp"},
    "page": dict.fromkeys(("Date", "Creator", "Format", "Type")),
}

POINTS = 72.0  # units of an SVG in an inch
SPACES = 'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'


def ending(path: str, option: str = "--plot", formats: Sequence[str] = FORMATS) -> str:
    """The format of a picture by the ending of its file, the first of ``formats`` for standard
    output.

    Raises BadRequest for other endings, MissingExtra without matplotlib.
    """
    suffix = formats[0] if path == "-" else Path(path).suffix.lstrip(".").lower()
    if suffix not in formats:
        raise BadRequest(
            f"{option} {path}: the ending says the format; use one of .{', .'.join(formats)}"
        )
    style.require()
    return suffix


@style.styled()
def rendered(figure: Figure, path: str) -> bytes:
    """The figure as the content of a file, vector or not by the ending of ``path``; raises
    BadRequest for others.
    """
    kind = ending(path)
    stream = io.BytesIO()
    if kind != "svg":  # in which text stays text, drawn with the fonts of who reads it
        style.legible(figure)
    figure.savefig(stream, format=kind, metadata=_METADATA[kind])
    return stream.getvalue()


@style.styled()
def svg(figure: Figure, described: str = "") -> str:
    """The figure as an inline ``<svg>`` element, as wide as its container, on no background.

    Text and frames take the colour of the text around it, so that it suits light and dark pages.
    Its ids begin with a digest of its content: several may be in one page. One that is
    ``described`` for those who do not see it has no line above it, which is text of the page.
    """
    width, height = POINTS * figure.get_size_inches()
    top = 0.0
    title = figure._suptitle  # type: ignore[attr-defined]  # there is no other way to it
    label = f' aria-label="{escape(described)}"' if described else ""
    if title is not None and described:
        top = height - POINTS * title.get_window_extent().y0 / figure.dpi
        title.set_visible(False)
    stream = io.StringIO()
    figure.savefig(stream, format="svg", transparent=True, metadata=_METADATA["page"])
    # Before are the size, which the page decides, and styles that would hold for the whole page.
    content = (
        stream.getvalue()
        .partition("</defs>")[2]
        .replace(INK, "currentColor")
        .replace(PAPER, "var(--paper, #fff)")
    )
    mark = "n" + hashlib.sha256(content.encode()).hexdigest()[:8] + "-"
    content = re.sub(r'(\bid="|url\(#|href="#)', rf"\g<1>{mark}", content)
    frame = f"0 {top:.1f} {width:.1f} {height - top:.1f}"
    return (
        f'<svg {SPACES} viewBox="{frame}" width="100%" role="img"{label} '
        f'style="stroke-linejoin: round">{content}'
    )


FILMS = ("gif", "mp4")

TALL = 0.75  # height of a frame over its width: square panels of half the width above a strip
INCHES = 8.0  # width of the sheet that fills a frame, inches: more pixels only make it finer

# shades of a GIF: far enough apart that Pillow finds each in a palette, and white stays white
LEVELS = (np.arange(256) // 8 * 255 // 31).astype(np.uint8)

# frames in a nutation turn from which the eye follows it; with fewer than half of them it may see
# it backwards
SMOOTH = 12.0

SHORTEST, LONGEST = 6.0, 30.0  # seconds of a film whose length is not given
# turn of the body from frame to frame up to which a mark on it shows how it rolls
MARKED = math.radians(60.0)
FRAMED = 300  # frames by whose cones the scales are laid out, evenly over the film
HELD = 0.4  # seconds of film that a firing stays announced, however short it is


def film_format(path: str) -> str:
    """The format of a film by the ending of its file, gif for standard output.

    Raises BadRequest for others, MissingExtra without matplotlib, CannotWrite for mp4 without
    ffmpeg.
    """
    kind = ending(path, "--output", FILMS)
    if kind == "mp4" and shutil.which("ffmpeg") is None:
        raise CannotWrite(
            path, "mp4 is made by ffmpeg, which is not installed; install it, or name a .gif"
        )
    return kind


class Timing(NamedTuple):
    """Division of ``until`` s of motion into ``frames`` pictures at ``fps`` a second."""

    until: float
    frames: int
    fps: int
    turns: float

    @property
    def times(self) -> Vector:
        """Moment of each frame, s."""
        return np.linspace(0.0, self.until, self.frames)

    @property
    def smooth(self) -> bool:
        """True where the eye can follow the nutation."""
        return self.frames >= 0.5 * SMOOTH * self.turns

    @property
    def pace(self) -> float:
        """Seconds of motion in a second of film."""
        return self.until * self.fps / self.frames


def timing(spacecraft: Spacecraft, until: float, fps: int, seconds: float | None) -> Timing:
    """Frames for ``until`` s of motion; without ``seconds`` as many as the nutation needs to be
    followed.
    """
    turns = float(until / spacecraft.inertial_period)
    if seconds is None:
        seconds = min(max(turns * SMOOTH / fps, SHORTEST), LONGEST)
    return Timing(float(until), max(round(seconds * fps), 2), fps, turns)


@style.styled()
def film(stream: IO[bytes], flight: Flight, timed: Timing, path: str, width: int = 800) -> None:
    """Write the film of ``width`` pixels to ``stream``, in the `film_format` of ``path``; raises as
    that does.
    """
    kind = film_format(path)
    scene = Scene(flight, timed, width)
    with work.steps(timed.frames):
        (_gif if kind == "gif" else _mp4)(stream, scene, timed)


def _gif(stream: IO[bytes], scene: Scene, timed: Timing) -> None:
    """Write a looped GIF with the palette of its first frame: fixed parts keep their colour."""
    from PIL import Image

    def frames() -> Iterator[Image.Image]:
        palette: Image.Image | None = None
        for number in range(timed.frames):
            scene.show(number)
            pixels = Image.fromarray(LEVELS[scene.pixels()])
            palette = palette or pixels.quantize(dither=Image.Dither.NONE)
            yield pixels.quantize(palette=palette, dither=Image.Dither.NONE)
            work.reach(number + 1)

    each = frames()
    # Time in milliseconds; GIF counts in hundredths of a second.
    next(each).save(
        stream,
        "GIF",
        save_all=True,
        append_images=each,
        duration=10 * round(100 / timed.fps),
        loop=0,
    )


def _mp4(stream: IO[bytes], scene: Scene, timed: Timing) -> None:
    """Write H.264 as browsers play it."""
    from matplotlib.animation import FFMpegWriter

    writer = FFMpegWriter(
        fps=timed.fps, codec="h264", extra_args=["-pix_fmt", "yuv420p", "-movflags", "+faststart"]
    )
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "film.mp4"
        try:
            with writer.saving(scene.figure, str(target), scene.figure.dpi):
                for number in range(timed.frames):
                    scene.show(number)
                    writer.grab_frame()
                    work.reach(number + 1)
        except subprocess.CalledProcessError as reason:
            raise CannotWrite("mp4", f"ffmpeg failed with status {reason.returncode}") from reason
        with target.open("rb") as encoded:
            shutil.copyfileobj(encoded, stream)


class Scene:
    """The figure of the film, and its parts that change from frame to frame."""

    def __init__(self, flight: Flight, timed: Timing, width: int) -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        self.flight, self.timed = flight, timed
        track = flight.sampled(timed.frames, timed.until)
        rows = np.searchsorted(track.t, timed.times, side="right") - 1
        rows[0] = 0  # before what is fired at once
        self.rates, self.quaternions = track.rates[rows], track.quaternion[rows]
        # Even numbers of pixels: video is coded in blocks.
        self.figure = style.sheet(INCHES, TALL * INCHES)
        self.figure.set_dpi(width // 2 * 2 / INCHES)
        self.canvas = FigureCanvasAgg(self.figure)
        self.path = geometry.drawn(flight, track)
        self.plane = geometry.sky_plane(flight, track.momentum[0])
        self.looked = geometry.view(flight, self.path)
        self._changing: list[Artist] = []
        # The parts that do not move, with room for those that do.
        figure = self.figure
        grid = figure.add_gridspec(2, 2, height_ratios=[3.0, 1.0])
        self.space, self.sky = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[0, 1])
        self.strip = figure.add_subplot(grid[1, :])
        some = np.unique(
            np.linspace(0, self.timed.frames - 1, min(self.timed.frames, FRAMED))
            .round()
            .astype(int)
        )
        cones = (self.cones(number) for number in some.tolist())
        rims = np.vstack(
            [part for at in cones for part in (at.body, at.space, at.axis[None], at.rotation[None])]
        )
        geometry.draw_ground(self.space, self.looked, self.path)
        geometry.frame(self.space, self.looked, np.vstack([rims, self.path.axis]))
        self.space.set_title(f"Cones{self.looked.scale}")
        shown = geometry.on_sky(self.plane, np.vstack([rims, self.path.axis]))
        style.square(self.sky, shown, margin=0.06)
        x, y, sense = geometry.sky_names(flight)
        self.sky.set(xlabel=x, ylabel=y, title=f"Seen along H(0)\n{sense}")
        overview.nutation_history(self.strip, flight, self.path)
        self.strip.set(xlabel=overview.TIME)
        geometry.name_directions(self.sky)
        style.legend(figure, [self.sky, self.strip])
        self.title = figure.suptitle(self.caption(0.0))
        figure.draw_without_rendering()
        figure.set_layout_engine("none")  # from now on nothing may move but the motion
        self.title.set_text("")
        self.canvas.draw()  # type: ignore[no-untyped-call]
        self.still = self.canvas.copy_from_bbox(figure.bbox)  # type: ignore[no-untyped-call]

    def cones(self, number: int) -> geometry.DrawnCones:
        """The cones of frame ``number``, from 0."""
        return geometry.cones(self.flight, self.rates[number], self.quaternions[number])

    def show(self, number: int) -> None:
        """Frame ``number``, from 0."""
        for artist in self._changing:
            artist.remove()
        now = float(self.timed.times[number])
        cones = self.cones(number)
        kept = {artist for axes in self.figure.axes for artist in axes.get_children()}
        done = self.path.t <= now
        geometry.draw_cones(self.space, self.looked, cones)
        geometry.draw_line(self.space, self.looked, self.path.axis[done], MOTION, 0.9)
        geometry.draw_circles(self.sky, self.plane, cones)
        if self.timed.until * abs(self.flight.spacecraft.spin) < MARKED * self.timed.frames:
            mark = geometry.body_mark(cones, self.quaternions[number])[None]
            self.space.plot(*self.looked.seen(mark)[0].T, "D", color=MOTION, markersize=4)
            self.sky.plot(*geometry.on_sky(self.plane, mark).T, "D", color=MOTION, markersize=4)
        self.sky.plot(
            *geometry.on_sky(self.plane, self.path.axis[done]).T, color=MOTION, linewidth=0.9
        )
        self.strip.axvline(now, color=INK, linewidth=1.2)
        drawn = (artist for axes in self.figure.axes for artist in axes.get_children())
        self._changing = [artist for artist in drawn if artist not in kept]
        self.title.set_text(self.caption(now))

    def caption(self, now: float) -> str:
        """Text above the frame: name, scheme, time, and the firing, also just after it."""
        firing = ""
        for number, pulse in enumerate(self.flight.schedule, start=1):
            if pulse.start <= now <= pulse.end + HELD * self.timed.pace:
                word = "firing" if now <= pulse.end else "fired"
                firing = f"   {word} {number}: {pulse.channel}"
        digits = max(0, min(6, math.ceil(-math.log10(self.timed.until / self.timed.frames))))
        name, scheme = map(style.short, (self.flight.spacecraft.name, self.flight.scheme))
        return f"{name}: {scheme}\nt = {now:.{digits}f} s{firing}"

    def pixels(self) -> NDArray[np.uint8]:
        """The frame, (height, width, 3): the changing parts drawn over the fixed ones."""
        self.canvas.restore_region(self.still)  # type: ignore[no-untyped-call]
        for artist in sorted([*self._changing, self.title], key=lambda drawn: drawn.get_zorder()):
            artist.draw(self.canvas.get_renderer())  # type: ignore[no-untyped-call]
        return np.array(self.canvas.buffer_rgba())[..., :3]  # type: ignore[no-untyped-call]
