"""Pictures as files, inline SVG and films: formats, the same bytes each time, what a frame shows,
what is refused.
"""

import hashlib
import io
import math
import os
import random
import re
import shlex
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib import style as matplotlib_style
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from PIL import Image
from support import places
from support.builders import spinner
from support.cases import deep, weekly
from support.golden import check_text, refusal
from support.process import Run
from support.shown import BODY, WIDE, drawn, flight_picture, flown
from support.smoke import BEGINNINGS

from nutdamp.common import work
from nutdamp.errors import BadRequest, CannotWrite, MissingExtra
from nutdamp.figures import image, overview, style
from nutdamp.figures.image import Scene, Timing, film_format, timing
from nutdamp.flight import propagation
from nutdamp.physics import attitude
from nutdamp.planning import plan as planning
from nutdamp.spacecraft.schedule import Pulse, Schedule

pytestmark = pytest.mark.usefixtures("plans_shared")


@pytest.mark.parametrize(
    ("path", "magic"),
    [("a.png", b"\x89PNG"), ("b.SVG", b"<?xml"), deep("c.d.pdf", b"%PDF"), ("-", b"\x89PNG")],
)
def test_the_ending_says_the_format_and_the_same_flight_gives_the_same_file(
    path: str, magic: bytes
) -> None:
    figure = drawn("course", "no pulses")
    content = image.rendered(figure, path)
    assert content.startswith(magic)
    assert image.rendered(figure, path) == content


def test_other_endings_and_missing_programs_are_named_with_the_cure(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    figure = drawn("course", "no pulses")
    said = [
        *(
            refusal(BadRequest, image.ending, path)
            for path in ("a.bmp", "a", "png", "a.png.gz", ".png")
        ),
        *(refusal(BadRequest, film_format, path) for path in ("a.webm", "gif")),
    ]
    with pytest.raises(BadRequest):
        image.rendered(figure, "a.bmp")
    assert film_format("-") == film_format("b.GIF") == "gif"
    monkeypatch.setenv("PATH", "")
    said.append(refusal(CannotWrite, film_format, "a.mp4"))
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    for call in (
        lambda: image.rendered(figure, "a.png"),
        lambda: overview.flight_figure("motion", *flown("no pulses")),
        lambda: image.ending("a.png"),
        lambda: film_format("a.gif"),
    ):
        with pytest.raises(MissingExtra, match=re.escape("pip install 'nutdamp[plot]'")):
            call()
    check_text("pictures.refused", "\n".join(said))


def test_settings_of_the_user_change_nothing() -> None:
    plain = image.rendered(drawn("course", "no pulses"), "a.png")
    with mpl.rc_context(
        {"axes.facecolor": "red", "font.size": 20, "text.usetex": True, "savefig.dpi": 10}
    ):
        assert image.rendered(drawn("course", "no pulses"), "a.png") == plain
        assert mpl.rcParams["font.size"] == 20


# --- SVG
# --------------------------------------------------------------------------------------------------


def test_inline_svg_stands_in_any_page() -> None:
    """As wide as what holds it, in the colour of the text around, and no rule or id of it meets
    another's.
    """
    shown = [image.svg(drawn("course", case)) for case in ("wide pulses", "no pulses")]
    ids = []
    for text in shown:
        root = ET.fromstring(text)
        assert text.startswith("<svg ")
        assert root.get("viewBox")
        assert (root.get("width"), root.get("height")) == ("100%", None)
        assert "currentColor" in text
        assert not re.search(r"<style|<metadata|#1a1a1a", text)
        ids.append([element.get("id", "") for element in root.iter() if element.get("id")])
        assert len(ids[-1]) == len(set(ids[-1]))
        assert set(re.findall(r'(?:url\(#|href="#)([^)"]+)', text)) <= set(ids[-1])
    assert not set(ids[0]) & set(ids[1])
    for content in (shown[0], image.rendered(drawn("course", "wide pulses"), "a.svg").decode()):
        words = re.findall(r"<text[^>]*>([^<]*)</text>", content)
        assert "θ, ° (log)" in words
        assert any(word.startswith("1: ") for word in words)
        assert "'DejaVu Sans', 'Bitstream Vera Sans', 'Verdana', sans-serif" in content


def digest() -> str:
    """Of the overview, which holds every panel, as a file and in a page."""
    file = image.rendered(flight_picture("overview", WIDE, "four-pulse"), "a.svg")
    return hashlib.sha256(
        file + image.svg(flight_picture("overview", WIDE, "four-pulse")).encode()
    ).hexdigest()


@pytest.mark.weekly
def test_another_process_makes_the_same_bytes() -> None:
    """Here hashes of texts are random, as they are for users;
    there they are those of the seed 1.
    """
    folders = [str(places.TESTS), str(Path(__file__).parent)]
    code = f"import sys; sys.path[:0] = {folders}; import {__name__}; print({__name__}.digest())"
    environment = {**os.environ, "PYTHONHASHSEED": "1"}
    other = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    assert other.stdout == f"{digest()}\n"


# --- films
# --------------------------------------------------------------------------------------------------


@pytest.fixture
def plain() -> Iterator[None]:
    """Scenes are made in the style of matplotlib."""
    with matplotlib_style.context("default"):
        yield


@pytest.fixture
def damped(plans_shared: None) -> tuple[propagation.Flight, float]:
    """The flight of two pulses of the example of the physics sheet, and its end."""
    pulses = planning.plan(WIDE, "two-pulse").pulses
    end = pulses.end + WIDE.inertial_period
    return propagation.flown(WIDE, pulses, end), end


@pytest.mark.deep
def test_a_gif_has_its_frames_its_size_and_its_pace(
    damped: tuple[propagation.Flight, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """And the frames are the scene to the pixel."""
    made, end = damped
    timed = timing(WIDE, end, 20, 0.4)
    stream = io.BytesIO()
    done = list[int]()
    monkeypatch.setattr(work, "reach", done.append)
    image.film(stream, made, timed, "a.gif", 401)
    assert done == list(range(1, 9))
    picture = Image.open(stream)
    assert (picture.format, picture.size, getattr(picture, "n_frames", 1)) == ("GIF", (400, 300), 8)
    assert (picture.info["duration"], picture.info["loop"]) == (50, 0)
    scene = style.styled()(Scene)(made, timed, 401)
    frames = []
    for number in range(timed.frames):
        picture.seek(number)
        frames.append(np.asarray(picture.convert("RGB")).astype(int))
        style.styled()(scene.show)(number)
        off = np.abs(frames[-1] - image.LEVELS[style.styled()(scene.pixels)()].astype(int)).max(
            axis=2
        )
        assert np.count_nonzero(off > 40) < 0.002 * off.size  # colours that the palette has not
    assert frames[0][0, 0].tolist() == [255, 255, 255]
    assert np.ptp(frames[0]) > 150  # nothing blank
    for one, other in ((0, 3), (3, 7)):
        assert np.count_nonzero(np.abs(frames[one] - frames[other]).max(axis=2) > 50) > 40


@pytest.mark.deep
def test_a_film_in_which_nothing_moves_has_all_its_frames() -> None:
    made = propagation.flown(spinner(degrees=0.0), Schedule(), 5.0)
    stream = io.BytesIO()
    image.film(stream, made, Timing(5.0, 4, 10, 1.0), "a.gif", 320)
    assert getattr(Image.open(stream), "n_frames", 1) == 4


@pytest.mark.usefixtures("plain")
def test_the_film_begins_before_a_pulse_at_once_and_ends_with_the_motion() -> None:
    body = spinner(degrees=20.0)
    kick = Schedule(
        (Pulse(0.0, 0.0, "steerable", -body.inertia.A * np.append(body.omega0[:2], 0.0)),)
    )
    scene = Scene(
        propagation.flown(body, kick, body.inertial_period),
        Timing(body.inertial_period, 8, 10, 1.0),
        400,
    )
    seen = [
        np.degrees(attitude.angle_between(scene.cones(frame).axis, scene.cones(frame).momentum))
        for frame in (0, 1)
    ]
    assert seen == pytest.approx([20.0, 0.0], abs=1e-9)


@pytest.mark.deep
@pytest.mark.usefixtures("plain")
def test_a_frame_shows_the_cones_of_its_moment_on_scales_that_stand_still(
    damped: tuple[propagation.Flight, float],
) -> None:
    """Marks of H, ω and the spin axis stand where the flight has them, and only once, whatever was
    shown before.
    """
    made, end = damped
    timed = Timing(end, 10, 10, 1.0)
    scene = Scene(made, timed, 400)
    scales = []
    for number in (0, 3, 7):
        scene.show(number)
        scene.pixels()
        scales.append(
            [
                (axes.get_xlim(), axes.get_ylim(), axes.get_position().bounds)
                for axes in scene.figure.axes
            ]
        )
        track = made.sampled(2, float(timed.times[number]) or 1e-9)
        squares = [
            line
            for line in scene.sky.lines
            if line.get_marker() == "s" and np.size(line.get_xdata())
        ]
        (place,) = (np.asarray(square.get_xydata(), dtype=float)[0] for square in squares)
        away = np.degrees(attitude.angle_between(track.axis[-1], track.momentum[0]))
        assert np.hypot(*place) == pytest.approx(away, abs=1e-6)
    assert scales[0] == scales[1] == scales[2]
    assert scene.sky.get_aspect() == scene.space.get_aspect() == 1.0


def diamonds(axes: Axes) -> list[Line2D]:
    """Those drawn: the legend's have no place."""
    return [line for line in axes.lines if line.get_marker() == "D" and np.size(line.get_xdata())]


@pytest.mark.usefixtures("plain")
def test_where_frames_follow_the_turns_a_mark_over_body_axis_1_shows_how_the_body_rolls() -> None:
    made = propagation.flown(spinner(degrees=20.0), Schedule(), 4.0)
    scene = Scene(made, Timing(4.0, 24, 10, 1.0), 320)
    seen = []
    for number in (0, 5):
        scene.show(number)
        (mark,), (solid,) = diamonds(scene.sky), diamonds(scene.space)
        x, y = np.radians(np.asarray(mark.get_xydata(), dtype=float)[0])
        angle = math.hypot(x, y)
        local = np.array(
            [x * math.sin(angle) / angle, y * math.sin(angle) / angle, math.cos(angle)]
        )
        direction = local @ scene.plane
        in_body = attitude.matrix(scene.quaternions[number]).T @ direction
        assert in_body[0] > 0.0
        assert in_body[1] == pytest.approx(0.0, abs=1e-3)
        assert np.asarray(solid.get_xydata())[0] == pytest.approx(
            scene.looked.seen(direction)[0][0], abs=1e-4
        )
        seen.append(direction)
    assert float(seen[0] @ seen[1]) < 0.999
    scene = Scene(made, Timing(4.0, 4, 10, 1.0), 320)
    scene.show(1)
    assert not diamonds(scene.sky)


@pytest.mark.usefixtures("plain")
def test_a_firing_is_announced(damped: tuple[propagation.Flight, float]) -> None:
    made, end = damped
    first = made.schedule.pulses[0]
    scene = Scene(made, Timing(end, 100, 20, 1.0), 400)
    assert "firing" not in scene.caption(first.start - 0.01)
    assert f"firing 1: {first.channel}" in scene.caption(first.t)
    over = scene.caption(first.end + 0.01)  # a short one would else be missed between two frames
    assert f"fired 1: {first.channel}" in over
    assert "firing" not in over
    assert "fire" not in scene.caption(first.end + 2.0 * image.HELD * scene.timed.pace)


@pytest.mark.parametrize(("turns", "seconds"), [(1.0, 6.0), (20.0, 12.0), (1000.0, 30.0)])
def test_the_length_follows_the_turns(turns: float, seconds: float) -> None:
    timed = timing(BODY, turns * BODY.inertial_period, 20, None)
    assert timed.frames == pytest.approx(20 * seconds, abs=1)
    assert timed.smooth == (turns < 100)
    assert timed.pace == pytest.approx(timed.until / seconds, rel=0.02)
    assert timing(BODY, 100.0, 10, 3.0).frames == 30


@pytest.mark.deep
def test_an_ffmpeg_that_fails_is_no_traceback(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, damped: tuple[propagation.Flight, float]
) -> None:
    (tmp_path / "ffmpeg").write_text("#!/bin/sh\ncat > /dev/null\nexit 3\n")
    (tmp_path / "ffmpeg").chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    with pytest.raises(CannotWrite, match="failed with status 3"):
        image.film(io.BytesIO(), damped[0], Timing(damped[1], 2, 10, 1.0), "a.mp4", 320)


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="needs ffmpeg")
def test_an_mp4_is_one(damped: tuple[propagation.Flight, float]) -> None:
    stream = io.BytesIO()
    image.film(stream, damped[0], Timing(damped[1], 6, 10, 1.0), "a.mp4", 400)
    assert stream.getvalue()[4:8] == b"ftyp"
    assert film_format("a.mp4") == "mp4"


# --- every spacecraft with options by chance: nothing breaks, and a file is written


FILES = tuple(sorted(path.stem for path in places.CONFIGS.glob("*.yaml")))
DISPERSED = {
    name
    for name in FILES
    if "\ndispersions:" in (places.CONFIGS / f"{name}.yaml").read_text("utf-8")
}
SPINS = {"couples-minisat": "--spin=-10rpm", "despun-comsat": ""}
"""Spins of those that turn the other way, or do not turn at all."""

TOLERANCES = "--set 'dispersions.omega0={normal: 0.05 deg/s}'"
"""Of the files that have none."""

CASES = ("", "--nominal", "--disperse 300", "--robust", "--robust --disperse 3000")
GOALS = ("", "--spin 10rpm", "--spin keep", "--target 10deg,45deg")
SCHEMES = ("", "--scheme two-pulse", "--scheme four-pulse", "--scheme optimal")
PAGES = (
    "",
    "--trade 2",
    "--with-disturbances",
    "--title T --document D --issue 1 --author A --date 2026-03-01",
)
SAVED = (
    "",
    "--least time",
    "--least pulses",
    "--least impulse",
    "--free-axis",
    "--shift 1deg",
    "--timed",
)
DRAWN = ("--plot p.png", "--figure motion --plot p.svg", "--plot p.pdf")
OTHERS = (
    "simulate --plot p.png",
    "simulate --flown --figure motion --plot p.svg",
    "simulate --scheme none --until 30s --plot p.svg",
    *(
        f"disperse --samples 300 --figure {name} --plot p.svg"
        for name in ("overview", "cases", "momentum")
    ),
    "trade --points 2 --plot p.png",
    "trade --points 2 --allow any --plot p.pdf",
)
FIRST = (
    ("genesis", "", "--spin 10rpm", "", ""),
    ("single-thruster", "--robust --disperse 3000", "", "", ""),
)
"""Reports that broke."""

TABLES = {
    "report -o page.html": ((CASES, GOALS, SCHEMES, PAGES), FIRST),
    "plan": ((("", "--nominal", "--robust"), GOALS, SCHEMES, DRAWN, SAVED), ()),
    "": ((OTHERS, GOALS), ()),
}
"""Options of each command, one of each group; and rows that are among them."""

EACH, DEEP = 6, 4
"""Rows of each spacecraft and command, and how many of a command run in CI, evenly spread."""


def listed() -> Iterator[Any]:
    """All commands, as parameters of a test."""
    drawn = random.Random(1)
    for command, (groups, first) in TABLES.items():
        rows = [*first, *((name, *map(drawn.choice, groups)) for name in EACH * FILES)]
        every = len(rows) // (DEEP - len(first))
        for number, (name, *options) in enumerate(rows):
            words = " ".join(filter(None, (command, *options)))
            words = re.sub(r"--spin \S+", SPINS.get(name, r"\g<0>"), words)
            called, *rest = words.split(" ", 1)
            flown = name in DISPERSED or not re.search("robust|disperse", words)
            text = " ".join([called, f"{name}.yaml", *rest, *[TOLERANCES] * (not flown)])
            yield (deep if number < len(first) or number % every == every // 2 else weekly)(text)


@pytest.mark.parametrize("command", [*listed()])
def test_a_file_is_written_whatever_meets(run: Run, tmp_path: Path, command: str) -> None:
    name = command.split()[1]
    (tmp_path / name).write_bytes((places.CONFIGS / name).read_bytes())
    done = run(*shlex.split(command), status=(0, 3, 4))
    assert "internal error" not in done.stdout + done.stderr
    written = tmp_path / re.findall(r"(?:-o|--plot) (\S+)", command)[0]
    if written.exists() or done.returncode != 3 or command.startswith("report"):
        assert written.read_bytes().lower().startswith(BEGINNINGS[written.suffix].lower())
