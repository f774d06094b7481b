"""Valid spacecraft, ordinary and degenerate, through every command and scheme: no traceback, no NaN, a proper exit.

Files are drawn from fixed seeds and run through the command line within this process.
"""

from __future__ import annotations

import contextlib
import io
import json
import math
import re
import traceback
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np
import pytest

from nutdamp.cli import main

SEEDS, BLOCKS = 400, 20
STATUSES = (0, 2, 3, 4)
SCHEMES = ("one-pulse", "two-pulse", "four-pulse", "half-cone", "rhumb-line")
NOT_A_NUMBER = re.compile(r"(?<![\w.])[-+]?(nan|inf|infinity)(?!\w)", re.IGNORECASE)


class Outcome(NamedTuple):
    """What one command did; ``status`` is None where it ended in a traceback."""

    status: int | None
    out: str
    err: str


def command(arguments: list[str]) -> Outcome:
    """Run the command line with ``arguments``."""
    out, err = (io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True) for _ in range(2))
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        patch.setattr("sys.argv", ["nutdamp", *arguments])
        patch.setenv("COLUMNS", "80")
        status: int | None = None
        try:
            main()
        except SystemExit as leave:
            status = leave.code if isinstance(leave.code, int) else 0
        except Exception:
            traceback.print_exc(file=err)
    texts = [stream.buffer.getvalue().decode() for stream in (out, err)]
    return Outcome(status, *texts)


def spacecraft(rng: np.random.Generator) -> dict[str, Any]:
    """A valid spacecraft file as a dictionary, often with something unusual in it."""

    def chance(share: float) -> bool:
        return bool(rng.random() < share)

    A = float(10.0 ** rng.uniform(-1.0, 4.0))
    ratio = float(
        rng.choice(
            [rng.uniform(0.2, 1.9), 1.0, 1.0 + 1e-12, 1.0 - 1e-9, 1.0 + 1e-4, 2.0, 0.01], p=[0.6, *[0.4 / 6] * 6]
        )
    )
    spin = float(rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-2.0, 1.0))
    degrees = float(rng.choice([0.0, 1e-7, 0.5, 5.0, 30.0, 70.0, 89.9], p=[0.06, 0.04, 0.2, 0.4, 0.2, 0.05, 0.05]))
    body: dict[str, Any] = {"name": "fuzz", "inertia": {"A": A, "C": ratio * A}}
    if chance(0.15):
        split = float(rng.choice([1e-10, 0.01, 0.2]))
        moments = [A * (1.0 + split), A * (1.0 - split), min(ratio, 1.5) * A]
        stable = not moments[1] <= moments[2] <= moments[0]
        if stable and moments[2] <= moments[0] + moments[1] and moments[0] <= moments[1] + moments[2]:
            body["inertia"] = {"tensor": np.diag(moments).tolist()}
    body["state"] = {"spin": spin, "nutation": f"{degrees} deg", "phase": float(rng.uniform(-3.0, 3.0))}
    if chance(0.2):
        body["attitude"] = {"quaternion": rng.normal(size=4).tolist(), "frame": "EME2000"}
        if chance(0.7):
            body["attitude"]["epoch"] = "2026-03-01T12:00:00Z"
    strength = (
        ratio * A * spin * spin * math.tan(math.radians(max(min(degrees, 80.0), 0.1))) * 10.0 ** rng.uniform(-2, 2)
    )
    thrusters: list[dict[str, Any]] = []
    for number in range(int(rng.choice([0, 1, 2, 4, 8], p=[0.1, 0.15, 0.2, 0.45, 0.1]))):
        torque = rng.normal(size=3) * np.array([1.0, 1.0, rng.choice([0.0, 0.3, 10.0], p=[0.7, 0.2, 0.1])])
        if chance(0.7):
            angle = 0.5 * math.pi * number
            torque = np.array([math.cos(angle), math.sin(angle), 0.0])
        one: dict[str, Any] = {"name": f"T{number}", "torque": (strength * torque).tolist()}
        if chance(0.6):
            one |= {"isp": 220, "lever_arm": 0.8}
        if chance(0.3):
            one |= {"min_on_time": 0.01 / abs(spin), "max_on_time": float(rng.choice([0.1, 1.0])) / abs(spin)}
        thrusters.append(one)
    if thrusters:
        body["thrusters"] = thrusters
    if chance(0.15):
        body["steerable"] = {} if chance(0.3) else {"torque": strength}
    period = 2.0 * math.pi / abs(spin)
    limits: dict[str, Any] = (
        {"horizon": period * float(rng.choice([0.01, 1.0, 5.0, 20.0, 100.0]))} if chance(0.5) else {}
    )
    for key, share, value in (
        ("tick", 0.15, 1e-3 * period),
        ("gap", 0.15, 0.1 * period),
        ("earliest", 0.1, 0.004 * period),
        ("max_pulses", 0.15, int(rng.integers(1, 6))),
        ("blackout", 0.1, [[0.3 * period, 0.6 * period], [0.5 * period, 2.0 * period]]),
    ):
        if chance(share):
            limits[key] = value
    if limits:
        body["limits"] = limits
    if chance(0.15):
        body["dissipation"] = {"time_constant": period * float(10.0 ** rng.uniform(-0.5, 4.0))}
    if chance(0.15):
        small = 1e-3 * strength
        body["disturbances"] = [{"name": "leak", "torque": [small, 0.0, float(rng.choice([0.0, 0.1 * small]))]}]
    if chance(0.4):
        body["requirement"] = {"nutation": "0.5 deg", "momentum_shift": "1 deg"}
    if chance(0.3):
        body["mass"] = 100.0
    if chance(0.25) and "attitude" not in body:
        body["goal"] = {"tilt": f"{rng.choice([0.0, degrees, 3.0, 60.0, 179.9])} deg", "azimuth": 0.0}
    elif chance(0.1):
        body["goal"] = {"spin": spin * float(rng.choice([1.0, 1.01, 0.8]))}
    if chance(0.4):
        body["dispersions"] = {
            "A": {"normal": "1 %"},
            "omega0": {"normal": 1e-3 * abs(spin)},
            "timing": {"uniform": "5 ms"},
        }
        if thrusters:
            body["dispersions"]["thrust"] = {"normal": "2 %"}
    return body


def commands(seed: int, rng: np.random.Generator, pointing: bool) -> Iterator[list[str]]:
    """What is done with the spacecraft of a seed: a plan of a scheme, and two other commands, all in rotation."""
    scheme = SCHEMES[seed % len(SCHEMES)]
    if scheme in ("half-cone", "rhumb-line") and not pointing and rng.random() < 0.9:
        scheme = SCHEMES[seed % 3]
    if seed % 16 == 0:
        scheme = "optimal"
    unusual = ([], ["--with-disturbances"], ["--coarse"], ["--literal"])[int(rng.integers(4))]
    yield ["plan", "f.yaml", "--scheme", scheme, *unusual, "--json", "-"]
    chosen = ["--scheme", scheme]
    others = (
        ["simulate", "f.yaml", *chosen, "--samples", "20", "--json", "-"],
        ["simulate", "f.yaml", *chosen, "--samples", "20", "--flown", "--csv", "-"],
        ["check", "f.yaml", "--json", "-"],
        ["disperse", "f.yaml", *chosen, "--samples", "100", "--json", "-"],
        ["export", "f.yaml", *chosen, "--format", ("apm", "stk", "basilisk", "json")[seed % 4]],
        ["plan", "f.yaml", "--scheme", "one-pulse", "--scheme", "two-pulse", "--scheme", "four-pulse"],
        ["simulate", "f.yaml", "--scheme", "none", "--samples", "20", "--json", "-"],
        ["disperse", "f.yaml", *chosen, "--samples", "100", "--impulses", "--force"],
        ["verify", "f.yaml", *chosen, "--json", "-"] if seed % 3 == 0 else ["check", "f.yaml"],
    )
    yield others[seed % len(others)]
    yield others[(seed // 3 + 4) % len(others)]


def not_json(name: str) -> NoReturn:
    raise AssertionError(f"{name} in JSON")


def faults(seed: int, folder: Path) -> list[str]:
    """What is wrong with the commands of one seed; empty where all is well."""
    rng = np.random.default_rng(seed)
    body = spacecraft(rng)
    (folder / "f.yaml").write_text(json.dumps(body, indent=1), encoding="utf-8")
    wrong = []
    for arguments in commands(seed, rng, "axis" in str(body.get("goal", "")) or "tilt" in body.get("goal", {})):
        outcome = command(arguments)
        problem = ""
        if outcome.status not in STATUSES or "internal error" in outcome.err + outcome.out:
            problem = f"status {outcome.status}"
        elif outcome.status == 2 and "f.yaml:" in outcome.err and ": warning" not in outcome.err:
            problem = "the file is not valid"
        elif NOT_A_NUMBER.search(outcome.out):
            problem = "not a number in the output"
        elif "json" in " ".join(arguments) and outcome.status != 2 and outcome.out.startswith("{"):
            json.loads(outcome.out, parse_constant=not_json)
        if problem:
            wrong.append(f"seed {seed}: nutdamp {' '.join(arguments)}: {problem}\n{outcome.err[-1500:]}")
    return wrong


def test_ordinary_and_degenerate_spacecraft_get_results_or_reasons(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert [one for seed in range(1, 41) for one in faults(seed, tmp_path)] == []


@pytest.mark.slow
@pytest.mark.parametrize("block", range(BLOCKS))
def test_thousands_of_spacecraft_get_results_or_reasons(
    block: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert [one for seed in range(block, SEEDS, BLOCKS) for one in faults(seed, tmp_path)] == []
