"""The README and the guide are true: sessions give the output shown, files load, snippets run,
links lead somewhere, commands are those of CI; and the smoke test of CI can fail: it sees
tracebacks, wrong exit statuses, missing files and untried commands.

With `NUTDAMP_WRITE_TEXTS=1` in the environment the test of the sessions writes the output of today
into the pages.
"""

import ast
import io
import itertools
import math
import os
import re
import shlex
import subprocess
import sys
import tomllib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner
from rich.console import Console
from support import places, smoke
from support.cases import deep, spread
from support.commands import call, python, rows, words
from support.golden import WRITE, check_text
from support.guide_pages import keys, pages
from support.process import Run
from support.shown import parsed

from nutdamp import __version__
from nutdamp.cli.main import COMMANDS, group
from nutdamp.cli.options import SHARED
from nutdamp.errors import BadRequest
from nutdamp.files import export, tabular, telemetry
from nutdamp.files.editing import parse_setting
from nutdamp.files.reader import example_text, json_schema, read_spacecraft
from nutdamp.files.schedules import EFFECTIVE
from nutdamp.schemes.catalogue import NAMES, SCHEMES, names_of
from nutdamp.spacecraft.tolerances import KINDS as TOLERANCE_KINDS
from nutdamp.units import KINDS
from nutdamp.views import guide, loop_cases, simulation
from nutdamp.views.verdict import HEADLINES, MET

pytestmark = pytest.mark.usefixtures("plans_shared")

ROOT = places.ROOT
README = ROOT / "README.md"
PAGES = (README, *sorted(guide.FOLDER.glob("*.md")))
TEXTS = {page: page.read_text(encoding="utf-8") for page in PAGES}
SESSION = re.compile(r"```console\n(\$ nutdamp .+?)\n```", re.DOTALL)
SESSIONS = [page.stem for page in PAGES if SESSION.search(TEXTS[page]) and page.stem != "motion"]
"""Pages with sessions; those of motion draw the figures of the source and fly in explain."""
REST = "…"
"""Last line of an output of which only the beginning is shown."""


def tidy(text: str) -> list[str]:
    return [line.rstrip() for line in text.strip().splitlines()]


@spread("name", SESSIONS, quick=1, deep=len(SESSIONS), ids=str)
def test_sessions_print_what_the_pages_show(run: Run, name: str) -> None:
    """Those of a page one after the other, in one folder; it says where the status is 4."""
    (page,) = (page for page in PAGES if page.stem == name)

    def flown(session: re.Match[str]) -> str:
        parts = re.split(r"^\$ ", session[1], flags=re.MULTILINE)[1:]
        return f"```console\n{''.join(outcome(run, part, text) for part in parts)}```"

    text = TEXTS[page]
    today = SESSION.sub(flown, text)
    if os.environ.get(WRITE):
        page.write_text(today, encoding="utf-8")
    else:
        assert today == text


def outcome(run: Run, part: str, page: str) -> str:
    """A command and the output of today, of which as many lines are shown as in ``part``."""
    command, _, shown = part.partition("\n")
    name, *arguments = shlex.split(command)
    assert name == "nutdamp"
    ended = run(*arguments, status=(0, 4))
    assert ended.returncode == 0 or "status 4" in page, command
    lines = tidy(ended.stdout)
    if (before := tidy(shown))[-1:] == [REST]:
        lines = [*lines[: len(before) - 1], REST]
    return "".join(f"{line}\n" for line in (f"$ {command}", *lines))


def test_what_the_readme_shows_of_files_is_what_is_there() -> None:
    text = TEXTS[README]
    assert len(text.encode()) <= 12_000
    assert "<!-- test command -->" in text
    assert "<!-- test command -->" in (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    (file,) = re.findall(r"```yaml\n(.+?)```", text, re.DOTALL)
    assert len(file.splitlines()) <= 10
    for page in PAGES:
        for shown in re.findall(r"```yaml\n(.+?)```", TEXTS[page], re.DOTALL):
            assert read_spacecraft(shown, page.name).name == "Sounder-1"
    assert f"## {__version__}\n" in TEXTS[guide.FOLDER / "changes.md"]


def test_every_snippet_of_python_is_an_example_that_runs() -> None:
    """`tests/contract/library` runs those examples."""
    snippets = [
        code
        for text in TEXTS.values()
        for code in re.findall(r"```python\n(.+?)```", text, re.DOTALL)
    ]
    examples = ("library_example.py", "library_dispersion.py", "library_sweep.py")
    for name, code in zip(examples, snippets, strict=True):
        assert (places.TESTS / "support" / name).read_text(encoding="utf-8").endswith(code)


def test_links_lead_to_pages_and_sections() -> None:
    for page, text in TEXTS.items():
        for target in re.findall(
            r"\]\(([^)\s]+)\)", re.sub(r"```.*?```", "", text, flags=re.DOTALL)
        ):
            path, _, section = target.partition("#")
            linked = page if not path else (page.parent / path).resolve()
            assert linked.exists(), (page.name, target)
            assert not section or section in anchors(TEXTS[linked]), (page.name, target)


def anchors(text: str) -> Iterator[str]:
    """The names by which headings can be linked, as GitHub makes them."""
    for heading in re.findall(r"^#+ (.+)$", text, re.MULTILINE):
        yield re.sub(r"[^\w\- ]", "", heading.casefold()).replace(" ", "-")


def test_every_page_is_linked_and_listed_and_made_or_short() -> None:
    """`python tests/support/guide_pages.py` writes those that are made from the code."""
    names = {page.stem for page in PAGES[1:]}
    assert names == {name for _, group in guide.PAGES for name in group}
    assert names <= set(re.findall(r"nutdamp/guide/(\w+)\.md", TEXTS[README]))
    for name, text in pages().items():
        assert TEXTS[guide.FOLDER / f"{name}.md"] == text
    for name in ("tutorial", "reading", *dict(guide.PAGES)["How to"]):
        assert len(TEXTS[guide.FOLDER / f"{name}.md"].splitlines()) <= 120, name


def test_the_smoke_test_sees_what_is_wrong(tmp_path: Path) -> None:
    path = tmp_path / "program"
    wrong = (
        "case $* in --version) echo 'Traceback (most recent call last):' >&2 ;; init) exit 7; esac"
    )
    path.write_text(f"#!/bin/sh\n{wrong}\n")
    path.chmod(0o755)
    ended = subprocess.run(
        [sys.executable, smoke.__file__, str(path)], capture_output=True, text=True, check=False
    )
    assert ended.returncode == 1
    for fault in (
        "plan missing.yaml: exit status 0, expected 1",
        "init: exit status 7, expected 0",
        "check smoke.yaml --json check.json: check.json begins with b''",
        "--version:\nTraceback",
    ):
        assert f"FAILED: nutdamp {fault}" in ended.stderr


def test_ci_tries_every_command_and_the_lowest_versions_that_are_declared() -> None:
    assert {line.split()[0].rstrip(";") for line in smoke.CALLS} >= set(COMMANDS)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for entry in project["dependencies"] + project["optional-dependencies"]["plot"]:
        # what .ci/run makes of it is then a requirement of exactly this version
        assert re.fullmatch(r"[a-z][a-z0-9-]*>=[0-9.]+", entry)


# --- every command that a screen or a page prints runs: next steps, commands of notes, those of the
# report

VALUE = rf"""(?:"[^"]*"|'[^']*'|FILE|FOLDER|{"|".join(NAMES)}|[^\s;,()]*[\d.=][^\s;,()]*)"""
OPTIONS = rf"(?: --?[a-z][\w-]*(?: {VALUE})?)*"
COMMAND = re.compile(rf"nutdamp (?!explain|init)([a-z]+\b(?: (?:SPACECRAFT|\S+\.yaml))?{OPTIONS})")
INSPECTED = re.compile(r"Inspect one: (?:nutdamp disperse, as here, with )?(?=--)")
NAMES_OF_FILES = {"SPACECRAFT": "spacecraft.yaml", "FILE": "file.csv", "FOLDER": "folder"}


def printed(command: str, shown: str) -> Iterator[str]:
    """The commands of what a ``command`` shows; next steps that are options are added to it."""
    for line in INSPECTED.sub(f"nutdamp {command} ", shown).splitlines():
        yield from COMMAND.findall(line)
        for step in line.split(" · ") if " · " in line else []:
            options = re.findall(f"^{OPTIONS}", f" {step}")
            yield from (command + each for each in options if each)


def check_commands(run: Run, commands: Iterator[str]) -> int:
    """The number of commands; fails where one is refused, or is not to be understood."""
    named = {
        re.sub("|".join(NAMES_OF_FILES), lambda name: NAMES_OF_FILES[name[0]], each)
        for each in commands
    }
    for command in sorted(named):
        assert "Traceback" not in call(run, command, status=(0, 3, 4)).stderr, command
    return len(named)


@pytest.mark.usefixtures("plain_pages")
@pytest.mark.parametrize(
    ("craft", "command", "count"),
    [
        ("example", "plan --scheme two-pulse", 4),
        deep("example", "plan --scheme four-pulse", 4),
        deep("example", "simulate --scheme two-pulse --samples 20", 4),
        ("example", "disperse --scheme two-pulse --samples 50", 3),
        ("example", "disperse --scheme two-pulse --samples 50 -v", 1),
        deep("example", "trade --points 2", 4),
        deep("example", "check", 3),
        deep("lunar-prospector", "plan --scheme command-block", 4),
        deep("upper-stage", "loop --until 8s", 4),
        deep("upper-stage", "disperse --loop --until 6s --samples 20", 3),
        ("upper-stage", "disperse --loop --until 6s --samples 20 -v", 2),
        ("upper-stage", "disperse --loop --until 6s --case 3", 1),
        deep("upper-stage", "budget", 4),
    ],
)
def test_every_command_on_a_screen_runs(
    run: Run, tmp_path: Path, craft: str, command: str, count: int
) -> None:
    """In a folder with that spacecraft file, since next steps name none."""
    (tmp_path / "spacecraft.yaml").write_text(example_text(craft))
    ended = call(run, command, columns=400)
    assert check_commands(run, printed(command, ended.stdout + ended.stderr)) == count


@pytest.mark.deep
@pytest.mark.parametrize("craft", ["example", "lunar-prospector"])
def test_every_command_on_a_page_runs(run: Run, tmp_path: Path, craft: str) -> None:
    (tmp_path / "spacecraft.yaml").write_text(example_text(craft))
    assert call(run, "report spacecraft.yaml --nominal --trade 2 -q").returncode == 0
    assert call(run, "plan spacecraft.yaml --nominal --csv edited.csv").returncode == 0
    page = parsed((tmp_path / "report.html").read_text(encoding="utf-8"))
    texts = (" ".join(node.text.split()) for node in page if node.tag in ("p", "pre", "li", "td"))
    assert check_commands(run, printed("report", "\n".join(texts))) >= 2


# --- explain: every topic prints what it is for, at any width, and loads nothing heavy

FIGURES = guide.topic_of("figures")
TOPICS = (
    *guide.NAMES,
    *guide.EQUATIONS,
    "file.thrusters",
    "file.limits.tick",
    "requirement",
)


def explained(*arguments: str, columns: int = 80) -> str:
    ended = CliRunner().invoke(
        group, ["explain", *arguments], env={"COLUMNS": str(columns), "NO_COLOR": "1"}
    )
    assert ended.exit_code == 0, ended.output
    return ended.stdout


def test_every_topic_and_every_equation_is_listed() -> None:
    listed, equations = words(explained()), words(explained("equations"))
    for _, names in guide.PAGES:
        assert all(f"{name} {guide.page(name).summary}" in listed for name in names)
    assert {*NAMES, "nutation", "file", "units", "figures", "equations"} <= set(guide.NAMES)
    assert all(name in listed for name in guide.NAMES)
    lines = explained(columns=80).splitlines()
    assert len(lines) <= 40  # one screen
    assert max(map(len, lines)) <= 80
    assert all(f"• {name}: {topic.summary}" in equations for name, topic in guide.EQUATIONS.items())


@pytest.mark.parametrize(
    "topic",
    [
        pytest.param(name, marks=[] if number % 6 == 0 else pytest.mark.deep)
        for number, name in enumerate(TOPICS)
    ],
)
def test_each_topic_fits_the_screen_and_loses_nothing(topic: str) -> None:
    """Rules of tables apart, every letter of its text is there, if not in the same line."""
    whole = letters(explained(topic, columns=300))
    assert whole.total() > 120
    for columns in (36, 80, 140):
        shown = explained(topic, columns=columns)
        assert max(map(len, shown.splitlines())) <= min(columns, guide.WIDEST)
        assert letters(shown) == whole
    if topic in guide.NAMES:
        text = re.sub(r"```\w*", "", guide.page_or_topic(topic).text)
        text = re.sub(r"^(\d+)\. ", r"\1 ", text, flags=re.MULTILINE)
        lost = letters(text) - letters(explained(topic))
        assert set(lost) <= set("#`|*-\\>"), lost


def letters(text: str) -> Counter[str]:
    return Counter(re.sub(r"[\s─▌]", "", text))


def test_a_scheme_says_how_when_with_which_options_and_within_what_limits() -> None:
    every = {name for other in SCHEMES.values() for name in names_of(other.options)} - set(SHARED)
    for scheme in NAMES:
        shown = explained(scheme)
        options = (
            "Options" if scheme == "none" else "Options of nutdamp plan"
        )  # other commands take none of them
        for title in ("How it works", "Equation", "When to use it", options, "Limits"):
            assert f"\n{title}\n" in shown
        for option in every:
            named = f"--{option.replace('_', '-')}" in shown
            assert named == (option in names_of(SCHEMES[scheme].options)), option


def test_an_equation_has_its_formula_its_symbols_and_what_is_changed() -> None:
    for entry in guide.entries("equations"):
        if entry.name in ("energy sink", "gyrostat"):  # of no source
            continue
        shown, facts = words(explained(entry.name)), dict(entry.rows)
        changed = entry.text.partition(facts["place"])[2]
        lines = "".join(entry.formulas).splitlines()
        assert all(words(line) in shown for line in lines)
        assert words(changed.replace("`", "")) in shown
        for symbol in facts["symbols"].split():
            assert f"{symbol}: {guide.SYMBOLS[symbol]}" in shown
            assert symbol.strip("'").removesuffix("(t)") in " ".join([*lines, changed])
        assert facts["place"] in shown


def test_numbers_and_figures_as_people_write_them() -> None:
    written = {
        "17": "M(17)",
        "m17": "M(17)",
        "(17)": "M(17)",
        "M 17": "M(17)",
        "k7": "K(7)",
        "K(7)": "K(7)",
        "24.4": "24.4",
        "§24.4": "24.4",
    }
    assert {requested: guide.topic_of(requested).name for requested in written} == written
    assert all(
        guide.topic_of(name) is FIGURES
        for name in ("Abb. 5", "abb8", "fig. 6", "Figures", "FIGURES")
    )


def test_every_key_of_the_models_is_in_the_file_topic() -> None:
    """With its description, unit and example; and each can be requested alone."""
    shown = words(explained("file"))
    schema = json_schema()
    every = list(keys())
    models = set(schema["properties"]).union(
        *(section["properties"] for section in schema["$defs"].values())
    )
    assert {key.name for key in every} == models | set(TOLERANCE_KINDS)
    for key in every:
        assert words(f"{key.name}: {key.text.replace('`', '')}") in shown, key.path
        assert key.field.description
        assert key.field.examples
    asked = (
        "limits.horizon state.spin thrusters.force attitude.frame attitude.quaternion "
        "limits.max_pulses dispersions.A"
    )
    texts = {key.path: key.text for key in every}
    alone = words(explained("file.dispersions.thrust"))
    check_text(
        "cli.explain.keys",
        "\n".join(f"{path}: {texts[path]}" for path in asked.split()) + f"\n{alone}",
    )


def test_examples_can_be_set() -> None:
    """As --set takes them, on a file that has what they need."""
    base = """
name: x
inertia: {A: 100, C: 80}
omega0: [0.1, 0, 3]
thrusters:
  - {name: T1, torque: [0, 8, 0], lever_arm: 1, isp: 220}
  - {name: T2, torque: [8, 0, 0], lever_arm: 1, isp: 220}
attitude: {quaternion: [1, 0, 0, 0], epoch: 2026-03-01T12:00:00Z, frame: GCRF}
sun: epoch
sun_sensor: {azimuth: 0}
"""
    settable = [key for key in keys() if not key.parent and key.name not in ("state", "omega0")]
    assert len(settable) > 10
    for key in settable:
        setting = parse_setting(f"{key.path}={key.field.examples[0]}")
        read_spacecraft(base, "f.yaml", [setting])


def test_every_unit_is_in_the_units_topic() -> None:
    shown = explained("units")
    assert not re.search(r"= 1 ", shown)  # names of the SI unit stand without a factor
    lines = re.sub(r"\n {3,}", " ", shown).splitlines()
    for kind in KINDS.values():
        (line,) = (line for line in lines if line.startswith(f" • {kind.noun.partition(' ')[2]}: "))
        for unit, factor in kind.factors.items():
            assert re.search(rf"(?<!\S){re.escape(unit)}(?=[; ]|$)", line), unit
            if factor != 1.0:
                value = float(re.findall(rf"(?<!\S){re.escape(unit)} = (\S+?)(?: |;|$)", line)[0])
                assert value == pytest.approx(factor, rel=1e-5)


# --- the figures of Magnus 1970
# ---------------------------------------------------------------------------------------

DRAWN = [
    re.split(r" (?=--?[a-z])", line)
    for line in re.findall(r"^\$ (.+)$", FIGURES.text, re.MULTILINE)
]


def command_of(name: str) -> list[str]:
    return shlex.split(" ".join(next(parts for parts in DRAWN if name in parts[-1])))[1:]


def test_the_figures_are_all_there_and_their_commands_differ_in_the_motion_alone() -> None:
    titles = " ".join(title for title, _ in FIGURES.sections)
    assert set(re.findall(r"Abb\. (\d)", titles)) == {"2", "4", "5", "6", "7", "8"}
    for first, *_, figure, plot in DRAWN:
        assert first == "nutdamp animate" or (
            first in ("nutdamp simulate", "nutdamp plan") and figure == "--figure motion"
        )
        assert first == "nutdamp animate" or re.fullmatch(r"--plot \w+\.png", plot)


CODE = {
    package: [
        node
        for path in sorted((places.ROOT / "nutdamp" / package).glob("*.py"))
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    ]
    for package in ("views", "page")
}
"""Syntax of the packages whose words people read."""


def calls(*functions: str, packages: Iterable[str] = ("views",)) -> Iterator[list[ast.expr]]:
    """Arguments of the calls of functions by their names, with a module before them or not."""
    for node in (node for package in packages for node in CODE[package]):
        if isinstance(node, ast.Call) and re.fullmatch(
            rf"(\w+\.)?({'|'.join(functions)})", ast.unparse(node.func)
        ):
            yield [*node.args, *(keyword.value for keyword in node.keywords)]


def texts_in(node: ast.expr) -> Iterator[str]:
    """The texts of a literal, of a list of them, or of either side of a choice."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    parts = getattr(node, "elts", [])
    if isinstance(node, ast.IfExp | ast.BinOp | ast.Starred):
        parts = [getattr(node, name, None) for name in ("body", "orelse", "left", "value")]
    for part in filter(None, parts):
        yield from texts_in(part)


def test_every_heading_title_and_bold_phrase_is_explained() -> None:
    """Headings of tables, their titles, and literal texts with the style bold beside them."""
    headed = [parts[1] for parts in calls("Column", "Column.named", packages=CODE)]
    headed += [parts[0] for parts in calls("Heading", packages=CODE)]
    headings = {" ".join(text.split()) for part in headed for text in texts_in(part)} - {""}
    assert len(headings) > 60
    phrases = [parts[0] for parts in calls("DataTable")]
    pairs = [node.elts for node in CODE["views"] if isinstance(node, ast.Tuple)]
    for first, *styles in filter(None, (*pairs, *calls("Text"))):
        if any("bold" in ast.unparse(style) for style in styles):
            phrases.append(first)
    bold = {text.strip(" :") for part in phrases for text in texts_in(part)} - {""}
    assert len(bold) > 25
    assert {text for text in headings | bold if not is_known(text)} == set()


def test_operators_words_and_channels_are_explained() -> None:
    for word in (
        *("coning", "wobble", "flat spin", "dual spin", "despin", "spin-up", "reorientation"),
        *("precession manoeuvre", "active nutation control", "damper", "jet damping", "slosh"),
        *("imbalance", "RCS", "burn", "thruster on-time", "Sun sensor", "Earth sensor"),
        *("aspect angle", "attitude determination", *HEADLINES.values(), MET[True], MET[False]),
        *("H turned", "after pulses", "spin error", "least delay margin"),
    ):
        assert is_known(word), word
    assert "N m: (0, 8, 0)" in explained("+M2")
    assert "0.8 m" in explained("+M2")
    assert CliRunner().invoke(group, ["explain", "+M9"]).exit_code != 0


def is_known(name: str) -> bool:
    try:
        return bool(guide.explained(name))
    except BadRequest:
        return False


def test_words_are_explained_however_they_are_written() -> None:
    for word in (
        "tilt",
        "requirement",
        "robust",
        "H",
        "momentum shift",
        "met fraction",
        "prolate",
        "flown",
        "max_on_time",
        "limits.tick",
        "Exit status",
        "dead band",
        "Azimuth",
        "on-time s",
        "on_time_s",
        "nutation after, deg",
        "spin axis: tilt",
        "H: azimuth",
        "H: right ascension",
    ):
        assert is_known(word), word
    assert guide.explained("on-time s").summary == guide.explained("On-Time").summary
    assert guide.explained("a") != guide.explained("A")  # symbols differ by case
    assert "file.thrusters.max_on_time" in explained("max_on_time")
    assert "## In the spacecraft file" in guide.explained("lever_arm").text
    with pytest.raises(BadRequest, match=r"momentum.shift"):
        guide.explained("momentun shift")


def keys_of_columns() -> Iterator[tuple[str, str]]:
    """Names of columns that go into files, and the places that have them, where written out."""
    for key, *others in calls("Column", "Column.named"):
        if isinstance(key, ast.Constant) and key.value:
            places_of = " ".join(text for other in others for text in texts_in(other))
            yield str(key.value).partition("=")[0], places_of
    for where, *names in calls("file_columns"):
        for text in (text for name in names for text in texts_in(name)):
            yield text.partition("=")[0], " ".join(texts_in(where))


def columns_written() -> Iterator[str]:
    yield from (*EFFECTIVE, *tabular.HEADER, *telemetry.TIMES, *telemetry.MEASURED)
    yield from export.OUTPUT_COLUMNS
    yield from (column.key for column in simulation.SPINS)
    yield from (output.key for output in loop_cases.SHOWN_OUTPUTS)
    for key, where in keys_of_columns():
        if "csv" in where or "json" not in where:
            yield from {key.replace("#", f"_{axis}") for axis in (1, 2, 3)}


def keys_written() -> Iterator[str]:
    """Names that the code gives to numbers in JSON."""
    made = ("_json", "_shares", "_fraction")
    functions = (node for node in CODE["views"] if isinstance(node, ast.FunctionDef))
    for function in (node for node in functions if node.name.endswith(made)):
        for node in ast.walk(function) if function.name != "note_json" else ():
            keys = node.keys if isinstance(node, ast.Dict) else ()
            yield from (text for key in keys if key is not None for text in texts_in(key))
    for _, *names in calls("values_of"):
        yield from (text.partition("=")[0] for name in names for text in texts_in(name))
    yield from (key.replace("#", "") for key, where in keys_of_columns() if "json" in where)


@pytest.mark.parametrize(("page", "written"), [("csv", columns_written), ("json", keys_written)])
def test_the_reference_has_every_column_and_every_name(
    page: str, written: Callable[[], Iterator[str]]
) -> None:
    listed = {name for names, _ in guide.page(page).rows for name in names.split(", ")}
    names = set(written())
    assert len(names) > 70
    assert names - listed == set()


def test_long_pages_go_through_a_pager_on_a_terminal_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    paged: list[str] = []
    monkeypatch.setattr("click.echo_via_pager", paged.append)
    assert "Sun pulse" in explained("command-block")
    assert paged == []
    terminal = Console(force_terminal=True, width=80, height=30, file=io.StringIO())
    monkeypatch.setattr("nutdamp.cli.files.console", lambda: terminal)
    monkeypatch.setattr("nutdamp.cli.files.on_keyboard", lambda: True)
    assert explained("command-block") == ""
    assert "Sun pulse" in paged.pop()
    assert "angle" in explained("tilt")
    assert paged == []


@pytest.mark.deep
@pytest.mark.parametrize("name", ["abb6.png", "abb4.gif"])
def test_the_commands_of_the_figures_draw(run: Run, tmp_path: Path, name: str) -> None:
    """One of each kind; what the others draw is flown below."""
    pytest.importorskip("matplotlib")
    command = command_of(name)
    small = ["--seconds", "0.2", "--fps", "5", "--width", "320"] if command[0] == "animate" else []
    run(
        *command, *small, status=4 if command[0] == "plan" else 0
    )  # full pulses miss the requirement
    assert (tmp_path / name).stat().st_size > 1000


def track(run: Run, tmp_path: Path, name: str) -> list[dict[str, float]]:
    """The track of a figure's command, in place of its picture."""
    command = command_of(name)
    for option in ("--figure", "--plot"):
        del command[command.index(option) : command.index(option) + 2]
    if command[0] == "plan":
        assert run(*command, "--csv", "pulses.csv").returncode in (0, 4)
        command = ["simulate", *command[1:3], "--schedule", "pulses.csv"]
    run(*command, "--csv", "track.csv", status=(0, 4))  # full pulses miss the requirement
    table = rows((tmp_path / "track.csv").read_text(encoding="utf-8"))
    return [{name: float(value or "nan") for name, value in row.items()} for row in table]


def transverse(row: dict[str, float]) -> complex:
    return complex(row["omega_1_rad_s"], row["omega_2_rad_s"])


@pytest.mark.parametrize(("name", "a"), [("abb6", 0.9), ("abb7", 0.3), ("oblate", -0.3)])
def test_abb_5_to_7_show_what_the_source_shows(
    run: Run, tmp_path: Path, name: str, a: float
) -> None:
    """Two rounds of four pulses or more, inwards; the axis turns by 90° (1 - a)/|a| between."""
    flown = track(run, tmp_path, name)
    jumps = [
        (left, right) for left, right in itertools.pairwise(flown) if right["pulse"] > left["pulse"]
    ]
    before, after = ([pair[side] for pair in jumps] for side in (0, 1))
    assert len(jumps) >= 8
    for left, right in zip(after[:-1], before[1:], strict=True):
        turn = transverse(right) / transverse(left)
        assert math.degrees(math.atan2(turn.imag, turn.real)) == pytest.approx(
            -math.copysign(90.0, a), abs=1e-6
        )
    # the rate of the nutation in space at small angles, over a quarter of the period in the body
    turned = math.degrees(
        (1.0 - a) * flown[0]["omega_3_rad_s"] * (before[2]["t_s"] - before[1]["t_s"])
    )
    assert turned == pytest.approx(90.0 * (1.0 - a) / abs(a), rel=1e-6)
    assert flown[-1]["nutation_deg"] < 0.1 * flown[0]["nutation_deg"]


def test_abb_8_stops_the_axis_where_h_was(run: Run, tmp_path: Path) -> None:
    first, *_, last = track(run, tmp_path, "abb8")
    assert last["pulse"] == 2
    start, end = ([row[f"momentum_{axis}_Nms"] for axis in "xyz"] for row in (first, last))
    for towards in (end, [last[f"axis_{axis}"] for axis in "xyz"]):
        unit = [part / math.hypot(*towards) for part in towards]
        assert unit == pytest.approx([part / math.hypot(*start) for part in start], abs=1e-9)


def test_abb_2_is_a_circle_about_a_centre_aside(run: Run, tmp_path: Path) -> None:
    flown = track(run, tmp_path, "abb2")
    centre = complex(1.0, -3.0) / (
        40.0 * flown[0]["omega_3_rad_s"]
    )  # (M2 - i M1)/((A - C) ω3), Magnus 1970 (13)
    radii = [abs(transverse(row) - centre) for row in flown]
    assert max(radii) == pytest.approx(min(radii), rel=1e-6)
    assert abs(centre) > 0.1 * radii[0]


def test_the_guide_loads_no_numbers(tmp_path: Path) -> None:
    """Neither numpy nor scipy."""
    code = f"""
import sys
from nutdamp.cli.main import group
for topic in {["", *guide.NAMES]!r}:
    group.main(["explain", *topic.split()], standalone_mode=False)
print("LOADED", *{{"numpy", "scipy", "matplotlib", "yaml"}} & set(sys.modules))
"""
    assert python(tmp_path, code).stdout.endswith("LOADED\n")
