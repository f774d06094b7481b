"""Telemetry from CSV files and attitude messages: times, and measurements of the motion.

An empty cell of CSV is a missing sample; a track of ``simulate --csv`` is such a file.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.common.time import Epoch
from nutdamp.errors import BadRequest
from nutdamp.estimation.model import BROKEN, absurd
from nutdamp.estimation.parameters import (
    ACCELERATION,
    AXIS,
    DIRECTION,
    GYROS,
    KIND,
    QUATERNION,
    SEEN,
    SUN_ASPECT,
    SUN_PULSE,
    Record,
    of_quaternions,
)
from nutdamp.files.ccsds.read import Contents, is_message, read_message
from nutdamp.files.tabular import HEADER as TRACK
from nutdamp.files.tabular import Table
from nutdamp.spacecraft.model import Attitude, Spacecraft, Vector
from nutdamp.spacecraft.schedule import Schedule
from nutdamp.units import KINDS


def record_of(history: Contents, spacecraft: Spacecraft, schedule: Schedule) -> Record:
    """Telemetry of a history, from attitude.epoch of the file on; raises BadRequest where it has
    none.

    Rates count where the message has all three: of a spin alone the attitudes tell more.
    """
    start = spacecraft.attitude
    if len(history.times) < 2 or history.frame is None:
        raise BadRequest("the message has no history of attitudes: expected several records")
    if start is None or start.epoch is None:
        raise BadRequest(
            "the spacecraft file has no attitude.epoch to count the times of a history from"
        )
    seen = Attitude(history.quaternions, start.epoch, history.frame).seen_in(start.frame)
    signals = of_quaternions(seen.quaternion, spacecraft)
    if np.isfinite(history.rates).all(axis=1).any():
        signals |= dict(zip(GYROS, history.rates.T, strict=True))
    times = history.times + history.epoch.since(Epoch.parse(start.epoch))
    return Record(times, signals, np.empty(0), 0.0, schedule)


TIMES = ("t_s", "utc")
JUMPS = "; at ideal impulses a track has two rows: name their schedule by --schedule"
DEGREE = math.pi / 180.0
AROUND, UP = (-360.0, 360.0), (-90.0, 90.0)  # deg


class Measurement(NamedTuple):
    """Columns that go together, and the signals that they are.

    A number times its ``factor`` is in SI; two angles, about axis 3 and up from the plane across
    it, within their ``limits``, deg, are a direction; ``vector`` names one of length 1.
    """

    columns: tuple[str, ...]
    signals: tuple[str, ...]
    factor: float = 1.0
    limits: tuple[tuple[float, float], ...] = ()
    vector: str = ""


ASPECTS = "sun_aspect_deg"
CROSSED = ("crossing_azimuth_deg", "crossing_elevation_deg")
TOWARDS = ("crossing_ra_deg", "crossing_dec_deg")
MEASUREMENTS = (
    *(Measurement((f"{name}_rad_s",), (name,)) for name in GYROS),
    *(Measurement((f"{name}_deg_s",), (name,), DEGREE) for name in GYROS),
    Measurement(("axis_ra_deg", "axis_dec_deg"), AXIS, limits=(AROUND, UP)),
    Measurement(AXIS, AXIS, vector="axis"),
    Measurement(QUATERNION, QUATERNION, vector="quaternion"),
    Measurement(("acceleration_m_s2",), (ACCELERATION,)),
    Measurement(CROSSED, SEEN, limits=(AROUND, UP)),
    Measurement(TOWARDS, DIRECTION, limits=(AROUND, UP)),
    Measurement((ASPECTS,), (SUN_ASPECT,), DEGREE, ((0.0, 180.0),)),
)
"""Crossings are of what is TOWARDS, else of the Sun."""

MEASURED = (*(name for group in MEASUREMENTS for name in group.columns), SUN_PULSE)
"""Columns of samples; SUN_PULSE is 1 from one seen on."""

UNIT_LENGTH = 0.01  # deviation from length one that a measured axis or quaternion may have
SAME = 0.03  # part by which a ratio of rates may differ from that of two units


def read_telemetry(
    path: str | Path,
    spacecraft: Spacecraft,
    sun_pulses: str | Path | None = None,
    schedule: Schedule | None = None,
) -> tuple[Record, list[str]]:
    """The record in a file, with ``sun_pulses`` of another, and warnings; raises CannotRead and
    FaultyFile.
    """
    if is_message(str(path)):
        history = read_message(str(path))
        record = record_of(history, spacecraft, schedule or Schedule())
        warnings = [f"{path}: {remark}" for remark in history.remarks]
    else:
        record, warnings = _read_samples(path, spacecraft, schedule or Schedule())
    if sun_pulses is None:
        return record, warnings
    if len(record.sun_pulses):
        warnings.append(
            f"{path}: the column {SUN_PULSE} is ignored: the times are those of {sun_pulses}"
        )
    table = Table(sun_pulses, (*TIMES, ASPECTS), "Sun pulses")
    _expect_time(table)
    table.expect()
    pulses, columns = _samples(table, spacecraft)
    table.check()
    record = replace(record, sun_pulses=pulses, sun_step=0.0)
    if ASPECTS not in columns or not np.isfinite(columns[ASPECTS]).any():
        return record, warnings
    times = np.union1d(
        record.times, pulses
    )  # with the Sun aspect angles at the pulses among the samples
    signals = {
        name: _spread(times, record.times, values) for name, values in record.signals.items()
    }
    at_pulses = _spread(times, pulses, np.radians(columns[ASPECTS]))
    signals[SUN_ASPECT] = np.where(
        np.isfinite(at_pulses), at_pulses, signals.get(SUN_ASPECT, math.nan)
    )
    return replace(record, times=times, signals=signals), warnings


def _read_samples(
    path: str | Path, spacecraft: Spacecraft, schedule: Schedule
) -> tuple[Record, list[str]]:
    table = Table(path, (*TIMES, *MEASURED, *TRACK), "samples")
    _expect_time(table)
    header = table.header
    if not table.faults and not {*MEASURED} & {*header}:
        table.fault(1, "", f"no column of samples; expected one or more of {', '.join(MEASURED)}")
    times = (Measurement((name,), TIMES) for name in TIMES)
    before: dict[tuple[str, ...], str] = {}  # first column of the same in other units
    for group in (*times, *MEASUREMENTS):
        first = next((name for name in group.columns if name in header), None)
        if first is None:
            continue
        for name in group.columns:
            if name not in header:
                table.fault(1, name, f"the column is missing; {first} needs it")
        other = before.setdefault(group.signals, first)
        if other != first:
            table.fault(1, first, f"given twice, also as {other}; remove one of them")
    if TOWARDS[0] in header and CROSSED[0] not in header:
        table.fault(1, CROSSED[0], f"the column is missing beside {TOWARDS[0]}")
    if CROSSED[0] in header and TOWARDS[0] not in header and spacecraft.sun is None:
        table.fault(
            1, CROSSED[0], "no direction: that of the Sun needs the key sun in the spacecraft file"
        )
    table.expect()
    impulses = [pulse.t for pulse in schedule if pulse.on_time == 0.0]
    moments, columns = _samples(table, spacecraft, impulses)
    table.check()
    signals = _signals(table, columns, spacecraft)
    for name in sorted(KIND.keys() & signals.keys()):
        out = absurd(spacecraft, name, signals[name])
        if 0.0 < out.mean() <= BROKEN:
            signals[name][out] = math.nan
            table.warned.append(
                f"{path}: {name}: {out.sum()} samples are left out, because no motion can give them"
            )
    _expect_unit(table, signals, spacecraft.spin)
    seen, step = _sun_column(table, moments, columns.get(SUN_PULSE))
    table.check()
    # A track has the motion before and after an impulse at one time: neither is a sample.
    jumps = np.flatnonzero(np.diff(moments) == 0.0)
    both = np.concatenate([jumps, jumps + 1])
    moments = np.delete(moments, both)
    signals = {name: np.delete(values, both) for name, values in signals.items()}
    return Record(moments, signals, seen, step, schedule), table.warned


def _spread(times: Vector, those: Vector, values: Vector) -> Vector:
    """Values at some of the ``times`` (n,), NaN at the others."""
    spread = np.full(len(times), math.nan)
    spread[np.searchsorted(times, those)] = values
    return spread


def _samples(
    table: Table, spacecraft: Spacecraft, impulses: Sequence[float] = ()
) -> tuple[Vector, dict[str, Vector]]:
    """Times of the rows (n,) s, two alike at ``impulses`` (s) only, and the columns (n,) of
    measurements, NaN where they are empty.
    """
    table.check()
    if not table.rows:
        table.fault(1, "", "no rows of samples below the names of the columns")
    column = TIMES[0] if TIMES[0] in table.header else TIMES[1]
    start = None if spacecraft.attitude is None else spacecraft.attitude.epoch
    if column == TIMES[1] and start is None:
        table.fault(
            1,
            column,
            "the spacecraft file has no attitude.epoch to count from; expected the column t_s",
        )
    table.check()
    epoch = Epoch.parse(start) if column == TIMES[1] and start is not None else None
    moments: list[float] = []
    for row in table.rows:
        try:
            time = row.number(column) if epoch is None else Epoch.parse(row[column]).since(epoch)
        except ValueError as reason:
            row.fault(column, str(reason))
            continue
        twice = time in impulses and time in moments[-1:]
        if time is not None and moments and time <= moments[-1] and not twice:
            row.fault(
                column,
                f"{row[column]} is not after the sample before, at {moments[-1]:.9g} s"
                + (JUMPS if TRACK[-1] in table.header else ""),
            )
        moments += [] if time is None else [time]
    table.check()
    columns = {}
    for name in (name for name in MEASURED if name in table.columns and name in table.header):
        numbers = (
            row.number(name) if row[name].lower() not in ("", "nan") else None for row in table.rows
        )
        columns[name] = np.array([math.nan if number is None else number for number in numbers])
    for group in MEASUREMENTS:
        for name, (low, high) in zip(group.columns, group.limits, strict=False):
            values = columns.get(name, np.empty(0))
            wrong = (values < low) | (values > high)
            _fault_first(table, wrong, name, f"expected an angle of {low:g} to {high:g} deg")
    return np.array(moments), columns


def _fault_first(table: Table, wrong: NDArray[np.bool_], name: str, problem: str) -> None:
    """A fault in a column for the first of the rows (n,) that are ``wrong``."""
    if wrong.any():
        table.rows[int(wrong.argmax())].fault(name, problem)


def _expect_time(table: Table) -> None:
    if not {*TIMES} & {*table.header}:
        table.fault(1, TIMES[0], f"the column is missing (or {TIMES[1]}){table.misspelt(TIMES[0])}")


def _signals(
    table: Table, columns: Mapping[str, Vector], spacecraft: Spacecraft
) -> dict[str, Vector]:
    """Measured body rates, axis, attitude, directions and acceleration, in SI; quaternions go
    before the axis.
    """
    signals: dict[str, Vector] = {}
    for names, own, factor, limits, vector in MEASUREMENTS:
        if names[0] not in columns:
            continue
        values = np.column_stack([columns[name] for name in names]) * factor
        if vector:
            sizes = np.linalg.norm(values, axis=1)
            wrong = np.abs(sizes - 1.0) > UNIT_LENGTH
            problem = f"the {vector} has length {sizes[wrong.argmax()]:.4g}; expected 1"
            _fault_first(table, wrong, names[0], problem)
            values = values / np.where(wrong, 1.0, sizes)[:, None]
        elif len(limits) == 2:
            around, up = np.radians(values).T
            across = np.cos(up)
            values = np.column_stack([across * np.cos(around), across * np.sin(around), np.sin(up)])
        if own == QUATERNION:
            signals |= of_quaternions(values, spacecraft)
        else:
            signals |= dict(zip(own, values.T, strict=True))
    if SEEN[0] in signals and spacecraft.sun is not None:
        for name, part in zip(DIRECTION, spacecraft.sun.tolist(), strict=True):
            to = signals.get(name, np.full(len(table.rows), math.nan))
            signals[name] = np.where(np.isfinite(to), to, part)
    return {name: values for name, values in signals.items() if np.isfinite(values).any()}


def _expect_unit(table: Table, signals: Mapping[str, Vector], spin: float) -> None:
    """A fault where ω3 is so many times the spin of the file as one unit of rates is of another."""
    name = GYROS[2]
    if name not in signals or spin == 0.0:
        return
    column, own = next(
        (group.columns[0], group.factor)
        for group in MEASUREMENTS
        if group.signals == (name,) and group.columns[0] in table.header
    )
    ratio = abs(float(np.nanmedian(signals[name])) / spin)
    units = KINDS["rate"].factors.items()
    meant = [
        (own / size, f"are the values of this column in {unit}")
        for unit, size in units
        if size != own
    ]
    meant += [(size, f"is the spin of the file in {unit}") for unit, size in units if size != 1.0]
    words = next((words for size, words in meant if abs(ratio / size - 1.0) < SAME), None)
    if words is not None:
        table.fault(
            1,
            column,
            f"its median is {ratio:.3g} times the spin of the spacecraft file ({spin:.4g} rad/s): "
            f"{words}?",
        )


def _sun_column(table: Table, times: Vector, values: Vector | None) -> tuple[Vector, float]:
    """Times of Sun pulses (k,) s, half a sample before the rows that first show them, and the time
    between samples.
    """
    if values is None:
        return np.empty(0), 0.0
    for row, value in zip(table.rows, values, strict=True):
        if np.isfinite(value) and value not in (0.0, 1.0):
            row.fault(SUN_PULSE, f"expected 0 or 1, got {value:g}")
    on = np.nan_to_num(values) > 0.5
    rising = np.flatnonzero(on[1:] & ~on[:-1]) + 1
    steps = np.diff(times)
    return times[rising] - 0.5 * steps[rising - 1], float(np.median(steps)) if len(steps) else 0.0
