"""The scheme optimal where thrusters are strong and the horizon is short, against schedules found without it."""

from __future__ import annotations

import csv
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.builders import Outcome, channel, cross, fan, spinner
from support.cases import deep, spread, weekly
from support.optimal import flies
from support.places import CASES, case

from nutdamp.files.spacecraft_file import load_spacecraft
from nutdamp.planning import plan
from nutdamp.schedule import Schedule, channel_pulse
from nutdamp.schemes.optimal import starting_points
from nutdamp.schemes.optimal.descent import Descent
from nutdamp.schemes.optimal.residual_equations import Equations
from nutdamp.schemes.optimal.sequences import Task
from nutdamp.spacecraft import Goal, Limits, Spacecraft

EXACT = 1e-8
"""Degrees that a schedule of strong thrusters leaves at most."""


def strong(degrees: float = 20.0, horizon: float = 2.0, **limits: Any) -> Spacecraft:
    """Five directions that do all there is to do within milliseconds, in less than one inertial period."""
    return spinner(degrees=degrees, channels=fan(5, 2e4), limits=Limits(horizon=horizon, **limits))


def task_of(spacecraft: Spacecraft, equations: Equations | None = None) -> Task:
    costs = np.array([np.linalg.norm(one.torque) for one in spacecraft.channels])
    return Task(spacecraft, equations or Equations(), spacecraft.channels, costs)


@pytest.mark.deep
@spread("name", sorted(path.stem for path in CASES.glob("optimal-beaten-*.csv")), quick=1, deep=0)
def test_no_schedule_found_without_it_is_cheaper(name: str) -> None:
    check_not_beaten(name, 1.001)


@pytest.mark.deep
def test_pulses_of_two_channels_may_stand_side_by_side() -> None:
    check_not_beaten("optimal-not-found", 1.0, free_axis=True)


def check_not_beaten(name: str, most: float, **options: Any) -> None:
    """By the schedule beside the file."""
    with case(f"{name}.csv").open(encoding="utf-8") as stream:
        impulses = [[float(row[f"impulse_{axis}_Nms"]) for axis in (1, 2, 3)] for row in csv.DictReader(stream)]
    known = math.fsum(math.hypot(*impulse) for impulse in impulses)
    assert flies(load_spacecraft(case(f"{name}.yaml")), left=EXACT, **options).pulses.total_impulse <= most * known


@pytest.mark.deep
@spread("rpm", [31.0, 31.5, 32.0], quick=1, deep=0)
def test_two_spin_jets_that_one_burn_does_not_suffice_for(rpm: float) -> None:
    body = load_spacecraft(case("spin-up.yaml"))
    flies(replace(body, goal=Goal(spin=rpm * math.pi / 30.0)), left=EXACT, dearest=1.01)


@pytest.mark.parametrize(
    "body",
    [
        deep(strong(gap=0.3, earliest=0.2)),
        weekly(strong(horizon=2.5, blackout=((0.0, 0.3), (0.9, 1.4)))),
        weekly(strong(horizon=2.5, max_pulses=3)),
        weekly(strong(horizon=2.5, tick=1e-4)),
    ],
    ids=["gap", "blackout", "max_pulses", "tick"],
)
def test_every_limit_is_kept(body: Spacecraft) -> None:
    flies(body, left=EXACT if body.limits.tick is None else 1.1 * math.degrees(0.5 * 1e-4 * 2e4 / (80.0 * 3.0)))


@pytest.mark.weekly
def test_on_times_are_none_or_at_least_the_least() -> None:
    free = strong(5.0, 1.0)
    made = plan(free, "optimal").pulses
    least = 3.0 * min(pulse.on_time for pulse in made)
    bounded = tuple(channel(one.name, *one.torque, min_on_time=least) for one in free.channels)
    assert flies(replace(free, channels=bounded), left=EXACT).pulses.cost >= made.cost * (1.0 - 1e-6)


@pytest.mark.deep
def test_the_same_plan_every_time() -> None:
    one, two = (starting_points.schedules(task_of(strong()))[0] for _ in range(2))
    assert [(pulse.start, pulse.on_time) for pulse in one] == [(pulse.start, pulse.on_time) for pulse in two]


@pytest.mark.deep
@pytest.mark.parametrize(("horizon", "count"), [(1.0, 2), (400.0, 40)])
def test_the_work_is_bounded(horizon: float, count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """However long the horizon, however many the channels: flights at a time are counted, not seconds."""
    calls, flown = list[int](), Task.misses

    def counted(self: Task, which: np.ndarray, x: np.ndarray, kicks: int) -> np.ndarray:
        calls.append(len(x))
        return flown(self, which, x, kicks)

    monkeypatch.setattr(Task, "misses", counted)
    starting_points.schedules(task_of(replace(strong(40.0, horizon), channels=fan(count, 2e4))))
    assert 0 < len(calls) < 2000
    assert sum(calls) < 400_000


@pytest.mark.parametrize("seed", range(4))
def test_misses_are_those_of_the_reference_integrator(seed: int) -> None:
    body = replace(strong(30.0, 4.0), channels=cross(3e2))
    task = task_of(body)
    sequences, x = starting_points.random_starts(task, 4, 1, np.random.default_rng(seed))
    which, (starts, on_times) = sequences.which[0].tolist(), np.split(x[0], 2)
    fired = zip(which, starts, on_times, strict=True)
    pulses = (channel_pulse(body.channels[one], start + 0.5 * on, on) for one, start, on in fired)
    flown = Outcome(body, Schedule(tuple(pulses)))
    momentum = np.asarray(body.inertia.moments) * flown.motion.rates
    size, after = float(np.linalg.norm(body.momentum)), flown.motion.rotation @ momentum
    misses = task.misses(sequences.which, x, 0)[0]
    assert misses[:2] == pytest.approx(momentum[:2] / size, abs=1e-11)
    assert np.linalg.norm(misses[2:]) == pytest.approx(np.linalg.norm(after[:2]) / size, abs=1e-11)
    # Kicks close in on it as the square of their number; they end half a kick earlier, which turns ω in the body.
    sizes = [np.linalg.norm(task.misses(sequences.which, x, kicks)[0].reshape(2, 2), axis=1) for kicks in (0, 4, 8, 16)]
    away = [float(np.abs(one - sizes[0]).max()) for one in sizes[1:]]
    assert away[0] / away[1] == pytest.approx(4.0, rel=0.2)
    assert away[1] / away[2] == pytest.approx(4.0, rel=0.1)


@pytest.mark.parametrize(("starts", "runs", "looked_at", "tries"), [(24, 16, 2, 5), deep(64, 30, 8, 20)])
def test_a_descent_keeps_its_bounds_and_ends_where_no_step_saves(
    starts: int, runs: int, looked_at: int, tries: int
) -> None:
    task = task_of(strong(30.0, 3.0))
    begun = starting_points.random_starts(task, 4, starts, np.random.default_rng(5))
    rows, levels = task.bounds(begun.sequences)
    descent = Descent(task, *begun, kicks=1)
    for _ in range(runs):
        descent.run(2 * 30 // runs)
        assert np.all(descent.state.x @ rows.T > levels)
    met = np.flatnonzero((descent.left < 1e-9) & (descent.state.error == 0.0))
    assert len(met) >= looked_at
    rng = np.random.default_rng(6)
    for row in met[:looked_at]:
        sequences, x = begun.sequences.of([row]), descent.state.x[[row]]
        scale = task.scale(sequences.which)
        for _ in range(tries):  # other sequences near it that leave nothing either cost no less
            beside = x + 0.02 * scale * rng.normal(size=scale.shape)
            while not np.all(beside @ rows.T > levels[[row]]):  # drawn back until it keeps its bounds
                beside = 0.5 * (beside + x)
            other = Descent(task, sequences, beside, kicks=1)
            other.close(20)
            assert other.left[0] >= 1e-9 or float(other.cost[0]) > float(descent.cost[row]) * (1.0 - 1e-4)


@pytest.mark.parametrize(
    ("body", "shift", "near"),
    [
        (replace(strong(25.0, 30.0), channels=cross(1e5)), False, 1e-4),
        deep(replace(strong(15.0, 3.4), channels=fan(36, 1e5)), True, 5e-3),
    ],
    ids=["one", "two"],
)
def test_it_costs_no_more_than_a_omega_where_that_can_be_had(body: Spacecraft, shift: bool, near: float) -> None:
    """By one pulse against ω where H is free, by the two exact ones once channels stand in every direction."""
    made = starting_points.schedules(task_of(body, Equations(shift=shift)))[0]
    assert made.total_impulse == pytest.approx(body.least_impulse, rel=near)
