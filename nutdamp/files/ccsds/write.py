"""Attitude parameter (APM), attitude ephemeris (AEM) and orbit parameter messages (OPM, CCSDS
502.0-B-3) written.

Body axes are those of the spacecraft file, which messages call `message.BODY_FRAME`. Nutation by
annex F5 is the steady motion of bodies symmetric about axis 3: others have the spin alone.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from nutdamp import __version__
from nutdamp.common.numerics import cleaned
from nutdamp.common.time import Epoch
from nutdamp.errors import BadRequest
from nutdamp.files.ccsds import message
from nutdamp.files.ccsds.message import (
    BODY_FRAME,
    QUATERNION_ANGVEL,
    SPIN,
    SPIN_NUTATION_MOM,
    block,
    label,
)
from nutdamp.files.export import AttitudeSegment, Reference, interpolated
from nutdamp.flight.dynamics import shed
from nutdamp.flight.end_state import momentum_gained
from nutdamp.flight.propagation import Flight
from nutdamp.physics import attitude
from nutdamp.planning.plan import Plan
from nutdamp.spacecraft.model import Inertia, Spacecraft, Vector
from nutdamp.spacecraft.schedule import Schedule

AXIS = 1e-12  # tilt in rad up to which the symmetry axis counts as the third axis of the file

FULL = 2.0 * math.pi


def spinning(inertia: Inertia) -> bool:
    """True where the body fits the model of these keywords: symmetric about axis 3."""
    return inertia.symmetric and math.hypot(*inertia.axes[:2, 2]) <= AXIS


def spin_values(inertia: Inertia, rates: Vector, quaternion: Vector) -> dict[str, Vector]:
    """Every keyword of the spin, (n,) each in deg, deg/s and s, for a motion in the axes of the
    file.

    ``rates`` (n, 3) rad/s; ``quaternion`` (n, 4) body -> frame, scalar first.
    """
    first, second, third = (cleaned(attitude.rotate(quaternion, axis)) for axis in np.eye(3))
    right_ascension, declination = _on_sphere(third)
    # The first axis after the first two turns is the node; the angle from it to body axis 1 is the
    # third.
    node = cleaned(
        np.stack([-np.sin(right_ascension), np.cos(right_ascension), 0.0 * declination], axis=-1)
    )
    momentum = rates @ inertia.tensor + inertia.wheel * inertia.axes[:, 2]
    size = np.linalg.norm(momentum, axis=-1)
    transverse = np.hypot(momentum[:, 0], momentum[:, 1])
    phase = np.where(transverse > 0.0, np.arctan2(-momentum[:, 1], momentum[:, 0]), 0.0)
    of_momentum = _on_sphere(cleaned(attitude.rotate(quaternion, momentum)))
    along = [np.sum(node * axis, axis=-1) for axis in (first, second)]
    return {
        "SPIN_ALPHA": np.degrees(right_ascension),
        "SPIN_DELTA": np.degrees(declination),
        "SPIN_ANGLE": np.degrees(np.arctan2(-along[1], along[0])),
        "SPIN_ANGLE_VEL": np.degrees(inertia.a * rates[:, 2] - inertia.wheel / inertia.A),
        "NUTATION": np.degrees(np.arctan2(transverse, momentum[:, 2])),
        "NUTATION_PER": FULL * inertia.A / size,
        "NUTATION_PHASE": np.degrees(phase),
        "MOMENTUM_ALPHA": np.degrees(of_momentum[0]),
        "MOMENTUM_DELTA": np.degrees(of_momentum[1]),
        "NUTATION_VEL": np.degrees(size / inertia.A),
    }


def _on_sphere(vectors: Vector) -> tuple[Vector, Vector]:
    """Right ascension in [0, 2π) and declination of vectors (n, 3), rad;
    the former is 0 at a pole.
    """
    x, y, z = vectors.T
    turned = np.arctan2(y, x) % FULL
    return np.where(turned < FULL, turned, 0.0), np.arctan2(z, np.hypot(x, y))


ORIGINATOR = "NUTDAMP"


def apm(plan: Plan, reference: Reference, created: Epoch) -> message.Message:
    """The message for a plan, made at ``created``; raises BadRequest for an ideal impulse, which
    has no duration.
    """
    spacecraft = plan.spacecraft
    frames = (reference.frame, BODY_FRAME)
    motion = spacecraft.inertia.in_file_axes(
        spacecraft.initial.rates, spacecraft.initial.quaternion
    )
    rates, quaternion = map(cleaned, motion)
    # The quaternion from A to B turns the axes of A into those of B (annex F2), as body -> inertial
    # turns vectors.
    scalar, *vector = quaternion.tolist()
    blocks = [
        block("", (message.Keyword("EPOCH"),), [reference.epoch.text], *_unsaid(spacecraft)),
        _block("QUAT", [*frames, *vector, scalar]),
        _block("ANGVEL", [*frames, BODY_FRAME, *np.degrees(rates)]),
    ]
    if spinning(spacecraft.inertia):
        spin = spin_values(spacecraft.inertia, *(values[None] for values in motion))
        values = [float(value[0]) for name, value in spin.items() if name not in message.MOMENTUM]
        blocks.append(_block("SPIN", [*frames, *values]))
    # The products are minus the entries off the diagonal (annex F6).
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = spacecraft.inertia.tensor.tolist()
    blocks.append(_block("INERTIA", [BODY_FRAME, xx, yy, zz, -xy, -xz, -yz]))
    blocks += _manoeuvres("MAN", plan, reference)
    about = block("", message.APM_METADATA, [*_identity(spacecraft), None, "UTC"])
    return message.Message("APM", _header(plan, created), (message.Segment(about, tuple(blocks)),))


def _block(name: str, values: message.Values, *comments: str) -> message.MessageBlock:
    return block(name, message.LAYOUTS[name].keywords, values, *comments)


def _header(plan: Plan, created: Epoch) -> message.MessageBlock:
    moment = created.text.partition(".")[0]
    values = [None, moment, ORIGINATOR, label(f"{plan.scheme}-{moment}")]
    about = f"nutdamp {__version__}: {plan.scheme} schedule for {plan.spacecraft.name}"
    return block("", message.HEADER, values, about, f"status: {plan.verdict.status.value}")


def _identity(spacecraft: Spacecraft) -> tuple[str, str]:
    return label(spacecraft.name), label(spacecraft.object_id or "")


def _unsaid(spacecraft: Spacecraft) -> list[str]:
    wheel = spacecraft.inertia.wheel
    per_kg = shed(spacecraft)
    of_file = "of the spacecraft file"
    spins = spinning(spacecraft.inertia)
    momentum = f"{wheel:.9g} N*m*s along principal axis 3"
    values = ", ".join(f"{moment:.9g}" for moment in (() if per_kg is None else per_kg))
    remarks = {
        f"The disturbances {of_file} are not in this message.": spacecraft.disturbances,
        f"The energy dissipation {of_file} is not in this message.": spacecraft.dissipation
        is not None,
        f"The wheel {of_file}, {momentum}, is in no keyword of this message.": wheel,
        (
            f"INERTIA is that at EPOCH: the principal moments fall by {values} kg*m**2 for each kg "
            "used."
        ): values,
        (
            "No SPIN block: the body is not symmetric about its third axis, "
            "as the model of that block is."
        ): not spins,
    }
    return [remark for remark, holds in remarks.items() if holds]


def _manoeuvres(name: str, plan: Plan, reference: Reference) -> Iterator[message.MessageBlock]:
    """Blocks of the pulses: MAN with their torques, MANEUVER with their velocity changes."""
    for place, pulse in enumerate(sorted(plan.pulses, key=lambda pulse: pulse.start), start=1):
        timing = (reference.epoch.plus(max(pulse.start, 0.0)).text, pulse.on_time)
        mass = None if pulse.propellant is None else -pulse.propellant
        if name == "MAN":
            if pulse.torque is None or pulse.on_time == 0.0:
                cure = "give the torquer a torque (steerable: {torque: 20 N m}) and plan again"
                impulse = f"pulse {place} is an ideal impulse without a duration"
                raise BadRequest(f"{impulse}, which an APM cannot hold; {cure}")
            values = [*timing, BODY_FRAME, *plan.spacecraft.inertia.in_file(pulse.torque), mass]
        else:
            if pulse.force is None:
                change = f"the velocity change by pulse {place} ({pulse.channel})"
                raise BadRequest(
                    f"{change} is not known; give the thrusters position, direction and force"
                )
            if pulse.propellant is None:
                used = f"the propellant of pulse {place} ({pulse.channel})"
                raise BadRequest(f"{used} is not known, which an OPM needs; give the thrusters isp")
            assert plan.spacecraft.mass is not None
            gained = momentum_gained(replace(plan.flight, schedule=Schedule((pulse,))))  # inertial
            values = [
                *timing,
                mass,
                reference.frame,
                *(KILO * cleaned(gained / plan.spacecraft.mass)),
            ]
        comments = [f"pulse {place}: {pulse.channel}"]
        if pulse.through_valve:
            start, on_time = pulse.loaded
            comments.append(
                f"Commanded: {on_time:.9g} s from {reference.epoch.plus(max(start, 0.0)).text} on."
            )
            thrust = f"{pulse.on_time:.9g} s at the torque given."
            comments.append(f"Start and duration below are those of the thrust: {thrust}")
        yield _block(name, values, *comments)


def aem(
    plan: Plan,
    flown: Flight,
    until: float,
    reference: Reference,
    created: Epoch,
    kind: str = QUATERNION_ANGVEL,
) -> message.Message:
    """The message for the flight of a plan from 0 to ``until`` s, in segments that end at the edges
    of pulses.

    ``kind`` is the ATTITUDE_TYPE, SPIN where the body has not the nutation of SPIN/NUTATION_MOM.
    """
    spacecraft = plan.spacecraft
    if kind == SPIN_NUTATION_MOM and not spinning(spacecraft.inertia):
        kind = SPIN
    segments = tuple(
        _segment(spacecraft, stretch, reference, kind) for stretch in interpolated(flown, until)
    )
    return message.Message("AEM", _header(plan, created), segments)


ALONE = (
    "SPIN_ANGLE_VEL is the rate about the third axis at that moment; no transverse rates, "
    "no nutation."
)
"""Comment on records of the spin alone."""


def _segment(
    spacecraft: Spacecraft, stretch: AttitudeSegment, reference: Reference, kind: str
) -> message.Segment:
    times = [reference.epoch.plus(seconds).text for seconds in stretch.t.tolist()]
    useable = (times[0], None, None, times[-1])  # all of it
    axes = BODY_FRAME if kind == QUATERNION_ANGVEL else None
    method = "LAGRANGE" if kind == SPIN else "HERMITE"
    values = [
        *_identity(spacecraft),
        None,
        reference.frame,
        BODY_FRAME,
        "UTC",
        *useable,
        kind,
        axes,
        method,
        "3",
    ]
    comments = [f"pulses completed: {stretch.completed}", *[ALONE] * (kind == SPIN)]
    if kind == QUATERNION_ANGVEL:
        columns = np.column_stack([stretch.quaternion[:, [1, 2, 3, 0]], np.degrees(stretch.rates)])
    else:
        spin = spin_values(spacecraft.inertia, stretch.rates, stretch.quaternion)
        if kind == SPIN:
            spin["SPIN_ANGLE_VEL"] = np.degrees(stretch.rates[:, 2])
        columns = np.column_stack(
            [spin[keyword.name] for keyword in message.AEM_RECORDS[kind].keywords[1:]]
        )
    records = tuple(
        (time, *map(message.number, row)) for time, row in zip(times, columns.tolist(), strict=True)
    )
    return message.Segment(
        block("", message.AEM_METADATA, values, *comments),
        records=records,
        record=message.AEM_RECORDS[kind],
    )


PART = (
    "Only the part with the manoeuvres: the spacecraft file has no orbit.",
    "CENTER_NAME and the state (EPOCH, X to Z_DOT), which the standard demands, are to be added.",
)

KILO = 1e-3


def opm(plan: Plan, reference: Reference, created: Epoch) -> message.Message:
    """The message for a plan, made at ``created``; raises BadRequest where mass, forces or
    propellant are unknown.
    """
    spacecraft = plan.spacecraft
    if spacecraft.mass is None:
        raise BadRequest(
            "an OPM needs the velocity change of each pulse; add the key mass to the spacecraft "
            "file"
        )
    orbit = spacecraft.orbit
    blocks = []
    centre = None if orbit is None else orbit.center
    about = [*_identity(spacecraft), centre, reference.frame, "UTC"]
    if orbit is not None:
        state = KILO * np.concatenate([orbit.position, orbit.velocity])
        blocks.append(_block("STATE", [reference.epoch.text, *state]))
    blocks += [_block("SPACECRAFT", [spacecraft.mass]), *_manoeuvres("MANEUVER", plan, reference)]
    metadata = block("", message.OPM_METADATA, about, *(PART if orbit is None else ()))
    return message.Message(
        "OPM", _header(plan, created), (message.Segment(metadata, tuple(blocks)),)
    )
