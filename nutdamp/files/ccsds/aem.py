"""The attitude ephemeris message: the flown motion, a new segment at each edge of a pulse.

As quaternions and rates, which fit every body, or as spin, nutation and momentum, for those symmetric about axis 3.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from nutdamp.epoch import Epoch
from nutdamp.errors import BadRequest
from nutdamp.files.ccsds.apm import angular_velocity, header, identity
from nutdamp.files.ccsds.message import (
    AEM_METADATA,
    AEM_RECORDS,
    BODY_FRAME,
    QUATERNION_ANGVEL,
    SPIN_NUTATION_MOM,
    Message,
    Segment,
    block,
    number,
)
from nutdamp.files.ccsds.spin import spin_values, spinning
from nutdamp.files.frames import Reference, Stretch, stretches
from nutdamp.flight import Flight
from nutdamp.planning import Plan
from nutdamp.spacecraft import Spacecraft


def aem(
    plan: Plan, flown: Flight, until: float, reference: Reference, created: Epoch, kind: str = QUATERNION_ANGVEL
) -> Message:
    """The message for the flight of a plan from 0 to ``until`` s; ``created`` is the moment at which it is made.

    Nobody interpolates across the edges of pulses, where the torque jumps, because segments end there. ``kind`` is the
    ATTITUDE_TYPE. Raises BadRequest for one that is not for this body.
    """
    body = plan.spacecraft
    if kind == SPIN_NUTATION_MOM and not spinning(body.inertia):
        raise BadRequest(
            f"{SPIN_NUTATION_MOM} is for a body symmetric about the third axis of its file, which this one is not; "
            "take --format aem, which has quaternions"
        )
    segments = tuple(_segment(body, stretch, reference, kind) for stretch in stretches(flown, until))
    return Message("AEM", header(plan, created), segments)


def _segment(body: Spacecraft, stretch: Stretch, reference: Reference, kind: str) -> Segment:
    times = [reference.epoch.plus(seconds).text for seconds in stretch.t.tolist()]
    metadata = block(
        "",
        AEM_METADATA,
        {
            **identity(body),
            "REF_FRAME_A": reference.frame,
            "REF_FRAME_B": BODY_FRAME,
            "TIME_SYSTEM": "UTC",
            "START_TIME": times[0],
            "STOP_TIME": times[-1],
            "ATTITUDE_TYPE": kind,
            **({"ANGVEL_FRAME": BODY_FRAME} if kind == QUATERNION_ANGVEL else {}),
            "INTERPOLATION_METHOD": "HERMITE",
            "INTERPOLATION_DEGREE": "3",
        },
        f"pulses completed: {stretch.completed}",
    )
    rows = _turns(stretch) if kind == QUATERNION_ANGVEL else _spins(body, stretch)
    records = tuple((time, *map(number, row)) for time, row in zip(times, rows, strict=True))
    return Segment(metadata, records=records, record=AEM_RECORDS[kind])


def _turns(stretch: Stretch) -> Iterable[tuple[float, ...]]:
    """Q1 Q2 Q3 QC and the rates."""
    for (scalar, *vector), rates in zip(stretch.quaternion.tolist(), stretch.rates, strict=True):
        yield (*vector, scalar, *angular_velocity(rates).values())


def _spins(body: Spacecraft, stretch: Stretch) -> Iterable[list[float]]:
    """Spin axis, angle and its rate, momentum, and the rate about that."""
    found = spin_values(body.inertia, stretch.rates, stretch.quaternion)
    names = [keyword.name for keyword in AEM_RECORDS[SPIN_NUTATION_MOM].keywords[1:]]
    rows: list[list[float]] = np.column_stack([found[name] for name in names]).tolist()
    return rows
