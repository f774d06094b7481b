"""The workbench in a real browser: it computes what `flown` does; drag, keys, limits, copies."""

import csv
import io
import json
import math
import re
import shlex
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import places
from support.builders import present
from support.cases import spread
from support.process import Run, plain_page
from support.shown import compared_text, part

from nutdamp.files.reader import example_text
from nutdamp.flight import propagation
from nutdamp.page.document import Moving
from nutdamp.page.moving import EDITED, moving_of
from nutdamp.page.report import page_html
from nutdamp.physics.attitude import angle_between
from nutdamp.planning.plan import Plan
from nutdamp.spacecraft.model import Goal
from nutdamp.spacecraft.schedule import Schedule

pytestmark = [pytest.mark.browser, pytest.mark.usefixtures("plans_shared")]

EXAMPLE = example_text()
NEARBY = """name: Target from the angular momentum, spin reversed
inertia: {A: 80, C: 120}
state: {spin: -30 rpm, nutation: 8 deg, phase: 70 deg}
steerable: {torque: 40 N m}
goal: {tilt: 10 deg, azimuth: 45 deg}
requirement: {nutation: 0.5 deg, momentum_shift: 0.2 deg}
"""
FLAT = """name: Three moments far apart, spin reversed
inertia: {tensor: [[120, 3, 0], [3, 100, 0], [0, 0, 60]]}
state: {spin: -12 rpm, nutation: 8 deg, phase: 20 deg}
thrusters: [{name: T1, torque: [2, 12, 0.5]}, {name: T2, torque: [-9, 3, 0]}]
"""
LIMITED = """name: Limits
inertia: {A: 120, C: 80}
state: {spin: 30 rpm, nutation: 5 deg, phase: 40 deg}
steerable: {torque: 20 N m}
limits: {horizon: 60 s, earliest: 1 s, gap: 0.2 s, tick: 1 ms, blackout: [[8 s, 9 s]]}
requirement: {nutation: 0.5 deg}
"""
FILES = {
    "example": EXAMPLE,
    "target": places.case("far-target.yaml").read_text(encoding="utf-8"),
    "nearby": NEARBY,
    "flat": FLAT,
    **{
        name: (places.CONFIGS / f"{name}.yaml").read_text(encoding="utf-8")
        for name in (
            "single-thruster",
            "cluster",
            "communications-spinner",
            "lunar-prospector",
            "steerable-stage",
            "magnus-oblate",
        )
    },
}
FILES["single-thruster"] += "sun: [100 deg, 10 deg]\n"  # the angle to it is shown

Browse = Callable[..., Any]
Times = Mapping[int, tuple[float, float]]
"""Start and on-time, s, of changed pulses by their place."""


@cache
def chosen(text: str) -> Plan:
    plan = compared_text(text).recommended
    assert plan is not None
    return plan


@pytest.fixture(scope="module")
def paged(tmp_path_factory: pytest.TempPathFactory) -> Callable[[Moving], Path]:
    """The file of a page with nothing but a moving view, which is quickly made."""
    folder = tmp_path_factory.mktemp("workbench")
    bare = plain_page(compared_text(EXAMPLE))

    def page(view: Moving) -> Path:
        made = replace(bare, motion=view, sections=())
        path = folder / f"{len(list(folder.iterdir()))}.html"
        path.write_text(page_html(made), encoding="utf-8")
        return path

    return page


@pytest.fixture(scope="module")
def written(paged: Callable[[Moving], Path]) -> Callable[[str], Path]:
    """The page of the recommended plan of a spacecraft file, made once."""
    return cache(lambda text: paged(moving_of(chosen(text))))


def changed(
    plan: Plan, times: Times, ratio: float = 0.0, thrust: float = 0.0
) -> propagation.Flight:
    """The flight through real widths with other times, C/A and thrust; the latter in per cent."""
    body = plan.spacecraft
    factor = 1.0 + thrust / 100.0
    pulses = []
    first, second, third = body.inertia.moments
    body = replace(
        body, inertia=replace(body.inertia, moments=(first, second, third * (1.0 + ratio / 100.0)))
    )
    for number, pulse in enumerate(plan.pulses):
        _, on_time = times.get(number, (pulse.start, pulse.on_time))
        scale = factor * (on_time / pulse.on_time if pulse.on_time else 1.0)
        torque = None if pulse.torque is None else pulse.torque * factor
        t = times[number][0] + 0.5 * on_time if number in times else pulse.t
        pulses.append(
            replace(pulse, t=t, on_time=on_time, impulse=pulse.impulse * scale, torque=torque)
        )
    return propagation.flown(body, Schedule(tuple(pulses)), 1.2 * plan.pulses.end + 10.0)


def settle(page: Any) -> None:
    """Wait for the frame in which a change is drawn."""
    page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def shown(page: Any, column: str = "now") -> dict[str, float]:
    """Angles at the end as numbers, rad."""
    settle(page)
    keys = page.eval_on_selector_all(
        ".bench [data-row]", "rows => rows.map((row) => row.dataset.row)"
    )
    return {key: float(part(page, f"{column}-{key}").get_attribute("value")) for key in keys}


def expect(page: Any, flight: propagation.Flight) -> None:
    values = shown(page)
    left = flight.residual
    assert {"nutation", "momentum_shift"} <= set(values)
    assert ("axis_error" in values) == (flight.spacecraft.goal.axis is not None)
    if flight.spacecraft.goal.spin is not None:
        error = abs(flight.settled.spin - flight.spacecraft.goal.spin)
        assert values.pop("spin") == pytest.approx(error, rel=0.0, abs=1e-12)
    for key, value in values.items():
        assert math.degrees(value) == pytest.approx(
            math.degrees(getattr(left, key)), rel=0.0, abs=1e-6
        ), key


def enter(page: Any, number: int, start: float, on_time: float) -> None:
    """Type start and on-time of a pulse; that of an ideal impulse cannot be changed."""
    if part(page, "pulse").is_enabled():
        part(page, "pulse").select_option(index=number)
    part(page, "begin").fill(str(start))
    if part(page, "width").is_enabled():
        part(page, "width").fill(str(on_time))


@spread("name", FILES, quick=5)
def test_the_end_is_that_of_simulate_through_real_widths(
    browse: Browse, written: Any, name: str
) -> None:
    plan = chosen(FILES[name])
    times: dict[int, tuple[float, float]] = {}
    with browse(written(FILES[name])) as page:
        expect(page, changed(plan, {}))
        assert shown(page) == shown(page, "plan")
        for number, pulse in list(enumerate(plan.pulses))[:2]:
            times[number] = (round(0.97 * pulse.start + 0.05, 4), round(0.9 * pulse.on_time, 4))
            enter(page, number, *times[number])
            expect(page, changed(plan, times))
        for ratio, thrust in ((1.0, 0.0), (-0.55, 0.0), (-1.0, 5.0), (0.35, -2.75)):
            part(page, "ratio").fill(str(ratio))
            part(page, "thrust").fill(str(thrust))
            expect(page, changed(plan, times, ratio, thrust))
        part(page, "reset").click()
        expect(page, changed(plan, {}))
        assert not part(page, "reset").is_enabled()


@spread("name", FILES, quick=1)
def test_a_changed_motion_is_drawn_as_it_is_flown(browse: Browse, written: Any, name: str) -> None:
    plan = chosen(FILES[name])
    pulse = plan.pulses.pulses[0]
    times = {0: (round(pulse.start + 0.02, 4), round(1.1 * pulse.on_time, 4))}
    flight = changed(plan, times, 0.5)
    with browse(written(FILES[name])) as page:
        before = part(page, "sky-curves").locator("path.axis").get_attribute("d")
        enter(page, 0, *times[0])
        part(page, "ratio").fill("0.5")
        settle(page)
        assert part(page, "sky-curves").locator("path.axis").get_attribute("d") != before
        last = int(part(page, "slider").get_attribute("max"))
        jumps = [entry.t for entry in flight.schedule if entry.on_time == 0.0]
        for row in (last // 5, last // 3, last // 2, last):
            part(page, "slider").fill(str(row))
            text = part(page, "t").text_content().removesuffix(" s")
            half = 0.5 * 10.0 ** -len(text.split(".")[1])  # the time is rounded
            if min((abs(float(text) - jump) for jump in jumps), default=1.0) < 0.02:
                continue
            near = [flight.sampled(2, max(float(text) + by, 1e-9)) for by in (-half, 0.0, half)]
            angles = {
                "theta": [track.nutation[-1] for track in near],
                "mu": [track.body_cone[-1] for track in near],
                "lambda": [track.space_cone[-1] for track in near],
            }
            for number, keep in enumerate(plan.spacecraft.watched, 1):
                sun = present(keep.direction)
                angles[f"aspect{number}"] = [angle_between(track.axis[-1], sun) for track in near]
            for name_, values in angles.items():
                angle = float(part(page, name_).text_content().removesuffix("°"))
                assert np.degrees(min(values)) - 6e-5 <= angle <= np.degrees(max(values)) + 6e-5
        part(page, "reset").click()
        settle(page)
        assert part(page, "sky-curves").locator("path.axis").get_attribute("d") == before


def test_the_spin_has_its_limit_too(browse: Browse, paged: Callable[[Moving], Path]) -> None:
    plan = chosen(FILES["single-thruster"])  # its pulses change the spin
    spin = 1.002 * plan._flight.settled.spin
    body = replace(plan.spacecraft, goal=Goal(spin=spin))
    with browse(paged(moving_of(replace(plan, spacecraft=body)))) as page:
        expect(page, propagation.flown(body, plan.pulses))
        limit = float(
            part(page, "limit-spin").text_content().removeprefix("≤ ").removesuffix(" rad/s")
        )
        assert limit == pytest.approx(1e-2 * spin, rel=1e-3)  # the default of requirement.spin


def drag(page: Any, index: int, grip: str, by: float) -> None:
    box = page.locator(".firing").nth(index).locator(f".{grip}").bounding_box()
    x, y = box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"]
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 0.5 * by, y)
    page.mouse.move(x + by, y)
    page.mouse.up()


@spread("name", ["example", "target", "steerable-stage"], quick=1)
def test_dragging_a_bar_moves_the_firing_and_its_edge_the_on_time(
    browse: Browse, written: Any, name: str
) -> None:
    plan = chosen(FILES[name])
    with browse(written(FILES[name])) as page:
        page.locator(".strip").scroll_into_view_if_needed()
        box = part(page, "strip").bounding_box()
        data = json.loads(page.locator(".moving script").text_content())
        second = (1.0 - data["lead"]) * box["width"] / data["until"]  # px
        pulse, step = plan.pulses.pulses[0], data["bench"]["step"]
        drag(page, 0, "middle", 40.0)
        start = float(part(page, "begin").input_value())
        on_time = pulse.on_time
        assert start == pytest.approx(pulse.start + 40.0 / second, abs=step)
        expect(page, changed(plan, {0: (start, on_time)}))
        bar = page.locator(".firing").first.bounding_box()
        assert bar["x"] == pytest.approx(
            box["x"] + data["lead"] * box["width"] + second * start, abs=1.5
        )
        if pulse.on_time == 0.0:
            assert page.locator(".firing .last").count() == 0
            return
        drag(page, 0, "last", -4.0)
        longer = float(part(page, "width").input_value())
        assert longer == pytest.approx(on_time - 4.0 / second, abs=step)
        expect(page, changed(plan, {0: (start, longer)}))
        end = start + longer
        drag(page, 0, "first", 3.0)
        begin, width = (float(part(page, field).input_value()) for field in ("begin", "width"))
        assert begin + width == pytest.approx(end, abs=1e-8)
        assert begin == pytest.approx(start + 3.0 / second, abs=step)
        expect(page, changed(plan, {0: (begin, width)}))


def test_values_stand_beside_their_limits_and_nothing_is_judged(
    browse: Browse, written: Any
) -> None:
    with browse(written(EXAMPLE)) as page:
        colour = "(one) => getComputedStyle(one).color"
        plain = part(page, "now-nutation").evaluate(colour)
        for thrust in (-5.0, 5.0, 0.0):
            part(page, "thrust").fill(str(thrust))
            settle(page)
            said = part(page, "thrust").get_attribute("aria-valuetext")
            assert f"nutation {part(page, 'now-nutation').text_content()}, limit ≤ 0.5°" in said
            assert part(page, "now-nutation").evaluate(colour) == plain
            assert not re.search(
                r"\bmet\b", page.locator(".moving").inner_text() + said, re.IGNORECASE
            )
        enter(page, 0, 0.5, 2.5)
        part(page, "width").blur()
        summary = part(page, "summary").text_content()
        assert summary.startswith(
            f"nutation {part(page, 'now-nutation').text_content()}, limit ≤ 0.5°; momentum shift "
        )
        assert summary.endswith(part(page, "broken").text_content())
        assert not re.search(r"\bmet\b", page.locator(".bench").text_content(), re.IGNORECASE)


def test_an_edited_page_says_so_until_it_is_reset(browse: Browse, written: Any) -> None:
    words = "EDITED – NOT THE PLAN ABOVE"
    plan = chosen(EXAMPLE)
    with browse(written(EXAMPLE)) as page:
        title = page.locator(".moving h3").first.text_content().strip()
        assert title == f"Motion: {plan.scheme}"
        banners = page.locator(".edited")
        assert (banners.count(), page.locator(".moving .edited").count()) == (2, 1)
        status = page.locator("#decision .status")
        assert status.locator(".edited").get_attribute("role") == "status"  # is read out, politely
        assert banners.all_text_contents() == ["", ""]
        assert part(page, "begin").input_value() == str(plan.pulses.pulses[0].start)
        for field in ("begin", "width"):
            part(page, field).fill(part(page, field).input_value())
        part(page, "width").blur()
        settle(page)
        assert banners.all_text_contents() == ["", ""]
        assert not part(page, "reset").is_enabled()
        part(page, "begin").fill(str(plan.pulses.pulses[0].start + 1e-12))
        settle(page)
        assert banners.all_text_contents() == [words, words]
        for media in ("screen", "print"):
            page.emulate_media(media=media)
            assert status.locator(".edited").bounding_box() == pytest.approx(
                status.bounding_box(), abs=0.5
            )
            page.evaluate("document.querySelector('#decision').scrollIntoView()")
            box = status.locator(".edited").bounding_box()
            middle = [box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"]]
            assert (
                page.evaluate("([x, y]) => document.elementFromPoint(x, y).className", middle)
                == "edited"
            )
        page.emulate_media(media="screen")
        assert page.locator(".moving .edited").is_visible()
        part(page, "reset").click()
        settle(page)
        assert banners.all_text_contents() == ["", ""]


@pytest.mark.parametrize(
    ("name", "number", "start", "on_time", "text"),
    [
        ("limited", 0, 0.5, 0.5, "pulse 1: start 0.5 s, earliest 1 s"),
        ("limited", 1, 59.9, 0.5, "pulse 2: end 60.4 s, horizon 60 s"),
        ("limited", 1, 8.5, 0.2, "pulse 2: fires in the blackout 8 s to 9 s"),
        ("limited", 0, 2.0005, 0.5, "pulse 1: start 2.0005 s is no multiple of 0.001 s"),
        ("limited", 0, 2.0, 0.5005, "pulse 1: on-time 0.5005 s is no multiple of 0.001 s"),
        ("limited", 1, (0, 0.1), 0.5, "pulse 2: gap 0.1 s, minimum 0.2 s"),
        ("example", 0, 0.5, 0.01, "pulse 1: on-time 0.01 s, minimum 0.02 s"),
        ("example", 0, 0.5, 2.5, "pulse 1: on-time 2.5 s, maximum 2 s"),
        ("example", 0, (1, -0.1), 0.5, "pulse 1: overlaps the firing before it"),
    ],
)
def test_a_broken_limit_is_named(
    browse: Browse,
    written: Any,
    name: str,
    number: int,
    start: float | tuple[int, float],
    on_time: float,
    text: str,
) -> None:
    """``start``, s: from t = 0, or from the end of another pulse."""
    file = LIMITED if name == "limited" else EXAMPLE
    if isinstance(start, tuple):
        other, after = start
        start = round(chosen(file).pulses.pulses[other].end + after, 3)
    with browse(written(file)) as page:
        assert part(page, "broken").text_content() == ""
        enter(page, number, start, on_time)
        settle(page)
        assert part(page, "broken").text_content().startswith("limits broken: pulse ")
        assert text in part(page, "broken").text_content()


@spread("name", ["example", "target", "flat", "single-thruster", "nearby"], quick=1)
def test_the_copied_command_flies_to_the_same_end(
    browse: Browse, paged: Callable[[Moving], Path], run: Run, tmp_path: Path, name: str
) -> None:
    plan = chosen(FILES[name])
    pulse = plan.pulses.pulses[0]
    file = tmp_path / "my sounder.yaml"
    file.write_text(FILES[name], encoding="utf-8")
    view = moving_of(plan, shlex.quote(file.name))
    with browse(paged(view), permissions=["clipboard-read", "clipboard-write"]) as page:
        enter(page, 0, round(pulse.start + 0.03, 4), round(0.95 * pulse.on_time, 4))
        left = shown(page)
        part(page, "copy-csv").click()
        settle(page)
        assert part(page, "copied").text_content() == "Copied."
        assert f"Save the CSV as {EDITED}" in page.locator(".bench").inner_text()
        (tmp_path / EDITED).write_text(
            page.evaluate("navigator.clipboard.readText()"), encoding="utf-8"
        )
        part(page, "copy-command").click()
        settle(page)
        command = page.evaluate("navigator.clipboard.readText()")
    rows = list(csv.DictReader(io.StringIO((tmp_path / EDITED).read_text(encoding="utf-8"))))
    assert [row["channel"] for row in rows] == [entry.channel for entry in plan.pulses]
    assert [float(row["start_s"]) for row in rows[1:]] == [
        entry.start for entry in plan.pulses.pulses[1:]
    ]
    assert command == f"nutdamp simulate 'my sounder.yaml' --schedule {EDITED} --flown"
    done = run(*shlex.split(command)[1:], "-q", "--json", "-", status=(0, 4))
    ended = json.loads(done.stdout)["flown"]
    for key, value in left.items():
        assert math.degrees(value) == pytest.approx(ended[f"{key}_deg"], rel=0.0, abs=1e-6)


def test_the_keyboard_does_everything(browse: Browse, written: Any) -> None:
    """Each tab stop is a control with a name that can be changed; what can do nothing is none."""
    plan = chosen(EXAMPLE)
    with browse(written(EXAMPLE)) as page:
        part(page, "pulse").focus()
        page.keyboard.press("ArrowDown")
        assert float(part(page, "begin").input_value()) == pytest.approx(
            plan.pulses.pulses[1].start, abs=1e-8
        )
        stops = []
        for _ in range(6):
            page.keyboard.press("Tab")
            stops.append(page.evaluate("document.activeElement.dataset.part"))
        assert stops == ["begin", "width", "ratio", "thrust", "copy-csv", "copy-command"]
        part(page, "thrust").focus()
        page.keyboard.press("ArrowRight")
        expect(page, changed(plan, {}, 0.0, 0.25))
        part(page, "begin").focus()
        page.keyboard.press("ArrowUp")
        start = float(part(page, "begin").input_value())
        assert start > plan.pulses.pulses[1].start
        expect(page, changed(plan, {1: (start, plan.pulses.pulses[1].on_time)}, 0.0, 0.25))
        part(page, "reset").focus()
        page.keyboard.press("Enter")
        expect(page, changed(plan, {}))
        assert page.evaluate("document.activeElement.dataset.part") == "begin"


def test_the_cones_roll_on_each_other(browse: Browse, written: Any) -> None:
    for text, side in ((EXAMPLE, 1.0), (NEARBY, -1.0)):  # prolate outside, oblate around
        with browse(written(text)) as page:
            last = int(part(page, "slider").get_attribute("max"))
            for row in (0, last // 5, last // 2):
                part(page, "slider").fill(str(row))
                body, space = (
                    [
                        float(part(page, "cones").locator(f"circle.{name}").get_attribute(key))
                        for key in ("cx", "cy", "r")
                    ]
                    for name in ("body", "space")
                )
                between = math.dist(body[:2], space[:2])
                assert between == pytest.approx(body[2] + side * space[2], abs=0.5)
                mu, theta = (
                    float(part(page, name).text_content().removesuffix("°"))
                    for name in ("mu", "theta")
                )
                assert body[2] / between == pytest.approx(mu / theta, rel=1e-3)


@pytest.mark.parametrize("name", ["example", "target"])
def test_it_fits_one_screen_and_a_phone(browse: Browse, written: Any, name: str) -> None:
    with browse(written(FILES[name]), 1280) as page:
        first = "document.querySelector('{}').getBoundingClientRect().bottom"
        assert page.evaluate(first.format("#decision")) <= 800.0
        assert page.evaluate(first.format(".controls")) <= 840.0
    with browse(written(FILES[name]), 400) as page:
        wide = (
            "[...document.querySelectorAll('.bench, .bench *')]"
            ".filter((one) => one.checkVisibility())"
        )
        assert page.evaluate(
            f"{wide}.every((one) => one.getBoundingClientRect().right <= innerWidth)"
        )


def test_an_accessibility_checker_finds_nothing_in_a_changed_workbench(
    browse: Browse, written: Any, violations: Callable[..., Any]
) -> None:
    for scheme in ("light", "dark"):
        with browse(written(EXAMPLE), 1280, scheme) as page:
            enter(page, 0, 0.5, 0.01)
            settle(page)
            assert part(page, "broken").text_content() != ""
            assert violations(page) == []
