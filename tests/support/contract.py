"""What tests of files share: exported plans, their motion, and faults of what is refused."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import strategies as st
from scipy.integrate import simpson
from support import messages, reference
from support.builders import events, present
from support.cases import deep
from support.golden import check_text

from nutdamp.errors import FaultyFile, printable
from nutdamp.files.editing import parse_setting
from nutdamp.files.reader import load_spacecraft, read_spacecraft
from nutdamp.planning import plan as planning
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.schedule import Pulse, Schedule

QUICK = ("steerable-stage", "tilted tensor, backwards", "oblate, backwards")
CASES = pytest.mark.parametrize(
    "case", [name if name in QUICK else deep(name) for name in messages.CASES]
)
"""Names of the plans of `support.messages`."""

Write = Callable[..., Path]


def faults(read: Callable[..., object], *given: Any) -> list[str]:
    """What is wrong with what ``read(*given)`` must refuse: ``LINE:COLUMN: KEY: problem``."""
    try:
        read(*given)
    except FaultyFile as wrong:
        return [
            f"{fault.line}:{fault.column}: {fault.where}: {fault.problem}" for fault in wrong.faults
        ]
    pytest.fail(f"taken without a fault: {given}")


def check_faults(
    key: str, read: Callable[[Any], object], inputs: Iterable[Any] | Mapping[str, Any]
) -> None:
    """Fails where ``read`` takes one of the inputs, or finds other faults in it than the text kept
    as ``key`` says.

    The text has each input, or its name where they have some, and below it the faults.
    """
    named = inputs.items() if isinstance(inputs, Mapping) else [(given, given) for given in inputs]
    lines = []
    for name, given in named:
        shown = name if isinstance(name, str) else " -> ".join(map(str, name))
        lines += [
            printable(shown.strip().replace("\n", " | ")),
            *(f"    {fault}" for fault in faults(read, given)),
        ]
    check_text(key, "\n".join(lines))


def at(value: Any, path: str) -> Any:
    """The part of an object at ``path``, such as ``channels.0.name``; arrays as lists."""
    for step in path.split("."):
        value = value[int(step)] if step.isdigit() else getattr(value, step)
    return value.tolist() if isinstance(value, np.ndarray) else value


def check_parts(value: Any, expected: Mapping[str, Any]) -> None:
    """Fails where one of the parts of an object, by their paths, is not as expected."""
    assert {path: at(value, path) for path in expected} == expected


ORBIT = (
    "orbit={position: [7000 km, -12 km, 3.5 km], "
    "velocity: [0.1 km/s, 7400, 120 m/s], center: earth}"
)
PUSHED = ("ace", "communications-spinner", "couples-minisat")
"""Files whose thrusters push the body too."""

VALVED = """
name: Valved
object_id: 2026-031A
mass: 250 kg
inertia: {A: 120 kg m^2, C: 80 kg m^2}
state: {spin: 30 rpm, nutation: 5 deg}
attitude: {epoch: 2026-03-01T12:00:00Z, frame: EME2000, quaternion: [1, 0, 0, 0]}
orbit: {position: [7000 km, -12 km, 3.5 km], velocity: [0.1 km/s, 7400, 120 m/s], center: earth}
thrusters:
  - {name: T1, position: [0, 0.5, 0.8], direction: [1, 0, 0], force: 10 N, isp: 220 s}
  - {name: T2, position: [0, -0.5, 0.8], direction: [-1, 0, 0], force: 10 N, isp: 220 s}
"""


@cache
def pushing(name: str, *, orbit: bool = True) -> planning.Plan:
    """A plan whose pulses change the velocity."""
    body = load_spacecraft(
        messages.CONFIGS / f"{name}.yaml", [parse_setting(ORBIT)] if orbit else []
    )
    plan = planning.plan(body, "four-pulse")
    assert plan.feasible
    return plan


@cache
def valved() -> planning.Plan:
    """A plan whose pulses are fired through valves."""
    text = VALVED + "valve: {open_delay: 15 ms, close_delay: 8 ms}\n"
    return planning.plan(read_spacecraft(text, "f.yaml"), "four-pulse")


def motions(
    body: Spacecraft, pulses: Schedule, times: Sequence[float], rotation: Vector
) -> list[reference.Motion]:
    """The motion at ``times`` s by the reference integrator, from ``rotation`` on."""
    start = reference.Motion(body.omega0, rotation)
    return reference.path(body.inertia.moments, start, events(pulses), times)


def velocity_change(plan: planning.Plan, pulse: Pulse) -> Vector:
    """∫ R F dt / m of one pulse, m/s, by Simpson on attitudes of the reference integrator."""
    body = plan.spacecraft
    start = messages.columns(body, body.initial.quaternion) @ body.inertia.axes
    times = np.linspace(pulse.start, pulse.end, 33)
    moved = motions(body, plan.pulses, times.tolist(), start)
    pushes = np.array([motion.rotation @ present(pulse.force) for motion in moved])
    return np.asarray(simpson(pushes, x=times, axis=0) / present(body.mass))


@st.composite
def slips(draw: st.DrawFn, text: str) -> list[str]:
    """The lines of ``text`` after slips of hand: dropped, doubled, swapped, cut, or added to."""
    lines = text.splitlines(keepends=True)
    for _ in range(draw(st.integers(1, 4))):
        if not lines:
            break
        index, other = (draw(st.integers(0, len(lines) - 1)) for _ in range(2))
        place = draw(st.integers(0, len(lines[index])))
        match draw(st.sampled_from(["drop", "double", "swap", "cut", "insert"])):
            case "drop":
                del lines[index]
            case "double":
                lines.insert(index, lines[other])
            case "swap":
                lines[index], lines[other] = lines[other], lines[index]
            case "cut":
                lines[index] = lines[index][:place] + draw(st.text(max_size=3))
            case "insert":
                lines[index] = (
                    lines[index][:place] + draw(st.text(max_size=3)) + lines[index][place:]
                )
    return lines


# --- the broken spacecraft files of files/broken_files.txt, with the faults to be found in them

HEAD = "name: Sat\n"
INERTIA = "inertia: {A: 120, C: 80}\n"
BODY = HEAD + INERTIA
BASE = BODY + "omega0: [0.1, 0.2, 3]\n"  # what follows stands in line 4
SPIN = HEAD + "omega0: [0.1, 0.2, 3]\n"  # what follows stands in line 3
THRUSTERS = (
    BASE
    + "thrusters:\n"
    + "  - {name: T1, torque: [8, 0, 0], min_on_time: 20 ms, max_on_time: 2 s}\n"
    + "  - {name: T2, torque: [-8, 0, 0]}\n"
    + "  - {name: T3, torque: [0, 8, 0], max_on_time: 10 ms}\n"
)  # what follows stands in line 8


def broken_files() -> dict[str, tuple[str, list[str]]]:
    """Text and expected faults of each case in broken_files.txt."""
    beginnings = {"HEAD": HEAD, "BODY": BODY, "BASE": BASE, "SPIN": SPIN, "THRUSTERS": THRUSTERS}
    cases: dict[str, tuple[str, list[str]]] = {}
    for case in (
        (Path(__file__).with_name("broken_files.txt")).read_text("utf-8").split("\n=== ")[1:]
    ):
        name, *lines = case.rstrip().split("\n")
        faults = [line.removeprefix("--> ") for line in lines if line.startswith("--> ")]
        text = "".join(
            beginnings.get(line, f"{line}\n") for line in lines[: len(lines) - len(faults)]
        )
        assert name not in cases
        cases[name] = text, faults
    return cases


BROKEN = broken_files()
