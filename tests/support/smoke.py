"""Runs every command of an installed nutdamp once, in a temporary folder, with nothing but the
standard library.

    python tests/support/smoke.py [NUTDAMP]

NUTDAMP is the program to run, by default the one beside this Python. Prints what went wrong and
leaves with 1 where an exit status is not the one expected, a traceback or a warning is printed, or
a file is missing or not of its kind.
"""

import json
import os
import re
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

SPACECRAFT = """
name: Smoke
mass: 250 kg
inertia: {tensor: [[120, 0.2, 0], [0.2, 119, 0], [0, 0, 80]]}
state: {spin: 30 rpm, nutation: 5 deg, phase: 40 deg}
attitude: {quaternion: [1, 0, 0, 0], epoch: 2026-03-01T12:00:00Z, frame: EME2000}
thrusters:
  - {name: +M1, position: [0, 0.3 m, 0.8 m], direction: [0, -1, 0], force: 10 N, isp: 220 s,
     max_on_time: 2 s}
  - {name: -M1, position: [0, -0.3 m, 0.8 m], direction: [0, 1, 0], force: 10 N, isp: 220 s,
     max_on_time: 2 s}
  - {name: +M2, torque: [0, 8 N m, 0], lever_arm: 0.8 m, isp: 220 s, min_on_time: 20 ms,
     max_on_time: 2 s}
  - {name: -M2, torque: [0, -8 N m, 0], lever_arm: 0.8 m, isp: 220 s, min_on_time: 20 ms,
     max_on_time: 2 s}
disturbances:
  - {name: leak, torque: [2 mN m, 0, 0]}
dispersions:
  A: {normal: 0.5 %}
  omega0: {normal: 0.1 deg/s}
  thrust: {normal: 2 %}
  timing: {uniform: 5 ms}
loop:
  sensor: {kind: gyro, rate: 50 Hz, noise: 0.005 deg/s}
  start: 0.5 deg
  stop: 0.1 deg
"""

BROKEN = "name: Broken\ninertia: {A: 120, C: 80}\nomega0: [0.1, 0, 0]\npaintwork: red\n"

CALLS = """
--version
--help
init
init; 1
init --list
init --from ace ace.yaml
plan ace.yaml --scheme one-pulse; 4
check
check smoke.yaml --json check.json
check broken.yaml; 2
schema -o schema.json
explain
explain 17
explain file.thrusters
explain weather; 2
plan
plan smoke.yaml --scheme two-pulse --json plan.json --csv pulses.csv --plot plan.png
plan smoke.yaml --scheme optimal --set limits.horizon=20s --csv optimal.csv
plan smoke.yaml --scheme optimal --set limits.horizon=20s --free-axis --least time
plan --scheme half-cone --target 10deg,45deg --nominal --json target.json
plan --robust --scheme one-pulse --json robust.json; 4
plan missing.yaml; 1
plan broken.yaml; 2
plan --colour red; 2
plan smoke.yaml --scheme half-cone; 2
plan smoke.yaml --scheme two-pulse --set limits.horizon=1ms; 3
simulate smoke.yaml --scheme two-pulse --csv track.csv --json track.json \
  --plot motion.svg --figure motion
simulate smoke.yaml --schedule pulses.csv --flown
simulate smoke.yaml --scheme none --until 10s --plot free.pdf
trade --points 1 --csv trade.csv --json trade.json --plot trade.png --schedules folder; 4
disperse smoke.yaml --schedule pulses.csv --samples 200 --csv c.csv \
  --json d.json --plot d.png --figure cases
disperse smoke.yaml --scheme two-pulse --case 7 --json case.json
verify smoke.yaml --scheme two-pulse --json verify.json
verify smoke.yaml --loop --set limits.horizon=15s --json loop-verified.json
loop smoke.yaml --set limits.horizon=30s --csv fired.csv --track flown.csv \
  --json loop.json --plot loop.png
loop smoke.yaml --set loop.sensor.scale=-100% --json reversed.json; 3
loop ace.yaml; 2
loop smoke.yaml --set limits.horizon=15s --case 2 --json dispersed.json
disperse smoke.yaml --loop --set disturbances=[] --until 20s --samples 10 \
  --csv loops.csv --json l.json --plot l.png
disperse smoke.yaml --loop --until 5s --samples 2; 4
budget smoke.yaml --set dissipation.time_constant=300s --csv budget.csv --json budget.json \
  --plot budget.png
budget smoke.yaml; 2
simulate smoke.yaml --scheme none --until 60s --samples 301 --csv telemetry.csv
fit telemetry.csv smoke.yaml -o fitted.yaml --at 90s --json fit.json --plot fit.png
plan fitted.yaml --scheme two-pulse
fit telemetry.csv smoke.yaml --schedule missing.csv; 1
report smoke.yaml --scheme two-pulse --disperse 200 -o report.html; 0 4
report -o report.pdf; 2
animate smoke.yaml --schedule pulses.csv --seconds 0.2 --fps 5 --width 320 -o film.gif
export smoke.yaml --schedule pulses.csv --format apm -o out.apm
export smoke.yaml --schedule pulses.csv --format apm -o out.xml
export smoke.yaml --schedule pulses.csv --format aem --until 5s -o out.aem
export smoke.yaml --schedule pulses.csv --format stk --until 5s -o out.a
export smoke.yaml --schedule pulses.csv --format basilisk -o out.py
export smoke.yaml --schedule pulses.csv --format json -o out.json
import apm out.apm -o again.yaml --schedule again.csv
import apm out.xml; 2
check again.yaml
""".strip().splitlines()
"""One call a line; behind a semicolon the exit statuses that are right, where that is not 0."""

BEGINNINGS = {
    ".png": b"\x89PNG",
    ".pdf": b"%PDF",
    ".gif": b"GIF8",
    ".svg": b"<?xml",
    ".html": b"<!doctype",
}
"""How a file of a kind begins."""


def main() -> int:
    """Run all; 1 where something is wrong."""
    program = str(
        Path(sys.argv[1]).absolute() if sys.argv[1:] else Path(sys.executable).with_name("nutdamp")
    )
    with tempfile.TemporaryDirectory() as folder:
        faults = list(_faults(program, Path(folder)))
    for fault in faults:
        print(f"FAILED: {fault}", file=sys.stderr)
    print(f"smoke test of {program}: {len(CALLS)} calls, {len(faults)} faults")
    return int(bool(faults))


def _faults(program: str, folder: Path) -> Iterator[str]:
    """What is wrong with each call, and with the files that are there in the end."""
    (folder / "smoke.yaml").write_text(SPACECRAFT, encoding="utf-8")
    (folder / "broken.yaml").write_text(BROKEN, encoding="utf-8")

    environment = {**os.environ, "COLUMNS": "80", "NO_COLOR": "1", "PYTHONUTF8": "1"}
    for line in CALLS:
        arguments, _, statuses = line.partition("; ")
        done = subprocess.run(
            [program, *shlex.split(arguments)],
            cwd=folder,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        if str(done.returncode) not in (statuses or "0").split():
            yield (
                f"nutdamp {arguments}: exit status {done.returncode}, "
                f"expected {statuses or 0}\n{done.stderr}"
            )
        elif re.search(r"Traceback|Warning", done.stderr):
            yield f"nutdamp {arguments}:\n{done.stderr}"
        for name in re.findall(r"(?:--json|--csv|--plot|--schedules|-o) (\S+)", arguments):
            if done.returncode in (0, 4):
                yield from _file_faults(folder / name, arguments)


def _file_faults(path: Path, arguments: str) -> Iterator[str]:
    """What is wrong with a file that a call should have written."""
    if path.is_dir():
        if not any(path.iterdir()):
            yield f"nutdamp {arguments}: nothing in {path.name}"
        return
    content = path.read_bytes() if path.exists() else b""
    if not content.lower().startswith(BEGINNINGS.get(path.suffix, b"").lower()) or not content:
        yield f"nutdamp {arguments}: {path.name} begins with {content[:20]!r}"
    elif path.suffix == ".json":
        try:
            json.loads(content)
        except ValueError as wrong:
            yield f"nutdamp {arguments}: {path.name}: {wrong}"


if __name__ == "__main__":
    sys.exit(main())
