"""The scheme optimal where thrusters are strong and the horizon is short, against schedules found without it."""

from __future__ import annotations

import csv
import math

import numpy as np
import pytest
from builders import Outcome
from cases_dir import CASES, case
from checker import violations

from nutdamp.files.spacecraft_file import load_spacecraft
from nutdamp.physics import attitude
from nutdamp.planning import plan

NANODEGREE = math.radians(1e-9)
TEN_NANODEGREE = math.radians(1e-8)

BEATEN = sorted(path.stem for path in CASES.glob("optimal-beaten-*.csv"))


def impulse_of(name: str) -> float:
    """Σ|J| of the schedule beside a file, N m s."""
    with case(f"{name}.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    return math.fsum(math.hypot(*(float(row[f"impulse_{axis}_Nms"]) for axis in (1, 2, 3))) for row in rows)


@pytest.mark.parametrize("name", BEATEN)
def test_no_schedule_found_without_it_is_cheaper(name: str) -> None:
    spacecraft = load_spacecraft(case(f"{name}.yaml"))
    made = plan(spacecraft, "optimal")
    assert made.schedule is not None, made.why
    assert made.pulses.total_impulse <= 1.001 * impulse_of(name)
    assert violations(spacecraft, made.pulses) == []
    flown = Outcome(spacecraft, made.pulses)
    assert flown.nutation < TEN_NANODEGREE
    body, motion = np.asarray(spacecraft.inertia.moments), flown.motion
    after = motion.rotation @ (body * motion.rates)
    assert attitude.angle_between(after, spacecraft.target_axis) < TEN_NANODEGREE
