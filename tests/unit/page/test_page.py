"""The page of report, without a browser: what stands on it, its manoeuvre sheet, and what a board
needs.
"""

import base64
import csv
import hashlib
import io
import json
import math
import re
import shlex
from dataclasses import replace
from functools import cache
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from support import places, reference
from support.builders import present
from support.cases import deep, weekly
from support.golden import check_text
from support.process import Run, plain_page
from support.shown import WIDE, Node, cells, downloaded, facts, section, sheet, tree
from support.spinners import FILE

import nutdamp
from nutdamp.api import trade
from nutdamp.figures import style
from nutdamp.files.reader import example_text, read_spacecraft
from nutdamp.files.schedules import read_blocks, read_plan
from nutdamp.flight import propagation
from nutdamp.flight.end_state import spin_phases
from nutdamp.montecarlo.study import Results, run, study_of
from nutdamp.page import moving
from nutdamp.page.document import Control, Moving, Prose
from nutdamp.page.report import CONDITIONS, Repeat, assumptions, block_html, page_html, report_page
from nutdamp.physics import attitude
from nutdamp.planning import plan as planning
from nutdamp.planning.decision import Comparison, compare
from nutdamp.planning.screening import CASES, Checkpoints, even, first_pulses
from nutdamp.planning.verdict import Status
from nutdamp.schemes.block_model import fired
from nutdamp.schemes.catalogue import CLASSIC, Options
from nutdamp.spacecraft import directions
from nutdamp.spacecraft.equipment import Block
from nutdamp.spacecraft.model import Disturbance, Goal, Keep, Limits, Requirement, Spacecraft
from nutdamp.spacecraft.schedule import Schedule
from nutdamp.views import guide
from nutdamp.views.decisions import comparison_json
from nutdamp.views.verdict import HEADLINES, statement

pytestmark = pytest.mark.usefixtures("plans_shared")

VALVE = "valve: {open_delay: 8 ms, close_delay: 12 ms, rise_time: 5 ms, fall_time: 10 ms}\n"
TANK = "tank: {propellant: 30 kg, pressure: 22 bar, final_pressure: 8 bar, exponent: 1}\n"
CALM = "name: X\ninertia: {A: 120, C: 80}\nomega0: [0, 0, 3]\n"
NO_THRUSTERS = CALM.replace("[0, 0, 3]", "[0.1, 0, 3]")
NASTY = """# </pre><script>alert(1)</script> and `ticks` ``` in a comment
name: '<b>&"|*'
inertia: {A: 120, C: 80}
state: {spin: 30 rpm, nutation: 5 deg, phase: 40 deg}
thrusters:
  - {name: '<i>"[x](y)', torque: [8, 0, 0], isp: 220, lever_arm: 1}
  - {name: 'a|b', torque: [-8, 0, 0], isp: 220, lever_arm: 1}
  - {name: "'&amp;", torque: [0, 8, 0], isp: 220, lever_arm: 1}
  - {name: '$D$', torque: [0, -8, 0], isp: 220, lever_arm: 1}
disturbances:
  - {name: <u>wind, torque: [0.001, 0, 0]}
requirement: {nutation: 0.5 deg}
"""


@cache
def compared_text(
    text: str, schemes: tuple[str, ...] = CLASSIC, samples: int | None = 0
) -> Comparison:
    """The comparison of schemes for the text of a spacecraft file, with nominal values if not told
    otherwise.
    """
    return compare(read_spacecraft(text, "craft.yaml"), schemes, samples=samples)


@cache
def page(text: str, *schemes: str, pictured: bool = False, samples: int | None = 0) -> str:
    make = report_page if pictured else plain_page
    repeat = Repeat("nutdamp report 'a <b>.yaml'", "a <b>.yaml", text)
    return page_html(make(compared_text(text, schemes or CLASSIC, samples), repeat))


@pytest.fixture
def nasty() -> Node:
    return tree(page(NASTY, "two-pulse"))


def scripts(node: Node) -> list[Node]:
    """What a browser would run: other types are data."""
    return [one for one in node.all("script") if "type" not in one.attributes]


def test_commands_name_the_spacecraft_by_its_file_if_there_is_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    keys = (("limits.gap", "1 s"), ("mass", "210"))
    repeat = Repeat("", "my craft.yaml", CALM, keys, ("--spin=keep",))
    assert repeat.craft() == Repeat("", "", "").craft() == "SPACECRAFT"
    Path(repeat.name).write_text(CALM, encoding="utf-8")
    assert repeat.craft() == "'my craft.yaml' '--set=limits.gap=1 s' --set=mass=210 --spin=keep"
    assert repeat.craft(built_in=True) == "'--set=limits.gap=1 s' --set=mass=210 --spin=keep"


# --- form
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "scheme", "pictured"),
    [
        (NO_THRUSTERS, "four-pulse", False),
        deep(NASTY, "two-pulse", False),
        *(weekly(text, "two-pulse", True) for text in (CALM, NASTY, example_text())),
    ],
)
def test_it_is_well_formed_and_needs_no_network(text: str, scheme: str, pictured: bool) -> None:
    content = page(text, scheme, pictured=pictured)
    assert ("NO PULSE needed" in content) == (text is CALM)
    assert content.startswith("<!DOCTYPE html>\n<html lang=")
    shown = tree(content)
    ids = [node.attributes["id"] for node in shown if "id" in node.attributes]
    assert len(ids) == len(set(ids))
    for node in shown:
        for key, value in node.attributes.items():
            if key in ("href", "src", "xlink:href", "data", "srcset", "action"):
                assert value.startswith(("#", "data:,", "data:text/yaml;base64,"))
                assert not value.startswith("#") or value[1:] in ids
            if not key.startswith("xmlns") and not value.startswith("data:"):
                assert "//" not in value or key == "aria-label"
        for used in re.findall(r"url\((.*?)\)", " ".join(node.attributes.values())):
            assert used.strip("'\"").removeprefix("#") in ids
    for drawing in shown.all("svg"):
        assert {"aria-label", "viewbox"} <= {*drawing.attributes}
    (style_sheet,) = shown.all("style")
    assert not re.search(r"@import|url\(", style_sheet.text)
    for table in shown.all("table"):
        (caption,) = table.all("caption")
        assert caption.text
        for row in table.all("tr"):
            heads = [node for node in row if node.tag == "th"]
            assert heads
            assert all(head.attributes["scope"] in ("col", "row") and head.text for head in heads)
        assert len({len(row) for row in cells(table)}) == 1
    digest = base64.b64encode(hashlib.sha256(scripts(shown)[0].text.encode()).digest()).decode()
    (policy,) = (
        node.attributes["content"] for node in shown.all("meta") if "http-equiv" in node.attributes
    )
    wanted = ["default-src 'none'", "style-src 'unsafe-inline'", f"script-src 'sha256-{digest}'"]
    assert policy.split("; ")[:3] == wanted


@pytest.mark.deep
def test_what_a_file_says_stays_text(nasty: Node) -> None:
    assert nasty.all("h1")[0].text == '<b>&"|*: damp 5° nutation'.replace(": ", " · ")
    assert not nasty.all("u")
    assert not any(node.text for node in nasty.all("i"))
    for node in nasty.all("b"):
        assert node.text.rstrip(":") in (*CLASSIC, "warning", "FLY") or "Basilisk" in node.text
    assert len(scripts(nasty)) == 1
    named = [
        row[0].text for table in section(nasty, "background").all("table") for row in cells(table)
    ]
    assert {'<i>"[x](y)', "<u>wind"} <= set(named)
    assert nasty.all("pre")[1].text == "nutdamp report 'a <b>.yaml'"
    (link,) = nasty.all("a")
    assert (link.attributes["download"], link.text) == ("a <b>.yaml", "Download a <b>.yaml")
    assert downloaded(link) == NASTY


def test_dark_pages_lighten_the_colours_that_the_pictures_use() -> None:
    css = (places.ROOT / "nutdamp" / "page" / "page.css").read_text(encoding="utf-8")
    used = (
        style.MOTION,
        style.PULSE,
        style.MOMENTUM,
        style.FIRED,
        style.TURNED,
        style.MISSED,
        style.UNCHECKED,
        style.GREY,
    )
    assert set(re.findall(r"(?:stroke|fill): (#\w+)\"\]", css)) == {
        colour.lower() for colour in used
    }


def test_options_and_relations_stay_in_one_line() -> None:
    shown = block_html(Prose("report --disperse flies them; < 1e-9 deg is left, a-b breaks"))
    assert '<span class="whole-word">--disperse</span> flies' in shown
    assert '<span class="whole-word">&lt; 1e-9 deg</span> is left, a-b breaks' in shown


# --- schemes and schedule
# --------------------------------------------------------------------------------------------


@pytest.mark.deep
@pytest.mark.parametrize(("samples", "recommended"), [(0, "four-pulse"), (None, "two-pulse")])
def test_comparison_and_schedule_say_what_the_json_says(
    samples: int | None, recommended: str
) -> None:
    both = compared_text(example_text(), CLASSIC, samples)
    shown = tree(page(example_text(), samples=samples))
    data = comparison_json(both)
    for row, plan in zip(
        sheet(section(shown, "schemes"), "Cost and residuals"), data["plans"], strict=True
    ):
        assert row["scheme"] == plan["scheme"]
        for head, expected in {
            "end s": plan["end_s"],
            "propellant g": 1e3 * plan["propellant_kg"],
            "momentum shift deg": plan["flown"]["momentum_shift_deg"],
        }.items():
            told = float(row[head].removeprefix("< "))
            assert told == pytest.approx(expected, rel=1e-3, abs=1e-9)
        assert (row["verdict"] == "met") is (plan["status"] == "fly")
    (marked,) = (one for one in shown.all("tr") if one.attributes.get("class") == "mark")
    assert marked.all("th")[0].text == data["recommended"] == recommended


@pytest.mark.deep
def test_valves_and_tank_are_told_and_commanded_on_times_apart_from_effective_ones() -> None:
    plain, valved = (page(example_text() + more, "two-pulse") for more in ("", VALVE + TANK))
    told = "11.73 bar"
    assert (told in plain, told in valved) == (False, True)
    for text, through in ((plain, False), (valved, True)):
        heads = sheet(section(tree(text), "background"), "Pulses of")[0]
        assert ("on-time s" in heads, "effective on-time s" in heads) == (True, through)


@pytest.mark.parametrize(
    ("text", "schemes", "title", "state", "sections"),
    [
        (NO_THRUSTERS, ("four-pulse",), "X · damp 2.862° nutation", "missed", 2),
        (example_text() + "goal: {tilt: 10 deg, azimuth: 45 deg}\n", ("rhumb-line",),
         "Sounder-1 · damp 5° nutation, turn by 10°", "caution", 4),
        (example_text() + "wheel: {momentum: 40 N m s}\n", ("one-pulse",),
         "Sounder-1 · damp 5° nutation", "missed", 4),
    ],
)  # fmt: skip
def test_the_page_says_what_is_to_be_done_and_why_there_is_no_plan(
    text: str, schemes: tuple[str, ...], title: str, state: str, sections: int
) -> None:
    """With a wheel it says what its equations mean."""
    made = plain_page(compared_text(text, schemes))
    shown = tree(made)
    assert (made.title, made.state, len(made.sections)) == (title, state, sections)
    assert ("H3 = Cω3 + h" in shown.text) == ("\nwheel:" in text)
    if sections == 2:
        assert made.headline[0] == "NO PLAN"
        table, *_ = section(shown, "schemes").all("table")
        assert cells(table)[1][-1].text == "no thrusters"
        assert "the file has no thrusters" in shown.text


def test_only_assumptions_that_apply_are_told() -> None:
    texts = [*assumptions(compared_text(CALM, ("one-pulse",)))]
    assert len(texts) == len(guide.limits()) - len(CONDITIONS)
    assert [text for text in texts if text.startswith("Rigid body")]
    several = [*assumptions(compared_text(NASTY, ("two-pulse",)))]
    assert [text.split()[0] for text in several if text not in texts] == [
        "Disturbances",
        "two-pulse",
    ]
    for begin in CONDITIONS:
        assert [text for text in guide.limits() if text.startswith(begin)], begin


@pytest.mark.weekly
def test_what_an_earlier_end_costs_stands_on_the_page_with_the_recommended_plan_marked() -> None:
    both = compared_text(example_text())
    fronts = trade(both.spacecraft, 3).fronts
    part = section(tree(report_page(both, Repeat("", "", ""), traded=fronts)), "trade")
    tables = part.all("table")
    assert len(tables) == 2
    numbers = [row[0].text for table in tables for row in cells(table)[1:]]
    assert numbers == [str(n) for n in range(1, 1 + sum(len(front.points) for front in fronts))]
    words = {text.text for text in part.all("text")}
    other = "" if present(both.recommended).scheme == "optimal" else " (not traded)"
    assert {
        f"recommended: {present(both.recommended).scheme}{other}",
        "H ends where it was",
    } <= words
    assert len([word for word in words if " over the lower bound, " in word]) == 1
    assert "H may end anywhere" in part.text
    assert 'id="trade"' not in page(example_text())


DISPERSED = """name: Wide
inertia: {A: 120, C: 80}
state: {spin: 30 rpm, nutation: 5 deg}
steerable: {torque: 20 N m}
requirement: {nutation: 0.5 deg, probability: 90 %}
dispersions: {A: {normal: SIGMA}}
"""


@pytest.mark.parametrize(("sigma", "good"), [deep("5 %", False), weekly("0.1 %", True)])
def test_dispersions_enter_the_verdict(sigma: str, good: bool) -> None:
    both = compared_text(DISPERSED.replace("SIGMA", sigma), ("two-pulse",), 1000)
    assert present(both.recommended).meets_requirement
    results = run(
        Results(study_of(both.spacecraft, present(both.recommended).pulses), 1000), threads=1
    )
    distribution = results.distribution("nutation")
    assert distribution is not None
    made = (report_page if good else plain_page)(both, Repeat("", "", ""))
    assert (made.verdict, made.state) == (statement(both.verdict), "met" if good else "missed")
    (line,) = made.lines
    within = line.bound.used(present(line.dispersed)) <= 1.0
    assert (both.verdict.met, line.met, within) == (good, good, good)
    part = section(tree(made), "dispersion")
    first = sheet(part, "What is left")[0]
    assert first["quantity"] == "nutation, deg"
    assert float(first["90 %"]) == pytest.approx(
        math.degrees(distribution.quantiles(np.array([0.9]))[0]), rel=2e-3
    )
    assert float(first["max"]) == pytest.approx(math.degrees(distribution.maximum), rel=1e-3)
    assert bool(part.all("svg")) == good  # of the good one pictures are made
    assert "A" in {row["input"] for row in sheet(part, "Tolerance budget")}
    captions = [one.text for one in part.all("caption")]
    assert "Requirement" not in captions  # it stands on the first screen


# --- the manoeuvre sheet: what is loaded, when to begin, when to hold, and the cases that say so


def turning(text: str, degrees: float, azimuth: float = math.radians(82.0)) -> Spacecraft:
    """The spacecraft of a file, with a target so many degrees away."""
    body = read_spacecraft(text, "f.yaml", ())
    return body.replace(
        goal=Goal(axis=directions.direction_in_n(body, math.radians(degrees), azimuth))
    )


def manoeuvre(body: Spacecraft, scheme: str, cases: int = 0) -> Node:
    """The section of a page, without pictures."""
    control = Control(document="ND-014", issue="2")
    compared = nutdamp.compare(body, [scheme], samples=cases)
    return section(
        tree(plain_page(compared, Repeat("", "f.yaml", "name: X"), control=control)), "manoeuvre"
    )


@cache
def example() -> Node:
    """The sheet of the built-in example."""
    return manoeuvre(nutdamp.example(), "two-pulse", 3000)


def numbers(text: str) -> list[float]:
    """The numbers of a text."""
    return [float(number) for number in re.findall(r"[+-]?\d+\.?\d*(?:e-?\d+)?", text)]


@pytest.mark.deep
def test_rows_are_the_pulses_as_they_are_loaded() -> None:
    body = nutdamp.example()
    chosen = planning.plan(nutdamp.example(), "two-pulse")
    _, after = chosen._flight.around_pulses()
    for row, pulse, left in zip(
        sheet(example(), "Fire"), chosen.pulses, np.degrees(after.nutation), strict=True
    ):
        assert (row["start s"], row["on-time s"]) == (f"{pulse.start:.3f}", f"{pulse.on_time:.3f}")
        assert float(row["spin phase deg"]) == pytest.approx(
            math.degrees(body.spin * pulse.start) % 360.0, abs=0.06
        )
        assert (row["thrusters"], row["done"]) == (pulse.channel, "☐")
        assert float(row["nutation after deg"]) == pytest.approx(left, abs=5e-3)
    given = facts(example(), "Document")
    assert given["document"] == "ND-014 iss 2"
    assert given["input file"].startswith("f.yaml, SHA-256 ")
    assert facts(example(), "Totals")["totals"].startswith(
        "pulses: 2; on-time 3.068 s; 14.22 g; the last ends at 7.434 s"
    )
    assert {row["sheet"] for row in sheet(example(), "Signatures")} == {"prepared", "checked"}


@pytest.mark.deep
def test_conditions_and_ranges_are_those_of_flown_cases() -> None:
    """The same draws through the study itself: of the motion at t = 0, of the end, and of a
    schedule that is late.
    """
    body = nutdamp.example()
    pulses = planning.plan(nutdamp.example(), "two-pulse").pulses
    study = study_of(body, pulses)
    go = facts(example(), "GO at t = 0")
    draws, _ = study.source().block(0)
    cases = study.model.cases(
        {name: draw if isinstance(draw, float) else draw[:CASES] for name, draw in draws.items()}
    )
    momentum = np.array(
        [np.broadcast_to(i * w, CASES) for i, w in zip(cases.moments, cases.omega0, strict=True)]
    )
    nutation = np.degrees(np.arccos(momentum[2] / np.linalg.norm(momentum, axis=0)))
    assert numbers(go["nutation"])[:2] == pytest.approx(
        np.quantile(nutation, [0.0015, 0.9985]), rel=5e-3
    )
    spins = np.broadcast_to(cases.omega0[2], CASES) * 30.0 / math.pi
    assert numbers(go["spin"])[:2] == pytest.approx(np.quantile(spins, [0.0015, 0.9985]), rel=1e-4)
    early, late, *_ = numbers(go["phase window"].partition("(")[2].replace("to ", ""))
    for shift, share in ((early, 0.997), (late, 0.997), (1.5 * early, 0.0), (1.5 * late, 0.0)):
        moved = replace(pulses, pulses=tuple(pulse.moved(shift) for pulse in pulses))
        fraction = present(run(Results(study_of(body, moved), CASES)).met_fraction)
        assert (fraction >= 0.997) == (share > 0.0), shift


def flown(body: Spacecraft, schedule: Schedule) -> NDArray[np.float64]:
    """Residuals of the first cases, (outputs, cases)."""
    return present(run(Results(study_of(body, schedule), CASES)).values)


@pytest.mark.deep
def test_limits_to_hold_are_of_cases_that_end_well_and_the_last_accepts_what_is_required() -> None:
    """Of this body two in three cases end well, of which half are required."""
    limits = {"nutation": "0.5 deg", "momentum_shift": "0.2 deg", "probability": 0.5}
    body = nutdamp.example().with_(
        requirement=limits, dispersions={"A": {"normal": "1 %"}, "thrust": {"normal": "3 %"}}
    )
    plan = planning.plan(body, "two-pulse")
    nutation, shift = np.degrees(flown(body, plan.pulses)[:2])
    well = (nutation <= 0.5) & (shift <= 0.2)
    assert 0.5 < well.mean() < 0.8
    after = np.degrees(flown(body, first_pulses(plan.pulses, 1))[0][well])
    first, last = (
        row["hold if outside deg"] for row in sheet(manoeuvre(body, "two-pulse", 3000), "Fire")
    )
    assert numbers(first) == pytest.approx([after.min(), after.max()], abs=5.1e-3)
    assert last == "accept ≤ 0.5"


@pytest.mark.deep
def test_rows_of_command_blocks_are_blocks_with_counts_and_the_sun_phase() -> None:
    body = turning(FILE, 9.0)
    shown = manoeuvre(body, "command-block")
    fired = planning.plan(body, "command-block").pulses
    (row,) = sheet(shown, "Fire")
    (block,) = fired.blocks
    assert (row["block"], row["pulses"], row["first Sun pulse"]) == (
        "1",
        str(block.count),
        str(block.first),
    )
    delay, counts = numbers(row["delay s (counts)"])
    assert (delay, counts) == (block.delay, present(body.commands).counts("delay", block.delay))
    # Without nutation the Sun phase is the delay times the spin.
    assert float(row["Sun phase deg"]) == pytest.approx(
        math.degrees(block.delay * body.spin) % 360.0, abs=0.3
    )
    assert f"T{row['start UTC']}Z" in (body.utc(fired.pulses[0].loaded[0], 3) or "")


STRICT, LOOSE = Requirement(nutation=1e-4), Requirement(nutation=0.2, probability=0.9)


@pytest.mark.parametrize(
    ("status", "change", "cases"),
    [
        (Status.FLY, {"requirement": LOOSE}, 100),
        (Status.FLY, {"dispersions": None}, 0),
        (Status.FLY, {"dispersions": None, "requirement": None}, 0),
        (Status.NOT_SHOWN, {}, 100),
        (Status.NOT_SHOWN, {"dispersions": None, "requirement": LOOSE}, 0),
        (Status.NOT_ENOUGH, {"requirement": STRICT}, 100),
        (
            Status.NO_PULSE,
            {"dispersions": None, "requirement": replace(LOOSE, probability=None)},
            0,
        ),
        (Status.NOT_COMMANDABLE, None, 0),
    ],
)
def test_only_a_sheet_to_fly_has_conditions_limits_to_hold_boxes_and_signatures(
    status: Status, change: dict[str, Any] | None, cases: int
) -> None:
    body = turning(FILE, 3.0) if change is None else nutdamp.example().replace(**change)
    scheme = (
        "rhumb-line" if change is None else "none" if status is Status.NO_PULSE else "two-pulse"
    )
    compared = nutdamp.compare(body, [scheme], samples=cases)
    page = tree(plain_page(compared))
    assert compared.verdict.status is status
    told = page.all("main")[0].text
    assert {words for words in HEADLINES.values() if re.search(rf"\b{words}\b", told)} == {
        HEADLINES[status]
    }
    shown = section(page, "manoeuvre")
    flies = status is Status.FLY
    captions = {caption.text for caption in shown.all("caption")}
    heads = {head.text for head in shown.all("th")}
    alarms = [one.text for one in shown.all("p") if one.attributes.get("class") == "alarm"]
    assert (alarms[:1] == ["NOT FOR FLIGHT"]) is bool(status.exit_status)
    assert any(caption.startswith("GO at t = 0") for caption in captions) is flies
    assert ("Signatures" in captions) is ("☐" in shown.text) is flies
    for head in ("hold if outside deg", "decide before", "done"):
        assert (head in heads) is flies


DATED = {
    "attitude": {"quaternion": [1, 0, 0, 0], "epoch": "2026-03-01T12:00:00Z", "frame": "EME2000"}
}


@pytest.mark.parametrize(("gap", "more"), [("1 s", {}), ("12 s", {}), ("12 s", DATED)])
def test_a_row_says_when_to_decide_unless_the_coast_is_too_short(
    gap: str, more: dict[str, Any]
) -> None:
    first, last = sheet(
        manoeuvre(nutdamp.example().with_(limits={"gap": gap}, **more), "two-pulse"), "Fire"
    )
    assert last["decide before"] == "–"
    decided = first["decide before"]
    if gap == "1 s":
        assert decided == "automatic"
    elif more:
        assert decided == last["start UTC"]
    else:
        assert float(last["start s"]) - 0.1 < numbers(decided)[0] <= float(last["start s"])


@pytest.mark.deep
@pytest.mark.parametrize(
    ("settings", "shown"),
    [
        ({"limits": {"tick": "2.5 ms"}}, 4),
        ({"dispersions": {"timing": {"uniform": "20 ms"}}}, 2),
        ({}, 3),
    ],
)
def test_times_are_no_finer_than_the_file_can_tell(settings: dict[str, object], shown: int) -> None:
    row, *_ = sheet(manoeuvre(nutdamp.example().with_(**settings), "two-pulse"), "Fire")
    assert {len(row[name].partition(".")[2]) for name in ("start s", "on-time s")} == {shown}


def test_the_nutation_after_each_pulse_is_that_of_the_reference() -> None:
    """Nutation and Sun angle after each pulse against Euler's equations by DOP853."""
    body = turning(FILE, 3.0, 0.5)
    plan = planning.plan(body, "rhumb-line")
    _, after = plan._flight.around_pulses()
    motion = reference.Motion(body.omega0, attitude.matrix(body.initial.quaternion))
    now = 0.0
    moments = np.asarray(body.inertia.moments)
    for index, pulse in enumerate(plan.pulses):
        (motion,) = reference.coast(
            body.inertia.moments, motion, np.zeros(3), np.array([pulse.start - now])
        )
        (motion,) = reference.coast(
            body.inertia.moments, motion, present(pulse.torque), np.array([pulse.on_time])
        )
        now = pulse.end
        momentum = motion.rotation @ (moments * motion.rates)
        assert float(after.nutation[index]) == pytest.approx(
            reference.angle(momentum, motion.rotation[:, 2]), abs=1e-7
        )
        seen = float(attitude.angle_between(after.momentum[index], present(body.sun)))
        assert seen == pytest.approx(reference.angle(momentum, present(body.sun)), abs=1e-7)


@pytest.mark.deep
def test_a_window_ends_at_half_a_turn_or_where_the_first_pulse_would_come_before_t_0() -> None:
    body = nutdamp.example()
    points = Checkpoints(study_of(body, planning.plan(body, "two-pulse").pulses))
    assert points.window(1.0 + 1e-9) is None
    assert present(points.window(0.0)) == pytest.approx((-math.pi / body.spin, math.pi / body.spin))
    soon = replace(
        points.study.model.schedule,
        pulses=tuple(pulse.moved(-0.6) for pulse in points.study.model.schedule),
    )
    early = present(Checkpoints(study_of(body, soon)).window(0.0))
    assert early.least == pytest.approx(-soon.pulses[0].start)


def test_checkpoints_are_even_and_the_first_pulses_are_those_of_the_first_blocks() -> None:
    body = turning(FILE, 3.0, 0.5)
    made = planning.plan(body, "command-block").pulses
    part = first_pulses(made, 4)
    assert [block.count for block in part.blocks] == [4]
    assert part.pulses == made.pulses[:4]
    assert propagation.flown(body, part).settled.spin == pytest.approx(body.spin)
    assert (even(1, 8), even(3, 8), even(10, 12)) == ([1], [1, 2, 3], list(range(1, 11)))
    assert (even(57, 8)[0], even(57, 8)[-1], len(even(57, 8))) == (1, 57, 8)


# --- what a board needs: the decision, the data, thresholds, how to repeat it, who signs

ACE = places.CONFIGS / "ace.yaml"


@cache
def compared_ace() -> Comparison:
    return compare(nutdamp.load(ACE), ["two-pulse"], samples=0)


@cache
def ace(**control: str) -> Node:
    """The page of a body with an attitude and an epoch, without pictures."""
    repeat = Repeat("nutdamp report", "ace.yaml", ACE.read_text("utf-8"))
    return tree(plain_page(compared_ace(), repeat, control=Control(**control)))


@pytest.mark.deep
def test_pulses_have_date_phase_and_cones() -> None:
    start = facts(ace(), "ACE")
    assert start["on-time"] == "in steps of 30 ms, 60 ms to 0.48 s"
    assert start["Sun sensor"].startswith("at azimuth 0 deg")
    body = compared_ace().spacecraft
    chosen = present(compared_ace().recommended)
    around = dict(zip(("before", "after"), chosen._flight.around_pulses(), strict=True))
    for index, (pulse, row) in enumerate(
        zip(chosen.pulses, sheet(ace(), "Pulses of"), strict=True)
    ):
        assert f"T{row['start UTC']}Z" in (body.utc(pulse.start, 3) or "")
        x, y, _ = attitude.matrix(chosen._flight.motion(np.array([pulse.start]))[1][0]).T @ present(
            body.sun
        )
        assert float(row["Sun phase deg"]) == pytest.approx(
            -math.degrees(math.atan2(y, x)) % 360.0, abs=0.051
        )
        for cone in ("nutation", "body_cone", "space_cone"):
            for when, track in around.items():
                shown = float(row[f"{cone.replace('_', ' ')} {when} deg"])
                assert shown == pytest.approx(math.degrees(getattr(track, cone)[index]), rel=1e-3)


def test_the_spin_phase_is_the_integral_of_the_spin() -> None:
    """Against Euler's equations by DOP853, with three moments and a torque about axis 3."""
    body = nutdamp.example().replace(disturbances=(Disturbance(0.0, 0.4),), dispersions=None)
    times = np.array([0.0, 3.0, 11.0, 40.0])
    phases = spin_phases(propagation.flown(body, nutdamp.plan(body, "none").pulses, 41.0), times)
    assert phases == pytest.approx(
        body.spin * times + 0.5 * 0.4 / body.inertia.C * times**2, rel=1e-12
    )
    uneven = nutdamp.load(ACE)
    made = propagation.flown(uneven, nutdamp.plan(uneven, "none").pulses, 61.0)
    grid = np.linspace(0.0, 60.0, 6001)
    motions = reference.coast(
        made.moments, reference.Motion(uneven.omega0, np.eye(3)), np.zeros(3), grid[1:]
    )
    spins = np.array([uneven.spin, *(one.rates[2] for one in motions)])
    assert spin_phases(made, grid[[-1]])[0] == pytest.approx(np.trapezoid(spins, grid), rel=1e-7)


@pytest.mark.deep
def test_the_verification_is_a_line_and_the_equations_are_those_of_the_guide() -> None:
    verified = section(ace(), "verification")
    assert re.search(
        r"DOP853( and Basilisk)? agree \(within 1e-09 rad\)", verified.all("p")[0].text
    )
    checks = {row["method"]: row for row in sheet(verified, "Maximum differences")}
    assert float(checks["DOP853, the file alone"]["Δaxis rad"].removeprefix("< ")) <= 1e-9
    (listing,) = (one.text for one in ace().all("pre") if "M(17)" in one.text)
    for number in ("M(1)", "M(17)", "M(18)", "M(19)"):
        assert re.search(rf"^{re.escape(number)} ", listing, re.MULTILINE)
    symbols = facts(ace(), "Symbols")
    assert symbols["J_v"] == "impulse of pulse v, N m s: about axis 1, + i times that about axis 2"


@pytest.mark.deep
def test_configuration_control_is_written_as_given() -> None:
    given = {"document": "ND-7", "issue": '2 "b"', "author": "M. Ö", "date": "2026-03-01"}
    controlled = ace(title="ACE <1>", **given)
    assert controlled.all("h1")[0].text == "ACE <1>"
    assert ace(title="Slew 2").all("h1")[0].text == "ACE · Slew 2", "the name stays"
    # With three moments the file's 0.6° is that of t = 0.
    assert ace().all("h1")[0].text == "ACE · damp 0.6° nutation"
    digest = hashlib.sha256(ACE.read_bytes()).hexdigest()
    for node, expected in ((controlled, 'ND-7 iss 2 "b" · M. Ö · 2026-03-01 · '), (ace(), "")):
        (line,) = (one.text for one in node.all("p") if one.attributes.get("class") == "control")
        assert line == f"{expected}input {digest[:8]}"
    footer = r'content: "ND\2d 7\20 iss\20 2\20 \22 b\22 \2c \20 2026\2d 03\2d 01\2c \20 input\20 '
    assert footer in controlled.all("style")[0].text


@pytest.mark.deep
@pytest.mark.usefixtures("plain_pages")
def test_input_is_known_by_its_digest_and_the_date_is_that_of_the_build_where_none_is_given(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert run("init", "craft.yaml").returncode == 0
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1772366400")
    digest = hashlib.sha256((tmp_path / "craft.yaml").read_bytes()).hexdigest()
    for more, said in (((), "2026-03-01"), (("--date", "1 May 2026"), "1 May 2026")):
        asked = (
            "report",
            "craft.yaml",
            "--nominal",
            "--scheme",
            "two-pulse",
            "-o",
            "page.html",
            *more,
        )
        assert run(*asked).returncode == 0
        content = (tmp_path / "page.html").read_text("utf-8")
        assert f'<p class="control">{said} · input {digest[:8]}</p>' in content
        assert facts(tree(content), "Versions")["input file"] == f"craft.yaml, SHA-256 {digest}"
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "yesterday")
    check_text("page.date", run("report", "-o", "c.html", status=2).stderr)


@pytest.mark.deep
@pytest.mark.usefixtures("plain_pages")
@pytest.mark.parametrize(
    ("tolerances", "state"), [((), "met"), (("--set", "dispersions.A={normal: 1 %}"), "missed")]
)
def test_the_top_of_the_page_has_the_bounds_of_the_screen(
    run: Run, tmp_path: Path, tolerances: tuple[str, ...], state: str
) -> None:
    """With the tolerances of the file enough cases comply with one scheme; with A known to 1 % with
    none.
    """
    schemes = [part for name in CLASSIC for part in ("--scheme", name)]
    run("report", *schemes, *tolerances, "-o", "page.html")
    lines = run("plan", *schemes, *tolerances, columns=120).stdout.splitlines()
    page = tree((tmp_path / "page.html").read_text("utf-8"))
    decision = section(page, "decision")
    assert decision.attributes["class"] == state
    assert [node.text for node in decision.all("p")[:2]] == lines[1:3]
    head, *body = cells(decision.all("table")[0])
    shown = {row[0].text: [cell.text for cell in row[1:]] for row in body}
    assert [cell.text for cell in head[:6]] == [
        "requirement",
        "limit",
        "nominal",
        "99.7 % within",
        "keep it",
        "margin",
    ]
    for line in (line for line in lines if line.partition("  ")[0] in shown):
        label, *texts = re.split(r"  +", line)
        assert shown.pop(label) == texts
    assert shown == {}


@pytest.mark.parametrize("scheme", ["two-pulse", "optimal"])
def test_the_first_screen_lists_up_to_eight_pulses_else_the_first_and_the_last(
    scheme: str,
) -> None:
    compared = compared_text(example_text(), (scheme,), None)
    made = plain_page(compared)
    pulses = present(compared.recommended).pulses
    shown = present(made.pulses).rows
    assert [row[0] for row in shown] == ["1", str(len(pulses))]
    assert made.count == len(pulses)
    link = f'The first and the last of {len(pulses)}; all are on the <a href="#manoeuvre">'
    assert (link in page_html(made)) == (len(pulses) > 8) == (scheme == "optimal")


# --- the rows of the moving view: they are those of simulate, and lie where the scales say

AT_REST = "name: Calm\ninertia: {A: 120, C: 80}\nomega0: [0, 0, 3]\n"
TEXTS = {
    "example": example_text(),
    "target": places.case("far-target.yaml").read_text(encoding="utf-8"),
    "three": """name: Three moments
inertia: {tensor: [[120, 3, 0], [3, 100, 0], [0, 0, 60]]}
state: {spin: 6 rpm, nutation: 20 deg}
steerable: {torque: 20 N m}
""",
    "single": """name: One thruster, spin reversed
inertia: {A: 80, C: 120}
state: {spin: -30 rpm, nutation: 3 deg}
thrusters: [{name: T1, torque: [0, 12, 0]}]
limits: {max_pulses: 1}
""",
    "calm": AT_REST,
    "small": "name: Small\ninertia: {A: 120, C: 80}\nstate: {spin: 30 rpm, nutation: 0.0004 deg}\n",
    "steep": (places.CONFIGS / "sounding-rocket-payload.yaml").read_text(encoding="utf-8"),
    "leap": (places.CONFIGS / "single-thruster.yaml").read_text(encoding="utf-8"),
}


def chosen(text: str) -> planning.Plan:
    return present(compared_text(text, samples=None).recommended)


@cache
def view(text: str) -> tuple[Moving, dict[str, Any], dict[str, list[int]]]:
    """The view, its data, and their columns as the script adds them up."""
    made = moving.moving_of(chosen(text))
    data = json.loads(made.data)
    return made, data, {name: list(accumulate(steps)) for name, steps in data["columns"].items()}


def simulated(run: Run, text: str) -> list[dict[str, str]]:
    """What the command in the caption writes."""
    command = (
        " ".join(view(text)[0].shown["command"]).replace("SPACECRAFT", "-").removesuffix("FILE")
    )
    screen = run(*shlex.split(command)[1:], "-", "-q", stdin=text, status=(0, 4))
    return list(csv.DictReader(io.StringIO(screen.stdout)))


@pytest.mark.parametrize("name", ["schedule", "blocks", "disturbances", deep("scheme")])
def test_the_command_in_the_caption_gives_the_rows_of_the_view(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """It names the file that the plan came from, whatever its name."""
    monkeypatch.chdir(tmp_path)
    text = (
        places.case("cb1015.yaml").read_text(encoding="utf-8")
        if name == "blocks"
        else TEXTS["example"]
    )
    text += "disturbances: [{torque: [20 mN m, 0, 0]}]\n" * (name == "disturbances")
    Path("my craft.yaml").write_text(text, encoding="utf-8")
    body = read_spacecraft(text, "my craft.yaml")
    if name == "blocks":
        header = "block,channel,first_sun_pulse,count,every,delay_s,width_s"
        Path("b 2.csv").write_text(
            f"{header}\n1,J2,6,1,1,0.972287825122,0.487394\n", encoding="utf-8"
        )
        plan = planning.Plan(
            body, "b 2.csv", fired(body, read_blocks("b 2.csv", body)[0]), _from_file=True
        )
    elif name == "schedule":
        planning.plan(body, "two-pulse").to_csv("p 2.csv")
        plan, _ = read_plan("p 2.csv", body)
    else:
        plan = planning.plan(body, "two-pulse", Options(with_disturbances=name == "disturbances"))
    made = moving.moving_of(plan, "'my craft.yaml'")
    assert made.shown["scheme"] == plan.scheme
    *words, file = shlex.split(" ".join(made.shown["command"]))
    assert file == "FILE"
    done = run(*words[1:], "-", "-q", status=(0, 4))
    rows = list(csv.DictReader(io.StringIO(done.stdout)))
    data = json.loads(made.data)
    digits = data["digits"]["cone"]
    shown = [f"{value / 10**digits:.{digits}f}" for value in accumulate(data["columns"]["theta"])]
    assert shown == [f"{float(row['nutation_deg']):z.{digits}f}" for row in rows]


def test_no_command_is_named_that_would_fly_other_pulses() -> None:
    plan = chosen(TEXTS["example"])
    sunlit = replace(plan.spacecraft, goal=Goal(sun=np.array([1.0, 0.0, 0.0])))
    for other in (replace(plan, scheme="robust"), replace(plan, spacecraft=sunlit)):
        assert moving.moving_of(other).shown["command"] == ()


def column(track: list[dict[str, str]], *keys: str) -> np.ndarray:
    return np.array([[float(row[key]) for key in keys] for row in track])


@pytest.mark.parametrize(
    "name", ["target", "three", "calm", *map(deep, ("example", "single", "small", "steep", "leap"))]
)
def test_each_row_is_that_of_simulate(run: Run, name: str) -> None:
    _, data, rows = view(TEXTS[name])
    track = simulated(run, TEXTS[name])
    assert {len(numbers) for numbers in rows.values()} == {len(track)}
    for what, key in (
        ("t", "t_s"),
        ("theta", "nutation_deg"),
        ("mu", "body_cone_deg"),
        ("lambda", "space_cone_deg"),
    ):
        digits = data["digits"]["t" if what == "t" else "cone"]
        shown = [f"{value / 10**digits:.{digits}f}" for value in rows[what]]
        assert shown == [f"{float(row[key]):z.{digits}f}" for row in track]
    axis = column(track, "axis_x", "axis_y", "axis_z")
    momentum = column(track, "momentum_x_Nms", "momentum_y_Nms", "momentum_z_Nms")
    globe = (("axis", axis), ("H", momentum / np.linalg.norm(momentum, axis=1, keepdims=True)))
    assert ("axis1" in rows) == ("H3" in rows) == (name == "target")  # the globe
    for prefix, expected in globe if name == "target" else ():
        on_sphere = np.array([rows[f"{prefix}{number}"] for number in (1, 2, 3)]).T / moving.SPHERE
        assert on_sphere == pytest.approx(expected, abs=0.51 / moving.SPHERE)
    framed = read_spacecraft(TEXTS[name], "craft.yaml").attitude is not None
    longitude, latitude = (
        (rows["angle1"], rows["angle2"]) if framed else (rows["angle2"], rows["angle1"])
    )
    for (x, y, z), along, above in zip(axis.tolist(), longitude, latitude, strict=True):
        across = math.hypot(x, y)
        height = math.atan2(z, across) if framed else math.atan2(across, z)
        assert above / 1e4 == pytest.approx(math.degrees(height), abs=6e-5)
        if along == moving.NONE:
            assert across < 1e-10
        else:
            way = math.radians(along / 1e4)
            assert (math.cos(way), math.sin(way)) == pytest.approx(
                (x / across, y / across), abs=2e-6
            )
            assert 0 <= along < 360 * 10**4


@pytest.mark.parametrize("name", ["example", "three", "small"])
def test_the_pole_curve_lies_where_its_scale_says(run: Run, name: str) -> None:
    made, _, rows = view(TEXTS[name])
    panel = made.shown["panels"][0]
    rates = column(simulated(run, TEXTS[name]), "omega_1_rad_s", "omega_2_rad_s", "omega_3_rad_s")
    axes = read_spacecraft(
        TEXTS[name], "craft.yaml"
    ).inertia.axes  # principal axes, which the panel names
    unit = {"deg/s": 1.0, "mdeg/s": 1e3}[panel["y"]["name"].removeprefix("ω2, ")]
    slopes = list[float]()
    for place, scale in enumerate((panel["x"], panel["y"])):
        numbers = [float(text.replace("−", "-")) / unit for _, text in scale["marks"]]
        slope, start = np.polyfit([where for where, _ in scale["marks"]], numbers, 1)
        shown = slope * np.array(rows[f"pole{place + 1}"]) + start
        assert shown == pytest.approx(np.degrees(rates @ axes)[:, place], abs=1.6 * abs(slope))
        slopes.append(abs(slope))
    assert slopes[0] == pytest.approx(slopes[1], rel=5e-3)


@pytest.mark.parametrize("name", ["example", "single", "small", "leap"])
def test_a_row_says_what_fires(name: str) -> None:
    _, data, rows = view(TEXTS[name])
    pulses = list(enumerate(chosen(TEXTS[name]).pulses, 1))
    scale = 10 ** data["digits"]["t"]
    half = 0.51 / scale
    fired = set()
    for time, which in zip(rows["t"], rows["firing"], strict=True):
        text = data["firings"][which]
        named = {int(number) for number in re.findall(r"(\d+): ", text)}
        inside = {n for n, one in pulses if one.start + half < time / scale < one.end - half}
        around = {n for n, one in pulses if one.start - half <= time / scale <= one.end + half}
        assert inside <= named <= around
        assert (text == "none") == (not named)
        fired |= named
    assert fired == {n for n, _ in pulses}


def test_dates_are_exact_through_a_leap_second_and_without_an_epoch_there_are_none() -> None:
    _, data, rows = view(
        TEXTS["leap"]
    )  # its epoch is ten seconds before the end of 2016, which has a 61st
    digits = data["digits"]["t"]
    dates = [data["utc"]["head"] + tail for tail in data["utc"]["tails"]]
    assert dates[0] == "2016-12-31T23:59:50." + digits * "0" + "Z"
    for time, date in zip(rows["t"], dates, strict=True):
        seconds, part = divmod(time, 10**digits)
        clock = (
            f"2016-12-31T23:59:{50 + seconds}"
            if seconds <= 10
            else f"2017-01-01T00:00:{seconds - 11:02d}"
        )
        off = abs(int(date[-1 - digits : -1]) - part)
        assert date == f"{clock}.{part:0{digits}d}Z" or off in (1, 10**digits - 1)
    assert any(":60." in date for date in dates)
    made, data, _ = view(TEXTS["single"])
    assert (made.shown["dated"], data["utc"]) == (False, None)


def test_the_target_is_a_mark_and_a_circle_and_further_circles_are_taken_as_data() -> None:
    _, data, _ = view(TEXTS["target"])
    (named,) = data["named"]
    assert (named["name"], named["kind"]) == ("target", "target")
    (circle,) = named["circles"]
    assert (circle["radius"], circle["kind"]) == (pytest.approx(math.radians(4)), "target")
    x, y, z = named["axis"]
    assert (math.degrees(math.atan2(y, x)), math.degrees(math.asin(z))) == pytest.approx(
        (-90, -30), abs=1e-3
    )
    assert data["target"] is not None
    plan = chosen(TEXTS["target"])
    star = replace(plan.spacecraft, keep=(Keep("star", np.array([0.0, 0.6, 0.8]), 0.2),))
    assert json.loads(moving.moving_of(replace(plan, spacecraft=star)).data)["named"] == [
        named,
        {
            "name": "star",
            "kind": "watched",
            "watched": True,
            "axis": [0.0, 0.6, 0.8],
            "circles": [
                {"name": "axis at least 11.46 deg from star", "radius": 0.2, "kind": "keep-out"}
            ],
        },
    ]


def test_sun_and_cones_of_the_file_are_on_the_globe(run: Run) -> None:
    only = TEXTS["target"] + "sun: [100 deg, 10 deg]\n"
    assert [one["name"] for one in view(only)[1]["named"]] == ["target", "Sun"]
    cones = """keep:
  - {name: Sun </script>, direction: sun, min: 4 deg, max: 170 deg}
  - {name: pole, direction: [0 deg, 90 deg], min: 2 deg}
"""
    made, data, rows = view(only + cones)
    assert "</script" not in made.data
    _, sun, pole = data["named"]
    assert (sun["name"], pole["name"]) == ("Sun </script>", "pole")
    circles = [(one["kind"], round(math.degrees(one["radius"]), 6)) for one in sun["circles"]]
    assert circles == [("keep-out", 4.0), ("keep-in", 170.0)]
    assert pole["axis"] == [0.0, 0.0, 1.0]
    axis = column(simulated(run, only + cones), "axis_x", "axis_y", "axis_z")
    for name, direction in (("aspect1", sun["axis"]), ("aspect2", pole["axis"])):
        assert np.cos(np.radians(np.array(rows[name]) / 1e4)) == pytest.approx(
            axis @ direction, abs=4e-6
        )


@pytest.mark.parametrize(
    ("body", "until", "required", "outside", "cones"),
    [
        (replace(WIDE, requirement=Requirement(nutation=math.radians(0.5))), 20.0, True, "", True),
        (replace(WIDE, requirement=Requirement(nutation=math.radians(50.0))), 20.0, False,
         "50 deg", True),
        # A despun body turns about an axis square to its own: μ is 90°, whatever θ is.
        (nutdamp.load(places.CONFIGS / "despun-comsat.yaml"), 60.0, True, "", False),
    ],
)  # fmt: skip
def test_the_strip_has_room_for_the_nutation_and_what_is_required(
    body: Spacecraft, until: float, required: bool, outside: str, cones: bool
) -> None:
    made = propagation.flown(body, planning.plan(body, "two-pulse").pulses, until)
    strip, (low, high) = moving.strip_of(made, made.sampled(200, until), until)
    assert ((strip["required"] is not None), strip["outside"], strip["cones"]) == (
        required,
        outside,
        cones,
    )
    assert (low < math.degrees(present(present(body.requirement).nutation)) < high) == required
    assert cones or -0.1 < low < 0.0 < 0.5 < high < 0.6


def test_the_strip_has_the_times_without_firings() -> None:
    body = replace(
        WIDE, limits=Limits(earliest=2.0, blackout=((5.0, 7.0), (19.0, 25.0)), horizon=60.0)
    )
    made = propagation.flown(body, Schedule(), 20.0)
    strip, _ = moving.strip_of(made, made.sampled(200, 20.0), 20.0)
    wide = 2000.0 * (1.0 - moving.LEAD) / 20.0  # units of the SVG in a second
    for shown, (first, last) in zip(strip["closed"], ((0, 2), (5, 7), (19, 20)), strict=True):
        begin = 2000.0 * moving.LEAD + wide * first
        assert shown == pytest.approx((begin, wide * (last - first)), abs=0.06)


@pytest.mark.parametrize(
    ("text", "dots"),
    [
        (TEXTS["steep"], False),
        (NO_THRUSTERS + "limits: {earliest: 3000 s, horizon: 3600 s}\n", True),
    ],
)
def test_a_track_has_rows_enough_or_is_drawn_as_dots_and_the_data_stay_small(
    text: str, dots: bool
) -> None:
    made, data, rows = view(text)
    turns = data["until"] / read_spacecraft(text, "a.yaml").body_period
    assert (len(rows["t"]) >= 24 * turns) != dots == data["dots"]
    assert len(rows["t"]) < moving.MOST_ROWS + 20
    assert len(made.data) < 160_000


@pytest.mark.parametrize("until", [1e-3, 2.0, 89.3, 4321.0, 1e7])
def test_playing_takes_seconds_to_minutes(until: float) -> None:
    speeds, first = moving._speeds(until)
    assert first in dict(speeds)
    assert dict(speeds)[1.0] == "real time"
    assert all(4.0 <= until / speed <= 120.0 * (1 + 1e-9) for speed, _ in speeds if speed != 1.0)
    assert 10.0 <= until / first <= 25.0


# --- workbench: what its script computes is tested in a browser
# -------------------------------------------------------


@pytest.mark.parametrize(
    ("more", "reason"),
    [
        ("dissipation: {time_constant: 600 s}", "energy dissipation"),
        ("disturbances: [{torque: [20 mN m, 0, 0]}]", "disturbance torques"),
        ("wheel: {momentum: 1 N m s}", "a wheel"),
        deep("tank: {propellant: 30 kg, pressure: 22 bar, final_pressure: 8 bar}", "blowdown"),
        deep("cold: {first: 90 %, pulses: 4}", "cold pulses"),
        deep(
            "valve: {open_delay: 8 ms, close_delay: 12 ms, rise_time: 5 ms, fall_time: 10 ms}",
            "valves",
        ),
    ],
)
def test_other_bodies_have_none_and_the_view_has_the_reason(more: str, reason: str) -> None:
    made, data, _ = view(f"{TEXTS['example']}\n{more}\n")
    assert (made.shown["workbench"], data["bench"]) == (None, None)
    shown = block_html(made)
    assert f"No workbench ({reason})" in shown
    assert 'class="bench"' not in shown


def test_its_data_are_the_plan_and_the_limits_of_the_file() -> None:
    plan = chosen(TEXTS["three"])
    blocks = replace(plan.pulses, blocks=(Block("T1", 1, 0.1, 0.1, 3),))
    reasons = [moving.absence(plan.spacecraft, each) for each in (plan.pulses, Schedule(), blocks)]
    assert reasons == ["", "no pulses", "command blocks"]
    assert not present(view(TEXTS["three"])[0].shown["workbench"])["rolling"]
    text = TEXTS["example"] + (
        "limits: {horizon: 60 s, earliest: 1 s, gap: 0.2 s, tick: 1 ms, blackout: [[30 s, 31 s]]}\n"
    )
    made, data, _ = view(text)
    assert present(made.shown["workbench"])["rolling"]
    bench = data["bench"]
    pulses = chosen(text).pulses.pulses
    assert [(entry["start"], entry["on"], entry["channel"]) for entry in bench["pulses"]] == [
        (pulse.start, pulse.on_time, pulse.channel) for pulse in pulses
    ]
    assert [entry["impulse"] for entry in bench["pulses"]] == [
        pulse.impulse.tolist() for pulse in pulses
    ]
    assert {(entry["least"], entry["most"]) for entry in bench["pulses"]} == {(0.02, 2.0)}
    limits = {
        "earliest": 1.0,
        "horizon": 60.0,
        "gap": 0.2,
        "tick": 1e-3,
        "blackout": [[30.0, 31.0]],
        "most": None,
    }
    assert bench["limits"] == limits
    assert [(key, limit) for key, _, limit in present(made.shown["workbench"])["rows"]] == [
        ("nutation", "≤ 0.5°"),
        ("momentum_shift", "≤ 0.2°"),
    ]


def test_with_a_target_the_axis_error_is_bounded_and_ideal_impulses_have_no_on_time() -> None:
    made, data, _ = view(TEXTS["target"])
    rows = [(key, limit) for key, _, limit in present(made.shown["workbench"])["rows"]]
    assert rows == [("nutation", ""), ("momentum_shift", ""), ("axis_error", "≤ 4°")]
    pulses = data["bench"]["pulses"]
    assert {(entry["on"], entry["torque"], entry["most"]) for entry in pulses} == {
        (0.0, None, None)
    }
