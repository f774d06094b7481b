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
from support.random_bodies import equipped

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


def spacecraft(seed: int) -> dict[str, Any]:
    """A valid spacecraft file as a dictionary: one of `equipped`, with something extreme in it."""
    file, rng = equipped(seed), np.random.default_rng(seed)
    period = 2.0 * math.pi / abs(float(file["state"]["spin"].split()[0]) * math.pi / 30.0)
    if "A" in file["inertia"] and "loop" not in file:  # on a disc its sensor may see nothing
        odd = [1.0, 1.0 + 1e-12, 1.0 - 1e-9, 1.0 + 1e-4, 2.0, 0.01, 1.5]
        file["inertia"]["C"] = file["inertia"]["A"] * float(rng.choice(odd))
    degrees = rng.choice([0.0, 1e-7, 0.5, 30.0, 70.0, 89.9], p=[0.15, 0.1, 0.4, 0.2, 0.1, 0.05])
    file["state"]["nutation"] = f"{degrees} deg"
    if rng.random() < 0.3:
        horizon = period * float(rng.choice([1e-6, 0.01, 1.0, 5.0, 100.0, 1e6]))
        file["limits"] = {"horizon": horizon, "max_pulses": int(rng.integers(1, 6))}
    if rng.random() < 0.1 and not {"channels", "loop", "tank", "cold", "goal"} & set(file):
        for key in ("thrusters", "valve", "dispersions", "commands"):
            file.pop(key, None)
    elif rng.random() < 0.1:
        tilt = float(rng.choice([0.0, degrees, 60.0, 179.9, 179.999999]))
        file["goal"] = {"tilt": f"{tilt} deg", "azimuth": 0.0}
    return file


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
    body = spacecraft(seed)
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
