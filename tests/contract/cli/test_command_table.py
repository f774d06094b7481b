"""The table ``commands.txt``: command lines, their exit status, and what of their answers is kept
in ``golden/texts.txt``.
"""

import json
import math
import re
import shlex
from collections.abc import Iterable
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest
from support import places
from support.cases import deep, weekly
from support.commands import CRAFTS, DATED, SCHEDULE, contents, written
from support.golden import check_text
from support.loops import follow_few_cycles
from support.process import Run, unpictured
from support.shown import parsed

from nutdamp.schemes.catalogue import NAMES

pytestmark = pytest.mark.usefixtures("plans_shared")


def table(header: str, rows: Iterable[tuple[object, ...]]) -> str:
    """A CSV file."""
    return "\n".join([header, *(",".join(map(str, row)) for row in rows), ""])


def spinning(value: float) -> str:
    """A record of a spin of ``value``, in deg/s where that is 180° a second in another unit."""
    unit = "deg_s" if value in (math.pi, -30.0) else "rad_s"
    sway = [(at, 0.1 * math.cos(at), value * (1.0 + 1e-3 * math.sin(at))) for at in range(40)]
    return table(f"t_s,omega_1_{unit},omega_3_{unit}", sway)


MARKUP = """
name: "[red]Evil[/] [/] :rocket:"
inertia: {A: 120, C: 80}
state: {spin: 30 rpm, nutation: 5 deg}
thrusters:
  - {name: "[red]", torque: [8, 0, 0]}
  - {name: "[/]", torque: [0, 8, 0]}
  - {name: ":rocket:", torque: [-8, 0, 0]}
dispersions: {A: {normal: 1 %}, thrust: {normal: 2 %}}
"""
"""Names that look like markup or emoji are shown as they are."""
TABLE = (Path(__file__).parent / "commands.txt").read_text(encoding="utf-8").split("\n=== ")[1:]
SAID = (
    r"ENOUGH|PLAN|warning|equirement|≤|infeasible|cannot|does not|needs|least impulse|there is no"
)
TWICE = re.compile(rf"\b({'|'.join(NAMES)}):? ?\1: ")  # a scheme that is named twice
MARKS = {"deep": deep, "weekly": weekly}
RATES = "t_s,omega_1_rad_s,omega_3_rad_s"
UNITS = {"180": 180.0, "30": 30.0, "314": math.pi, "-30": -30.0, "017": math.pi**2 / 180.0}
FILES = {
    "late_yaml": DATED.replace("2026-03-01T12:00:00Z", "9999-12-31T23:59:59.5Z"),
    "old_yaml": DATED.replace("2026", "1960"),
    "bad_csv": "t_s,omega_1\n0,1\n",
    "short_csv": table(RATES, [(0.05 * at, 0.1 + 0.001 * at, 0.1) for at in range(20)]),
    "many_csv": table(RATES, [(at, "x", "y" if at < 6 else 0.1) for at in range(601)]),
    **{f"unit{name}_csv": spinning(value) for name, value in UNITS.items()},
    "own_csv": SCHEDULE.replace(",channel", "").replace("1,0,steerable,4", "1,0,-5")
    + "2,0.5,0,4,0\n",
    "old_csv": "old",
    "markup_yaml": MARKUP,
}


def group(text: str) -> Any:
    """A group of rows by its name, which may have a mark."""
    name, _, mark = text.partition("\n")[0].partition(" ")
    rows = text.partition("\n")[2].replace("\n    ", " ").splitlines()
    values = (name, [row.strip() for row in rows if row.strip()])
    return MARKS[mark](*values) if mark else values


def at(data: Any, path: str) -> Any:
    """The values of JSON ``data`` at keys and numbers of entries, ``*`` being all."""
    for place, key in enumerate(path.split(".")):
        if key == "*":
            rest = ".".join(path.split(".")[place + 1 :])
            return [at(entry, rest) if rest else entry for entry in data]
        data = data[int(key)] if isinstance(data, list) else data.get(key.replace("~", " "), "-")
    return data


def plain(value: Any) -> Any:
    """Floats with six digits, zero for what is rounding."""
    if isinstance(value, float):
        return 0.0 if abs(value) < 1e-10 else float(f"{value:.6g}")
    if isinstance(value, dict):
        return {key: plain(entry) for key, entry in value.items()}
    return [plain(entry) for entry in value] if isinstance(value, list) else value


def said_on(page: str) -> str:
    """The text of a page of ``report``, behind the kind of its verdict."""
    tree = parsed(page)
    (decision,) = (node for node in tree.all("section") if node.attributes["id"] == "decision")
    return f"{decision.attributes['class']}: {tree.text}".replace("\N{NO-BREAK SPACE}", " ")


@pytest.mark.parametrize(("name", "rows"), [group(text) for text in TABLE])
def test_commands(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, rows: list[str]
) -> None:
    """Lines of the screen that a pattern picks, what one picks of the page, or values of the JSON;
    files written or changed; all of standard error.
    """
    follow_few_cycles(monkeypatch)
    written(tmp_path, **CRAFTS, **FILES)
    shown = []
    for row in rows:
        command, status, *kept = (cell.strip() for cell in row.replace("SAID", SAID).split(" | "))
        paths = kept[0].split() if kept and kept[0].startswith("/") else []
        before = contents(tmp_path)
        line = command.replace("CONFIGS", str(places.CONFIGS)).replace("CASES", str(places.CASES))
        columns = 200 if kept else 80  # where lines are picked, sentences are in one
        page = kept[0].removeprefix("page ") if kept and kept[0].startswith("page ") else None
        with nullcontext() if page is None else unpictured():
            ended = run(*shlex.split(line), *(["--json", "-"] if paths else []), columns=columns)
        assert "Traceback" not in ended.stderr
        assert (ended.returncode, row) == (int(status), row), ended.stderr
        assert not re.search(" $", ended.stdout, re.MULTILINE), row  # no blanks fill up lines
        assert not TWICE.search(f"{ended.stdout}\n{ended.stderr}"), row
        assert paths or not re.search(r"…(?! +\d+ more)", ended.stdout), row  # no value is cut
        if page is not None:
            told = said_on((tmp_path / "report.html").read_text(encoding="utf-8"))
            assert not TWICE.search(told), row
            texts = [*dict.fromkeys(re.findall(page, told))]
        elif paths:
            data = json.loads(ended.stdout)
            texts = [f"{path} {json.dumps(plain(at(data, path[1:])))}" for path in paths]
        else:
            pattern = ("(?!)" if kept[0] == "-" else kept[0]) if kept else ""
            texts = [part for part in ended.stdout.splitlines() if re.search(pattern, part)]
        after = contents(tmp_path)
        texts += [f"+ {file}" for file in after if after[file] != before.get(file)]
        shown.append("\n".join([f"$ {command}", *texts, ended.stderr.rpartition("\nError: ")[2]]))
    text = "\n".join(shown).replace(str(places.CONFIGS), "CONFIGS")
    check_text(f"cli.{name}", text.replace(str(places.CASES), "CASES"))
