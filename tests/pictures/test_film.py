"""Films: as many frames as said, each of them the motion at its moment."""

from __future__ import annotations

import io
import itertools
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from matplotlib import style as matplotlib_style
from PIL import Image
from support.builders import cross, spinner

from nutdamp import flight, planning
from nutdamp.errors import BadRequest, CannotWrite, MissingExtra
from nutdamp.flight import Flight
from nutdamp.physics.attitude import angle_between
from nutdamp.presentation.figures import animation, style
from nutdamp.presentation.figures.animation import Scene, Timing, film_format, timing
from nutdamp.schedule import Pulse, Schedule
from nutdamp.spacecraft import Spacecraft

pytestmark = pytest.mark.usefixtures("plans_shared")


def flown(body: Spacecraft, pulses: Schedule | None = None) -> tuple[Flight, float]:
    made = planning.plan(body, "two-pulse").pulses if pulses is None else pulses
    end = made.end + body.inertial_period
    return flight.flown(body, made, end), end


def film(
    made: Flight, timed: Timing, path: str, width: int, progress: Callable[[int], object] = lambda _: None
) -> bytes:
    """The content of the file."""
    stream = io.BytesIO()
    animation.film(stream, made, timed, path, width, progress)
    return stream.getvalue()


def test_a_gif_has_its_frames_its_size_and_its_pace() -> None:
    made, end = flown(spinner(channels=cross(20.0)))
    done: list[int] = []
    content = film(made, timing(made.spacecraft, end, 20, 0.6), "a.gif", 401, done.append)
    picture = Image.open(io.BytesIO(content))
    assert picture.format == "GIF"
    assert picture.size == (400, 240)
    assert getattr(picture, "n_frames", 1) == 12
    assert picture.info["duration"] == 50
    assert done == list(range(1, 13))
    frames = []
    for number in (0, 5, 11):
        picture.seek(number)
        frames.append(np.asarray(picture.convert("RGB")).astype(int))
    assert frames[0][0, 0].tolist() == [255, 255, 255]
    assert np.ptp(frames[0]) > 150  # nothing blank
    for one, other in ((0, 1), (1, 2)):
        assert np.count_nonzero(np.abs(frames[one] - frames[other]).max(axis=2) > 50) > 40


@pytest.mark.deep
def test_each_frame_is_written_before_the_next_is_drawn() -> None:
    """So that a film of any length takes the memory of a frame; and the frames are the scene to the pixel."""
    made, end = flown(spinner(channels=cross(20.0)))
    timed = timing(made.spacecraft, end, 10, 1.0)
    stream, sizes = io.BytesIO(), []
    animation.film(stream, made, timed, "a.gif", 320, lambda _: sizes.append(stream.tell()))
    assert len(sizes) == timed.frames == 10
    assert all(one < other for one, other in itertools.pairwise(sizes))
    assert sizes[-1] == len(stream.getvalue()) - 1
    picture = Image.open(stream)
    scene = style.styled(Scene)(made, timed, 320)
    for number in range(timed.frames):
        picture.seek(number)
        style.styled(scene.show)(number)
        drawn = animation.LEVELS[style.styled(scene.pixels)()].astype(int)
        off = np.abs(np.asarray(picture.convert("RGB")).astype(int) - drawn).max(axis=2)
        assert np.count_nonzero(off > 40) < 0.002 * off.size  # colours that the palette has not
    assert picture.info["loop"] == 0


def test_a_film_in_which_nothing_moves_has_all_its_frames() -> None:
    body = spinner(degrees=0.0)
    content = film(flight.flown(body, Schedule(), 5.0), Timing(5.0, 4, 10, 1.0), "a.gif", 320)
    assert getattr(Image.open(io.BytesIO(content)), "n_frames", 1) == 4


def test_the_film_begins_before_a_pulse_at_once_and_ends_with_the_motion() -> None:
    body = spinner(degrees=20.0)
    kick = Schedule((Pulse(0.0, 0.0, "steerable", -body.inertia.A * np.append(body.omega0[:2], 0.0)),))
    made, end = flown(body, kick)
    with matplotlib_style.context("default"):
        scene = Scene(made, Timing(end, 8, 10, 1.0), 400)
    assert np.degrees(angle_between(scene.cones(0).axis, scene.cones(0).momentum)) == pytest.approx(20.0)
    assert np.degrees(angle_between(scene.cones(1).axis, scene.cones(1).momentum)) == pytest.approx(0.0, abs=1e-9)


def test_a_frame_shows_the_cones_of_its_moment() -> None:
    """Marks of H, ω and the spin axis stand where the flight has them, and only once, whatever was shown before."""
    made, end = flown(spinner(80, 120, -3.0, 30.0, channels=cross(40.0)))
    timed = Timing(end, 10, 10, 1.0)
    with matplotlib_style.context("default"):
        scene = Scene(made, timed, 400)
        for number in (0, 3, 7):
            scene.show(number)
            track = made.sampled(2, float(timed.times[number])) if number else made.sampled(2, 1e-9)
            away = np.degrees(angle_between(track.axis[-1], track.momentum[0]))
            squares = [line for line in scene.sky.lines if line.get_marker() == "s" and np.size(line.get_xdata())]
            assert len(squares) == 1
            place = np.asarray(squares[0].get_xydata(), dtype=float)[0]
            assert np.hypot(*place) == pytest.approx(away, abs=1e-6)


def test_the_scales_stand_still() -> None:
    made, end = flown(spinner(channels=cross(20.0)))
    with matplotlib_style.context("default"):
        scene = Scene(made, Timing(end, 6, 10, 1.0), 400)
        seen = []
        for number in range(6):
            scene.show(number)
            scene.pixels()
            seen.append([(axes.get_xlim(), axes.get_ylim(), axes.get_position().bounds) for axes in scene.figure.axes])
    assert all(one == seen[0] for one in seen)
    assert scene.sky.get_aspect() == scene.space.get_aspect() == 1.0


def test_a_firing_is_announced() -> None:
    made, end = flown(spinner(channels=cross(20.0)))
    first = made.schedule.pulses[0]
    with matplotlib_style.context("default"):
        scene = Scene(made, Timing(end, 100, 20, 1.0), 400)
    assert "firing" not in scene.caption(first.start - 0.01)
    assert f"firing 1: {first.channel}" in scene.caption(first.t)
    over = scene.caption(first.end + 0.01)  # a short one would else be missed between two frames
    assert f"fired 1: {first.channel}" in over
    assert "firing" not in over
    assert "fire" not in scene.caption(first.end + 2.0 * animation.HELD * scene.timed.pace)


@pytest.mark.parametrize(("turns", "seconds"), [(1.0, 6.0), (20.0, 12.0), (1000.0, 30.0)])
def test_the_length_follows_the_turns(turns: float, seconds: float) -> None:
    body = spinner()
    timed = timing(body, turns * body.inertial_period, 20, None)
    assert timed.frames == pytest.approx(20 * seconds, abs=1)
    assert timed.smooth == (turns < 100)
    assert timed.pace == pytest.approx(timed.until / seconds, rel=0.02)
    assert timing(body, 100.0, 10, 3.0).frames == 30


def test_other_endings_are_refused() -> None:
    for path in ("a.webm", "gif", "a.png"):
        with pytest.raises(BadRequest, match=r"\.gif, \.mp4"):
            film_format(path)
    assert film_format("-") == film_format("b.GIF") == "gif"


def test_without_ffmpeg_or_matplotlib_the_cure_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    with pytest.raises(CannotWrite, match=r"ffmpeg.*\.gif"):
        film_format("a.mp4")
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingExtra, match="plot"):
        film_format("a.gif")


def test_an_ffmpeg_that_fails_is_no_traceback(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    broken = tmp_path / "ffmpeg"
    broken.write_text("#!/bin/sh\ncat > /dev/null\nexit 3\n")
    broken.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    made, end = flown(spinner(channels=cross(20.0)))
    with pytest.raises(CannotWrite, match="ffmpeg failed with status 3"):
        film(made, Timing(end, 2, 10, 1.0), "a.mp4", 320)


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="needs ffmpeg")
def test_an_mp4_is_one() -> None:
    made, end = flown(spinner(channels=cross(20.0)))
    content = film(made, Timing(end, 6, 10, 1.0), "a.mp4", 400)
    assert content[4:8] == b"ftyp"
    assert animation.film_format("a.mp4") == "mp4"
