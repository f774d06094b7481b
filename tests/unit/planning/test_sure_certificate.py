"""Certificates of the least cost of robust plans: the file alone proves it, and nothing else is cheaper."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog
from support.builders import channel, cross, spinner
from support.cases import spread
from support.dispersed import normal
from support.process import within
from support.sure_certificate_checker import added, check
from test_surest import a_body, relative

from nutdamp.certificate import certificate
from nutdamp.errors import BadRequest
from nutdamp.files.certificate_json import certificate_json
from nutdamp.files.examples import example_text
from nutdamp.files.output import json_text
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.planning import Plan
from nutdamp.schedule import Schedule
from nutdamp.schemes.options import OptimalOptions
from nutdamp.spacecraft import Goal, Limits, Requirement, Spacecraft
from nutdamp.tolerances import Dispersions, Tolerance

WEAK, STRONG, MARGIN = 8.0, 4_000.0, 1.2


def uncertain(body: Spacecraft, shift: float | None = None, rates: float = 1e-4) -> Spacecraft:
    """With moments, rates, thrust and timing that are not known well; 0.5° of nutation may stay."""
    tolerances = Dispersions(
        A=relative(0.004),
        C=relative(0.004),
        omega0=(normal(rates), normal(rates), normal(30.0 * rates)),
        thrust={one.name: relative(0.02) for one in body.channels},
        thrust_per_pulse=relative(0.02),
        timing=Tolerance("uniform", 0.004),
        timing_offset=Tolerance("bias", 0.003),
    )
    off = None if shift is None else math.radians(shift)
    return replace(body, requirement=Requirement(math.radians(0.5), off, 0.95), dispersions=tolerances)


def bodies() -> dict[str, Spacecraft]:
    """Shapes, spins, windows, goals, and channels that act at once or are on for long."""
    windows = Limits(earliest=3.0, horizon=70.0, blackout=((10.0, 22.5), (40.0, 41.0)))
    single, upward = (channel("T", 40.0, 0.0, 0.0),), (*cross(WEAK), channel("R", 0.0, 0.0, 4.0))
    return {
        "built-in example": read_spacecraft(example_text(), "example.yaml"),
        "single thruster": uncertain(spinner(channels=single, limits=Limits(horizon=40.0)), 1.0),
        "correlated": a_body(correlation=(("A", "C", 0.9), ("thrust T1", "thrust T2", -0.5))),
        "oblate": a_body(100.0, 150.0, 2.0),
        "reversed": uncertain(spinner(spin=-3.0, channels=cross(WEAK), limits=Limits(horizon=40.0))),
        "windows": uncertain(spinner(channels=cross(WEAK), limits=windows)),
        "strong in windows": uncertain(spinner(channels=cross(STRONG), limits=windows), 0.8),
        "damped": replace(
            uncertain(spinner(100.0, 150.0, channels=cross(WEAK), limits=Limits(horizon=40.0))), dissipation=60.0
        ),
        "grows": replace(uncertain(spinner(channels=cross(STRONG), limits=Limits(horizon=20.0))), dissipation=60.0),
        "turned": replace(
            uncertain(spinner(channels=cross(WEAK), limits=Limits(horizon=60.0)), 1.0),
            goal=Goal(axis=np.array([math.sin(0.05), 0.0, math.cos(0.05)])),
        ),
        "spun up": replace(
            uncertain(spinner(channels=upward, limits=Limits(horizon=40.0)), rates=1e-9), goal=Goal(spin=3.1)
        ),
    }


def a_plan(body: Spacecraft, margin: float) -> Plan:
    """A robust plan of that margin, of which only the program matters."""
    return Plan(body, "optimal", Schedule(), options=OptimalOptions(), margin=margin)


@cache
def text_of(name: str, margin: float = MARGIN) -> str:
    return json_text(certificate_json(certificate(a_plan(bodies()[name], margin))))


@spread("name", bodies(), quick=2)
def test_the_file_alone_proves_the_bound(name: str) -> None:
    content = json.loads(text_of(name))
    assert check(text_of(name)) == content["bound"] > 0.0
    assert 0.0 < content["gap"] + 1e-6 < 2e-3
    assert content["margin_sigmas"] == MARGIN
    assert "not_proved" in content


@pytest.mark.deep
def test_more_margin_never_costs_less() -> None:
    least = [check(text_of("built-in example", margin)) for margin in (0.0, 1.5, 3.0)]
    assert least == sorted(least)
    assert least[2] > 1.05 * least[0]


def raised(c: dict[str, Any]) -> None:
    """Higher prices would prove a higher bound."""
    for one in c["tangents"]:
        one["price"] *= 1.01
    c["bound"] = 1.01 * (c["bound"] + c["gained"]) - c["gained"]
    for one in c["primer"]:
        one["q"] = {name: [1.01 * q for q in curve] for name, curve in one["q"].items()}
    for one in c["firings"]:
        one["q"] *= 1.01


def one_raised(c: dict[str, Any]) -> None:
    c["tangents"][0]["price"] *= 1.05


def longer(c: dict[str, Any]) -> None:
    """Tangents of more than a unit vector would cut off what keeps the cone."""
    for one in c["tangents"]:
        one["shared"] = [1.1 * w for w in one["shared"]]


def later(c: dict[str, Any]) -> None:
    for one in c["firings"]:
        one["t_s"] += 0.3


TAMPERED: dict[str, Callable[[dict[str, Any]], None]] = {
    "prices": raised,
    "one price": one_raised,
    "negative price": lambda c: c["tangents"][0].update(price=-c["tangents"][0]["price"]),
    "unit vectors": longer,
    "margin": lambda c: c.update(margin_sigmas=1.1 * c["margin_sigmas"]),
    "limit": lambda c: c["kinds"]["nutation"].update(most_Nms=1.1 * c["kinds"]["nutation"]["most_Nms"]),
    "bound": lambda c: c.update(bound=1.001 * c["bound"]),
    "cost": lambda c: c["channels"][0].update(cost_per_s=0.9 * c["channels"][0]["cost_per_s"]),
    "gained": lambda c: c.update(gained=c["gained"] - 0.01 * c["bound"], bound=1.01 * c["bound"]),
    "curve": lambda c: c["primer"][0]["q"].update({c["channels"][0]["name"]: [0.0] * len(c["primer"][0]["t_s"])}),
    "moments": later,
    "on-time": lambda c: c["firings"][0].update(on_time_s=0.5 * c["firings"][0]["on_time_s"]),
}


@spread("name", ["built-in example", "strong in windows"], quick=1)
@spread("what", TAMPERED, quick=10)
def test_a_tampered_file_proves_nothing(name: str, what: str) -> None:
    content = json.loads(text_of(name))
    TAMPERED[what](content)
    with pytest.raises(AssertionError):
        check(json.dumps(content))


class Cones:
    """The program of a file over some columns (channel, moment, width), solved by other means than the planner's."""

    def __init__(self, c: dict[str, Any], at: np.ndarray, t: np.ndarray, width: float) -> None:
        self.c, self.most = c, np.where([c["channels"][one]["acts_at_once"] for one in at], np.inf, width)
        self.costs = np.array([c["channels"][one]["cost_per_s"] for one in at])
        own = np.array([one["each_pulse"] for one in c["inputs"]])
        self.effects, self.shared, self.own = {}, {}, {}
        for kind in c["kinds"]:
            parts = [added(c, kind, one, np.array([moment]))[:2] for one, moment in zip(at, t, strict=True)]
            changes = np.array([part[1][0] for part in parts])
            self.effects[kind] = np.array([part[0][0] for part in parts])
            self.shared[kind], self.own[kind] = np.where(own, 0.0, changes), np.where(own, changes, 0.0)
        turns = np.floor((t - c["earliest_s"]) / c["turn_s"])
        self.pulse = np.unique(np.column_stack([at, turns]), axis=0, return_inverse=True)[1].ravel()

    def tangents(self, kind: str, x: np.ndarray) -> list[tuple[np.ndarray, float]]:
        """Rows and right sides of the tangents where the cone is passed most by ``x``."""
        k, margin, found = self.c["kinds"][kind], self.c["margin_sigmas"], []
        goal, start = complex(*k["goal_Nms"]), np.array(k["start_Nms"]) @ [1, 1j]
        own = np.zeros((self.pulse.max() + 1, len(start)), dtype=complex)
        np.add.at(own, self.pulse, x[:, None] * self.own[kind])
        S = np.vstack([start + x @ self.shared[kind], own])
        directions = [1.0, -1.0] if kind == "spin" else np.exp(2j * np.pi * np.arange(72) / 72).tolist()
        for u in directions:
            along = (np.conj(u) * S).real
            w = along / max(float(np.linalg.norm(along)), 1e-12)
            by = (np.conj(u) * (x @ self.effects[kind] - goal)).real + margin * np.linalg.norm(along) - k["most_Nms"]
            found.append((float(by) / k["most_Nms"], u, w))
        cuts = []
        for _, u, w in sorted((one for one in found if one[0] > 1e-6), key=lambda one: -one[0])[:6]:
            moved = (np.conj(u) * (self.shared[kind] @ w[0] + (self.own[kind] * w[1:][self.pulse]).sum(axis=1))).real
            right = k["most_Nms"] + (np.conj(u) * (goal - margin * start @ w[0])).real
            cuts.append(((np.conj(u) * self.effects[kind]).real + margin * moved, float(right)))
        return cuts

    def least(self, rounds: int = 200) -> float | None:
        """The least cost, from below to a millionth; None where there is no solution."""
        x, rows, rights = np.zeros(len(self.costs)), list[np.ndarray](), list[float]()
        bounds = [(0.0, None if math.isinf(one) else one) for one in self.most]
        for _ in range(rounds):
            cuts = [one for kind in self.c["kinds"] for one in self.tangents(kind, x)]
            if not cuts:
                break
            rows, rights = rows + [one[0] for one in cuts], rights + [one[1] for one in cuts]
            found = linprog(self.costs, np.array(rows), np.array(rights), bounds=bounds)
            if found.x is None:
                return None
            x = found.x
        return float(self.costs @ x)


def columns_of(c: dict[str, Any], width: float, some: Callable[[int], np.ndarray]) -> Cones:
    """Slots of a width in the windows, ``some`` of them."""
    t = np.concatenate([np.arange(begin + 0.5 * width, end, width) for begin, end in c["windows_s"]])
    at = np.repeat(np.arange(len(c["channels"])), len(t))
    chosen = some(len(at))
    return Cones(c, at[chosen], np.tile(t, len(c["channels"]))[chosen], width)


@spread("name", ["single thruster", "oblate", "strong in windows", "built-in example"], quick=2)
def test_another_solver_on_another_grid_finds_nothing_cheaper_and_nearly_the_bound(name: str) -> None:
    c = json.loads(text_of(name))
    width = 2.0 * math.pi / max(abs(c["spin_rad_s"]), abs(c["nutation_rad_s"])) / 41.0
    least = columns_of(c, width, np.arange).least()
    assert least is not None
    assert c["bound"] * (1.0 - 1e-3) < least < 1.01 * c["bound"]


@pytest.mark.parametrize("name", ["single thruster", "strong in windows"])
def test_firing_at_random_moments_is_never_cheaper(name: str) -> None:
    c, draw, found = json.loads(text_of(name)), np.random.default_rng(5), []
    for count in (12, 25, 50, 100) * 5:

        def some(most: int, count: int = count) -> np.ndarray:
            return draw.choice(most, min(count, most), replace=False)

        found.append(columns_of(c, 0.3, some).least())
    known = [one for one in found if one is not None]
    assert len(known) >= 5
    assert min(known) >= c["bound"] * (1.0 - 1e-5)


def test_a_margin_that_cannot_be_kept_has_no_certificate() -> None:
    with pytest.raises(BadRequest, match="no firing was found that keeps the requirement with its margin of 60 σ"):
        certificate(a_plan(bodies()["built-in example"], 60.0))


@pytest.mark.deep
def test_the_command_writes_the_file_of_the_robust_plan_and_draws_its_curve(tmp_path: Path) -> None:
    file, picture = tmp_path / "proof.json", tmp_path / "primer.svg"
    command = ["plan", "--quiet", "--robust", "--scheme", "optimal", "--certificate", str(file)]
    result = within(tmp_path, *command, "--plot", str(picture), "--figure", "primer", "--json", "plan.json")
    assert result.returncode == 0
    bound, content = check(file.read_text()), json.loads(file.read_text())
    chosen = json.loads((tmp_path / "plan.json").read_text())["robust"]["recommended"]
    assert content["margin_sigmas"] == chosen["margin_sigmas"]
    assert content["plan"]["cost"] == pytest.approx(chosen["propellant_kg"])
    assert content["probability"] == 0.997
    screen = " ".join(result.stdout.split())
    assert (
        f"{content['margin_sigmas']:.4g} σ, costs less than {1e3 * bound:.4g} g; a firing of that program costs"
        in screen
    )
    assert "It does not prove that 99.7 % of cases comply." in screen
    assert "first-order least (margin" in picture.read_text()


@pytest.mark.deep
def test_a_robust_plan_that_is_not_of_the_program_has_none(tmp_path: Path) -> None:
    """Where nothing is required there is no margin to keep."""
    command = ["plan", "--robust", "--set", "requirement={}", "--certificate", "proof.json"]
    result = within(tmp_path, *command)
    assert result.returncode == 1
    assert "which no program against dispersions made" in " ".join(result.stderr.split())
    assert "Robust plan" in result.stdout
    assert not (tmp_path / "proof.json").exists()
