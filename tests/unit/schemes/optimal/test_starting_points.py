"""The scheme optimal where thrusters are strong and the horizon is short, against schedules found without it."""

from __future__ import annotations

import csv
import math
from dataclasses import replace

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


def impulse_of(name: str) -> float:
    """Σ|J| of the schedule beside a file, N m s."""
    with case(f"{name}.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    return math.fsum(math.hypot(*(float(row[f"impulse_{axis}_Nms"]) for axis in (1, 2, 3))) for row in rows)


def strong(degrees: float = 20.0, horizon: float = 2.0, limits: Limits | None = None) -> Spacecraft:
    """Five directions that do all there is to do within milliseconds, in less than one inertial period."""
    return spinner(degrees=degrees, channels=fan(5, 2e4), limits=limits or Limits(horizon=horizon))


def task_of(spacecraft: Spacecraft, equations: Equations | None = None) -> Task:
    costs = np.array([np.linalg.norm(one.torque) for one in spacecraft.channels])
    return Task(spacecraft, equations or Equations(), spacecraft.channels, costs)


@pytest.mark.deep
@spread("name", sorted(path.stem for path in CASES.glob("optimal-beaten-*.csv")), quick=1, deep=0)
def test_no_schedule_found_without_it_is_cheaper(name: str) -> None:
    assert flies(load_spacecraft(case(f"{name}.yaml")), left=EXACT).pulses.total_impulse <= 1.001 * impulse_of(name)


@pytest.mark.deep
def test_pulses_of_two_channels_may_stand_side_by_side() -> None:
    made = flies(load_spacecraft(case("optimal-not-found.yaml")), left=EXACT, free_axis=True)
    assert made.pulses.total_impulse <= impulse_of("optimal-not-found")


@pytest.mark.deep
@spread("rpm", [31.0, 31.5, 32.0], quick=1, deep=0)
def test_two_spin_jets_that_one_burn_does_not_suffice_for(rpm: float) -> None:
    spacecraft = load_spacecraft(case("spin-up.yaml"))
    flies(replace(spacecraft, goal=Goal(spin=rpm * math.pi / 30.0)), left=EXACT, dearest=1.01)


@pytest.mark.parametrize(
    "limits",
    [
        deep(Limits(horizon=2.0, gap=0.3, earliest=0.2)),
        weekly(Limits(horizon=2.5, blackout=((0.0, 0.3), (0.9, 1.4)))),
        weekly(Limits(horizon=2.5, max_pulses=3)),
        weekly(Limits(horizon=2.5, tick=1e-4)),
    ],
    ids=["gap", "blackout", "max_pulses", "tick"],
)
def test_every_limit_is_kept(limits: Limits) -> None:
    coarse = math.degrees(0.5 * 1e-4 * 2e4 / (80.0 * 3.0))
    flies(strong(limits=limits), left=EXACT if limits.tick is None else 1.1 * coarse)


@pytest.mark.weekly
def test_on_times_are_none_or_at_least_the_least() -> None:
    free = strong(5.0, 1.0)
    found = plan(free, "optimal").pulses
    least = 3.0 * min(pulse.on_time for pulse in found)
    bounded = tuple(channel(one.name, *one.torque, min_on_time=least) for one in free.channels)
    assert flies(replace(free, channels=bounded), left=EXACT).pulses.cost >= found.cost * (1.0 - 1e-6)


@pytest.mark.deep
def test_the_same_plan_every_time() -> None:
    one, two = (starting_points.schedules(task_of(strong()))[0] for _ in range(2))
    assert [(pulse.start, pulse.on_time) for pulse in one] == [(pulse.start, pulse.on_time) for pulse in two]


@pytest.mark.deep
@pytest.mark.parametrize(("horizon", "count"), [(1.0, 2), (400.0, 40)])
def test_the_work_is_bounded(horizon: float, count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """However long the horizon, however many the channels: flights at a time are counted, not seconds."""
    calls: list[int] = []
    flown = Task.misses

    def counted(self: Task, which: np.ndarray, x: np.ndarray, kicks: int) -> np.ndarray:
        calls.append(len(x))
        return flown(self, which, x, kicks)

    monkeypatch.setattr(Task, "misses", counted)
    starting_points.schedules(task_of(replace(strong(40.0, horizon), channels=fan(count, 2e4))))
    assert 0 < len(calls) < 2000
    assert sum(calls) < 400_000


@pytest.mark.parametrize("seed", range(4))
def test_misses_are_those_of_the_reference_integrator(seed: int) -> None:
    spacecraft = replace(strong(30.0, 4.0), channels=cross(3e2))
    task = task_of(spacecraft)
    sequences, x = starting_points.random_starts(task, 4, 1, np.random.default_rng(seed))
    count = sequences.which.shape[1]
    pulses = (
        channel_pulse(spacecraft.channels[number], start + 0.5 * on, on)
        for number, start, on in zip(sequences.which[0].tolist(), x[0, :count], x[0, count:], strict=True)
    )
    flown = Outcome(spacecraft, Schedule(tuple(pulses)))
    momentum = np.asarray(spacecraft.inertia.moments) * flown.motion.rates
    size = float(np.linalg.norm(spacecraft.momentum))
    misses = task.misses(sequences.which, x, 0)[0]
    assert misses[:2] == pytest.approx(momentum[:2] / size, abs=1e-11)
    after = flown.motion.rotation @ momentum
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
        one = starting_points.Starts(begun.sequences.of([row]), descent.state.x[[row]])
        scale = task.scale(one.sequences.which)
        for _ in range(tries):  # other sequences near it that leave nothing either cost no less
            beside = one.x + 0.02 * scale * rng.normal(size=scale.shape)
            while not np.all(beside @ rows.T > levels[[row]]):  # drawn back until it keeps its bounds
                beside = 0.5 * (beside + one.x)
            other = Descent(task, one.sequences, beside, kicks=1)
            other.close(20)
            assert other.left[0] >= 1e-9 or float(other.cost[0]) > float(descent.cost[row]) * (1.0 - 1e-4)


def test_one_impulse_is_the_cheapest_where_h_is_free() -> None:
    """A|ω0| by one pulse against ω, whatever else the sequence might have fired."""
    spacecraft = replace(strong(25.0, 30.0), channels=cross(1e5))
    made = starting_points.schedules(task_of(spacecraft, Equations(shift=False)))[0]
    assert made.total_impulse == pytest.approx(spacecraft.least_impulse, rel=1e-4)


@pytest.mark.deep
def test_two_impulses_cost_no_more_where_there_is_a_period() -> None:
    """The exact two pulses attain A|ω0| once channels stand in every direction."""
    spacecraft = replace(strong(15.0, 3.4), channels=fan(36, 1e5))
    made = starting_points.schedules(task_of(spacecraft))[0]
    assert made.total_impulse == pytest.approx(spacecraft.least_impulse, rel=5e-3)
