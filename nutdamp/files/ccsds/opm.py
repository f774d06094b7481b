"""The orbit parameter message (CCSDS 502.0-B-3): the velocity change of each pulse as a manoeuvre.

Its state vector is the orbit of the spacecraft file. Without one the message is only the part with the manoeuvres,
which says so: the standard demands a state.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from nutdamp.epoch import Epoch
from nutdamp.errors import BadRequest
from nutdamp.files.ccsds.apm import Values, header, identity, notes_on
from nutdamp.files.ccsds.message import OPM_BLOCKS, OPM_METADATA, Block, Message, Segment, block
from nutdamp.files.frames import Reference
from nutdamp.flight import Flight
from nutdamp.planning import Plan
from nutdamp.rounding import cleaned
from nutdamp.schedule import Pulse, Schedule
from nutdamp.spacecraft import Orbit, Vector
from nutdamp.velocity_change import momentum_gained

PART = (
    "Only the part with the manoeuvres: the spacecraft file has no orbit.",
    "CENTER_NAME and the state (EPOCH, X to Z_DOT), which the standard demands, are to be added.",
)

KILO = 1e-3


def opm(plan: Plan, reference: Reference, created: Epoch) -> Message:
    """The message for a plan; ``created`` is the moment at which it is made.

    Raises BadRequest where mass, forces or propellant are not known.
    """
    body, flown = plan.spacecraft, plan.flight
    if body.mass is None:
        raise BadRequest("an OPM needs the velocity change of each pulse; add the key mass to the spacecraft file")
    orbit = body.orbit
    centre: Values = {} if orbit is None else {"CENTER_NAME": orbit.center}
    about = {**identity(body), **centre, "REF_FRAME": reference.frame, "TIME_SYSTEM": "UTC"}
    metadata = block("", OPM_METADATA, about, *(PART if orbit is None else ()))
    blocks = [] if orbit is None else [_block("STATE", {"EPOCH": reference.epoch.text, **_state(orbit)})]
    blocks.append(_block("SPACECRAFT", {"MASS": body.mass}))
    for number, pulse in enumerate(sorted(plan.pulses, key=lambda pulse: pulse.start), start=1):
        gained = _velocity(pulse, number, flown, body.mass)
        values = _manoeuvre(pulse, number, gained, reference)
        blocks.append(_block("MANEUVER", values, *notes_on(pulse, number, reference)))
    return Message("OPM", header(plan, created), (Segment(metadata, tuple(blocks)),))


def _block(name: str, values: Values, *comments: str) -> Block:
    return block(name, OPM_BLOCKS[name].keywords, values, *comments)


def _state(orbit: Orbit) -> Values:
    numbers = (KILO * np.concatenate([orbit.position, orbit.velocity])).tolist()
    return dict(zip(("X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT"), numbers, strict=True))


def _velocity(pulse: Pulse, number: int, flown: Flight, mass: float) -> Vector:
    """What a pulse adds to the velocity, (3,) m/s, inertial: along its force as the body turns."""
    if pulse.force is None:
        cure = "give the thrusters position, direction and force"
        raise BadRequest(f"the velocity change by pulse {number} ({pulse.channel}) is not known; {cure}")
    return cleaned(momentum_gained(replace(flown, schedule=Schedule((pulse,)))) / mass)


def _manoeuvre(pulse: Pulse, number: int, velocity: Vector, reference: Reference) -> Values:
    if pulse.propellant is None:
        cure = "give the thrusters isp"
        raise BadRequest(f"the propellant of pulse {number} ({pulse.channel}) is not known, which an OPM needs; {cure}")
    return {
        "MAN_EPOCH_IGNITION": reference.epoch.plus(max(pulse.start, 0.0)).text,
        "MAN_DURATION": pulse.on_time,
        "MAN_DELTA_MASS": -pulse.propellant,
        "MAN_REF_FRAME": reference.frame,
        **dict(zip(("MAN_DV_1", "MAN_DV_2", "MAN_DV_3"), (KILO * velocity).tolist(), strict=True)),
    }
