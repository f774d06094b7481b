"""The broken spacecraft files of files/broken_files.txt, with the faults to be found in them."""

from pathlib import Path

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
