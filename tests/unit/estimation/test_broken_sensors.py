"""Broken sensors: no estimate is far off that is accepted, but where no record could tell."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from support.cases import deep, spread, weekly
from support.telemetry import KINDS, Telemetry, gyro_case, telemetry

from nutdamp.errors import Infeasible, NutdampError
from nutdamp.estimation.fit import expect_told, fit
from nutdamp.estimation.results import compared, refused
from nutdamp.files.telemetry import read_telemetry

# --- records with broken sensors: what happens to their columns, and what `fit` says

Array = NDArray[np.float64]
Fault = Callable[[Array, np.random.Generator], None]
"""What is done to the columns (n, k) of a record, in place."""

CROSSED = (("star",), ("star", "omega_3"), ("sun",), ("quaternion",))
"""Kinds of records besides `KINDS`: crossings of a star or the Sun, or quaternions."""

SENSORS = ("bias", "misalignment", "wobble")
"""First words of what is estimated of the sensors themselves."""


def _to(column: int, values: Callable[[Array], Array | float]) -> Fault:
    def done(table: Array, _: np.random.Generator) -> None:
        table[:, column] = values(table[:, column])

    return done


def _all(values: Callable[[Array], Array | float]) -> Fault:
    def done(table: Array, _: np.random.Generator) -> None:
        for column in range(table.shape[1]):
            table[:, column] = values(table[:, column])

    return done


def _first(values: Array) -> float:
    return float(values[np.isfinite(values)][0])


def _held(values: Array, value: float) -> Array:
    return np.where(
        (np.arange(len(values)) > 0.5 * len(values)) & np.isfinite(values), value, values
    )


def _swapped(table: Array, _: np.random.Generator) -> None:
    table[:, :2] = table[:, 1::-1] if table.shape[1] > 1 else table[:, :2]


def _signs(table: Array, _: np.random.Generator) -> None:
    table[:, :2] *= -1.0


def _noise(table: Array, draw: np.random.Generator) -> None:
    table[:, 0] = np.nanstd(table[:, 0]) * draw.normal(size=len(table))


def _spikes(table: Array, draw: np.random.Generator) -> None:
    table[draw.uniform(size=len(table)) < 0.02, 0] = 1e14


def _outliers(table: Array, draw: np.random.Generator) -> None:
    out = draw.uniform(size=len(table)) < 0.3
    table[out, 0] = (np.nanstd(table[:, 0]) or 1.0) * 5.0 * draw.normal(size=out.sum())


def _steps(values: Array) -> Array:
    step = 0.7 * float(np.nanstd(values)) or 1.0
    return np.asarray(np.rint(values / step) * step)


def _clipped(values: Array) -> Array:
    middle = float(np.nanmedian(values))
    size = 0.6 * float(np.nanstd(values)) * math.sqrt(2.0)
    return np.clip(values, middle - size, middle + size)


FAULTS: dict[str, Fault] = {
    "dead_one": _to(0, lambda values: 0.0 * values),
    "dead_last": _to(-1, lambda values: 0.0 * values),
    "dead_all": _all(lambda values: 0.0 * values),
    "stuck_one": _to(0, lambda values: 0.0 * values + _first(values)),
    "stuck_all": _all(lambda values: 0.0 * values + _first(values)),
    "swapped": _swapped,
    "sign_one": _to(0, lambda values: -values),
    "sign_last": _to(-1, lambda values: -values),
    "x57": _all(lambda values: math.degrees(1.0) * values),
    "coarse": _to(0, _steps),
    "dead_later": _to(0, lambda values: _held(values, 0.0)),
    "stuck_later": _to(
        -1, lambda values: _held(values, values[np.isfinite(values)][len(values) // 3])
    ),
    "huge_one": _to(0, lambda values: 0.0 * values + 1e14),
    "spikes": _spikes,
    "signs": _signs,
    "x57_one": _to(0, lambda values: math.degrees(1.0) * values),
    "rpm": _all(lambda values: values / 6.0),
    "coarse_all": _all(_steps),
    "clipped": _to(0, _clipped),
    "noise": _noise,
    "outliers": _outliers,
    "drifts": _to(
        0, lambda values: values + 3.0 * np.nanstd(values) * np.linspace(0.0, 1.0, len(values))
    ),
}
"""The first ten are for CI."""


ALONE = (("omega_1",), ("acceleration",))
UNTELLABLE: dict[str, tuple[tuple[str, ...], ...]] = {
    "signs": KINDS,
    "sign_one": ALONE,
    "sign_last": (*ALONE, ("acceleration", "omega_3")),
    "x57": (*ALONE, ("omega_12",)),
    "rpm": (*ALONE, ("omega_12",)),
}
"""Kinds of records that do not tell a fault.

A body turned by 180 deg about its axis moves alike: both transverse signs, or that of a lone
transverse signal. Without the spin beside them transverse signals of another size are another
nutation.
"""


def untellable(number: int, fault: str) -> bool:
    """True where no record of the kind of a number tells the fault."""
    kinds = (*KINDS, *CROSSED)
    return kinds[number % len(kinds)] in UNTELLABLE.get(fault, ())


def record_of(folder: Path, number: int) -> Telemetry:
    """Telemetry of a number, of the kind whose turn it is."""
    kinds = (*KINDS, *CROSSED)
    return telemetry(folder, 7000 + number, kinds[number % len(kinds)])


def _apart(name: str, difference: float) -> float:
    """A difference of two estimates; turns about the axis count without whole ones."""
    return math.remainder(difference, 2.0 * math.pi) if name == "attitude_3" else difference


def outcome(folder: Path, number: int, fault: str) -> tuple[str, float, str]:
    """What `fit` does with a record and a fault: verdict; farthest estimate in sigmas; words."""
    told = record_of(folder, number)
    path = next(folder.glob(f"{7000 + number}.csv"))
    header, *rows = path.read_text().splitlines()
    cells = [row.split(",") for row in rows]
    table = np.array([[float(cell or "nan") for cell in row[1:]] for row in cells])
    towards = 2 * header.count("crossing_ra_deg")  # columns that say where a star is
    FAULTS[fault](table[:, : table.shape[1] - towards], np.random.default_rng([3, number]))
    lines = [
        ",".join([row[0], *("" if math.isnan(value) else repr(float(value)) for value in values)])
        for row, values in zip(cells, table, strict=True)
    ]
    path.write_text("\n".join([header, *lines]) + "\n", encoding="utf-8")
    sun = folder / f"{7000 + number}-sun.csv"
    try:
        record = read_telemetry(
            path, told.spacecraft, sun if sun.exists() else None, told.record.schedule
        )[0]
        fitted = compared(told.spacecraft, record)
    except NutdampError as error:
        return "refused", 0.0, str(error)
    if refused(fitted):
        return "refused", 0.0, ", ".join(fitted.causes)
    off = {
        each.name: abs(_apart(each.name, fitted.named[each.name] - told.truth[each.name])) / sigma
        for each, sigma in zip(fitted.model.parameters, fitted.sigmas, strict=True)
        if each.name in told.truth and not each.name.startswith(SENSORS)
    }
    worst = max(off, key=lambda name: off[name])
    return "accepted", off[worst], worst


# --- sensors that are broken: no estimate is accepted that is far off, but where no record could
# tell

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
        with pytest.raises(Infeasible, match="does not determine all of omega_1, omega_2, omega_3"):
            expect_told(replace(fitted, jacobian=slopes))


def test_a_signal_of_which_much_would_be_left_out_is_named() -> None:
    case = gyro_case(2)
    values = np.array(case.record.signals["omega_1"])
    values[::4] += 300.0 * case.noise * np.random.default_rng(1).normal(size=len(values[::4]))
    with pytest.raises(
        Infeasible, match=r"does not explain omega_1: 2\d % of its samples would be left out"
    ):
        fit(
            case.spacecraft,
            replace(case.record, signals={**case.record.signals, "omega_1": values}),
        )
