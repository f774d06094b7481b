"""The attitude ephemeris message: the flown motion as quaternions and rates, a new segment at each edge of a pulse."""

from __future__ import annotations

from nutdamp.epoch import Epoch
from nutdamp.files.ccsds.apm import angular_velocity, header, identity
from nutdamp.files.ccsds.message import AEM_METADATA, BODY_FRAME, Message, Segment, block, number
from nutdamp.files.frames import Reference, Stretch, stretches
from nutdamp.flight import Flight
from nutdamp.planning import Plan
from nutdamp.spacecraft import Spacecraft


def aem(plan: Plan, flown: Flight, until: float, reference: Reference, created: Epoch) -> Message:
    """The message for the flight of a plan from 0 to ``until`` s; ``created`` is the moment at which it is made.

    Nobody interpolates across the edges of pulses, where the torque jumps, because segments end there.
    """
    segments = tuple(_segment(plan.spacecraft, stretch, reference) for stretch in stretches(flown, until))
    return Message("AEM", header(plan, created), segments)


def _segment(body: Spacecraft, stretch: Stretch, reference: Reference) -> Segment:
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
            "ATTITUDE_TYPE": "QUATERNION/ANGVEL",
            "ANGVEL_FRAME": BODY_FRAME,
            "INTERPOLATION_METHOD": "HERMITE",
            "INTERPOLATION_DEGREE": "3",
        },
        f"pulses completed: {stretch.completed}",
    )
    rows = zip(times, stretch.quaternion.tolist(), stretch.rates, strict=True)
    records = tuple(
        (time, *map(number, (*vector, scalar, *angular_velocity(rates).values())))
        for time, (scalar, *vector), rates in rows
    )
    return Segment(metadata, records=records)
