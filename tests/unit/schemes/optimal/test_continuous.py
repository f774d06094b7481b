"""Firing without a pause, one channel after another: the earliest end, and short horizons."""

import math

import numpy as np
import pytest
from scipy.optimize import linprog
from support import places
from support.builders import Outcome, fan, spinner
from support.cases import deep, spread

from nutdamp.files.reader import example_text, load_spacecraft, read_spacecraft
from nutdamp.planning.plan import plan
from nutdamp.schemes.catalogue import OptimalOptions
from nutdamp.spacecraft.constraints import keeps_limits
from nutdamp.spacecraft.model import Limits, Spacecraft

SOONEST = OptimalOptions(least="time", free_axis=False)


@pytest.mark.parametrize(
    ("name", "free", "latest"),
    [
        (
            "continuous-tr2",
            False,
            0.515,
        ),  # 0.721 by channels that may fire at once, 0.613 by an independent search
        ("continuous-opt507", False, 0.9271),  # "infeasible" once, as the next one
        deep("continuous-opt513", False, 1.6467),
        deep("continuous-tr2", True, 0.42),
    ],
)
def test_schedules_that_leave_no_pause_are_found(name: str, free: bool, latest: float) -> None:
    body = load_spacecraft(places.case(f"{name}.yaml"))
    made = plan(body, "optimal", OptimalOptions(least="time", free_axis=free))
    assert made.end < latest
    assert keeps_limits(body, made.pulses)
    ended = Outcome(body, made.pulses)
    assert ended.nutation < 1e-9
    assert free or ended.shift < 1e-9


@pytest.mark.parametrize("wheel", [0.0, 60.0])
def test_a_nutation_smaller_than_any_pulse_has_no_schedule(wheel: float) -> None:
    """1e-4 deg: less than the shortest on-time of the example takes out, and nothing that a slot
    would fire for.
    """
    text = example_text().replace("nutation: 5 deg", "nutation: 0.0001 deg", 1)
    made = plan(
        read_spacecraft(f"{text}\nwheel: {{momentum: {wheel} N m s}}\n", "craft.yaml"), "optimal"
    )
    assert made.failure is None
    assert "without min_on_time there is a schedule" in (made.refusal or "")


@pytest.mark.parametrize("name", ["continuous-opt507", deep("continuous-opt513")])
def test_the_cheapest_of_a_horizon_that_is_nearly_too_short_is_found(name: str) -> None:
    body = load_spacecraft(places.case(f"{name}.yaml"))
    made = plan(body, "optimal", OptimalOptions(free_axis=False))
    assert made.feasible
    assert Outcome(body, made.pulses).nutation < 1e-9


def least_end(body: Spacecraft) -> float:
    """The earliest end of small angles, s, when at each moment one channel at most fires: a program
    of its own.
    """
    inertia, spin = body.inertia, body.spin
    torques = np.array([complex(one.torque[0], one.torque[1]) for one in body.channels])
    goal = -inertia.A * complex(body.omega0[0], body.omega0[1])

    def possible(end: float) -> bool:
        count = 240
        times = (np.arange(count) + 0.5) * end / count
        kicks = np.vstack(
            [
                np.outer(torques, np.exp(1j * rate * times)).ravel()
                for rate in (inertia.a * spin, spin)
            ]
        )
        kicks *= end / count
        equal = np.vstack([kicks[0].real, kicks[0].imag, kicks[1].real, kicks[1].imag]) / abs(goal)
        right = np.array([goal.real, goal.imag, 0.0, 0.0]) / abs(goal)
        shared = np.tile(np.eye(count), len(torques))
        return bool(
            linprog(
                np.zeros(kicks.shape[1]), shared, np.ones(count), equal, right, bounds=(0.0, 1.0)
            ).success
        )

    low = 0.0
    high = 10.0 * body.inertial_period
    assert possible(high)
    for _ in range(9):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if possible(middle) else (middle, high)
    return high


@spread("seed", range(14), quick=1, deep=3)
def test_no_schedule_ends_earlier(seed: int) -> None:
    """Within 3 % of what is possible at small angles, where that is exact."""
    rng = np.random.default_rng(seed)
    spin, ratio = (
        float(rng.choice([-1.0, 1.0]) * rng.uniform(1.0, 4.0)),
        float(rng.choice([0.5, 0.7, 1.3, 1.6])),
    )
    plain = spinner(100.0, 100.0 * ratio, spin, 0.3, phase=rng.uniform(-math.pi, math.pi))
    torque = plain.least_impulse / plain.inertial_period * 10.0 ** rng.uniform(0.2, 0.8)
    channels = fan(int(rng.integers(3, 6)), torque)
    horizon = 10.0 * plain.inertial_period
    body = spinner(
        100.0,
        100.0 * ratio,
        spin,
        0.3,
        phase=math.atan2(plain.omega0[1], plain.omega0[0]),
        channels=channels,
        limits=Limits(horizon=horizon),
    )
    made = plan(body, "optimal", SOONEST)
    assert made.feasible
    assert Outcome(body, made.pulses).nutation < 1e-9
    assert made.end < 1.03 * least_end(body)
