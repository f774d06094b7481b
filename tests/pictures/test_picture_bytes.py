"""What is in a picture as a file and in a page: text as text, and the same bytes in every process."""

from __future__ import annotations

import hashlib
import os
import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
from support import places
from support.builders import cross, spinner

from nutdamp import planning
from nutdamp.presentation import figures
from nutdamp.schedule import Schedule, channel_pulse

pytestmark = pytest.mark.usefixtures("plans_shared")


def test_svg_has_its_text_as_text() -> None:
    made, track = figures.shown(planning.plan(spinner(channels=cross(20.0)), "two-pulse"))
    shown = figures.svg(figures.flight_figure("timeline", made, track))
    file = figures.rendered(figures.flight_figure("timeline", made, track), "a.svg").decode()
    for content in (shown, file):
        words = re.findall(r"<text[^>]*>([^<]*)</text>", content)
        assert "Firings" in words
        assert any(word.startswith("1: ") for word in words)
        assert "'DejaVu Sans', 'Bitstream Vera Sans', Verdana, sans-serif" in content
    assert not re.search(r'\sd="[^"]*\.\d{3}', shown)


def test_a_page_has_the_bands_of_all_pulses_of_a_panel_as_one_path() -> None:
    body = spinner(channels=cross(20.0))
    fired = Schedule(tuple(channel_pulse(body.channels[n % 4], 0.5 + 0.7 * n, 0.1) for n in range(30)))
    drawn = figures.flight_figure("history", *figures.shown(planning.Plan(body, "kicks", fired)))
    content = figures.svg(drawn)
    assert ElementTree.fromstring(content).tag.endswith("svg")
    outlines = re.findall(r'<path d="([^"]*)"[^>]*fill-opacity: 0\.25', content)
    assert sorted(outline.count("M") for outline in outlines) == [1, 30, 30, 30, 30]  # the first is in the legend


def digest() -> str:
    """Of the overview, which holds every panel, as a file and in a page."""
    made, track = figures.shown(planning.plan(spinner(channels=cross(20.0)), "four-pulse"))
    file = figures.rendered(figures.flight_figure("overview", made, track), "a.svg")
    return hashlib.sha256(file + figures.svg(figures.flight_figure("overview", made, track)).encode()).hexdigest()


@pytest.mark.weekly
def test_another_process_makes_the_same_bytes() -> None:
    """Here hashes of texts are random, as they are for users; there they are those of the seed 1."""
    folders = [str(places.TESTS), str(Path(__file__).parent)]
    code = f"import sys; sys.path[:0] = {folders}; import {__name__}; print({__name__}.digest())"
    environment = {**os.environ, "PYTHONHASHSEED": "1"}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout == f"{digest()}\n"
