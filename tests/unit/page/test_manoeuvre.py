"""The manoeuvre sheet: what is loaded, when to begin, when to hold, and the cases that say so."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from support import reference
from support.markup import Node
from support.pages import plain_page
from support.shown import facts, section, sheet, tree
from support.spinners import FILE

import nutdamp
from nutdamp.files.reader import read_spacecraft
from nutdamp.flight import propagation
from nutdamp.montecarlo.study import Results, run, study_of
from nutdamp.page.document import Control
from nutdamp.page.report import Repeat
from nutdamp.physics import attitude
from nutdamp.planning import plan as planning
from nutdamp.planning.screening import CASES, Checkpoints, even, first_pulses
from nutdamp.planning.verdict import Status
from nutdamp.spacecraft.model import Goal, Requirement, Spacecraft
from nutdamp.spacecraft.schedule import Schedule
from nutdamp.views.verdict import HEADLINES

pytestmark = pytest.mark.usefixtures("plans_shared")

DISPERSED = f"""{FILE}
dispersions:
  A: {{normal: 2 %}}
  omega0: [{{normal: 0.1 deg/s}}, {{normal: 0.1 deg/s}}, {{normal: 0.5 %}}]
  thrust: {{normal: 3 %}}
"""


def turning(text: str, degrees: float, azimuth: float = math.radians(82.0)) -> Spacecraft:
    """The spacecraft of a file, with a target so many degrees away."""
    body = read_spacecraft(text, "f.yaml", ())
    return body.replace(goal=Goal(axis=body.direction_in_n(math.radians(degrees), azimuth)))


def manoeuvre(body: Spacecraft, scheme: str, cases: int = 0) -> Node:
    """The section of a page, without pictures."""
    control = Control(document="ND-014", issue="2")
    compared = nutdamp.compare(body, [scheme], samples=cases)
    return section(tree(plain_page(compared, Repeat("", "f.yaml", "name: X"), control=control)), "manoeuvre")


@cache
def example() -> Node:
    """The sheet of the built-in example."""
    return manoeuvre(nutdamp.example(), "two-pulse", 3000)


def numbers(text: str) -> list[float]:
    """The numbers of a text."""
    return [float(number) for number in re.findall(r"[+-]?\d+\.?\d*(?:e-?\d+)?", text)]


@pytest.mark.deep
def test_rows_are_the_pulses_as_they_are_loaded() -> None:
    body, chosen = nutdamp.example(), planning.plan(nutdamp.example(), "two-pulse")
    _, after = chosen.flight.around_pulses()
    for row, pulse, left in zip(sheet(example(), "Fire"), chosen.pulses, np.degrees(after.nutation), strict=True):
        assert (row["start s"], row["on-time s"]) == (f"{pulse.start:.3f}", f"{pulse.on_time:.3f}")
        assert float(row["spin phase deg"]) == pytest.approx(math.degrees(body.spin * pulse.start) % 360.0, abs=0.06)
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
    """The same draws through the study itself: of the motion at t = 0, of the end, and of a schedule that is late."""
    body, pulses = nutdamp.example(), planning.plan(nutdamp.example(), "two-pulse").pulses
    study = study_of(body, pulses)
    go = facts(example(), "GO at t = 0")
    draws, _ = study.source().block(0)
    cases = study.model.cases({name: draw if isinstance(draw, float) else draw[:CASES] for name, draw in draws.items()})
    momentum = np.array([np.broadcast_to(i * w, CASES) for i, w in zip(cases.moments, cases.omega0, strict=True)])
    nutation = np.degrees(np.arccos(momentum[2] / np.linalg.norm(momentum, axis=0)))
    assert numbers(go["nutation"])[:2] == pytest.approx(np.quantile(nutation, [0.0015, 0.9985]), rel=5e-3)
    spins = np.broadcast_to(cases.omega0[2], CASES) * 30.0 / math.pi
    assert numbers(go["spin"])[:2] == pytest.approx(np.quantile(spins, [0.0015, 0.9985]), rel=1e-4)
    early, late, *_ = numbers(go["phase window"].partition("(")[2].replace("to ", ""))
    for shift, share in ((early, 0.997), (late, 0.997), (1.5 * early, 0.0), (1.5 * late, 0.0)):
        moved = replace(pulses, pulses=tuple(pulse.moved(shift) for pulse in pulses))
        fraction = run(Results(study_of(body, moved), CASES)).met_fraction
        assert fraction is not None
        assert (fraction >= 0.997) == (share > 0.0), shift


def flown(body: Spacecraft, schedule: Schedule) -> NDArray[np.float64]:
    """Residuals of the first cases, (outputs, cases)."""
    values = run(Results(study_of(body, schedule), CASES)).values
    assert values is not None
    return values


@pytest.mark.deep
def test_limits_to_hold_are_those_of_cases_that_end_well_and_the_last_row_accepts_what_is_required() -> None:
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
    first, last = (row["hold if outside deg"] for row in sheet(manoeuvre(body, "two-pulse", 3000), "Fire"))
    assert numbers(first) == pytest.approx([after.min(), after.max()], abs=5.1e-3)
    assert last == "accept ≤ 0.5"


@pytest.mark.deep
def test_rows_of_command_blocks_are_blocks_with_counts_and_the_sun_phase() -> None:
    body = turning(FILE, 9.0)
    shown, fired = manoeuvre(body, "command-block"), planning.plan(body, "command-block").pulses
    (row,) = sheet(shown, "Fire")
    (block,) = fired.blocks
    assert (row["block"], row["pulses"], row["first Sun pulse"]) == ("1", str(block.count), str(block.first))
    delay, counts = numbers(row["delay s (counts)"])
    assert body.commands is not None
    assert (delay, counts) == (block.delay, body.commands.counts("delay", block.delay))
    # Without nutation the Sun phase is the delay times the spin.
    assert float(row["Sun phase deg"]) == pytest.approx(math.degrees(block.delay * body.spin) % 360.0, abs=0.3)
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
        (Status.NO_PULSE, {"dispersions": None, "requirement": replace(LOOSE, probability=None)}, 0),
        (Status.NOT_COMMANDABLE, None, 0),
    ],
)
def test_only_a_sheet_to_fly_has_conditions_limits_to_hold_boxes_and_signatures(
    status: Status, change: dict[str, Any] | None, cases: int
) -> None:
    body = turning(FILE, 3.0) if change is None else nutdamp.example().replace(**change)
    scheme = "rhumb-line" if change is None else "none" if status is Status.NO_PULSE else "two-pulse"
    compared = nutdamp.compare(body, [scheme], samples=cases)
    page = tree(plain_page(compared))
    assert compared.verdict.status is status
    told = page.all("main")[0].text
    assert {words for words in HEADLINES.values() if re.search(rf"\b{words}\b", told)} == {HEADLINES[status]}
    shown, flies = section(page, "manoeuvre"), status is Status.FLY
    captions = {caption.text for caption in shown.all("caption")}
    heads = {head.text for head in shown.all("th")}
    alarms = [one.text for one in shown.all("p") if one.attributes.get("class") == "alarm"]
    assert (alarms[:1] == ["NOT FOR FLIGHT"]) is bool(status.exit_status)
    assert any(caption.startswith("GO at t = 0") for caption in captions) is flies
    assert ("Signatures" in captions) is ("☐" in shown.text) is flies
    for head in ("hold if outside deg", "decide before", "done"):
        assert (head in heads) is flies


DATED = {"attitude": {"quaternion": [1, 0, 0, 0], "epoch": "2026-03-01T12:00:00Z", "frame": "EME2000"}}


@pytest.mark.parametrize(("gap", "more"), [("1 s", {}), ("12 s", {}), ("12 s", DATED)])
def test_a_row_says_when_to_decide_unless_the_coast_is_too_short(gap: str, more: dict[str, Any]) -> None:
    first, last = sheet(manoeuvre(nutdamp.example().with_(limits={"gap": gap}, **more), "two-pulse"), "Fire")
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
    [({"limits": {"tick": "2.5 ms"}}, 4), ({"dispersions": {"timing": {"uniform": "20 ms"}}}, 2), ({}, 3)],
)
def test_times_are_no_finer_than_the_file_can_tell(settings: dict[str, object], shown: int) -> None:
    row, *_ = sheet(manoeuvre(nutdamp.example().with_(**settings), "two-pulse"), "Fire")
    assert {len(row[name].partition(".")[2]) for name in ("start s", "on-time s")} == {shown}


def test_the_nutation_after_each_pulse_is_that_of_the_reference() -> None:
    """Nutation and Sun angle after each pulse against Euler's equations by DOP853."""
    body = turning(FILE, 3.0, 0.5)
    plan = planning.plan(body, "rhumb-line")
    assert body.sun is not None
    _, after = plan.flight.around_pulses()
    motion = reference.Motion(body.omega0, attitude.matrix(body.initial.quaternion))
    now, moments = 0.0, np.asarray(body.inertia.moments)
    for index, pulse in enumerate(plan.pulses):
        (motion,) = reference.coast(body.inertia.moments, motion, np.zeros(3), np.array([pulse.start - now]))
        assert pulse.torque is not None
        (motion,) = reference.coast(body.inertia.moments, motion, pulse.torque, np.array([pulse.on_time]))
        now = pulse.end
        momentum = motion.rotation @ (moments * motion.rates)
        assert float(after.nutation[index]) == pytest.approx(reference.angle(momentum, motion.rotation[:, 2]), abs=1e-7)
        seen = float(attitude.angle_between(after.momentum[index], body.sun))
        assert seen == pytest.approx(reference.angle(momentum, body.sun), abs=1e-7)


@pytest.mark.deep
def test_a_window_ends_at_half_a_turn_or_where_the_first_pulse_would_come_before_t_0() -> None:
    body = nutdamp.example()
    points = Checkpoints(study_of(body, planning.plan(body, "two-pulse").pulses))
    assert points.window(1.0 + 1e-9) is None
    window = points.window(0.0)
    assert window is not None
    assert window == pytest.approx((-math.pi / body.spin, math.pi / body.spin))
    soon = replace(
        points.study.model.schedule, pulses=tuple(pulse.moved(-0.6) for pulse in points.study.model.schedule)
    )
    early = Checkpoints(study_of(body, soon)).window(0.0)
    assert early is not None
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
