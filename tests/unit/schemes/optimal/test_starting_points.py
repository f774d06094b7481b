"""The scheme optimal where thrusters are strong and the horizon is short, against schedules found without it."""

from __future__ import annotations

import csv
import math
from dataclasses import replace

import numpy as np
import pytest
from support.builders import Outcome, channel, cross, fan, off_target, spinner
from support.cases import spread
from support.checker import violations
from support.places import CASES, case

from nutdamp.files.spacecraft_file import load_spacecraft
from nutdamp.planning import plan
from nutdamp.remarks import infeasibility
from nutdamp.schedule import Schedule, channel_pulse
from nutdamp.schemes import Options
from nutdamp.schemes.optimal import starting_points
from nutdamp.schemes.optimal.descent import Descent
from nutdamp.schemes.optimal.residual_equations import Equations
from nutdamp.schemes.optimal.sequences import Task
from nutdamp.spacecraft import Goal, Limits, Spacecraft

TEN_NANODEGREE = math.radians(1e-8)

BEATEN = sorted(path.stem for path in CASES.glob("optimal-beaten-*.csv"))


def impulse_of(name: str) -> float:
    """Σ|J| of the schedule beside a file, N m s."""
    with case(f"{name}.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    return math.fsum(math.hypot(*(float(row[f"impulse_{axis}_Nms"]) for axis in (1, 2, 3))) for row in rows)


def strong(degrees: float = 20.0, horizon: float = 2.0, limits: Limits | None = None) -> Spacecraft:
    """Five directions that do all there is to do within milliseconds, in less than one inertial period."""
    return spinner(
        120.0, 80.0, 3.0, degrees, 0.7, channels=fan(5, 2e4), limits=limits or Limits(horizon=horizon)
    )  # fmt: skip


def task_of(spacecraft: Spacecraft, equations: Equations | None = None) -> Task:
    costs = np.array([np.linalg.norm(one.torque) for one in spacecraft.channels])
    return Task(spacecraft, equations or Equations(), spacecraft.channels, costs)


@pytest.mark.deep
@spread("name", BEATEN, quick=1)
def test_no_schedule_found_without_it_is_cheaper(name: str) -> None:
    spacecraft = load_spacecraft(case(f"{name}.yaml"))
    made = plan(spacecraft, "optimal")
    assert made.schedule is not None, infeasibility(made)
    assert made.pulses.total_impulse <= 1.001 * impulse_of(name)
    assert violations(spacecraft, made.pulses) == []
    assert Outcome(spacecraft, made.pulses).nutation < TEN_NANODEGREE
    assert off_target(spacecraft, made.pulses) < TEN_NANODEGREE


def test_pulses_of_two_channels_may_stand_side_by_side() -> None:
    spacecraft = load_spacecraft(case("optimal-not-found.yaml"))
    made = plan(spacecraft, "optimal", Options(free_axis=True))
    assert made.schedule is not None, infeasibility(made)
    assert made.pulses.total_impulse <= impulse_of("optimal-not-found")
    assert violations(spacecraft, made.pulses) == []
    assert Outcome(spacecraft, made.pulses).nutation < TEN_NANODEGREE


@spread("rpm", [31.0, 31.5, 32.0], quick=1)
def test_two_spin_jets_that_one_burn_does_not_suffice_for(rpm: float) -> None:
    spacecraft = load_spacecraft(case("spin-up.yaml"))
    spacecraft = replace(spacecraft, goal=Goal(spin=rpm * math.pi / 30.0))
    made = plan(spacecraft, "optimal")
    assert made.schedule is not None, infeasibility(made)
    assert made.schedule.bounds is not None
    assert made.schedule.propellant is not None
    assert made.schedule.bounds.first_order is not None
    assert made.schedule.propellant <= 1.01 * made.schedule.bounds.first_order
    assert violations(spacecraft, made.pulses) == []
    flown = Outcome(spacecraft, made.pulses)
    assert flown.spin == pytest.approx(rpm * math.pi / 30.0, rel=1e-9)
    assert max(flown.nutation, flown.shift) < TEN_NANODEGREE


@spread(
    "limits",
    [
        Limits(horizon=2.0, gap=0.3, earliest=0.2),
        Limits(horizon=2.5, blackout=((0.0, 0.3), (0.9, 1.4))),
        Limits(horizon=2.5, max_pulses=3),
        Limits(horizon=2.5, tick=1e-4),
    ],
    quick=1,
    ids=["gap", "blackout", "max_pulses", "tick"],
)
def test_every_limit_is_kept(limits: Limits) -> None:
    spacecraft = strong(limits=limits)
    made = plan(spacecraft, "optimal")
    assert made.schedule is not None, infeasibility(made)
    assert violations(spacecraft, made.pulses) == []
    left = Outcome(spacecraft, made.pulses)
    coarse = 0.5 * 1e-4 * 2e4 / (80.0 * 3.0) if limits.tick is not None else TEN_NANODEGREE
    assert max(left.nutation, left.shift) < 1.1 * coarse


@pytest.mark.deep
def test_on_times_are_none_or_at_least_the_least() -> None:
    free = strong(20.0, 2.0)
    least = min(pulse.on_time for pulse in plan(free, "optimal").pulses)
    bounded = replace(
        free, channels=tuple(channel(one.name, *one.torque, min_on_time=3.0 * least) for one in free.channels)
    )
    made = plan(bounded, "optimal")
    assert made.schedule is not None, infeasibility(made)
    assert violations(bounded, made.pulses) == []
    assert Outcome(bounded, made.pulses).nutation < TEN_NANODEGREE
    assert made.pulses.total_impulse >= plan(free, "optimal").pulses.total_impulse * (1.0 - 1e-6)


@pytest.mark.deep
def test_h_may_end_off_its_target_and_that_saves() -> None:
    spacecraft = strong(5.0, 1.0)
    kept = plan(spacecraft, "optimal").pulses.total_impulse
    loose = plan(spacecraft, "optimal", Options(shift=math.radians(0.5)))
    free = plan(spacecraft, "optimal", Options(free_axis=True)).pulses.total_impulse
    flown = Outcome(spacecraft, loose.pulses)
    assert flown.nutation < TEN_NANODEGREE
    assert flown.shift <= math.radians(0.5) * (1.0 + 1e-6)
    assert free * (1.0 - 1e-6) <= loose.pulses.total_impulse < 0.99 * kept


@pytest.mark.deep
def test_the_same_plan_every_time() -> None:
    one, two = (plan(strong(), "optimal").pulses for _ in range(2))
    assert [(pulse.start, pulse.on_time) for pulse in one] == [(pulse.start, pulse.on_time) for pulse in two]


def test_the_work_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """However long the horizon, however many the channels: flights at a time are counted, not seconds."""
    calls: list[int] = []
    flown = Task.misses

    def counted(self: Task, which: np.ndarray, x: np.ndarray, kicks: int) -> np.ndarray:
        calls.append(len(x))
        return flown(self, which, x, kicks)

    monkeypatch.setattr(Task, "misses", counted)
    for horizon, count in ((1.0, 2), (400.0, 40)):
        calls.clear()
        body = replace(strong(40.0, horizon), channels=fan(count, 2e4))
        starting_points.schedules(task_of(body))
        assert len(calls) < 2000
        assert sum(calls) < 400_000


# --- the descent -----------------------------------------------------------------------------------------------------


def a_sequence(task: Task, seed: int, pulses: int = 4) -> starting_points.Starts:
    return starting_points.random_starts(task, pulses, 1, np.random.default_rng(seed))


@pytest.mark.parametrize("seed", range(6))
def test_misses_are_those_of_the_reference_integrator(seed: int) -> None:
    spacecraft = replace(strong(30.0, 4.0), channels=cross(3e2))
    task = task_of(spacecraft)
    sequences, x = a_sequence(task, seed)
    count = sequences.which.shape[1]
    pulses = (
        channel_pulse(spacecraft.channels[number], start + 0.5 * on, on)
        for number, start, on in zip(sequences.which[0].tolist(), x[0, :count], x[0, count:], strict=True)
    )
    flown = Outcome(spacecraft, Schedule(tuple(pulses)))
    moments = np.asarray(spacecraft.inertia.moments)
    momentum, size = moments * flown.motion.rates, float(np.linalg.norm(spacecraft.momentum))
    after = flown.motion.rotation @ momentum
    misses = task.misses(sequences.which, x, 0)[0]
    assert misses[:2] == pytest.approx(momentum[:2] / size, abs=1e-11)
    assert np.linalg.norm(misses[2:]) == pytest.approx(np.linalg.norm(after[:2]) / size, abs=1e-11)
    # Kicks close in on it as the square of their number; they end half a kick earlier, which turns ω in the body.
    sizes = [_sizes(task.misses(sequences.which, x, kicks)[0]) for kicks in (0, 4, 8, 16)]
    away = [float(np.abs(one - sizes[0]).max()) for one in sizes[1:]]
    assert away[0] / away[1] == pytest.approx(4.0, rel=0.2)
    assert away[1] / away[2] == pytest.approx(4.0, rel=0.1)


def _sizes(misses: np.ndarray) -> np.ndarray:
    """Of the transverse momentum, and of the shift."""
    return np.asarray(np.linalg.norm(misses.reshape(2, 2), axis=1))


def test_a_descent_keeps_its_bounds_and_ends_where_no_step_saves() -> None:
    task = task_of(strong(30.0, 3.0))
    starts = starting_points.random_starts(task, 4, 64, np.random.default_rng(5))
    rows, levels = task.bounds(starts.sequences)
    descent = Descent(task, *starts, kicks=1)
    for _ in range(30):
        descent.run(2)
        assert np.all(descent.state.x @ rows.T > levels)
    met = np.flatnonzero((descent.left < 1e-9) & (descent.state.error == 0.0))
    assert len(met) > 8
    rng = np.random.default_rng(6)
    for row in met[:8]:
        one = starting_points.Starts(starts.sequences.of([row]), descent.state.x[[row]])
        cost = float(descent.cost[row])
        for _ in range(20):  # other sequences near it that leave nothing either cost no less
            scale = task.scale(one.sequences.which)
            other = Descent(
                task,
                one.sequences,
                _inside(one.x + 0.02 * scale * rng.normal(size=scale.shape), rows, levels[[row]], one.x),
                kicks=1,
            )
            other.close(20)
            if other.left[0] < 1e-9:
                assert float(other.cost[0]) > cost * (1.0 - 1e-4)


def _inside(x: np.ndarray, rows: np.ndarray, levels: np.ndarray, within: np.ndarray) -> np.ndarray:
    """``x`` drawn back towards ``within`` until it keeps its bounds."""
    for _ in range(60):
        if np.all(x @ rows.T > levels):
            return x
        x = 0.5 * (x + within)
    return within


def test_one_impulse_is_the_cheapest_where_h_is_free() -> None:
    """A|ω0| by one pulse against ω, whatever else the sequence might have fired."""
    spacecraft = replace(strong(25.0, 30.0), channels=cross(1e5))
    made = starting_points.schedules(task_of(spacecraft, Equations(shift=False)))[0]
    assert made.total_impulse == pytest.approx(spacecraft.least_impulse, rel=1e-4)


def test_two_impulses_cost_no_more_where_there_is_a_period() -> None:
    """The exact two pulses attain A|ω0| once channels stand in every direction."""
    spacecraft = replace(strong(15.0, 3.4), channels=fan(36, 1e5))
    made = starting_points.schedules(task_of(spacecraft))[0]
    assert made.total_impulse == pytest.approx(spacecraft.least_impulse, rel=5e-3)
