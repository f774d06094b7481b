"""Attitude file (.a) of the Systems Tool Kit: the flown motion as quaternions, scalar last, and body rates in deg/s."""

from __future__ import annotations

import datetime

import numpy as np

from nutdamp import __version__
from nutdamp.files.frames import NANOSECONDS, Reference, stretches
from nutdamp.flight import Flight

AXES = {"EME2000": "J2000", "J2000": "J2000", "GCRF": "ICRF"}
"""What the format calls the frames."""


def stk_attitude(flown: Flight, until: float, reference: Reference) -> str:
    """The text of the file for a flight from 0 to ``until`` s.

    Times are never repeated: where an ideal impulse makes the rates jump, the row after it comes a nanosecond later.
    """
    rows: list[str] = []
    last: tuple[float, list[float]] | None = None
    for stretch in stretches(flown, until):
        rates = np.degrees(stretch.rates).tolist()
        for t, (scalar, *vector), rate in zip(stretch.t.tolist(), stretch.quaternion.tolist(), rates, strict=True):
            if last is not None and t <= last[0]:
                if np.allclose(rate, last[1], rtol=0.0, atol=1e-9 * np.linalg.norm(rate)):
                    continue
                t = last[0] + 1.0 / NANOSECONDS
            rows.append(" ".join([f"{t:.9f}", *(f"{part:.16e}" for part in (*vector, scalar, *rate))]))
            last = t, rate
    lines = [
        "stk.v.11.0",
        f"# nutdamp {__version__}: {_plain(flown.spacecraft.name)}",
        "BEGIN Attitude",
        f"NumberOfAttitudePoints {len(rows)}",
        f"ScenarioEpoch {_calendar(reference)}",
        "CentralBody Earth",
        f"CoordinateAxes {AXES[reference.frame]}",
        "InterpolationOrder 1",
        "AttitudeTimeQuatAngVels",
        *rows,
        "END Attitude",
    ]
    return "\n".join(lines) + "\n"


def _calendar(reference: Reference) -> str:
    """``1 Mar 2026 12:00:00.000000000``."""
    date, _, clock = reference.epoch.text.partition("T")
    day = datetime.date.fromisoformat(date)
    months = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")
    return f"{day.day} {months[day.month - 1]} {day.year} {clock}"


def _plain(text: str) -> str:
    return " ".join(text.split())
