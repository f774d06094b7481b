"""Sensors that are broken: no estimate is accepted that is far off,
but where no record could tell.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.broken_sensors import FAULTS, outcome, untellable
from support.cases import deep, spread, weekly
from support.synthetic import gyro_case

from nutdamp.errors import Infeasible
from nutdamp.estimation.fit import expect_told, fit

RECORDS, IN_CI = 60, 10


def expect_sound(folder: Path, number: int, fault: str) -> None:
    said, off, words = outcome(folder, number, fault)
    assert said == "refused" or off < 5.0 or untellable(number, fault), words


@spread(
    ("fault", "number"),
    [(fault, number) for fault in list(FAULTS)[:IN_CI] for number in range(RECORDS)],
    quick=2,
    deep=40,
)
def test_ten_kinds_of_broken_sensors_lead_to_no_wrong_estimate(
    tmp_path: Path, fault: str, number: int
) -> None:
    expect_sound(tmp_path, number, fault)


@pytest.mark.parametrize(
    ("fault", "number"),
    [weekly(fault, number) for fault in list(FAULTS)[IN_CI:] for number in range(RECORDS)],
)
def test_other_kinds_of_broken_sensors_lead_to_no_wrong_estimate(
    tmp_path: Path, fault: str, number: int
) -> None:
    expect_sound(tmp_path, number, fault)


@pytest.mark.parametrize(
    ("fault", "number"),
    [
        ("clipped", 21),
        ("sign_last", 13),
        deep("sign_last", 14),
        deep("sign_last", 30),
        deep("signs", 15),
        deep("signs", 16),
        ("signs", 31),
    ],
)
def test_no_clipped_opposite_or_mirrored_motion_is_accepted(
    tmp_path: Path, fault: str, number: int
) -> None:
    assert outcome(tmp_path, number, fault)[0] == "refused"


def test_what_neither_data_nor_file_tell_is_named() -> None:
    fitted = fit(*(getattr(gyro_case(1), name) for name in ("spacecraft", "record")))
    expect_told(fitted)
    slopes = fitted.jacobian.copy()
    for lost in (
        0.0,
        3.0 * slopes[:, fitted.index("omega_2")],
    ):  # nothing, or not apart from another
        slopes[:, fitted.index("omega_1")] = lost
        with pytest.raises(Infeasible, match="does not tell all of omega_1, omega_2, omega_3"):
            expect_told(replace(fitted, jacobian=slopes))


def test_a_signal_of_which_much_would_be_left_out_is_named() -> None:
    case = gyro_case(2)
    values = np.array(case.record.signals["omega_1"])
    values[::4] += 300.0 * case.noise * np.random.default_rng(1).normal(size=len(values[::4]))
    with pytest.raises(
        Infeasible, match=r"does not explain omega_1: 2\d % of it would be left out"
    ):
        fit(
            case.spacecraft,
            replace(case.record, signals={**case.record.signals, "omega_1": values}),
        )
