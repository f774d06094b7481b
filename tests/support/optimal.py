"""What every schedule of the scheme optimal has to do, and random spacecraft to try it on."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from unittest import mock

import numpy as np
from support.builders import Outcome, off_target, spinner
from support.checker import violations

from nutdamp.planning.causes import infeasibility
from nutdamp.planning.plan import Plan, plan
from nutdamp.schemes.catalogue import OptimalOptions
from nutdamp.schemes.optimal import search
from nutdamp.schemes.optimal.problem import Problem
from nutdamp.spacecraft.equipment import Channel, Thruster
from nutdamp.spacecraft.model import Limits, Spacecraft


def flies(
    spacecraft: Spacecraft, *, left: float = 1e-6, dearest: float = math.inf, **options: Any
) -> Plan:
    """The plan of optimal with these options, H kept unless they free it: it keeps all limits, and
    its rigorous bound.

    By the reference integrator it leaves less than ``left`` degrees, and the spin of the goal. It
    costs at most ``dearest`` times the first-order bound, which knows neither large angles nor
    on-times.
    """
    chosen = OptimalOptions(**({"free_axis": False} | options))
    made = plan(spacecraft, "optimal", chosen)
    assert made.schedule is not None, infeasibility(made)
    assert violations(spacecraft, made.pulses) == []
    flown = Outcome(spacecraft, made.pulses)
    goal = spacecraft.goal
    assert math.degrees(flown.nutation) < left
    if not chosen.free_axis:
        off = flown.shift if goal.axis is None else off_target(spacecraft, made.pulses)
        assert math.degrees(off - (chosen.shift or 0.0)) < left
    assert goal.spin is None or math.isclose(flown.spin, goal.spin, rel_tol=1e-8)
    bounds = made.schedule.bounds
    if bounds is not None:
        cost = made.pulses.cost_in(bounds.unit)
        assert bounds.rigorous is None or bounds.rigorous <= cost * (1.0 + 1e-9)
        assert bounds.first_order is None or cost <= dearest * bounds.first_order
    if not math.isinf(dearest):
        assert bounds is not None
        small = bounds.first_order
        if small is None:  # at large angles a plan may cost less than that, which is then no bound
            small = Problem(spacecraft, chosen).program().solve().cost
        assert made.pulses.cost_in(bounds.unit) <= dearest * small
    return made


@contextmanager
def as_found() -> Iterator[None]:
    """Within it, optimal gives what it finds over the whole horizon, not what ends earlier for up
    to 0.1 % more.
    """
    with mock.patch.object(search, "hastened", lambda _search, best: best):
        yield


def random_layout(seed: int) -> Spacecraft:
    """2 to 12 skew channels, 1° to 30° of nutation, 1 to 50 body nutation periods."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 13))
    A = rng.uniform(60, 200)
    spin = rng.uniform(0.5, 6) * rng.choice([-1, 1])
    C = A * float(rng.choice([rng.uniform(0.3, 0.95), rng.uniform(1.05, 1.9)]))
    degrees = rng.uniform(1, 30)
    period = 2 * math.pi / abs((A - C) / A * spin)
    horizon = rng.uniform(1, 50) * period
    needed = C * abs(spin) * math.tan(math.radians(degrees)) / period
    made = []
    for index in range(count):
        angle = rng.uniform(0, 2 * math.pi)
        size = needed * 10 ** rng.uniform(-0.7, 1.5)
        axial = rng.uniform(-0.2, 0.2) * size * (rng.random() < 0.4)
        torque = np.array([size * math.cos(angle), size * math.sin(angle), axial])
        shortest = rng.choice([0.0, 0.02])
        longest = math.inf if rng.random() < 0.5 else rng.uniform(0.2, 4)
        one = Thruster(f"c{index}", torque, None, rng.uniform(1, 20), 220.0, shortest, longest)
        made.append(Channel(f"c{index}", (one,)))
    return spinner(
        A,
        C,
        spin,
        degrees,
        rng.uniform(0, 6.28),
        channels=tuple(made),
        limits=Limits(horizon=horizon),
    )
