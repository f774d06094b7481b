"""The manoeuvre sheet: what is loaded, when to begin, when to hold, and the cases that say so."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from support import places, reference
from support.markup import Node
from support.pages import plain_page
from support.shown import facts, section, sheet, tree
from support.spinners import FILE

import nutdamp
from nutdamp.files.reader import load_spacecraft, read_spacecraft
from nutdamp.flight.propagation import flown
from nutdamp.montecarlo.study import CASES, Checkpoints, Results, even, first_pulses, run, study_of
from nutdamp.page.document import Control
from nutdamp.page.report import Repeat
from nutdamp.physics import attitude
from nutdamp.planning import plan as planning
from nutdamp.planning.decision import compare
from nutdamp.spacecraft.model import Goal, Spacecraft

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
    page = plain_page(compare(body, [scheme], samples=cases), Repeat("", "f.yaml", "name: X"), control=control)
    return section(tree(page), "manoeuvre")


@cache
def example() -> Node:
    """The sheet of the built-in example."""
    return manoeuvre(nutdamp.example(), "two-pulse", 1000)


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
    for count, row in enumerate(sheet(example(), "Fire"), 1):
        values = run(Results(study_of(body, first_pulses(pulses, count)), CASES)).values
        assert values is not None
        least, most = np.degrees(np.quantile(values[0], [0.0015, 0.9985]))
        least = min(least, float(row["nutation after deg"]))  # what is expected is no reason to hold
        assert numbers(row["hold if outside deg"]) == pytest.approx([least, most], rel=5e-3)
    early, late, *_ = numbers(go["phase window"].partition("(")[2].replace("to ", ""))
    for shift, share in ((early, 0.997), (late, 0.997), (1.5 * early, 0.0), (1.5 * late, 0.0)):
        moved = replace(pulses, pulses=tuple(pulse.moved(shift) for pulse in pulses))
        fraction = run(Results(study_of(body, moved), CASES)).met_fraction
        assert fraction is not None
        assert (fraction >= 0.997) == (share > 0.0), shift


@pytest.mark.deep
def test_rows_of_command_blocks_are_blocks_with_counts_and_the_sun_phase() -> None:
    body = turning(DISPERSED, 9.0)
    shown, fired = manoeuvre(body, "command-block", 500), planning.plan(body, "command-block").pulses
    (row,) = sheet(shown, "Fire")
    (block,) = fired.blocks
    assert (row["block"], row["pulses"], row["first Sun pulse"]) == ("1", str(block.count), str(block.first))
    delay, counts = numbers(row["delay s (counts)"])
    assert body.commands is not None
    assert (delay, counts) == (block.delay, body.commands.counts("delay", block.delay))
    # Without nutation the Sun phase is the delay times the spin.
    assert float(row["Sun phase deg"]) == pytest.approx(math.degrees(block.delay * body.spin) % 360.0, abs=0.3)
    assert row["start UTC"] == body.utc(fired.pulses[0].loaded[0], 3)
    least, most = numbers(row["hold if outside deg"])
    assert least <= float(row["nutation after deg"]) < most


@pytest.mark.deep
def test_what_cannot_be_commanded_has_a_banner_instead_and_without_dispersions_nothing_to_hold_by() -> None:
    timed = manoeuvre(turning(FILE, 3.0), "rhumb-line")
    ideal = manoeuvre(load_spacecraft(str(places.CONFIGS / "magnus-oblate.yaml")), "two-pulse")
    for node, why in ((timed, "no command block fires its pulses"), (ideal, "fires ideal impulses")):
        (banner,) = (one for one in node.all("p") if one.attributes.get("class") == "alarm")
        assert "cannot be commanded" in banner.text
        assert why in banner.text
        assert node.all("table") == []
    calm = manoeuvre(nutdamp.example().replace(dispersions=None), "two-pulse")
    assert "hold if outside deg" not in sheet(calm, "Fire")[0]
    assert facts(calm, "GO at t = 0")["phase window"] == "not known: the file gives no dispersions"
    idle = manoeuvre(nutdamp.example(), "two-pulse")
    assert facts(idle, "GO at t = 0")["phase window"] == "not known: dispersed cases were not flown"


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
    assert flown(body, part).settled.spin == pytest.approx(body.spin)
    assert (even(1, 8), even(3, 8), even(10, 12)) == ([1], [1, 2, 3], list(range(1, 11)))
    assert (even(57, 8)[0], even(57, 8)[-1], len(even(57, 8))) == (1, 57, 8)
