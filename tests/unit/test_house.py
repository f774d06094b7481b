"""The layout of the code, as `nutdamp/guide/contributing.md` describes it."""

import ast
import inspect
import re
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from pathlib import Path

import pytest
from support import places

from nutdamp.spacecraft.roles import ROLES

PACKAGE = places.ROOT / "nutdamp"
LOOSE = {"__init__", "__main__", "api", "errors", "units"}
LONGEST, SHORTEST = 464, 10
"""Statements of a module, but of a scheme: lines can be bought with density. The most
is what the longest has, files/ccsds/read.
"""

FLOORS = 25
"""Longest chain of imports, those within functions and for types alone too."""

MOST_MODULES, MOST_OUTSIDE = 139, 111
"""Modules without the markers of packages, and of them those outside views,
figures and the page.
"""

MOST_LOADED, MOST_LINES = 43, 16_347
"""Modules that `plan --scheme two-pulse --nominal` loads for the built-in example, and their lines:
all that a stranger can meet who follows it.
"""

RIDDLES = re.compile(r"(What|Whether|How|Which|That|Why|Where|When)\b")
"""First words of a docstring that does not say what the thing is."""


@cache
def trees() -> dict[str, ast.Module]:
    """The modules by their path below the package."""
    return {
        path.relative_to(PACKAGE).as_posix(): ast.parse(path.read_text(encoding="utf-8"))
        for path in sorted(PACKAGE.rglob("*.py"))
    }


def documented(tree: ast.Module) -> Iterator[str]:
    """The docstrings of a module, its classes and its functions."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and (
            text := ast.get_docstring(node)
        ):
            yield text


def test_packages_are_folders_and_nothing_more() -> None:
    markers = [path for path in PACKAGE.rglob("__init__.py") if path.parent != PACKAGE]
    assert [path for path in markers if path.read_text(encoding="utf-8")] == []
    assert {path.stem for path in PACKAGE.glob("*.py")} == LOOSE


def test_a_module_can_be_read_in_a_sitting() -> None:
    sizes = {
        path: sum(isinstance(node, ast.stmt) for node in ast.walk(tree))
        for path, tree in trees().items()
    }
    assert {path: count for path, count in sizes.items() if count > LONGEST} == {}
    short = {
        path for path, count in sizes.items() if count < SHORTEST and not path.endswith("__.py")
    }
    assert {path for path in short if not path.startswith("schemes/")} == set()


def test_the_house_can_be_held_in_the_head() -> None:
    modules = [path for path in trees() if not path.endswith("__init__.py")]
    assert len(modules) <= MOST_MODULES
    assert (
        len([path for path in modules if not path.startswith(("views/", "figures/", "page/"))])
        <= MOST_OUTSIDE
    )


def test_a_two_pulse_plan_loads_few_modules(tmp_path: Path) -> None:
    code = """
import sys
from nutdamp.cli.main import group
group.main(["plan", "--scheme", "two-pulse", "--nominal"], standalone_mode=False)
print("LOADED", *(name for name in sys.modules if name.startswith("nutdamp.")))
"""
    run = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    names = run.stdout.split("LOADED ")[1].replace("nutdamp.", "").replace(".", "/").split()
    modules = {f"{name}.py" for name in names} & {*trees()}
    lines = [(PACKAGE / path).read_text(encoding="utf-8").splitlines() for path in modules]
    assert len(modules) <= MOST_LOADED
    assert sum(map(len, lines)) <= MOST_LINES


@cache
def imported(module: str) -> frozenset[str]:
    """Modules of the package that a module imports, anywhere in it, by their names below the
    package.
    """
    names = set()
    for node in ast.walk(trees()[f"{module.replace('.', '/')}.py"]):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("nutdamp"):
            base = (node.module or "").removeprefix("nutdamp").removeprefix(".")
            names |= {f"{base}.{alias.name}".removeprefix(".") for alias in node.names} | {base}
    return frozenset(
        name for name in names if name != module and f"{name.replace('.', '/')}.py" in trees()
    )


@cache
def chain(module: str) -> tuple[str, ...]:
    """The longest chain of imports down from a module; fails with RecursionError where they run in
    a circle.
    """
    return (module, *max(map(chain, imported(module)), key=len, default=()))


def test_imports_run_down_few_floors_and_never_in_a_circle() -> None:
    modules = [
        path.removesuffix(".py").replace("/", ".")
        for path in trees()
        if not path.endswith("__init__.py")
    ]
    assert len(max(map(chain, modules), key=len)) <= FLOORS


HEADED = {"Column": 1, "Column.named": 1, "Heading": 0}
"""Classes of columns, and the place of the heading among their arguments."""


def headings(tree: ast.Module) -> Iterator[str]:
    """The headings of tables that stand in a module as literals, those of tables without
    declaration too.
    """
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        name = ast.unparse(node.func)
        given = (
            node.args
            if name.rpartition(".")[2] == "columns"
            else node.args[HEADED[name] :][:1]
            if name in HEADED
            else []
        )
        yield from (
            each.value
            for each in given
            if isinstance(each, ast.Constant) and isinstance(each.value, str) and each.value
        )


def test_a_heading_of_tables_stands_in_one_module() -> None:
    homes = defaultdict(set)
    for path, tree in trees().items():
        if path.partition("/")[0] in ("views", "figures", "page", "cli"):
            for heading in headings(tree):
                homes[heading].add(path)
    shared = next(
        node for node in trees()["views/tables.py"].body if getattr(node, "name", "") == "Shared"
    )
    for node in ast.walk(shared):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            homes[node.value].add("views/tables.py")
    assert len(homes) > 80
    assert {heading: paths for heading, paths in homes.items() if len(paths) > 1} == {}


def test_a_class_name_stands_once() -> None:
    named = defaultdict(list)
    for path, tree in trees().items():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                named[node.name].append(path)
    assert {name: paths for name, paths in named.items() if len(set(paths)) > 1} == {}


def test_no_module_takes_what_another_keeps_to_itself() -> None:
    taken = [
        (path, alias.name)
        for path, tree in trees().items()
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("nutdamp.")
        for alias in node.names
        if alias.name.startswith("_")
    ]
    assert taken == []


@pytest.mark.parametrize("package", sorted({path.partition("/")[0] for path in trees()}))
def test_docstrings_say_what_a_thing_is(package: str) -> None:
    riddles = [
        (path, text.splitlines()[0])
        for path, tree in trees().items()
        if path.partition("/")[0] == package
        for text in documented(tree)
        if RIDDLES.match(text)
    ]
    assert riddles == []


# --- one judgement

REQUIREMENTS, VERDICT, WORDS = (
    "spacecraft/requirements.py",
    "planning/verdict.py",
    "views/verdict.py",
)
REQUIRED = {"nutation", "momentum_shift", "spin"}
"""Fields of a requirement."""

COMPARE = {
    "planning/decision.py": "severities of plans with each other",
    "schemes/optimal/search.py": "leads of a search that come near enough to be refined",
    "page/moving.py": "what lies within the scale of a drawing",
    "figures/studies.py": "what lies within the scale of a drawing",
    WORDS: "digits that keep a number on its side of the limit",
}
"""Modules that compare with the limit of a bound, but judge nothing by it."""

SHARES = {
    VERDICT: "share of the cases that keep one bound alone",
    "planning/chance_plan.py": (
        "trials of margins and of tolerances, whose plans are judged like all others"
    ),
    "planning/screening.py": (
        "shifts of a schedule that is judged, for the phase window of its sheet"
    ),
}
"""Modules that compare a share of cases with the one required, but give no plan a status by it."""

SAID = re.compile(
    r"\b((NOT )?met|FLY|NO PULSE|NO PLAN|(NOT )?ENOUGH|NOT SHOWN|CANNOT BE COMMANDED)\b"
)
WORDED = {
    (VERDICT, "met"): "value of `Light`, the class of a part of the page",
    ("views/dispersion.py", "met"): "key of JSON",
    ("planning/notes.py", "met-without-pulse-from"): "code of a note",
    ("planning/notes.py", "met-without-pulse-until"): "code of a note",
}
"""Texts with a word of the verdict that do not tell one."""


def named(node: ast.AST) -> str:
    """Last part of a name; empty for what is none."""
    return node.id if isinstance(node, ast.Name) else getattr(node, "attr", "")


def limits(node: ast.AST, stored: set[str]) -> bool:
    """True for an expression with the limit of a bound or a field of a requirement, maybe under a
    name ``stored``.
    """
    for part in ast.walk(node):
        owner = named(part.value) if isinstance(part, ast.Attribute) else ""
        if owner in ("requirement", "required", "requested") and named(part) in REQUIRED:
            return True
        if (owner, named(part)) == ("bound", "limit") or named(part) in stored:
            return True
    return False


def sizes(node: ast.AST) -> Iterator[list[ast.expr]]:
    """Both sides of the comparisons of sizes in a tree, or all of a chain."""
    for part in ast.walk(node):
        if isinstance(part, ast.Compare) and isinstance(
            part.ops[0], ast.Lt | ast.LtE | ast.Gt | ast.GtE
        ):
            yield [part.left, *part.comparators]


def judges(function: ast.FunctionDef) -> bool:
    """True where a function compares something with a limit, by whatever name it has it, or a
    severity with 1.
    """
    stored = set[str]()
    for node in 3 * [*ast.walk(function)]:  # names of names too
        if (
            isinstance(node, ast.Assign)
            and not isinstance(node.value, ast.BoolOp)
            and limits(node.value, stored)
        ):
            stored |= {
                named(part) for target in node.targets for part in getattr(target, "elts", [target])
            }
    return any(
        any(limits(side, stored) for side in sides)
        or (
            {"severity", "severities", "shares"} & {*map(named, sides)}
            and ast.unparse(sides[-1]) == "1.0"
        )
        for sides in sizes(function)
    )


def test_only_the_requirements_compare_a_residual_with_a_bound() -> None:
    functions = [(path, node) for path, tree in trees().items() for node in ast.walk(tree)]
    judging = {
        path for path, node in functions if isinstance(node, ast.FunctionDef) and judges(node)
    }
    assert judging == {REQUIREMENTS, *COMPARE}


def test_only_the_requirements_compare_a_share_with_the_one_required() -> None:
    written = ((path, sides) for path, tree in trees().items() for sides in sizes(tree))
    shares = ((path, sides) for path, sides in written if "probability" in map(named, sides))
    assert {path for path, sides in shares if not isinstance(sides[-1], ast.Constant)} == {
        REQUIREMENTS,
        *SHARES,
    }


def test_only_the_verdict_makes_a_status_and_only_its_view_names_one() -> None:
    makes, names, words = set(), set(), set()
    for path, tree in trees().items():
        prose = {*documented(tree)}
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and named(node.func) in ("Verdict", "Status"):
                makes.add(path)
            elif isinstance(node, ast.Attribute) and named(node.value) == "Status":
                names.add(path)
            elif isinstance(node, ast.Constant) and isinstance(node.value, str) and path != WORDS:
                words |= {
                    (path, text)
                    for text in {node.value}
                    if SAID.search(text) and inspect.cleandoc(text) not in prose
                }
    assert (makes, names) == ({VERDICT}, {VERDICT, WORDS})
    assert words == {*WORDED}


def test_parameters_that_are_spacecraft_bear_the_name_of_a_role() -> None:
    parameters = (
        (name, node)
        for name, tree in trees().items()
        for node in ast.walk(tree)
        if isinstance(node, ast.arg) and node.annotation is not None
    )
    strange = [
        f"{name}:{node.lineno} {node.arg}"
        for name, node in parameters
        if ast.unparse(node.annotation or node).removesuffix(" | None") == "Spacecraft"
        and node.arg not in ROLES
    ]
    assert not strange


def test_every_name_in_the_story_of_a_plan_exists_and_the_story_is_short() -> None:
    text = (PACKAGE / "guide" / "contributing.md").read_text(encoding="utf-8")
    story = text.partition("## How a two-pulse plan comes about")[2].partition("\n## ")[0]
    assert len(story.splitlines()) <= 60
    modules = re.findall(r"^- \*\*(.+?)\*\*", story, re.MULTILINE)
    assert len(modules) == 14
    for module, names in re.findall(r"\b([a-z_]+/[a-z_]+)\.(\w+(?:\.\w+)?)", story):
        assert module in modules
        owner: object = import_module(f"nutdamp.{module.replace('/', '.')}")
        for name in names.split("."):
            owner = getattr(owner, name)
