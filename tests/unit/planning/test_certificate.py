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
from support.cases import spread
from support.certificate_checker import check
from support.process import within

from nutdamp.certificate import NominalCertificate, certificate
from nutdamp.errors import BadRequest
from nutdamp.files.certificate_json import certificate_json
from nutdamp.files.output import json_text
from nutdamp.planning import plan
from nutdamp.schemes.options import OptimalOptions
from nutdamp.spacecraft import Goal, Limits, Spacecraft, Steerable

WEAK, STRONG = 8.0, 4_000.0


def bodies() -> dict[str, tuple[Spacecraft, OptimalOptions]]:
    """Shapes, spins, windows, goals and options."""
    plain, impulse = OptimalOptions(), OptimalOptions(least="impulse")
    windows = Limits(earliest=3.0, horizon=70.0, blackout=((10.0, 22.5), (40.0, 41.0)))
    forward = spinner(
        channels=(channel("T1", WEAK, 0.0, 0.0), channel("T2", -3.0, 5.0, 0.0), channel("T3", 1.0, -9.0, 0.0))
    )
    return {
        "prolate": (spinner(channels=cross(WEAK), limits=Limits(horizon=60.0)), plain),
        "oblate": (spinner(100.0, 150.0, channels=cross(WEAK), limits=Limits(horizon=40.0)), plain),
        "reversed": (spinner(spin=-3.0, channels=cross(WEAK), limits=Limits(horizon=40.0)), plain),
        "windows": (spinner(channels=cross(WEAK), limits=windows), plain),
        "strong": (spinner(channels=cross(STRONG), limits=Limits(horizon=30.0)), impulse),
        "strong in windows": (spinner(channels=cross(STRONG), limits=windows), impulse),
        "one way only": (replace(forward, limits=Limits(horizon=90.0)), impulse),
        "free axis": (forward, OptimalOptions(free_axis=True)),
        "shift": (spinner(channels=cross(STRONG), limits=Limits(horizon=5.0)), OptimalOptions(shift=math.radians(0.3))),
        "steerable beside": (spinner(channels=cross(WEAK), steerable=Steerable(20.0)), plain),
        "turned": (
            replace(
                spinner(channels=cross(WEAK), limits=Limits(horizon=60.0)),
                goal=Goal(axis=np.array([math.sin(0.15), 0.0, math.cos(0.15)])),
            ),
            plain,
        ),
        "spun up": (
            replace(
                spinner(channels=(*cross(WEAK), channel("R", 0.0, 0.0, 4.0)), limits=Limits(horizon=40.0)),
                goal=Goal(spin=3.1),
            ),
            impulse,
        ),
        "damped": (
            replace(spinner(100.0, 150.0, channels=cross(WEAK), limits=Limits(horizon=40.0)), dissipation=60.0),
            plain,
        ),
        "I1 ≠ I2": (spinner(moments=(122.0, 118.0, 80.0), channels=cross(WEAK), limits=Limits(horizon=40.0)), plain),
    }


def certified(name: str) -> NominalCertificate:
    body, options = bodies()[name]
    found = certificate(plan(body, "optimal", options))
    assert isinstance(found, NominalCertificate)
    return found


@spread("name", bodies(), quick=1)
def test_the_file_alone_proves_the_bound(name: str) -> None:
    found = certified(name)
    bounds = found.plan.pulses.bounds
    assert bounds is not None
    assert check(json_text(certificate_json(found))) == bounds.first_order
    assert found.proof.bound > 0.0


def halved(c: dict[str, Any], *keys: str | int) -> None:
    """Halves the number at ``keys``."""
    for key in keys[:-1]:
        c = c[key]  # type: ignore[index]
    c[keys[-1]] *= 0.5  # type: ignore[index]


def shifted(c: dict[str, Any]) -> None:
    c["burns"][0]["t_s"] += 0.4


def raised(c: dict[str, Any]) -> None:
    """Higher prices would prove a higher bound."""
    for one in c["equations"]:
        one["price"] *= 1.01
    c["bound"] = 1.01 * (c["bound"] + c["gained"]) - c["gained"]
    for one in c["primer"]:
        one["q"] = {name: [1.01 * q for q in curve] for name, curve in one["q"].items()}


def kept_dark(c: dict[str, Any]) -> None:
    """Another window, in which q was not looked at when the prices were made."""
    c["windows_s"] = [[0.0, 90.0]]


TAMPERED: dict[str, Callable[[dict[str, Any]], None]] = {
    "a": lambda c: halved(c, "a"),
    "rates": lambda c: c.update(nutation_rad_s=0.5 * c["nutation_rad_s"], a=0.5 * c["a"]),
    "goal": lambda c: halved(c, "equations", 0, "goal_Nms"),
    "bound": lambda c: c.update(bound=1.001 * c["bound"]),
    "cost": lambda c: halved(c, "channels", 0, "cost_per_s"),
    "torque": lambda c: c["channels"][0].update(torque_Nm=[1.1 * one for one in c["channels"][0]["torque_Nm"]]),
    "on-time": lambda c: halved(c, "burns", 0, "on_time_s"),
    "moment": shifted,
    "curve": lambda c: halved(c, "primer", 0, "q", "+1", 7),
    "prices": raised,
}


@spread("name", ["windows", "strong in windows"], quick=1)
@spread("what", TAMPERED, quick=1)
def test_a_tampered_file_proves_nothing(name: str, what: str) -> None:
    content = json.loads(json_text(certificate_json(certified(name))))
    TAMPERED[what](content)
    with pytest.raises(AssertionError):
        check(json.dumps(content))


@pytest.mark.deep
def test_firing_in_the_dark_would_be_worth_more() -> None:
    """The prices know of the windows: where they end, q goes above the price of a channel that acts at once."""
    limits = Limits(earliest=0.0, horizon=2.0)
    found = certificate(
        plan(
            spinner(channels=(channel("T", STRONG, 0.0, 0.0), channel("U", 0.0, -STRONG, 0.0)), limits=limits),
            "optimal",
            OptimalOptions(least="impulse", free_axis=True),
        )
    )
    content = certificate_json(found)
    check(json_text(content))
    kept_dark(content)
    with pytest.raises(AssertionError, match="q is above the price"):
        check(json_text(content))


def test_what_has_no_certificate_says_why() -> None:
    body, options = bodies()["prolate"]
    with pytest.raises(BadRequest, match="a certificate is of a plan of optimal, not of four-pulse"):
        certificate(plan(body, "four-pulse"))
    far = replace(body, limits=Limits(horizon=0.5))
    with pytest.raises(BadRequest, match=r"optimal has no least cost to prove here: within 0\.5 s"):
        certificate(plan(far, "optimal", options))


def test_the_command_writes_the_file_and_draws_the_curve(tmp_path: Path) -> None:
    file, picture = tmp_path / "proof.json", tmp_path / "primer.svg"
    command = ["plan", "--quiet", "--certificate", str(file), "--plot", str(picture), "--figure", "primer"]
    result = within(tmp_path, *command)
    assert result.returncode == 0
    bound = check(file.read_text())
    assert json.loads(file.read_text())["unit"] == "kg"
    assert f"first-order least within 120 s {1e3 * bound:.4g} g" in " ".join(result.stdout.split())
    drawn = picture.read_text()
    assert "primer curve" in drawn
    assert f"first-order least (small angles): {1e3 * bound:.4g} g" in drawn
    assert "burns of the linear program" in drawn


def test_without_optimal_the_command_says_what_to_name(tmp_path: Path) -> None:
    file = tmp_path / "proof.json"
    result = within(tmp_path, "plan", "--quiet", "--scheme", "two-pulse", "--certificate", str(file))
    assert result.returncode == 2
    assert "a certificate is of optimal, which is not planned" in result.stderr
    assert not file.exists()


@pytest.mark.parametrize("options", [(), ("--robust", "--set", "dispersions={A: {normal: 1 %}}")])
def test_where_there_is_no_certificate_the_screen_is_shown_and_says_so(
    tmp_path: Path, options: tuple[str, ...]
) -> None:
    """Optimal is infeasible within half a second, which only planning shows."""
    file = tmp_path / "proof.json"
    schemes = ("--scheme", "optimal", "--set", "limits.horizon=0.5 s")
    result = within(tmp_path, "plan", *schemes, *options, "--certificate", str(file))
    assert result.returncode == 1
    assert ("Robust plan: optimal" if options else "No recommendation: no scheme is feasible.") in result.stdout
    whose = "the robust plan" if options else "optimal"
    assert f"cannot write {file}: there is no certificate: {whose} has no least cost" in " ".join(result.stderr.split())
    assert not file.exists()


def test_where_another_plan_is_recommended_the_command_says_whose_certificate_it_writes(tmp_path: Path) -> None:
    whose = "the certificate is of optimal for nominal values, which is not the recommended plan"
    command = ["plan", "--certificate", "proof.json", "--scheme", "optimal", "--scheme", "four-pulse"]
    impulse, pulses = (within(tmp_path, *command, "--least", least) for least in ("impulse", "pulses"))
    assert "Recommended: optimal" in impulse.stdout
    assert whose not in impulse.stderr
    assert "Recommended: four-pulse" in pulses.stdout
    assert whose in pulses.stderr
