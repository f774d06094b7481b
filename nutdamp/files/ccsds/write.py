"""Attitude parameter (APM), attitude ephemeris (AEM) and orbit parameter messages (OPM, CCSDS
502.0-B-3) written from plans, and spacecraft files written from messages.

Body axes are those of the spacecraft file, which messages call `message.BODY_FRAME`. Nutation by
annex F5 is the steady motion of bodies symmetric about axis 3: others have the spin alone.
"""

from __future__ import annotations

import json
import math
import unicodedata
from collections.abc import Iterator, Mapping
from dataclasses import replace
from decimal import Decimal
from itertools import chain, groupby
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from nutdamp import __version__
from nutdamp.common.numerics import cleaned
from nutdamp.common.results import Note, note
from nutdamp.common.time import DIGITS, MONTH, Epoch
from nutdamp.errors import BadRequest, Fault, FaultyFile, printable
from nutdamp.files.ccsds import message
from nutdamp.files.ccsds.message import (
    APM_BLOCKS,
    BODY_FRAME,
    LAYOUTS,
    QUATERNION_ANGVEL,
    SPIN,
    SPIN_NUTATION_MOM,
    VERSION,
    Keyword,
    Layout,
    names,
)
from nutdamp.files.ccsds.read import Contents, Manoeuvre
from nutdamp.files.editing import (
    Edit,
    Edits,
    Later,
    attitude_edits,
    carry_text,
    epoch_after,
    inertia_edits,
    rate_edits,
)
from nutdamp.files.export import AXES, Reference, interpolated
from nutdamp.files.reader import Source, read_spacecraft
from nutdamp.files.yaml import Node
from nutdamp.flight.dynamics import shed
from nutdamp.flight.end_state import momentum_gained
from nutdamp.flight.propagation import Flight
from nutdamp.physics import attitude
from nutdamp.physics.inertia import principal_axes
from nutdamp.planning.plan import Plan
from nutdamp.spacecraft.model import Attitude, Inertia, Spacecraft, Vector
from nutdamp.spacecraft.schedule import STEERABLE, Pulse, Schedule


class MessageBlock(NamedTuple):
    """Keywords that belong together, with their values as texts, and ``rows`` of a ``record``;
    ``name`` is that of the layout, META of metadata and DATA of records in an AEM, else empty.
    """

    name: str
    entries: tuple[tuple[Keyword, str], ...] = ()
    comments: tuple[str, ...] = ()
    rows: tuple[tuple[str, ...], ...] = ()
    record: Layout = Layout("")


class Message(NamedTuple):
    """A whole message; ``kind`` is APM, AEM or OPM. Of each segment the first block is metadata."""

    kind: str
    header: MessageBlock
    segments: tuple[tuple[MessageBlock, ...], ...]


LONGEST_LINE = 254  # ASCII characters that a line may have
SIGNIFICANT = 16  # most digits that a number may have

VERSION_OF = {"APM": VERSION, "AEM": VERSION, "OPM": "3.0"}

Values = Mapping[str, Any]
"""Texts, and numbers (of any shape of one) in the units of the tables, by keyword; None where one
is left out. A block takes those that are its own.
"""


def block(
    name: str, values: Values, *comments: str, keywords: tuple[Keyword, ...] = ()
) -> MessageBlock:
    """A block of ``values`` in the order of its ``keywords``, which are those of its layout."""
    entries = tuple(
        (keyword, value if isinstance(value, str) else number(np.asarray(value).item()))
        for keyword in keywords or LAYOUTS[name].keywords
        if (value := values.get(keyword.name)) is not None
    )
    return MessageBlock(name, entries, tuple(comment(text) for text in comments))


def number(value: float) -> str:
    """A number as the standard has it: at most 16 digits, at least one on either side of the point,
    no -0.
    """
    if value == 0.0:
        return "0.0"
    exact = Decimal(repr(float(value)))
    if len(exact.as_tuple().digits) > SIGNIFICANT:
        exact = Decimal(f"{value:.{SIGNIFICANT - 1}e}")
    exact = exact.normalize()
    fixed = f"{exact:f}"
    if "." not in fixed:
        fixed += ".0"
    if sum(character.isdigit() for character in fixed) <= SIGNIFICANT:
        return fixed
    sign, digits, _ = exact.as_tuple()
    first, *rest = (str(digit) for digit in digits)
    return f"{'-' * sign}{first}.{''.join(rest) or '0'}E{exact.adjusted():+03d}"


def label(text: str) -> str:
    """A name as a value of the standard: printable ASCII in capitals; UNKNOWN where nothing is
    left.
    """
    return " ".join(_ascii(text).upper().split())[:200] or "UNKNOWN"


def comment(text: str) -> str:
    """A comment as the standard has it: printable ASCII, short enough for one line."""
    return _ascii(text)[: LONGEST_LINE - len("COMMENT ")]


def _ascii(text: str) -> str:
    """Text in ASCII: accents and other characters are dropped."""
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
    return "".join(character if character.isprintable() else " " for character in plain)


SCHEMA_INSTANCE = "http://www.w3.org/2001/XMLSchema-instance"


def to_xml(message: Message) -> str:
    """The text of a message."""
    # Namespace and attributes are written as the standard prints them.
    versioned = {"id": f"CCSDS_{message.kind}_VERS", "version": VERSION_OF[message.kind]}
    root = Element(message.kind.lower(), {"xmlns:xsi": SCHEMA_INSTANCE, **versioned})
    _fill(SubElement(root, "header"), message.header)
    body = SubElement(root, "body")
    for metadata, *blocks in message.segments:
        place = SubElement(body, "segment")
        _fill(SubElement(place, "metadata"), metadata)
        data = SubElement(place, "data")
        for part in blocks:
            _fill(SubElement(data, LAYOUTS[part.name].tag) if part.name in LAYOUTS else data, part)
            for row in part.rows:
                record = SubElement(SubElement(data, "attitudeState"), part.record.tag)
                values = dict(zip(names(part.record.keywords), row, strict=True))
                _fill(record, block("", values, keywords=part.record.keywords))
    indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{tostring(root, encoding="unicode")}\n'


def _fill(place: Element, block: MessageBlock) -> None:
    for comment in block.comments:
        SubElement(place, "COMMENT").text = comment
    for tag, group in groupby(block.entries, lambda entry: entry[0].tag):
        parent = SubElement(place, tag) if tag else place
        for keyword, value in group:
            units = {"units": keyword.unit} if keyword.unit else {}
            SubElement(parent, keyword.name, units).text = value


EDGED = (*APM_BLOCKS, "META", "DATA")
"""Blocks between lines of their name."""


def to_kvn(message: Message) -> str:
    """The text of a message."""
    paragraphs = []
    for part in (message.header, *chain(*message.segments)):
        width = max((len(keyword.name) for keyword, _ in part.entries), default=0)
        lines = [
            *(f"COMMENT {comment}" for comment in part.comments),
            *(
                f"{keyword.name:<{width}} = {value}"
                + (f" [{keyword.unit}]" if keyword.unit else "")
                for keyword, value in part.entries
            ),
            *map(" ".join, part.rows),
        ]
        if part.name in EDGED:
            lines = [f"{part.name}_START", *lines, f"{part.name}_STOP"]
        paragraphs.append("\n".join(lines))
    version = f"CCSDS_{message.kind}_VERS = {VERSION_OF[message.kind]}"
    return "\n".join([version, "\n\n".join(paragraphs), ""])


AXIS = 1e-12  # tilt in rad up to which the symmetry axis counts as the third axis of the file

FULL = 2.0 * math.pi


def spinning(inertia: Inertia) -> bool:
    """True where the body fits the model of these keywords: symmetric about axis 3."""
    return inertia.symmetric and math.hypot(*inertia.axes[:2, 2]) <= AXIS


def motion_values(rates: Vector, quaternion: Vector) -> dict[str, Vector]:
    """Keywords of quaternion and rates, as `spin_values` has them.

    The quaternion from A to B turns the axes of A into those of B (annex F2), as body -> inertial
    turns vectors.
    """
    columns = [*quaternion[:, [1, 2, 3, 0]].T, *np.degrees(rates).T]
    return dict(zip(names((*message.QUATERNION, *message.ANGVEL)), columns, strict=True))


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


def euler_rate(spin: dict[str, Vector], third: float) -> str:
    """Comment on SPIN_ANGLE_VEL at the first moment, which reads like a fault beside the spin: of
    a body with C/A = 4/3 it is -30 deg/s at a spin of 90 deg/s.

    ``third`` is ω3 in rad/s.
    """
    rate = float(spin["SPIN_ANGLE_VEL"][0])
    return (
        "SPIN_ANGLE_VEL is the Euler rate about the axis, psi-dot = w3 - phi-dot cos theta: "
        f"{rate:.6g} deg/s. The spin of the body, w3, is {math.degrees(third):.6g} deg/s."
    )


def _on_sphere(vectors: Vector) -> tuple[Vector, Vector]:
    """Right ascension in [0, 2π) and declination of vectors (n, 3), rad;
    the former is 0 at a pole.
    """
    x, y, z = vectors.T
    turned = np.arctan2(y, x) % FULL
    return np.where(turned < FULL, turned, 0.0), np.arctan2(z, np.hypot(x, y))


ORIGINATOR = "NUTDAMP"

PRODUCTS = (  # comment on the signs of INERTIA
    "IXY, IXZ, IYZ are products of inertia such as the sum of m*x*y, as CCSDS 504.0-B-2 has them: "
    "minus the entries of the tensor off its diagonal."
)


def apm(plan: Plan, reference: Reference, created: Epoch) -> Message:
    """The message for a plan, made at ``created``; raises BadRequest for an ideal impulse, which
    has no duration.
    """
    spacecraft = plan.spacecraft
    motion = spacecraft.inertia.in_file_axes(
        spacecraft.initial.rates, spacecraft.initial.quaternion
    )
    # The products are minus the entries off the diagonal (annex F6).
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = spacecraft.inertia.tensor.tolist()
    told: dict[str, Any] = {
        **_identity(spacecraft),
        **{"EPOCH": reference.epoch.text, "REF_FRAME_A": reference.frame},
        **dict.fromkeys(("REF_FRAME_B", "ANGVEL_FRAME", "INERTIA_REF_FRAME"), BODY_FRAME),
        **motion_values(*(cleaned(values)[None] for values in motion)),
        **dict(zip(names(message.INERTIA), (xx, yy, zz, -xy, -xz, -yz), strict=True)),
    }
    blocks = [
        block("", told, *_unsaid(spacecraft), keywords=(Keyword("EPOCH"),)),
        block("QUAT", told),
        block("ANGVEL", told),
    ]
    if spinning(spacecraft.inertia):
        spin = spin_values(spacecraft.inertia, *(values[None] for values in motion))
        rate = euler_rate(spin, float(motion[0][2]))
        without = dict.fromkeys(names(message.MOMENTUM))
        blocks.append(block("SPIN", told | spin | without, rate))
    blocks += [block("INERTIA", told, PRODUCTS), *_manoeuvres("MAN", plan, reference)]
    about = block("", told, keywords=message.APM_METADATA)
    return Message("APM", _header(plan, created), ((about, *blocks),))


def _header(plan: Plan, created: Epoch) -> MessageBlock:
    moment = created.text.partition(".")[0]
    values = {
        "CREATION_DATE": moment,
        "ORIGINATOR": ORIGINATOR,
        "MESSAGE_ID": label(f"{plan.scheme}-{moment}"),
    }
    return block(
        "",
        values,
        f"nutdamp {__version__}: {plan.scheme} schedule for {plan.spacecraft.name}",
        f"status: {plan.verdict.status.value}",
        keywords=message.HEADER,
    )


def _identity(spacecraft: Spacecraft) -> dict[str, str]:
    name, identity = label(spacecraft.name), label(spacecraft.object_id or "")
    return {"OBJECT_NAME": name, "OBJECT_ID": identity, "TIME_SYSTEM": "UTC"}


def _unsaid(spacecraft: Spacecraft) -> list[str]:
    wheel = spacecraft.inertia.wheel
    per_kg = shed(spacecraft)
    of_file = "of the spacecraft file"
    spins = spinning(spacecraft.inertia)
    values = ", ".join(f"{moment:.9g}" for moment in (() if per_kg is None else per_kg))
    momentum = f"{wheel:.9g} N*m*s along principal axis 3"
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
            "No SPIN block: the body is not symmetric about its third axis, as the model of that "
            "block is."
        ): not spins,
    }
    return [remark for remark, holds in remarks.items() if holds]


def _manoeuvres(name: str, plan: Plan, reference: Reference) -> Iterator[MessageBlock]:
    """Blocks of the pulses: MAN with their torques, MANEUVER with their velocity changes."""
    for place, pulse in enumerate(sorted(plan.pulses, key=lambda pulse: pulse.start), start=1):
        begin = reference.epoch.plus(max(pulse.start, 0.0)).text
        values: dict[str, Any] = {
            "MAN_DURATION": pulse.on_time,
            "MAN_DELTA_MASS": None if pulse.propellant is None else -pulse.propellant,
        }
        if name == "MAN":
            if pulse.torque is None or pulse.on_time == 0.0:
                raise BadRequest(
                    f"pulse {place} is an ideal impulse without a duration, which an APM cannot "
                    "hold; "
                    "give the torquer a torque (steerable: {torque: 20 N m}) and plan again"
                )
            torque = plan.spacecraft.inertia.in_file(pulse.torque)
            values |= {"MAN_EPOCH_START": begin, "MAN_REF_FRAME": BODY_FRAME}
            values |= dict(zip(names(message.TORQUE), torque, strict=True))
        else:
            if pulse.force is None:
                raise BadRequest(
                    f"the velocity change by pulse {place} ({pulse.channel}) is not known; give "
                    "the thrusters position, direction and force"
                )
            if pulse.propellant is None:
                raise BadRequest(
                    f"the propellant of pulse {place} ({pulse.channel}) is not known, which an OPM "
                    "needs; give the thrusters isp"
                )
            assert plan.spacecraft.mass is not None
            gained = momentum_gained(replace(plan._flight, schedule=Schedule((pulse,))))  # inertial
            change = KILO * cleaned(gained / plan.spacecraft.mass)
            values |= {"MAN_EPOCH_IGNITION": begin, "MAN_REF_FRAME": reference.frame}
            values |= {f"MAN_DV_{axis}": part for axis, part in enumerate(change, start=1)}
        comments = [f"pulse {place}: {pulse.channel}"]
        if pulse.through_valve:
            start, on_time = pulse.loaded
            comments.append(
                f"Commanded: {on_time:.9g} s from {reference.epoch.plus(max(start, 0.0)).text} on."
            )
            comments.append(
                f"Start and duration below are those of the thrust: {pulse.on_time:.9g} s at the "
                "torque given."
            )
        yield block(name, values, *comments)


def aem(
    plan: Plan,
    flown: Flight,
    until: float,
    reference: Reference,
    created: Epoch,
    kind: str = QUATERNION_ANGVEL,
) -> Message:
    """The message for the flight of a plan from 0 to ``until`` s, in segments that end at the edges
    of pulses.

    ``kind`` is the ATTITUDE_TYPE, SPIN where the body has not the nutation of SPIN/NUTATION_MOM.
    """
    spacecraft = plan.spacecraft
    if kind == SPIN_NUTATION_MOM and not spinning(spacecraft.inertia):
        kind = SPIN
    record = message.AEM_RECORDS[kind]
    about = _identity(spacecraft) | {
        "REF_FRAME_A": reference.frame,
        "REF_FRAME_B": BODY_FRAME,
        "ATTITUDE_TYPE": kind,
        "INTERPOLATION_METHOD": "LAGRANGE" if kind == SPIN else "HERMITE",
        "INTERPOLATION_DEGREE": "3",
    }
    segments = []
    for stretch in interpolated(flown, until):
        times = [reference.epoch.plus(seconds).text for seconds in stretch.t.tolist()]
        useable = {"START_TIME": times[0], "STOP_TIME": times[-1]}  # all of it
        comments = [f"pulses completed: {stretch.completed}"]
        if kind == QUATERNION_ANGVEL:
            about["ANGVEL_FRAME"] = BODY_FRAME
            motion = motion_values(stretch.rates, stretch.quaternion)
        else:
            motion = spin_values(spacecraft.inertia, stretch.rates, stretch.quaternion)
            comments.append(
                ALONE if kind == SPIN else euler_rate(motion, float(stretch.rates[0, 2]))
            )
        if kind == SPIN:
            motion["SPIN_ANGLE_VEL"] = np.degrees(stretch.rates[:, 2])
        columns = [map(number, motion[name].tolist()) for name in names(record.keywords)[1:]]
        segments.append(
            (
                block("META", about | useable, *comments, keywords=message.AEM_METADATA),
                MessageBlock("DATA", rows=tuple(zip(times, *columns, strict=True)), record=record),
            )
        )
    return Message("AEM", _header(plan, created), tuple(segments))


ALONE = (
    "SPIN_ANGLE_VEL is the rate about the third axis at that moment; no transverse rates, no "
    "nutation."
)
"""Comment on records of the spin alone."""

PART = (
    "Only the part with the manoeuvres: the spacecraft file has no orbit.",
    "CENTER_NAME and the state (EPOCH, X to Z_DOT), which the standard demands, are to be added.",
)

KILO = 1e-3


def opm(plan: Plan, reference: Reference, created: Epoch) -> Message:
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
    about = _identity(spacecraft) | {"REF_FRAME": reference.frame}
    if orbit is not None:
        about["CENTER_NAME"] = orbit.center
        state = KILO * np.concatenate([orbit.position, orbit.velocity])
        keywords = names(LAYOUTS["STATE"].keywords)
        values = dict(zip(keywords, (reference.epoch.text, *state), strict=True))
        blocks.append(block("STATE", values))
    mass = block("SPACECRAFT", {"MASS": spacecraft.mass})
    blocks += [mass, *_manoeuvres("MANEUVER", plan, reference)]
    remarks = PART if orbit is None else ()
    metadata = block("", about, *remarks, keywords=message.OPM_METADATA)
    return Message("OPM", _header(plan, created), ((metadata, *blocks),))


# --- spacecraft files from messages: new ones with a schedule, or others merged into

ALIKE = 1e-9  # relative difference up to which torques count as transverse, and as of one magnitude

_SOURCES = {
    "inertia": ("INERTIA", "PHYS"),
    "omega0": ("ANGVEL", "SPIN", "ATT"),
    "steerable": ("MAN",),
}
"""Blocks of messages behind each part of the spacecraft file; the first there is one has it."""

SAME_NUTATION, ROUNDED = 0.01, 1e-5
"""Share of a nutation, and rad besides, by which that of the inertia may differ: messages round."""


def imported(contents: Contents, path: str) -> tuple[str, Spacecraft, Schedule]:
    """Text of the spacecraft file, the spacecraft, and the manoeuvres; FaultyFile, by lines of the
    message.
    """
    record = contents.at()
    (rates,), (quaternion,), tensor = record.rates, record.quaternions, contents.tensor
    if tensor is None or np.isnan(rates).any():
        name, absent = ("INERTIA", "moments of inertia") if tensor is None else ("ANGVEL", "rates")
        problem = (
            f"missing; a spacecraft file needs {absent}: --into merges the message into one that "
            "has them"
        )
        raise FaultyFile([Fault(path, 1, 1, name, problem)])
    _, axes = principal_axes(tensor)
    torques = [axes.T @ manoeuvre.torque for manoeuvre in contents.manoeuvres]
    sizes = [float(np.linalg.norm(torque)) for torque in torques]
    transverse = all(
        abs(torque[2]) <= ALIKE * size for torque, size in zip(torques, sizes, strict=True)
    )
    alike = sizes and transverse and max(sizes) - min(sizes) <= ALIKE * max(sizes)
    unknown = "no thruster layout, " + ("no mass, " if contents.mass is None else "")
    # Texts are in double quotes, in which JSON and YAML agree.
    lines = [
        f"# From the attitude message {printable(path)}; numbers as given there.",
        f"# It knows {unknown}no requirement and no limits: add them.",
        f"name: {json.dumps(contents.name, ensure_ascii=False)}",
    ]
    if contents.object_id is not None:
        lines.append(f"object_id: {json.dumps(contents.object_id, ensure_ascii=False)}")
    if contents.mass is not None:
        lines.append(f"mass: {contents.mass!r} kg")
    texts = ", ".join(f"{math.degrees(rate)!r} deg/s" for rate in rates.tolist())
    first, second, third = np.diag(tensor).tolist()
    if first == second and not np.triu(tensor, 1).any():
        lines.append(f"inertia: {{A: {first!r} kg m^2, C: {third!r} kg m^2}}")
    else:
        rows = (", ".join(f"{part!r} kg m^2" for part in row) for row in tensor.tolist())
        lines += ["inertia:", "  tensor:", *(f"    - [{row}]" for row in rows)]
    lines.append(f"omega0: [{texts}]")
    if not np.isnan(quaternion).any():
        lines += [
            "attitude:",
            f"  epoch: {record.epoch.text.rstrip('0').rstrip('.')}Z",
            f"  frame: {contents.frame}",
            f"  quaternion: {quaternion.tolist()}   # body -> frame, scalar first",
        ]
    lines += _actuators(contents.manoeuvres, sizes[0] if alike else None)
    text = "\n".join(lines) + "\n"
    # Pulses of the steerable torquer; one that overlaps another has a name of its own.
    pulses: list[Pulse] = []
    free = 0.0
    for place, (manoeuvre, torque) in enumerate(
        zip(contents.manoeuvres, torques, strict=True), start=1
    ):
        start, lasts, used = manoeuvre.start, manoeuvre.duration, manoeuvre.mass
        alone = start >= free - 1e-9
        spent = None if used is None else -used
        channel = STEERABLE if alone else f"MAN{place}"
        pulses.append(
            Pulse(start + 0.5 * lasts, lasts, channel, torque * lasts, torque, propellant=spent)
        )
        free = max(free, start + lasts) if alone else free
    try:
        return text, read_spacecraft(text, path), Schedule(tuple(pulses))
    except FaultyFile as wrong:  # its faults are those of the message
        faults = []
        for fault in wrong.faults:
            part = fault.where.partition(".")[0].partition("[")[0]
            places = [name for name in _SOURCES.get(part, ()) if name in contents.lines]
            where, line = (places[0], contents.lines[places[0]]) if places else (fault.where, 1)
            faults.append(Fault(path, line, 1, where, fault.problem))
        raise FaultyFile(faults) from None


def acute(record: Contents) -> float:
    """Nutation that a record states, rad, of a body that spins either way; NaN of none."""
    stated = abs(float(record.nutations[0]))
    return min(stated, math.pi - stated)


def contradictions(record: Contents, spacecraft: Spacecraft, remains: str) -> list[Note]:
    """Note on a nutation that a record states and that is not the one by inertia and period; the
    file has what ``remains``.
    """
    stated, follows = acute(record), spacecraft.widest.nutation
    if math.isnan(stated) or abs(follows - stated) <= ROUNDED + SAME_NUTATION * stated:
        return []
    return [
        note(
            "message-contradicts",
            stated_deg=math.degrees(stated),
            follows_deg=math.degrees(follows),
            remains=remains,
        )
    ]


def _actuators(manoeuvres: tuple[Manoeuvre, ...], torquer: float | None) -> list[str]:
    if not manoeuvres:
        return [
            "# The message fires nothing; without thrusters an ideal steerable impulse is assumed."
        ]
    if torquer is not None:
        first = round(manoeuvres[0].start, DIGITS)
        return [
            (
                "# All manoeuvres of the message are transverse and of one torque, as a steerable "
                "torquer gives them."
            ),
            f"steerable: {{torque: {torquer!r} N m}}",
            *[f"limits: {{earliest: {first!r} s}}   # the first manoeuvre begins then"]
            * bool(first),
        ]
    distinct = {tuple(manoeuvre.torque.tolist()): None for manoeuvre in manoeuvres}
    return [
        (
            "# The torques that the message fires, as thrusters to begin with; without any, an "
            "ideal steerable impulse is"
        ),
        "# assumed.",
        "# thrusters:",
        *(
            (
                "#   - "
                f"{{name: MAN{place}, torque: [{', '.join(f'{part!r} N m' for part in torque)}]}}"
            )
            for place, torque in enumerate(distinct, start=1)
        ),
    ]


def merge(
    source: Source, contents: Contents, time: float = 0.0, *, inertia: bool
) -> tuple[str, tuple[str, ...], list[Note]]:
    """Text of a spacecraft file with the motion at the first record from ``time`` s on, and with
    mass and ``inertia`` where asked for; remarks, and notes.

    Of SPIN with a nutation the spin and the angle stay, whatever C/A the file has. Raises
    BadRequest where the message has not what is to be merged, or the file would be none.
    """
    if inertia and contents.tensor is None:
        raise BadRequest("the message has no inertia to merge")
    before = source.read(lambda _: None)
    after, doubts, record = before, list[Note](), contents
    if inertia and contents.tensor is not None:
        moments = Inertia(*principal_axes(contents.tensor), before.inertia.wheel)
        after = replace(after, inertia=moments)
    axes, quaternion = after.inertia.axes, before.initial.quaternion
    rates, turn = before.rates, np.full(4, math.nan)
    if len(contents.times) or not inertia:  # an ACM may have physical properties alone
        record = contents.at(time, before.spin)
        turn = record.quaternions[0]
        rates = rates if np.isnan(record.rates).any() else record.rates[0]
    after = replace(after, omega0=axes.T @ rates)
    if record is not contents and acute(record) > 0.0:
        doubts = contradictions(record, after, "the spin and nutation of the message")
        first, second, third = after.inertia.momentum(after.omega0).tolist()
        share = abs(third) * math.tan(acute(record)) / math.hypot(first, second)
        after = replace(after, omega0=after.omega0 * (share, share, 1.0))
    turned = not np.isnan(turn).any()
    start = None if before.attitude is None else before.attitude.epoch
    if turned and start is not None:
        apart = abs(record.epoch.since(Epoch.parse(start)))
        doubts += [note("record-far", apart_lasting_s=apart)] if apart > MONTH else []
    if turned:
        quaternion = attitude.multiply(turn, attitude.from_matrix(axes))
        own = None if before.attitude is None else before.attitude.frame
        # A file in J2000 stays so where the message says EME2000.
        frame = own if AXES.get(f"{own}") == AXES.get(f"{contents.frame}") else contents.frame
        after = replace(after, attitude=Attitude(turn, epoch_after(record.epoch.text, 0.0), frame))
    later = Later(before, after, quaternion)

    def edits(tree: Node) -> Edits:
        if inertia:
            yield from inertia_edits(tree, later)
        if inertia and contents.mass is not None:
            yield Edit(("mass",), contents.mass, "mass")
        if rates is not before.rates:
            yield from rate_edits(tree, later)
        if turned:
            yield from attitude_edits(tree, later)

    text = carry_text(*source[:3], edits)
    try:
        Source(text, source.name).read(lambda _: None)
    except FaultyFile as wrong:
        listed = "; ".join(f"{fault.where}: {fault.problem}" for fault in wrong.faults)
        raise BadRequest(f"the message does not fit {source.name}: {listed}") from None
    return text, record.remarks, doubts
