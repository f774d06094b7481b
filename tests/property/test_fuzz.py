"""Valid spacecraft through every command and scheme: no traceback, no NaN, a proper exit."""

import json
import math
import re
import subprocess
import traceback
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pytest
from support.cases import spread
from support.process import Planner, within
from support.random_bodies import equipped, power

from nutdamp.schemes import planner as schemes

SEEDS, BLOCKS = 600, 24
"""Spacecraft, and in how many blocks they run."""

STATUSES = (0, 2, 3, 4)
SCHEMES = ("one-pulse", "two-pulse", "four-pulse", "half-cone", "rhumb-line")
EPOCH = '{"epoch":"2026-03-01T12:00:00Z","frame":"EME2000","quaternion":[1,0,0,0]}'
INTERNAL = re.compile(r"internal error|Traceback|[a-z]Warning:|pydantic|scipy|numpy|HiGHS|linprog")
SCRIPTED = re.compile(r"<(script|style)\b.*?</\1>", re.DOTALL)
"""What a page does not show."""

MINUS_ZERO = re.compile(r"(?<![\w.e])-0(\.0*)?(?![\w.])")
NOT_A_NUMBER = re.compile(r"(?<![\w.])[-+]?(nan|inf|infinity)(?!\w)", re.IGNORECASE)


def spacecraft(rng: np.random.Generator) -> dict[str, Any]:
    """A valid spacecraft file as a dictionary, often with something unusual in it."""

    def chance(share: float) -> bool:
        return bool(rng.random() < share)

    A = power(rng, -1.0, 4.0)
    odd = [1.0, 1.0 + 1e-12, 1.0 - 1e-9, 1.0 + 1e-4, 2.0, 0.01]
    ratio = float(rng.choice([rng.uniform(0.2, 1.9), *odd], p=[0.6, *[0.4 / 6] * 6]))
    spin = float(rng.choice([-1.0, 1.0])) * power(rng, -2.0, 1.0)
    degrees = float(
        rng.choice(
            [0.0, 1e-7, 0.5, 5.0, 30.0, 70.0, 89.9], p=[0.06, 0.04, 0.2, 0.43, 0.2, 0.06, 0.01]
        )
    )
    body: dict[str, Any] = {"name": "fuzz", "inertia": {"A": A, "C": ratio * A}}
    if chance(0.15):
        split = float(rng.choice([1e-10, 0.01, 0.2]))
        moments = [A * (1.0 + split), A * (1.0 - split), min(ratio, 1.5) * A]
        if not moments[1] <= moments[2] <= moments[0] and 2 * max(moments) <= sum(
            moments
        ):  # stable, and a body
            body["inertia"] = {"tensor": np.diag(moments).tolist()}
    body["state"] = {
        "spin": spin,
        "nutation": f"{degrees} deg",
        "phase": float(rng.uniform(-3.0, 3.0)),
    }
    if chance(0.2):
        body["attitude"] = {"quaternion": rng.normal(size=4).tolist(), "frame": "EME2000"}
        if chance(0.7):
            body["attitude"]["epoch"] = "2026-03-01T12:00:00Z"
    tangent = math.tan(math.radians(max(min(degrees, 80.0), 0.1)))
    strength = ratio * A * spin * spin * tangent * power(rng, -2.0, 2.0)
    period = 2.0 * math.pi / abs(spin)
    body["thrusters"] = []
    for number in range(int(rng.choice([0, 1, 2, 4, 8], p=[0.1, 0.15, 0.2, 0.45, 0.1]))):
        torque = rng.normal(size=3) * np.array(
            [1.0, 1.0, rng.choice([0.0, 0.3, 10.0], p=[0.7, 0.2, 0.1])]
        )
        if chance(0.7):
            torque = np.array(
                [math.cos(0.5 * math.pi * number), math.sin(0.5 * math.pi * number), 0.0]
            )
        one: dict[str, Any] = {"name": f"T{number}", "torque": (strength * torque).tolist()}
        if chance(0.6):
            one |= {"isp": 220, "lever_arm": 0.8}
        if chance(0.3):
            one |= {
                "min_on_time": 0.01 / abs(spin),
                "max_on_time": float(rng.choice([0.1, 1.0])) / abs(spin),
            }
        body["thrusters"].append(one)
    if chance(0.15):
        body["steerable"] = {} if chance(0.3) else {"torque": strength}
    horizon = period * float(rng.choice([1e-6, 0.01, 1.0, 5.0, 20.0, 100.0, 1e6]))
    body["limits"] = {"horizon": horizon} if chance(0.5) else {}
    for key, share, value in (
        ("tick", 0.15, 1e-3 * period),
        ("gap", 0.15, 0.1 * period),
        ("earliest", 0.1, 0.004 * min(period, body["limits"].get("horizon", period))),
        ("max_pulses", 0.15, int(rng.integers(1, 6))),
        ("blackout", 0.1, [[0.3 * period, 0.6 * period], [0.5 * period, 2.0 * period]]),
    ):
        if chance(share):
            body["limits"][key] = value
    small = 1e-3 * strength
    leak = [{"name": "leak", "torque": [small, 0.0, float(rng.choice([0.0, 0.1 * small]))]}]
    for key, share, part in (
        ("dissipation", 0.15, {"time_constant": period * power(rng, -0.5, 4.0)}),
        ("disturbances", 0.15, leak),
        ("requirement", 0.4, {"nutation": "0.5 deg", "momentum_shift": "1 deg"}),
        ("mass", 0.3, 100.0),
    ):
        if chance(share):
            body[key] = part
    if chance(0.25) and "attitude" not in body:
        body["goal"] = {
            "tilt": f"{rng.choice([0.0, degrees, 3.0, 60.0, 179.9, 179.999999])} deg",
            "azimuth": 0.0,
        }
    elif chance(0.1):
        body["goal"] = {"spin": spin * float(rng.choice([1.0, 1.01, 0.8]))}
    if chance(0.7):
        wide, thrust = (
            {"A": {"normal": "1 %"}, "timing": {"uniform": "5 ms"}},
            {"thrust": {"normal": "2 %"}},
        )
        body["dispersions"] = {
            **wide,
            "omega0": {"normal": 1e-3 * abs(spin)},
            **(thrust if body["thrusters"] else {}),
        }
    return {key: part for key, part in body.items() if key not in ("thrusters", "limits") or part}


OTHERS = (
    "simulate CHOSEN --samples 20 --json -",
    "simulate CHOSEN --samples 20 --flown --csv -",
    "simulate CHOSEN --samples 20 --flown --until 100s --json -",
    "check f.yaml --json -; check f.yaml",
    "disperse CHOSEN --samples 100 --json -",
    "export CHOSEN PLACED --format FORMAT",
    (
        "export CHOSEN PLACED --format apm -o f.apm; import apm f.apm --schedule f.csv; "
        "simulate f.yaml --schedule f.csv"
    ),
    "plan f.yaml --scheme one-pulse --scheme two-pulse --scheme four-pulse",
    "simulate f.yaml --scheme none --samples 20 --json -",
    "disperse CHOSEN --case 3",
    "plan CHOSEN --csv -; plan CHOSEN --set limits.max_pulses=3",
    "plan CHOSEN; simulate CHOSEN --samples 20",
    "plan CHOSEN --robust --json -",
)
"""In rotation; coprime with the schemes in number, so that each command meets each."""

RARE = (
    (11, 0, "verify CHOSEN --json -"),
    (23, 0, "report CHOSEN -o f.html"),
    (199, 3, "animate CHOSEN -o f.gif --seconds 0.2 --fps 5 --width 320"),
    (249, 7, "trade f.yaml --points 1 --allow any --json -"),
    (97, 0, "explain TOPIC"),
)


def commands(seed: int, body: dict[str, Any]) -> Iterator[list[str]]:
    """What is done with the spacecraft of a seed: a plan of a scheme, and two or more other
    commands.

    Optimal, which takes longest, is planned less often.
    """
    scheme = "optimal" if seed % 25 == 0 else SCHEMES[seed % len(SCHEMES)]
    axis = "tilt" in body.get("goal", {})
    chosen = f"f.yaml --scheme {scheme}"
    if scheme in ("half-cone", "rhumb-line") and not axis and seed % 7:
        chosen += f" --target {(0, 40, 140)[seed % 3]}deg,{(10, 2, 80)[seed // 3 % 3]}deg"
    unusual = "", "--with-disturbances", "--coarse", "--literal", "--free-axis", "--per-turn 2", ""
    words = {
        "CHOSEN": chosen,
        "PLACED": "" if axis or "epoch" in body.get("attitude", {}) else f"--set attitude={EPOCH}",
        "FORMAT": ("stk", "aem", "basilisk", "json")[seed // 13 % 4],
        "TOPIC": ("", scheme, "17", "file", "units", "nutation")[seed // 97 % 6],
        "--robust": "" if scheme == "optimal" else "--robust",
    }
    rows = [
        f"plan CHOSEN {unusual[seed // 5 % 7]} --json -",
        OTHERS[seed % 13],
        OTHERS[(seed // 3 + 4) % 13],
    ]
    for row in [*rows, *(rare for every, rest, rare in RARE if seed % every == rest)]:
        for command in row.split("; "):
            yield [part for word in command.split() for part in words.get(word, word).split()]


def not_json(name: str) -> NoReturn:
    raise ValueError(f"{name} in it")


def faults(seed: int, folder: Path, planner: Planner) -> list[str]:
    """What is wrong with the commands of one seed; empty where all is well."""
    planner.kept.clear()
    for old in folder.iterdir():
        old.unlink()
    body = spacecraft(np.random.default_rng(seed))
    (folder / "f.yaml").write_text(json.dumps(body, indent=1), encoding="utf-8")
    wrong = []
    for arguments in commands(seed, body):
        if arguments[0] == "import" and not (folder / "f.apm").exists():
            break
        try:
            done = within(folder, *arguments)
        except Exception:  # a bug: the other seeds are tried all the same
            problem = "an error that is no message"
            said = traceback.format_exc()
        else:
            problem = problem_of(arguments, done, folder)
            said = done.stderr
        if problem:
            wrong.append(f"seed {seed}: nutdamp {' '.join(arguments)}: {problem}\n{said[-1500:]}")
    return wrong


def problem_of(arguments: list[str], done: subprocess.CompletedProcess[str], folder: Path) -> str:
    """What is wrong with what one command printed; empty where nothing is."""
    files = [one for one in folder.iterdir() if one.suffix in (".csv", ".apm")]
    pages = [SCRIPTED.sub("", one.read_text(encoding="utf-8")) for one in folder.glob("*.html")]
    texts = [done.stdout, done.stderr, *(one.read_text(encoding="utf-8") for one in files), *pages]
    shown = done.stderr + (
        "" if "basilisk" in arguments else done.stdout
    )  # that format is a script
    internal = INTERNAL.search(shown)
    if done.returncode not in STATUSES or internal:
        return (
            f"status {done.returncode}, {internal.group() if internal else 'no text from within'}"
        )
    if done.returncode == 2 and "f.yaml:" in done.stderr and ": warning" not in done.stderr:
        return "the file is not valid"
    if any(NOT_A_NUMBER.search(text) for text in texts):
        return "not a number in the output"
    written = done.returncode == 0 or (arguments[0] == "plan" and done.returncode != 2)
    if arguments[-2:] == ["--json", "-"] and (written or done.stdout):
        try:
            json.loads(done.stdout, parse_constant=not_json)
        except ValueError as reason:
            return f"not JSON: {reason}"
    return ""


@pytest.fixture
def planner(monkeypatch: pytest.MonkeyPatch) -> Planner:
    """The commands of a seed share its schedules: to find them takes most of the time.

    And independent integrations give up sooner than a user's do: those of a thousand turns take
    most of what is left.
    """
    one = Planner()
    monkeypatch.setattr(schemes, "schedule", one.schedule)
    monkeypatch.setattr("nutdamp.flight.verification.EVALUATIONS", 20_000)
    monkeypatch.setattr("nutdamp.flight.basilisk.MOST_STEPS", 20_000)
    return one


EVERY = (
    "plan f.yaml --json -",
    "simulate f.yaml --samples 50 --flown --csv -",
    "disperse f.yaml --samples 300 --json -",
    "loop f.yaml --json -",
    "report f.yaml -o f.html --disperse 300",
)
"""What each file of `equipped` goes through."""


FAULTY = (44, 66, 212)
"""Seeds of files that went wrong once."""


@pytest.mark.deep
@pytest.mark.parametrize("seed", FAULTY)
def test_files_that_went_wrong_once(seed: int, tmp_path: Path, planner: Planner) -> None:
    test_files_over_the_whole_schema_get_results_or_reasons(seed, tmp_path, planner)


@spread("seed", range(400), quick=0, deep=40)
def test_files_over_the_whole_schema_get_results_or_reasons(
    seed: int, tmp_path: Path, planner: Planner
) -> None:
    (tmp_path / "f.yaml").write_text(json.dumps(equipped(seed), indent=1), encoding="utf-8")
    for row in EVERY if seed % 5 == 0 else EVERY[:-1]:
        done = within(tmp_path, *row.split())
        assert problem_of(row.split(), done, tmp_path) == "", done.stderr[-500:]
        assert not MINUS_ZERO.search(done.stdout + done.stderr), row


@pytest.mark.weekly
@pytest.mark.parametrize("block", range(BLOCKS))
def test_ordinary_and_degenerate_spacecraft_get_results_or_reasons(
    block: int, tmp_path: Path, planner: Planner
) -> None:
    assert [
        one for seed in range(block, SEEDS, BLOCKS) for one in faults(seed, tmp_path, planner)
    ] == []
    assert planner.calls > 0
