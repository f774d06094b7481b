"""Telemetry from CSV files: times, and measurements of the motion; an empty cell is a missing sample.

Columns: t_s (from t = 0 of the spacecraft file) or utc; omega_1_rad_s to omega_3_rad_s (or _deg_s); axis_ra_deg and
axis_dec_deg, or axis_x, axis_y, axis_z; acceleration_m_s2; sun_pulse, 1 from the sample on that has seen one. A track
of ``simulate --csv`` is such a file. An attitude history (AEM) gives the axis, and the rates where it has them.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from nutdamp.common.time import Epoch
from nutdamp.estimation.parameters import ACCELERATION, AXIS, GYROS, SUN_PULSE, Record
from nutdamp.files.ccsds.history import is_history, read_history, record_of
from nutdamp.files.tabular import HEADER as TRACK
from nutdamp.files.tabular import Cells, Table
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.schedule import Schedule
from nutdamp.units import shown

Vector = NDArray[np.float64]

TIMES = ("t_s", "utc")
RATES = {f"{name}_rad_s": (name, 1.0) for name in GYROS} | {f"{name}_deg_s": (name, math.pi / 180.0) for name in GYROS}
ANGLES = ("axis_ra_deg", "axis_dec_deg")
ACCELERATIONS = "acceleration_m_s2"
MEASURED = (*RATES, *ANGLES, *AXIS, ACCELERATIONS, SUN_PULSE)
"""Columns of samples."""

UNIT = 0.01
"""Deviation from length one that a measured axis may have."""


SAME = 0.03
"""Part by which a ratio of rates may differ from that of two units."""


def read_telemetry(
    path: str | Path, spacecraft: Spacecraft, sun_pulses: str | Path | None = None, schedule: Schedule | None = None
) -> tuple[Record, list[str]]:
    """The record in a CSV file, and warnings; ``sun_pulses``: a file of the times of Sun pulses besides.

    Raises CannotRead, and FaultyFile with every fault of the first file that has one.
    """
    if is_history(str(path)):
        history = read_history(str(path))
        seen = np.empty(0) if sun_pulses is None else read_sun_pulses(sun_pulses, spacecraft)
        record = record_of(history, spacecraft, schedule or Schedule())
        return replace(record, sun_pulses=seen), [f"{path}: {remark}" for remark in history.remarks]
    table = Table(path, (*TIMES, *MEASURED, *TRACK), "samples")
    _expect_columns(table)
    rows = [(line, cells) for line, row in table.rows if (cells := table.cells(line, row)) is not None]
    table.check()
    times = _times(table, rows, spacecraft)
    columns = {name: _column(table, rows, name) for name in MEASURED if name in table.header}
    for name in ANGLES:
        if name in columns and np.nanmax(np.abs(columns[name]), initial=0.0) > (360.0 if name == ANGLES[0] else 90.0):
            line = rows[int(np.nanargmax(np.abs(columns[name])))][0]
            table.fault(line, name, f"expected an angle of at most {360 if name == ANGLES[0] else 90} deg")
    signals = _signals(table, rows, columns)
    _expect_unit(table, signals, spacecraft.spin)
    seen, step = _sun_column(table, rows, times, columns.get(SUN_PULSE))
    table.check()
    warnings = table.warned
    if sun_pulses is not None:
        if len(seen):
            warnings.append(f"{table.name}: the column {SUN_PULSE} is ignored: the times are those of {sun_pulses}")
        seen, step = read_sun_pulses(sun_pulses, spacecraft), 0.0
    return Record(times, signals, seen, step, schedule or Schedule()), warnings


def read_sun_pulses(path: str | Path, spacecraft: Spacecraft) -> Vector:
    """Times (k,) s of Sun pulses in a CSV file with the column t_s or utc; raises CannotRead or FaultyFile."""
    table = Table(path, TIMES, "Sun pulses")
    _expect_time(table)
    table.expect()
    rows = [(line, cells) for line, row in table.rows if (cells := table.cells(line, row)) is not None]
    table.check()
    return _times(table, rows, spacecraft)


def _expect_time(table: Table) -> None:
    there = [name for name in TIMES if name in table.header]
    if not there:
        table.fault(1, TIMES[0], f"the column is missing (or {TIMES[1]}){table.misspelt(TIMES[0])}")
    if len(there) == 2:
        table.fault(1, TIMES[1], f"two columns of times: expected {TIMES[0]} or {TIMES[1]}")


def _expect_columns(table: Table) -> None:
    """Faults for columns that are missing, in other units, or that contradict each other."""
    _expect_time(table)
    header = table.header
    measured = [name for name in MEASURED if name in header]
    for name in header:
        if name not in table.known and re.match(r"omega|axis|accel|sun|rate|gyro|(ra|dec)(_|$)", name, re.IGNORECASE):
            table.fault(1, name, f"{shown(name)} is no column of telemetry{_instead(name)}")
    if not measured and not table.faults:
        table.fault(1, "", f"no column of samples; expected some of {', '.join(MEASURED)}")
    for name in GYROS:
        if f"{name}_rad_s" in header and f"{name}_deg_s" in header:
            table.fault(1, f"{name}_deg_s", f"given twice, also as {name}_rad_s; remove one of them")
    for group in (ANGLES, AXIS):
        missing = [name for name in group if name not in header]
        if 0 < len(missing) < len(group):
            table.fault(1, missing[0], f"the column is missing beside {next(name for name in group if name in header)}")
    if set(ANGLES) & set(header) and set(AXIS) & set(header):
        table.fault(1, ANGLES[0], f"the axis is given twice, also as {', '.join(AXIS)}; remove one of them")
    table.expect()


def _instead(name: str) -> str:
    """The columns that a name may be meant as, with the units that there are."""
    lowered = name.lower()
    rates = ["omega_1_rad_s … omega_3_rad_s or omega_1_deg_s … omega_3_deg_s"]
    for word, columns in (
        ("omega", rates),
        ("rate", rates),
        ("gyro", rates),
        ("accel", [ACCELERATIONS]),
        ("sun", [SUN_PULSE]),
        ("", [*ANGLES, *AXIS]),
    ):
        if lowered.startswith(word):
            return f"; expected {', '.join(columns)}"
    return ""


def _times(table: Table, rows: list[tuple[int, Cells]], spacecraft: Spacecraft) -> Vector:
    """Times of the rows, s from t = 0 of the spacecraft file; raises FaultyFile where they do not rise."""
    column = TIMES[0] if TIMES[0] in table.header else TIMES[1]
    if not rows:
        table.fault(1, "", "no rows of samples below the names of the columns")
    epoch = None
    if column == TIMES[1]:
        given = None if spacecraft.attitude is None else spacecraft.attitude.epoch
        if given is None:
            table.fault(1, column, "the spacecraft file has no attitude.epoch to count from; expected the column t_s")
        else:
            epoch = Epoch.parse(given)
    table.check()
    times = np.full(len(rows), math.nan)
    latest = -math.inf
    for index, (line, cells) in enumerate(rows):
        time = table.number(line, cells, column) if epoch is None else _utc(table, line, cells, epoch)
        if time is None:
            continue
        if time <= latest:
            text = f"{cells[column]} does not rise: the sample before is at {latest:.9g} s"
            table.fault(line, column, text)
        times[index] = latest = time
    table.check()
    return times


def _utc(table: Table, line: int, cells: Cells, epoch: Epoch) -> float | None:
    try:
        return Epoch.parse(cells["utc"]).since(epoch)
    except ValueError as wrong:
        table.fault(line, "utc", str(wrong))
        return None


def _column(table: Table, rows: list[tuple[int, Cells]], name: str) -> Vector:
    """A column (n,), NaN where it is empty."""
    values = np.full(len(rows), math.nan)
    for index, (line, cells) in enumerate(rows):
        if cells[name] and cells[name].lower() != "nan":
            value = table.number(line, cells, name)
            values[index] = math.nan if value is None else value
    return values


def _signals(table: Table, rows: list[tuple[int, Cells]], columns: Mapping[str, Vector]) -> dict[str, Vector]:
    """Measured body rates, axis and acceleration, in SI."""
    signals = {RATES[name][0]: RATES[name][1] * values for name, values in columns.items() if name in RATES}
    if ACCELERATIONS in columns:
        signals[ACCELERATION] = columns[ACCELERATIONS]
    axis = None
    if ANGLES[0] in columns:
        ascension, declination = (np.radians(columns[name]) for name in ANGLES)
        across = np.cos(declination)
        axis = np.column_stack([across * np.cos(ascension), across * np.sin(ascension), np.sin(declination)])
    elif AXIS[0] in columns:
        axis = np.column_stack([columns[name] for name in AXIS])
        sizes = np.linalg.norm(axis, axis=1)
        wrong = np.flatnonzero(np.abs(sizes - 1.0) > UNIT)
        if len(wrong):
            table.fault(
                rows[wrong[0]][0], AXIS[0], f"the axis has length {sizes[wrong[0]]:.4g}; expected a unit vector"
            )
        axis = axis / sizes[:, None]
    if axis is not None:
        signals |= dict(zip(AXIS, axis.T, strict=True))
    return {name: values for name, values in signals.items() if np.isfinite(values).any()}


def _expect_unit(table: Table, signals: Mapping[str, Vector], spin: float) -> None:
    """A fault where ω3 is so many times the spin of the file as one unit of rates is of another."""
    name = GYROS[2]
    if name not in signals:
        return
    column = next(entry for entry in table.header if RATES.get(entry, ("",))[0] == name)
    ratio = abs(float(np.nanmedian(signals[name])) / spin)
    turned, per_minute = 180.0 / math.pi, 30.0 / math.pi
    of_values = (
        {turned: "deg/s", per_minute: "rpm"} if RATES[column][1] == 1.0 else {1.0 / turned: "rad/s", 1.0 / 6.0: "rpm"}
    )
    of_file = {1.0 / turned: "deg/s", 1.0 / per_minute: "rpm"}
    for units, where in ((of_values, "are the values of this column"), (of_file, "is the spin of the file")):
        for size, unit in units.items():
            if abs(ratio / size - 1.0) < SAME:
                seen = f"its median is {ratio:.3g} times the spin of the spacecraft file ({spin:.4g} rad/s)"
                table.fault(1, column, f"{seen}: {where} in {unit}?")
                return


def _sun_column(
    table: Table, rows: list[tuple[int, Cells]], times: Vector, values: Vector | None
) -> tuple[Vector, float]:
    """Times of Sun pulses (k,) s, half a sample before the rows that first show them, and the time between samples."""
    if values is None:
        return np.empty(0), 0.0
    for (line, _), value in zip(rows, values, strict=True):
        if np.isfinite(value) and value not in (0.0, 1.0):
            table.fault(line, SUN_PULSE, f"expected 0 or 1, got {value:g}")
    on = np.nan_to_num(values) > 0.5
    rising = np.flatnonzero(on[1:] & ~on[:-1]) + 1
    steps = np.diff(times)
    return times[rising] - 0.5 * steps[rising - 1], float(np.median(steps)) if len(steps) else 0.0
