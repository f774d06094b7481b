"""Commands as users run them: what refused ones say, and the JSON, CSV and folders of others."""

import csv
import io
import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from rich.console import Console, RenderableType
from support import places
from support.dispersed import FILE
from support.process import Run, Status, environment

EXACT = "name: X\ninertia: {A: 120, C: 80}\nomega0: [0.1, 0, 3]\n"
"""The shortest spacecraft file: ideal impulses, and no requirement."""
DATED = """
name: Dated
inertia: {A: 120, C: 80}
state: {spin: 30 rpm, nutation: 5 deg, phase: 40 deg}
attitude: {epoch: 2026-03-01T12:00:00Z, frame: EME2000, quaternion: [0.3, -0.2, 0.9, 0.1]}
steerable: {torque: 20 N m}
"""
JETS = """\
thrusters:
  - {name: a, torque: [8, 0, 0], lever_arm: 0.8, isp: 220}
  - {name: b, torque: [-8, 0, 0], lever_arm: 0.8, isp: 220}
  - {name: c, torque: [0, 8, 0], lever_arm: 0.8, isp: 220}
  - {name: d, torque: [0, -8, 0], lever_arm: 0.8, isp: 220}
"""
CALM = f"""name: Sat
inertia: {{A: 120, C: 80}}
state: {{spin: 3 rad/s, nutation: 5 deg, phase: 40 deg}}
{JETS}"""
WEAK = """
name: Weak
inertia: {A: 120, C: 80}
state: {spin: 30 rpm, nutation: 5 deg}
thrusters: [{name: T1, torque: [0, 0.5, 0], max_on_time: 100 ms}]
requirement: {nutation: 0.01 deg}
limits: {horizon: 20 s}
"""
BALL = "name: Ball\ninertia: {A: 100, C: 100}\nstate: {spin: 30 rpm, nutation: 5 deg}\n"
TILTED = """
name: Tilted
inertia: {tensor: [[120, 0, 2], [0, 118, 0], [2, 0, 80]]}
omega0: [0.1, 0, 3]
thrusters: [{name: T1, torque: [0, 8, 0], min_on_time: 20 ms}, {name: SPIN, torque: [0, 0, 5]}]
"""
DRAWN = """\
name: Sat
inertia: {A: 120, C: 80}
omega0: [0.1, 0.2, 3]
thrusters:
  - {name: left 1, position: [0, 0.3, 0.8], direction: [0, -1, 0], force: 10 N}
  - {name: T2, torque: [0, 8, 0]}
  - {name: T3, torque: [0, -8, 0]}
channels: {+: [left 1], -: [T2]}
dispersions:
  A: {normal: 0}
  thrust: {normal: 3 %}
  thrust_direction: {normal: 0.5 deg}
  timing: {uniform: 5 ms}
"""
KEEPER = """
name: Keeper
inertia: {A: 120, C: 80}
state: {spin: 30 rpm, nutation: 5 deg}
steerable: {torque: 60 N m}
requirement: {nutation: 1 deg}
attitude: {frame: EME2000, quaternion: [1, 0, 0, 0]}
keep: [{name: star, direction: [0, 89 deg], min: 5 deg}]
"""
BARE = """
name: Upper
inertia: {A: 100 kg m^2, C: 70 kg m^2}
omega0: [0.042 rad/s, 0.036 rad/s, 3 rad/s]
thrusters:
  - {name: +M1, torque: [ 20, 0, 0], isp: 220 s, lever_arm: 1 m, min_on_time: 5 ms,
     max_on_time: 50 ms}
  - {name: -M1, torque: [-20, 0, 0], isp: 220 s, lever_arm: 1 m, min_on_time: 5 ms,
     max_on_time: 50 ms}
  - {name: +M2, torque: [0,  20, 0], isp: 220 s, lever_arm: 1 m, min_on_time: 5 ms,
     max_on_time: 50 ms}
  - {name: -M2, torque: [0, -20, 0], isp: 220 s, lever_arm: 1 m, min_on_time: 5 ms,
     max_on_time: 50 ms}
requirement: {nutation: 0.3 deg}
"""
LOOPED = f"""{BARE}
loop:
  sensor: {{kind: gyro, rate: 100 Hz, noise: 0.01 deg/s, bias: 0.02 deg/s, delay: 20 ms}}
  start: 0.2 deg
  stop: 0.05 deg
  min_interval: 0.5 s
"""
SEEN = f"""{LOOPED}
attitude: {{quaternion: [1, 0, 0, 0], epoch: 2026-03-01T12:00:00Z, frame: EME2000}}
keep: [{{name: star, direction: [0 deg, 85 deg], min: 8 deg}}]
"""
GOOD = EXACT.replace("X", "Good")
STAGE = (places.CONFIGS / "upper-stage.yaml").read_text(encoding="utf-8")
CRAFTS = {
    "good_yaml": GOOD,
    "typo_yaml": GOOD.replace("Good", "Typo").replace("C:", "c:"),
    "fast_yaml": GOOD.replace("3]", "300]"),
    "nameless_yaml": "name: X\n",
    "tilted_yaml": TILTED,
    "drawn_yaml": DRAWN,
    "undrawn_yaml": DRAWN.partition("dispersions:")[0],
    "keeper_yaml": KEEPER,
    "weak_yaml": WEAK,
    "axial_yaml": WEAK.replace("[0, 0.5, 0]", "[0, 0, 5]"),
    "ball_yaml": BALL,
    "rest_yaml": BALL.replace("5 deg", "0 deg"),
    "calm_yaml": CALM,
    "sat_yaml": CALM + "dispersions: {A: {normal: 0.1 %}, thrust: {b: {normal: 30 %}}}\n",
    "x_yaml": EXACT,
    "dated_yaml": DATED,
    "body_yaml": FILE,
    "bare_yaml": BARE,
    "craft_yaml": LOOPED,
    "seen_yaml": SEEN,
    "free_yaml": SEEN.replace("8 deg", "1 deg"),
    "sunny_yaml": """
name: Spinner
inertia: {A: 80 kg m^2, C: 120 kg m^2}
state: {spin: -30 rpm, nutation: 2 deg}
attitude: {quaternion: [1, 0, 0, 0]}
thrusters: [{name: T1, torque: [8, 0, 0], max_on_time: 900 ms}]
sun: [40 deg, 20 deg]
sun_sensor: {azimuth: 35 deg}
commands: {delay_step: 2 ms, delay_max: 1.9 s, width: {step: 1 ms, min: 20 ms, max: 1.8 s},
  every: [1, 2]}
keep: [{name: pole, direction: [10 deg, 86 deg], min: 2 deg}]
""",
    "pointed_yaml": """
name: Pointed
inertia: {A: 120 kg m^2, C: 80 kg m^2}
state: {spin: 3 rad/s, nutation: 6 deg}
attitude: {quaternion: [0.809017, 0.081804, 0.582065, 0], epoch: 2016-12-31T23:59:59Z,
  frame: EME2000}
steerable: {torque: 60 N m}
""",
    "stage_yaml": STAGE,
    "undispersed_yaml": STAGE.partition("dispersions:\n")[0],
    "unlooped_yaml": STAGE[: STAGE.index("\nloop:")] + "\n" + STAGE[STAGE.index("dispersions:") :],
}
"""Spacecraft files for commands, as `written` takes them."""
WIDER = {
    "A": "0.5 %", "C": "0.5 %", "omega0": "0.1 deg/s", "thrust": "2 %", "thrust_per_pulse": "1 %",
    "thrust_direction": "0.5 deg", "position": "5 mm", "attitude": "0.2 deg",
}  # fmt: skip
"""Tolerances of the built-in example with which no nominal plan complies often enough."""
WIDE = [
    part
    for key, size in WIDER.items()
    for part in ("--set", f"dispersions.{key}={{normal: {size}}}")
]
"""Sets them."""
BUILT_IN = "warning: no spacecraft file given: using the built-in example (see `nutdamp init`)\n"
"""First line of standard error where no file is named, with -q too."""
SCHEDULE = "t_s,on_time_s,channel,impulse_1_Nms,impulse_2_Nms,impulse_3_Nms\n1,0,steerable,4,0,0\n"


def contents(folder: Path) -> dict[str, bytes]:
    """Every file of a folder, by its path there."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def names(folder: Path) -> list[str]:
    """What is in a folder."""
    return sorted(path.name for path in folder.iterdir())


def written(folder: Path, **files: str) -> None:
    """Write files: ``written(folder, craft_yaml="name: X")`` writes craft.yaml."""
    for name, text in files.items():
        (folder / name.replace("_", ".")).write_text(text, encoding="utf-8")


def refusals(
    run: Run, folder: Path, commands: Iterable[str], status: int = 2, stdin: str | None = None
) -> str:
    """What each of the commands says, behind it; none prints a result or touches a file."""
    before = contents(folder)
    said = []
    for command in commands:
        refused = run(*shlex.split(command.replace("FOLDER", str(folder))), stdin=stdin)
        assert (refused.returncode, refused.stdout) == (status, ""), command
        assert "Traceback" not in refused.stderr, command
        assert contents(folder) == before, command
        shown = (
            refused.stderr.removeprefix(BUILT_IN)
            .rpartition("\nError: ")[2]
            .replace(str(folder), "FOLDER")
            .rstrip("\n")
        )
        shown = re.sub(
            "^No such option.*", "No such option", shown
        )  # each version of click says more in its own way
        said.append(f"$ {command}\n{shown}")
    return "\n".join(said)


def words(text: str) -> str:
    """A text without its line breaks."""
    return " ".join(text.split())


def call(run: Run, command: str, **options: Any) -> subprocess.CompletedProcess[str]:
    """Run one command line, given as one text."""
    return run(*shlex.split(command), **options)


def result(run: Run, command: str, *, status: Status = 0, stdin: str | None = None) -> Any:
    """The JSON that a command prints, and nothing else,
    with ``--json -`` where it is not export.
    """
    line = command if command.startswith("export") else f"{command} --json -"
    return json.loads(call(run, line, stdin=stdin, status=status).stdout)


def printed(shown: RenderableType, width: int = 80) -> list[str]:
    """The lines of what is printed on a screen without colours, without blanks at their ends."""
    console = Console(width=width, file=io.StringIO(), markup=False, emoji=False, highlight=False)
    with console.capture() as captured:
        console.print(shown)
    return [line.rstrip() for line in captured.get().splitlines()]


def rows(text: str) -> list[dict[str, str]]:
    """Rows of a CSV text."""
    return list(csv.DictReader(text.splitlines()))


def python(
    folder: Path, code: str, *arguments: str, status: int = 0
) -> subprocess.CompletedProcess[str]:
    """Run code in a Python of its own."""
    ended = subprocess.run(
        [sys.executable, "-c", code, *arguments],
        cwd=folder,
        env={**os.environ, **environment(80)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == status, ended.stderr
    return ended
