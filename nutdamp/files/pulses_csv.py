"""Schedules as CSV, as ``plan`` writes them; `schedule_file` reads them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from nutdamp.files.output import csv_text, number
from nutdamp.flight import Flight

HEADER = (
    "pulse",
    "t_s",
    "start_s",
    "on_time_s",
    "channel",
    "torque_1_Nm",
    "torque_2_Nm",
    "torque_3_Nm",
    "impulse_1_Nms",
    "impulse_2_Nms",
    "impulse_3_Nms",
    "propellant_kg",
    "nutation_before_deg",
    "nutation_after_deg",
)
EFFECTIVE = ("effective_start_s", "effective_on_time_s")
"""Behind those, where pulses go through valves: start and on-time are those of the command then."""

UTC = "utc"
IMPULSE = HEADER[8:11]
TORQUE = HEADER[5:8]


def pulses_array(flown: Flight) -> NDArray[np.void]:
    """The schedule of a flown flight, one row a pulse, fields as in `HEADER`; vectors in the axes of the file.

    What is not known is NaN: the torque of an ideal impulse, a propellant. Through valves the fields `EFFECTIVE`
    follow; with an epoch, a last field ``utc`` has the date and time of each start.
    """
    before, after = flown.around_pulses()
    body = flown.spacecraft
    dated, valves = body.utc(0.0) is not None, flown.schedule.through_valves
    header = (*HEADER, *(EFFECTIVE if valves else ()), *((UTC,) if dated else ()))
    rows = [
        (
            index + 1,
            *(pulse.t, *pulse.loaded),
            pulse.channel,
            *(np.full(3, math.nan) if pulse.torque is None else body.inertia.in_file(pulse.torque)),
            *body.inertia.in_file(pulse.impulse),
            math.nan if pulse.propellant is None else pulse.propellant,
            math.degrees(before.nutation[index]),
            math.degrees(after.nutation[index]),
            *((pulse.start, pulse.on_time) if valves else ()),
            *([body.utc(pulse.loaded[0]) or ""] if dated else []),
        )
        for index, pulse in enumerate(flown.schedule)
    ]
    longest = max((len(pulse.channel) for pulse in flown.schedule), default=1)
    kinds = {"pulse": "i8", "channel": f"U{longest}", UTC: "U30"}
    return np.array(rows, dtype=[(name, kinds.get(name, "f8")) for name in header])


def pulses_csv(flown: Flight) -> str:
    """The rows of `pulses_array` as CSV; what is not known is empty."""
    table = pulses_array(flown)
    texts = ([number(cell) if isinstance(cell, float) else str(cell) for cell in row] for row in table.tolist())
    return csv_text(table.dtype.names or HEADER, texts)
