"""A spacecraft file, and a schedule, from an attitude parameter message."""

from __future__ import annotations

import json
import math

import numpy as np

from nutdamp.epoch import DIGITS
from nutdamp.errors import Fault, FaultyFile, printable
from nutdamp.files.ccsds.apm_reader import ApmContents, Manoeuvre
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.schedule import STEERABLE, Pulse, Schedule
from nutdamp.spacecraft import Spacecraft, Vector

ALIKE = 1e-9
"""Relative difference up to which torques count as transverse, and as of one magnitude."""

_BLOCKS = {"inertia": "INERTIA", "omega0": "ANGVEL", "attitude": "EPOCH", "steerable": "MAN"}
"""Where a part of the spacecraft file comes from in the message."""


SAME_NUTATION, ROUNDED = 0.01, 1e-5
"""Share of a nutation, and rad besides, by which that of the inertia may differ: messages round."""


def imported(contents: ApmContents, path: str) -> tuple[str, Spacecraft, Schedule]:
    """Text of the spacecraft file, the spacecraft in it, and the manoeuvres as a schedule (empty without any).

    Raises FaultyFile, with lines of the message, where what it says cannot be a spacecraft for nutdamp.
    """
    bare = _read(spacecraft_text(contents, path, None), contents, path)
    torques = [bare.inertia.axes.T @ one.torque for one in contents.manoeuvres]
    torquer = _torquer(torques)
    text = spacecraft_text(contents, path, torquer)
    body = _read(text, contents, path)
    return text, body, _schedule(contents.manoeuvres, body)


def contradictions(contents: ApmContents, body: Spacecraft) -> list[str]:
    """Where the motion of the spacecraft is another than the message states: its nutation, by inertia and period."""
    stated, follows = contents.nutation, body.widest.nutation
    if stated is None or abs(follows - abs(stated)) <= ROUNDED + SAME_NUTATION * abs(stated):
        return []
    return [
        f"SPIN says a nutation of {math.degrees(abs(stated)):.4g} deg, but with this INERTIA NUTATION_PER gives one "
        f"of {math.degrees(follows):.4g} deg, which the file has; one of the three is wrong"
    ]


def _read(text: str, contents: ApmContents, path: str) -> Spacecraft:
    """The spacecraft in the text; its faults are those of the message that it came from."""
    try:
        return read_spacecraft(text, path)
    except FaultyFile as wrong:
        faults = []
        for fault in wrong.faults:
            block = _BLOCKS.get(fault.where.partition(".")[0].partition("[")[0], "")
            line = contents.lines.get(block, contents.lines.get("SPIN", 1) if block == "ANGVEL" else 1)
            faults.append(Fault(path, line, 1, block or fault.where, fault.problem))
        raise FaultyFile(faults) from None


def spacecraft_text(contents: ApmContents, path: str, torquer: float | None) -> str:
    """The spacecraft file as YAML; ``torquer`` N m is the torque of a steerable torquer, or None."""
    lines = [
        f"# From the attitude parameter message {printable(path)}; numbers as given there.",
        "# An APM knows no thruster layout, no mass, no requirement and no limits: add them.",
        f"name: {_text(contents.name)}",
    ]
    if contents.object_id is not None:
        lines.append(f"object_id: {_text(contents.object_id)}")
    lines += [
        *_inertia(contents.tensor),
        f"omega0: [{', '.join(f'{rate!r} deg/s' for rate in _degrees(contents.rates))}]",
    ]
    if contents.quaternion is not None:
        parts = ", ".join(repr(part) for part in contents.quaternion.tolist())
        lines += [
            "attitude:",
            f"  epoch: {contents.epoch.text.rstrip('0').rstrip('.')}Z",
            f"  frame: {contents.frame}",
            f"  quaternion: [{parts}]   # body -> frame, scalar first",
        ]
    lines += _actuators(contents.manoeuvres, torquer)
    return "\n".join(lines) + "\n"


def _text(value: str) -> str:
    """A text in double quotes, in which JSON and YAML agree."""
    return json.dumps(value, ensure_ascii=False)


def _degrees(rates: Vector) -> list[float]:
    return [math.degrees(rate) for rate in rates.tolist()]


def _inertia(tensor: Vector) -> list[str]:
    first, second, third = np.diag(tensor).tolist()
    if first == second and not (tensor - np.diag(np.diag(tensor))).any():
        return [f"inertia: {{A: {first!r} kg m^2, C: {third!r} kg m^2}}"]
    rows = (", ".join(f"{part!r} kg m^2" for part in row) for row in tensor.tolist())
    return ["inertia:", "  tensor:", *(f"    - [{row}]" for row in rows)]


def _actuators(manoeuvres: tuple[Manoeuvre, ...], torquer: float | None) -> list[str]:
    if not manoeuvres:
        return ["# The message fires nothing; without thrusters an ideal steerable impulse is assumed."]
    if torquer is not None:
        lines = [
            "# All manoeuvres of the message are transverse and of one torque, as a steerable torquer gives them.",
            f"steerable: {{torque: {torquer!r} N m}}",
        ]
        first = round(manoeuvres[0].start, DIGITS)
        return [*lines, f"limits: {{earliest: {first!r} s}}   # the first manoeuvre begins then"] if first else lines
    distinct = {tuple(one.torque.tolist()): None for one in manoeuvres}
    return [
        "# The torques that the message fires, as thrusters to begin with; without any, an ideal steerable impulse is",
        "# assumed.",
        "# thrusters:",
        *(
            f"#   - {{name: MAN{number}, torque: [{', '.join(f'{part!r} N m' for part in torque)}]}}"
            for number, torque in enumerate(distinct, start=1)
        ),
    ]


def _torquer(torques: list[Vector]) -> float | None:
    """The torque in N m that all have, where all are transverse (principal axes); None else."""
    if not torques:
        return None
    sizes = [float(np.linalg.norm(torque)) for torque in torques]
    transverse = all(abs(torque[2]) <= ALIKE * size for torque, size in zip(torques, sizes, strict=True))
    return sizes[0] if transverse and max(sizes) - min(sizes) <= ALIKE * max(sizes) else None


def _schedule(manoeuvres: tuple[Manoeuvre, ...], body: Spacecraft) -> Schedule:
    """The manoeuvres as pulses of the steerable torquer; one that overlaps another has a name of its own."""
    pulses: list[Pulse] = []
    free = 0.0
    for number, one in enumerate(manoeuvres, start=1):
        torque = body.inertia.axes.T @ one.torque
        alone = one.start >= free - 1e-9
        pulses.append(
            Pulse(
                t=one.start + 0.5 * one.duration,
                on_time=one.duration,
                channel=STEERABLE if alone else f"MAN{number}",
                impulse=torque * one.duration,
                torque=torque,
                propellant=None if one.mass is None else -one.mass,
            )
        )
        free = max(free, one.start + one.duration) if alone else free
    return Schedule(tuple(pulses))
