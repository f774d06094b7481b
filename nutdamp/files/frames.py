"""When and in which axes: what exchange formats need besides the plan, and the motion in the axes of the file."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from nutdamp.epoch import Epoch
from nutdamp.errors import BadRequest, Unsuitable
from nutdamp.flight import Flight, Leg
from nutdamp.rounding import cleaned
from nutdamp.spacecraft import Spacecraft, Vector

FRAMES = ("EME2000", "J2000", "GCRF")
"""Inertial frames that the formats have a name for."""

EXAMPLE = {
    "epoch": "2026-03-01T12:00:00Z           # of t = 0, UTC",
    "frame": "EME2000                        # or J2000, GCRF",
    "quaternion": "[1, 0, 0, 0]              # body -> frame at t = 0, scalar first",
}

TURN = math.radians(6.0)
"""rad; the body turns by no more between two records. Interpolation with the rates then errs by less than 1e-5 deg, and
even a plain turn from one attitude to the next by less than 0.01 deg at 5 deg of nutation."""

LEAST_RECORDS = 4
"""Records of a stretch, however short: enough for interpolation of degree 3."""

MOST_RECORDS = 1_000_000
"""More make no file that anyone reads."""

NANOSECONDS = 1e9
"""In a second; to divide by them gives the number nearest to the decimal one."""


class Reference(NamedTuple):
    """The moment t = 0 and the frame of the attitude."""

    epoch: Epoch
    frame: str


class Stretch(NamedTuple):
    """Motion without jumps, in the axes of the file.

    ``t`` (n,) s, whole nanoseconds; ``rates`` (n, 3) rad/s; ``quaternion`` (n, 4) body -> frame, scalar first, without
    jumps of sign; ``completed`` pulses are over when it begins.
    """

    t: Vector
    rates: Vector
    quaternion: Vector
    completed: int


def reference(spacecraft: Spacecraft) -> Reference:
    """Epoch and frame of the file; raises BadRequest with the lines to add, or for those that no format knows."""
    given = spacecraft.attitude
    if given is None or given.epoch is None or given.frame is None:
        missing = [key for key in EXAMPLE if given is None or getattr(given, key) is None]
        names = " and ".join(f"attitude.{key}" for key in missing if key != "quaternion")
        lines = "\n".join(f"  {key}: {EXAMPLE[key]}" for key in missing)
        verb = "add" if given is None else "add there"
        raise BadRequest(
            f"this format needs {names}, which the spacecraft file does not give; {verb}\nattitude:\n{lines}"
        )
    if given.frame not in FRAMES:
        problem = f"{given.frame!r} is no frame that the format knows; expected one of {', '.join(FRAMES)}"
        raise Unsuitable(("attitude", "frame"), problem)
    try:
        return Reference(Epoch.parse(given.epoch), given.frame)
    except ValueError as wrong:
        raise Unsuitable(("attitude", "epoch"), str(wrong)) from None


def stretches(flown: Flight, until: float) -> Iterator[Stretch]:
    """The motion from 0 to ``until`` s between the edges of pulses, close enough to be interpolated.

    Stretches too short to be distinguished in nanoseconds are left out. Raises BadRequest for a motion that would take
    more than `MOST_RECORDS`.
    """
    legs = [leg for leg in flown.legs if leg.start < until]
    counts = [_records(leg, until) for leg in legs]
    if sum(counts) > MOST_RECORDS:
        raise BadRequest(
            f"the track would have {sum(counts)} records, more than {MOST_RECORDS}; choose an earlier end (until)"
        )
    previous: Vector | None = None
    for leg, count in zip(legs, counts, strict=True):
        begin, end = (round(time * NANOSECONDS) for time in (leg.start, min(leg.end, until)))
        t = np.unique(np.rint(np.linspace(begin, end, count))) / NANOSECONDS
        if len(t) < LEAST_RECORDS:
            continue
        rates, quaternion = map(cleaned, flown.spacecraft.inertia.in_file_axes(*leg.path.motion(t)))
        quaternion = _steady(quaternion, previous)
        previous = quaternion[-1]
        yield Stretch(t, rates, quaternion, leg.completed)


def _records(leg: Leg, until: float) -> int:
    """How many records keep the turn from one to the next below `TURN`."""
    end = min(leg.end, until)
    rates, _ = leg.path.motion(np.linspace(leg.start, end, 9))
    turn = float(np.linalg.norm(rates, axis=1).max()) * (end - leg.start)
    return max(math.ceil(turn / TURN) + 1, LEAST_RECORDS)


def _steady(quaternion: Vector, previous: Vector | None) -> Vector:
    """The same attitudes, of q and -q always the one nearer to the record before."""
    before = quaternion[0] if previous is None else previous
    steps = np.sum(quaternion * np.vstack([before, quaternion[:-1]]), axis=1)
    return np.asarray(quaternion * np.cumprod(np.where(steps < 0.0, -1.0, 1.0))[:, None])
