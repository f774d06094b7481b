"""What `plan` says of the recommended plan is what `disperse` says of it, for random spacecraft with tolerances."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from support.cases import spread

import nutdamp
from nutdamp.planning.decision import compare, decide
from nutdamp.spacecraft.model import Spacecraft

SCHEMES = ("one-pulse", "two-pulse", "four-pulse")


def tolerant(seed: int) -> Spacecraft:
    """The built-in example with other moments, motion, tolerances and requirement: some plans comply, others do not."""
    rng = np.random.default_rng(seed)
    size = float(10.0 ** rng.uniform(-1.0, 0.0))
    requirement: dict[str, Any] = {"nutation": f"{rng.uniform(0.2, 0.8)} deg"}
    if rng.random() < 0.5:
        requirement["momentum_shift"] = f"{rng.uniform(0.1, 1.0)} deg"
    return nutdamp.example().with_(
        inertia={"A": 120.0, "C": 120.0 * rng.uniform(0.4, 1.6)},
        state={"spin": f"{rng.choice([-20, 30])} rpm", "nutation": f"{rng.uniform(2.0, 8.0)} deg", "phase": "40 deg"},
        requirement=requirement | {"probability": float(rng.choice([0.9, 0.99, 0.997]))},
        dispersions={
            "A": {"normal": f"{0.5 * size} %"},
            "omega0": {"normal": f"{0.1 * size} deg/s"},
            "thrust": {"normal": f"{2.0 * size} %"},
            "timing": {"uniform": "5 ms"},
        },
    )


@spread("seed", range(100), quick=1, deep=5)
def test_plan_and_disperse_say_the_same(seed: int) -> None:
    body, samples = tolerant(seed), 4_000
    compared = compare(body, SCHEMES, samples=samples)
    decided = decide(compared)
    assert decided is not None
    assert decided.cases is not None
    flown = nutdamp.disperse(decided.plan, samples)
    assert decided.cases.complying == pytest.approx(flown.met_fraction)
    assert decided.met == (flown.meets_requirement and decided.nominal)
    complying = [plan for plan in compared if plan.feasible and compared.meets(plan)]
    for plan in compared:
        share = compared.shares.get(plan)
        if share is not None and share.met is not None:
            exact = nutdamp.disperse(plan, samples)
            assert share.met == exact.meets_requirement, plan.scheme
            assert share.low <= (exact.met_fraction or 0.0) <= share.high
    if complying:
        assert decided.plan in complying
        assert decided.plan.pulses.cost <= min(plan.pulses.cost for plan in complying) * 1.001
