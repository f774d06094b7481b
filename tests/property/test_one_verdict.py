"""All commands, the page, its sheet and the library give one verdict on a plan."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from support.cases import spread
from support.commands import call, result
from support.process import Run

import nutdamp
from nutdamp.files.reader import example_names, example_text
from nutdamp.planning.decision import ROBUST
from nutdamp.planning.verdict import Status
from nutdamp.views.verdict import verdict_json

pytestmark = pytest.mark.usefixtures("plans_shared")

EXIT = {status.value: status.exit_status for status in Status}
BASES = (
    "example",
    "single-thruster",
    "upper-stage",
    "cluster",
    "couples-minisat",
    "genesis",
    "despun-comsat",
)


def random_file(seed: int) -> str:
    """An example with another nutation, requirement and tolerances: some plans comply."""
    rng = np.random.default_rng(seed)
    file = yaml.safe_load(example_text(str(rng.choice(BASES))))
    if "epoch" in file.get("attitude", {}):
        file["attitude"]["epoch"] = file["attitude"]["epoch"].isoformat()
    size = float(10.0 ** rng.uniform(-1.2, 0.3))
    requirement: dict[str, Any] = {"nutation": f"{rng.uniform(0.05, 0.8)} deg"}
    if rng.random() < 0.5:
        requirement["momentum_shift"] = f"{rng.uniform(0.1, 3.0)} deg"
    if rng.random() < 0.3:
        requirement["nutation_during"] = f"{rng.uniform(4.0, 12.0)} deg"
    if rng.random() < 0.7:
        requirement["probability"] = float(rng.choice([0.9, 0.99, 0.997]))
    file["requirement"] = requirement
    file["dispersions"] = {
        "omega0": {"normal": f"{0.1 * size} deg/s"},
        "thrust": {"normal": f"{2.0 * size} %"},
        "timing": {"uniform": "5 ms"},
    }
    if rng.random() < 0.1:
        del file["dispersions"]
    return yaml.safe_dump(file, sort_keys=False)


def files() -> Iterator[Any]:
    """A hundred random files, and all that ship with the package."""
    for seed in range(100):
        yield pytest.param(random_file(seed), id=f"random-{seed}")
    for name in example_names()[1:]:
        yield pytest.param(example_text(name), id=name)


def judged(decision: dict[str, Any]) -> dict[str, Any]:
    """What every decision tells: status, cases, and each bound with its rounded values."""
    told = {key: decision[key] for key in ("status", "scheme", "met", "verdict", "causes", "cases")}
    told["requirement"] = [
        {key: round(value, 9) if isinstance(value, float) else value for key, value in line.items()}
        for line in decision["requirement"]
    ]
    return told


def page_of(text: str) -> dict[str, Any]:
    """Status, sentence, and shares of the bounds, on the page; whether it has a sheet to sign."""
    headline = re.search(r'<p class="headline"><b>(.*?)</b>', text)
    sentence = re.search(r'<p class="verdict">(.*?)</p>', text)
    bars = re.search(r'<table class="margins">.*?</table>', text, re.DOTALL)
    assert headline is not None
    return {
        "status": headline[1],
        "sentence": sentence and sentence[1],
        "met": re.findall(r"<td[^>]*>((?:NOT )?met)</td></tr>", bars[0] if bars else ""),
        "signed": "Signatures" in text,
        "refused": "NOT FOR FLIGHT" in text,
    }


HEADLINES = {
    "fly": "FLY",
    "not-shown": "NOT SHOWN",
    "not-enough": "NOT ENOUGH",
    "no-pulse": "NO PULSE",
    "no-plan": "NO PLAN",
    "not-commandable": "CANNOT BE COMMANDED",
}


@pytest.mark.usefixtures("plain_pages")
@pytest.mark.filterwarnings("ignore:.*loop.start:UserWarning")
@spread("text", files(), quick=1, deep=4)
def test_everything_that_judges_a_plan_says_the_same(run: Run, tmp_path: Path, text: str) -> None:
    (tmp_path / "body.yaml").write_text(text)
    made = call(run, "plan body.yaml --json - --csv pulses.csv")
    decision = json.loads(made.stdout)["decision"]
    status, scheme = decision["status"], decision["scheme"]
    assert made.returncode == EXIT[status]

    assert call(run, "report body.yaml -o page.html").returncode == EXIT[status]
    page = page_of((tmp_path / "page.html").read_text())
    assert page["status"].removesuffix(", nothing required") == HEADLINES[status]
    if status == "no-plan":
        return
    fires = decision["end_s"] > 0.0
    assert page["refused"] == (fires and status in ("not-shown", "not-enough", "not-commandable"))
    assert page["sentence"] == decision["verdict"]
    required = [line for line in decision["requirement"] if line["required"]]
    assert page["met"] == ["met" if line["met"] else "NOT met" for line in required]
    if page["signed"]:
        assert status == "fly"

    pulses = "--schedule pulses.csv" if scheme == ROBUST else f"--scheme {scheme}"
    for command in ("simulate", "disperse") if decision["cases"] else ("simulate",):
        told = result(run, f"{command} body.yaml {pulses}", status=EXIT[status])["decision"]
        told["scheme"] = scheme if told["scheme"] == "pulses.csv" else told["scheme"]
        assert judged(told) == judged(decision), command
    export = result(run, f"export body.yaml {pulses} --format json", status=EXIT[status])
    told = export["decision"]
    told["scheme"] = scheme if told["scheme"] == "pulses.csv" else told["scheme"]
    assert judged(told) == judged(decision)

    named = None if scheme == ROBUST else scheme
    known = nutdamp.plan(nutdamp.load(tmp_path / "body.yaml"), named).verdict
    assert judged(json.loads(json.dumps(verdict_json(known)))) == judged(decision)
    assert known.status.exit_status == made.returncode


@spread("seed", range(12), quick=0, deep=2)
def test_a_point_of_a_trade_is_judged_as_its_schedule_is(
    run: Run, tmp_path: Path, seed: int
) -> None:
    (tmp_path / "body.yaml").write_text(random_file(seed))
    made = call(run, "trade body.yaml --points 2 --allow 0deg --schedules points --json -")
    points = [point for front in json.loads(made.stdout)["fronts"] for point in front["points"]]
    passing = any(EXIT[point["status"]] == 0 for point in points)
    assert made.returncode == (0 if passing else 4 if points else 3)
    for number, point in enumerate(points, start=1):
        (name,) = (tmp_path / "points").glob(f"*{number}*.csv")
        told = json.loads(call(run, f"simulate body.yaml --schedule {name} --json -").stdout)[
            "decision"
        ]
        assert point["status"] == told["status"]
        assert point["share"] == (told["cases"] and told["cases"]["met_fraction"])
