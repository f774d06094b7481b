"""The attitude parameter message: state at t = 0, spin with nutation, inertia, and one manoeuvre block a pulse.

Everything is given in the axes of the spacecraft file, which the message calls `message.BODY_FRAME`.
"""

from __future__ import annotations

import numpy as np

from nutdamp import __version__
from nutdamp.epoch import Epoch
from nutdamp.errors import BadRequest
from nutdamp.files.ccsds.message import (
    APM_BLOCKS,
    APM_METADATA,
    BODY_FRAME,
    HEADER,
    MOMENTUM,
    Block,
    Keyword,
    Message,
    Segment,
    block,
    label,
)
from nutdamp.files.ccsds.spin import spin_values, spinning
from nutdamp.files.frames import Reference
from nutdamp.lightening import shed
from nutdamp.planning import Plan
from nutdamp.rounding import cleaned
from nutdamp.schedule import Pulse
from nutdamp.spacecraft import Spacecraft, Vector

ORIGINATOR = "NUTDAMP"

Values = dict[str, str | float]


def apm(plan: Plan, reference: Reference, created: Epoch) -> Message:
    """The message for a plan; ``created`` is the moment at which it is made.

    Raises BadRequest for an ideal impulse, which has no duration and so no manoeuvre block.
    """
    body = plan.spacecraft
    spins = spinning(body.inertia)
    state = block("", (Keyword("EPOCH"),), {"EPOCH": reference.epoch.text}, *unsaid(body), *_spinless(spins))
    blocks = [state, *_motion(body, reference.frame)]
    if spins:
        blocks.append(_block("SPIN", {**_frames(reference.frame), **_spin(body)}))
    blocks.append(_block("INERTIA", _inertia(body)))
    blocks += [
        _block("MAN", _manoeuvre(pulse, number, body, reference), *notes_on(pulse, number, reference))
        for number, pulse in enumerate(sorted(plan.pulses, key=lambda pulse: pulse.start), start=1)
    ]
    about = block("", APM_METADATA, {**identity(body), "TIME_SYSTEM": "UTC"})
    return Message("APM", header(plan, created), (Segment(about, tuple(blocks)),))


def header(plan: Plan, created: Epoch) -> Block:
    """Who made the message, when, and of what."""
    moment = created.text.partition(".")[0]
    values: Values = {
        "CREATION_DATE": moment,
        "ORIGINATOR": ORIGINATOR,
        "MESSAGE_ID": label(f"{plan.scheme}-{moment}"),
    }
    return block("", HEADER, values, f"nutdamp {__version__}: {plan.scheme} schedule for {plan.spacecraft.name}")


def identity(body: Spacecraft) -> Values:
    """Name and designator of the object."""
    return {"OBJECT_NAME": label(body.name), "OBJECT_ID": label(body.object_id or "")}


def unsaid(body: Spacecraft) -> list[str]:
    """What the spacecraft file has and a message of state and pulses cannot hold."""
    found = []
    if body.disturbances:
        found.append("The disturbances of the spacecraft file are not in this message.")
    if body.dissipation is not None:
        found.append("The energy dissipation of the spacecraft file is not in this message.")
    per_kg = shed(body)
    if per_kg is not None:
        values = ", ".join(f"{one:.9g}" for one in per_kg)
        found.append(f"INERTIA is that at EPOCH: the principal moments fall by {values} kg*m**2 for each kg used.")
    return found


def notes_on(pulse: Pulse, number: int, reference: Reference) -> list[str]:
    """What is said of the manoeuvre of a pulse: its channel, and through a valve what is commanded for it."""
    found = [f"pulse {number}: {pulse.channel}"]
    if pulse.command is not None:
        start, on_time = pulse.loaded
        found.append(f"Commanded: {on_time:.9g} s from {reference.epoch.plus(max(start, 0.0)).text} on.")
        found.append(f"Start and duration below are those of the thrust: {pulse.on_time:.9g} s at the torque given.")
    return found


def _spinless(spins: bool) -> list[str]:
    if spins:
        return []
    return ["No SPIN block: the body is not symmetric about its third axis, as the model of that block is."]


def _block(name: str, values: Values, *comments: str) -> Block:
    return block(name, APM_BLOCKS[name].keywords, values, *comments)


def _frames(frame: str) -> Values:
    return {"REF_FRAME_A": frame, "REF_FRAME_B": BODY_FRAME}


def _motion(body: Spacecraft, frame: str) -> list[Block]:
    """Attitude and angular velocity at t = 0."""
    rates, quaternion = map(cleaned, body.inertia.in_file_axes(body.initial.rates, body.initial.quaternion))
    scalar, *vector = quaternion.tolist()
    # The quaternion from A to B turns the axes of A into those of B (annex F2), as body -> inertial turns vectors.
    turn: Values = dict(zip(("Q1", "Q2", "Q3", "QC"), (*vector, scalar), strict=True))
    rate: Values = {"ANGVEL_FRAME": BODY_FRAME, **angular_velocity(rates)}
    return [_block("QUAT", {**_frames(frame), **turn}), _block("ANGVEL", {**_frames(frame), **rate})]


def angular_velocity(rates: Vector) -> dict[str, float]:
    """Components in deg/s."""
    return dict(zip(("ANGVEL_X", "ANGVEL_Y", "ANGVEL_Z"), np.degrees(rates).tolist(), strict=True))


def _spin(body: Spacecraft) -> Values:
    """Spin and nutation at t = 0."""
    rates, quaternion = body.inertia.in_file_axes(body.initial.rates, body.initial.quaternion)
    found = spin_values(body.inertia, rates[None], quaternion[None])
    return {name: float(value[0]) for name, value in found.items() if name not in MOMENTUM}


def _inertia(body: Spacecraft) -> Values:
    """Moments and products; the products are minus what is off the diagonal (annex F6)."""
    tensor = body.inertia.tensor.tolist()
    return {
        "INERTIA_REF_FRAME": BODY_FRAME,
        "IXX": tensor[0][0],
        "IYY": tensor[1][1],
        "IZZ": tensor[2][2],
        "IXY": -tensor[0][1],
        "IXZ": -tensor[0][2],
        "IYZ": -tensor[1][2],
    }


def _manoeuvre(pulse: Pulse, number: int, body: Spacecraft, reference: Reference) -> Values:
    if pulse.torque is None or pulse.on_time == 0.0:
        cure = "give the torquer a torque (steerable: {torque: 20 N m}) and plan again"
        raise BadRequest(f"pulse {number} is an ideal impulse without a duration, which an APM cannot hold; {cure}")
    torque = body.inertia.in_file(pulse.torque).tolist()
    values: Values = {
        "MAN_EPOCH_START": reference.epoch.plus(max(pulse.start, 0.0)).text,
        "MAN_DURATION": pulse.on_time,
        "MAN_REF_FRAME": BODY_FRAME,
        **dict(zip(("MAN_TOR_X", "MAN_TOR_Y", "MAN_TOR_Z"), torque, strict=True)),
    }
    return values if pulse.propellant is None else {**values, "MAN_DELTA_MASS": -pulse.propellant}
