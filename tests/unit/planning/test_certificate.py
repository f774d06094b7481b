"""Certificates of the least cost of optimal, checked from the file alone by `certificate_checker`."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.builders import channel, cross, spinner
from support.cases import weekly
from support.certificate_checker import check
from support.golden import check_text, refused
from support.process import Run

from nutdamp.errors import BadRequest
from nutdamp.files.tabular import json_text
from nutdamp.planning.plan import plan
from nutdamp.planning.tradeoff import certificate
from nutdamp.schemes.catalogue import OptimalOptions
from nutdamp.spacecraft.equipment import Steerable
from nutdamp.spacecraft.model import Goal, Limits, Spacecraft
from nutdamp.views.decisions import certificate_json

WEAK, STRONG = cross(8.0), cross(4_000.0)
PLAIN, IMPULSE = OptimalOptions(), OptimalOptions(least="impulse")
WINDOWS = Limits(earliest=3.0, horizon=70.0, blackout=((10.0, 22.5), (40.0, 41.0)))
ONE_WAY = (channel("T1", 8.0, 0.0, 0.0), channel("T2", -3.0, 5.0, 0.0), channel("T3", 1.0, -9.0, 0.0))
BRIEF = Limits(horizon=40.0)
PROLATE = spinner(channels=WEAK, limits=Limits(horizon=60.0))
OBLATE = spinner(100.0, 150.0, channels=WEAK, limits=BRIEF)
TURNED, FASTER = Goal(axis=np.array([math.sin(0.15), 0.0, math.cos(0.15)])), Goal(spin=3.1)
ROLL = channel("R", 0.0, 0.0, 4.0)
BODIES: dict[str, tuple[Spacecraft, OptimalOptions]] = {
    "prolate": (PROLATE, PLAIN),
    "oblate": (OBLATE, PLAIN),
    "reversed": (spinner(spin=-3.0, channels=WEAK, limits=BRIEF), PLAIN),
    "windows": (spinner(channels=WEAK, limits=WINDOWS), PLAIN),
    "strong": (spinner(channels=STRONG, limits=Limits(horizon=30.0)), IMPULSE),
    "strong in windows": (spinner(channels=STRONG, limits=WINDOWS), IMPULSE),
    "one way only": (spinner(channels=ONE_WAY, limits=Limits(horizon=90.0)), IMPULSE),
    "free axis": (spinner(channels=ONE_WAY), OptimalOptions(free_axis=True)),
    "shift": (spinner(channels=STRONG, limits=Limits(horizon=5.0)), OptimalOptions(shift=math.radians(0.3))),
    "steerable beside": (spinner(channels=WEAK, steerable=Steerable(20.0)), PLAIN),
    "turned": (replace(PROLATE, goal=TURNED), PLAIN),
    "spun up": (replace(spinner(channels=(*WEAK, ROLL), limits=BRIEF), goal=FASTER), IMPULSE),
    "damped": (replace(OBLATE, dissipation=60.0), PLAIN),
    "I1 ≠ I2": (spinner(moments=(122.0, 118.0, 80.0), channels=WEAK, limits=BRIEF), PLAIN),
}
IN_CI = ("windows", "one way only", "shift", "damped", "I1 ≠ I2")


def raised(c: dict[str, Any]) -> None:
    """Higher prices would prove a higher bound."""
    for one in c["equations"]:
        one["price"] *= 1.01
    c["bound"] = 1.01 * (c["bound"] + c["gained"]) - c["gained"]
    for one in c["primer"]:
        one["q"] = {name: [1.01 * q for q in curve] for name, curve in one["q"].items()}


def halved(*keys: str | int) -> Callable[[dict[str, Any]], None]:
    """Halves the number at ``keys``."""

    def halve(c: Any) -> None:
        for key in keys[:-1]:
            c = c[key]
        c[keys[-1]] *= 0.5

    return halve


TAMPERED: list[Callable[[dict[str, Any]], None]] = [
    halved("circle", 0),
    halved("nutation_rad_s"),
    halved("equations", 0, "goal_Nms"),
    lambda c: c.update(bound=1.001 * c["bound"]),
    halved("channels", 0, "cost_per_s"),
    lambda c: c["channels"][0].update(torque_Nm=[1.1 * one for one in c["channels"][0]["torque_Nm"]]),
    halved("burns", 0, "on_time_s"),
    lambda c: c["burns"][0].update(t_s=c["burns"][0]["t_s"] + 0.4),
    halved("primer", 0, "q", "+1", 7),
    raised,
]


def refutes(text: str, *tampers: Callable[[dict[str, Any]], None]) -> None:
    """The file as it is proves what it says, and as any of these make it does not."""
    for tamper in tampers:
        content = json.loads(text)
        tamper(content)
        with pytest.raises(AssertionError):
            check(json.dumps(content))


@pytest.mark.deep
@pytest.mark.parametrize("name", [one if one in IN_CI else weekly(one) for one in BODIES])
def test_the_file_alone_proves_the_bound_and_a_tampered_one_does_not(name: str) -> None:
    body, options = BODIES[name]
    made = certificate(plan(body, "optimal", options))
    text, bounds = json_text(certificate_json(made)), made.plan.pulses.bounds
    assert bounds is not None
    assert check(text) == bounds.first_order == made.proof.bound > 0.0
    if "windows" in name:
        refutes(text, *TAMPERED)


@pytest.mark.deep
def test_firing_in_the_dark_would_be_worth_more() -> None:
    """The prices know of the windows: where they end, q goes above the price of a channel that acts at once."""
    two = channel("T", 4_000.0, 0.0, 0.0), channel("U", 0.0, -4_000.0, 0.0)
    options = OptimalOptions(least="impulse", free_axis=True)
    content = certificate_json(certificate(plan(spinner(channels=two, limits=Limits(horizon=2.0)), "optimal", options)))
    check(json_text(content))
    content["windows_s"] = [[0.0, 90.0]]
    with pytest.raises(AssertionError, match="above"):
        check(json_text(content))


def test_what_has_no_certificate_says_why_and_the_command_what_to_name(run: Run, tmp_path: Path) -> None:
    """Optimal is infeasible within a millisecond, which only planning shows: the screen is shown too."""
    with refused(BadRequest, "plan.certificate-of-other"):
        certificate(plan(PROLATE, "four-pulse"))
    for status, scheme in ((2, ("two-pulse",)), (1, ("optimal", "--set", "limits.horizon=1 ms"))):
        result = run("plan", "--scheme", *scheme, "--certificate", "proof.json", columns=300)
        assert (result.returncode, bool(result.stdout)) == (status, status == 1)
        assert not (tmp_path / "proof.json").exists()
        check_text(f"plan.certificate-{status}", "\n".join(result.stderr.strip().splitlines()[-1:]))


def test_the_command_writes_the_file_and_says_what_it_proves(run: Run, tmp_path: Path) -> None:
    limits = ("--nominal", "--set", "limits.horizon=30 s")
    result = run("plan", "-v", "--scheme", "optimal", "--certificate", "proof.json", *limits, columns=200)
    assert result.returncode == 0
    text = (tmp_path / "proof.json").read_text()
    assert json.loads(text)["unit"] == "kg"
    assert f"small-angle bound within 30 s: {1e3 * check(text):.4g} g" in result.stdout
    refutes(text, raised)


@pytest.mark.deep
def test_where_another_plan_is_recommended_the_command_says_whose_certificate_it_writes(run: Run) -> None:
    command = ("plan", "--scheme", "optimal", "--scheme", "two-pulse", "--certificate", "proof.json", "--json", "-")
    nominal, dispersed = (run(*command, *each, columns=200) for each in (["--nominal"], []))
    schemes = [json.loads(one.stdout)["decision"]["scheme"] for one in (nominal, dispersed)]
    assert schemes == ["optimal", "two-pulse"]
    whose = [line for line in dispersed.stderr.splitlines() if line not in nominal.stderr]
    check_text("plan.certificate-whose", "\n".join(whose))
