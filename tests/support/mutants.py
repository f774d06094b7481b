"""Kill rate of the tests: N mutants of a package are drawn, and each is run against the tests that execute its line.

    python tests/support/mutants.py PACKAGE [TESTS …] [--number 20] [--seed 1] [--marks "not weekly"] [--budget 20]

PACKAGE is a folder or module below nutdamp/ (``physics``, ``schemes/optimal``, ``planning.py``; ``.`` for all). TESTS
are files or folders, by default all that pytest collects. Needs Python 3.12 or newer (`sys.monitoring`) and forks.

The tests run once, to see which lines each executes. Then every mutant gets a fork of that session: the code of the
functions that it changes is replaced, what tests and nutdamp have cached is cleared, and the tests of its line run, the
short ones first, until one fails or BUDGET seconds of CPU are spent. Tests in processes of their own see no mutant, nor
do constants of modules. A survivor may be equivalent: that is for the reader of the list to judge.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import copy
import functools
import gc
import os
import random
import resource
import sys
import time
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
SWAPS: dict[type[ast.AST], type[ast.AST]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.Pow: ast.Mult,
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
    ast.And: ast.Or,
    ast.Or: ast.And,
}
NAMES = {"min": "max", "max": "min", "sin": "cos", "cos": "sin", "any": "all", "all": "any", "floor": "ceil"}


@dataclass(frozen=True)
class Mutant:
    """One change of one node: the place of the node in the order of `ast.walk`, and which of its changes."""

    path: Path
    line: int
    before: str
    after: str
    module: ast.Module = field(repr=False, compare=False)


def changes(node: ast.AST) -> Iterator[ast.AST]:
    """The nodes that may stand in the place of ``node``."""
    changed: Any = copy.deepcopy(node)
    match node:
        case ast.BinOp() | ast.BoolOp() | ast.AugAssign() if type(node.op) in SWAPS:
            changed.op = SWAPS[type(changed.op)]()
            yield changed
        case ast.Compare() if type(node.ops[0]) in SWAPS:
            changed.ops[0] = SWAPS[type(changed.ops[0])]()
            yield changed
        case ast.UnaryOp(op=ast.Not() | ast.USub()):
            yield changed.operand
        case ast.Constant(value=bool() as flag):
            yield ast.Constant(not flag)
        case ast.Constant(value=int() | float() as number):
            yield ast.Constant(number + 1)
        case ast.If() | ast.IfExp() | ast.While():
            changed.test = ast.UnaryOp(ast.Not(), changed.test)
            yield changed
        case ast.Expr(value=ast.Call()):
            yield ast.Pass()
        case ast.Call(func=ast.Name(id=name)) if name in NAMES:
            changed.func.id = NAMES[name]
            yield changed
        case ast.Call(func=ast.Attribute(attr=name)) if name in NAMES:
            changed.func.attr = NAMES[name]
            yield changed


class Replace(ast.NodeTransformer):
    """A tree with one node replaced by another."""

    def __init__(self, old: ast.AST, new: ast.AST) -> None:
        self.old, self.new = old, new

    def visit(self, node: ast.AST) -> Any:
        """The node, or what takes its place."""
        return ast.copy_location(self.new, node) if node is self.old else self.generic_visit(node)


def places(path: Path) -> dict[int, list[tuple[ast.Module, ast.AST, ast.AST]]]:
    """For each line of a file what may be changed there: the tree, a node, and what takes its place."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    found: dict[int, list[tuple[ast.Module, ast.AST, ast.AST]]] = defaultdict(list)
    skipped: set[int] = set()
    for function in ast.walk(tree):
        if not isinstance(function, ast.FunctionDef) or id(function) in skipped:
            continue
        for statement in function.body:
            for node in ast.walk(statement):
                if isinstance(node, ast.FunctionDef | ast.Raise | ast.AnnAssign):
                    skipped.update(id(inner) for inner in ast.walk(node))
                if id(node) not in skipped and hasattr(node, "lineno"):
                    found[node.lineno].extend((tree, node, new) for new in changes(node))
    return found


def draw(package: str, number: int, seed: int) -> list[Mutant]:
    """``number`` mutants of a package: a line by chance, then one of its changes by chance."""
    where = ROOT / "nutdamp" / package
    files = [where] if where.is_file() else sorted(where.rglob("*.py"))
    lines = [(path, line, options) for path in files for line, options in sorted(places(path).items()) if options]
    chance = random.Random(seed)
    chance.shuffle(lines)
    mutants = []
    for path, line, options in lines[:number]:
        tree, old, new = chance.choice(options)
        before = ast.unparse(old).partition("\n")[0]
        changed = ast.fix_missing_locations(Replace(old, new).visit(_copied(tree, old)))
        mutants.append(Mutant(path, line, before, ast.unparse(new).partition("\n")[0], changed))
    return mutants


def _copied(tree: ast.Module, kept: ast.AST) -> ast.Module:
    """A copy of a tree that shares one node with it."""
    return copy.deepcopy(tree, {id(kept): kept})


def apply(mutant: Mutant) -> int:
    """Give the living functions of the module their changed code; return how many have changed."""
    file = str(mutant.path)
    fresh: dict[tuple[str, int], CodeType] = {}

    def collect(code: CodeType) -> None:
        fresh[code.co_qualname, code.co_firstlineno] = code
        for constant in code.co_consts:
            if isinstance(constant, CodeType):
                collect(constant)

    collect(compile(mutant.module, file, "exec"))
    changed = 0
    for function in gc.get_objects():
        if isinstance(function, FunctionType) and function.__code__.co_filename == file:
            code = function.__code__
            new = fresh.get((code.co_qualname, code.co_firstlineno))
            if new is not None and new != code and new.co_freevars == code.co_freevars:
                function.__code__ = new
                changed += 1
    return changed


def forget() -> None:
    """Clear what functions have cached, and the plans that tests share."""
    for found in gc.get_objects():
        if isinstance(found, functools._lru_cache_wrapper):
            file = getattr(getattr(found.__wrapped__, "__code__", None), "co_filename", "")
            if file.startswith(str(ROOT)):
                found.cache_clear()
        elif type(found).__name__ == "Planner":
            found.kept.clear()


class Session:
    """A pytest plugin: runs all tests once with their lines noted, then the mutants in forks."""

    def __init__(self, mutants: list[Mutant], budget: float, jobs: int, out: int) -> None:
        self.mutants, self.budget, self.jobs, self.out = mutants, budget, jobs, out
        self.seen: dict[tuple[str, int], list[tuple[float, pytest.Item]]] = defaultdict(list)
        self.wanted = {(str(mutant.path), mutant.line) for mutant in mutants}
        self.files = {file for file, _ in self.wanted}
        self.lines: set[tuple[str, int]] = set()
        self.results: dict[int, str] = {}

    def say(self, text: str) -> None:
        """Write a line past what pytest captures."""
        os.write(self.out, f"{text}\n".encode())

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Instead of pytest's loop."""
        monitoring: Any = vars(sys)["monitoring"]
        monitoring.use_tool_id(monitoring.COVERAGE_ID, "mutants")
        monitoring.register_callback(monitoring.COVERAGE_ID, monitoring.events.LINE, self._line)
        monitoring.set_events(monitoring.COVERAGE_ID, monitoring.events.LINE)
        begun = time.process_time()
        for item, after in zip(session.items, [*session.items[1:], None], strict=True):
            monitoring.restart_events()
            self.lines.clear()
            start, failed = time.process_time(), session.testsfailed
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=after)
            spent = time.process_time() - start
            if session.testsfailed == failed:  # what fails without a mutant kills none
                for place in self.lines:
                    self.seen[place].append((spent, item))
        monitoring.set_events(monitoring.COVERAGE_ID, 0)
        monitoring.free_tool_id(monitoring.COVERAGE_ID)
        self.say(
            f"{len(session.items)} tests, {session.testsfailed} failed, {time.process_time() - begun:.0f} s of CPU"
        )
        self._mutate()
        return True

    def _line(self, code: CodeType, line: int) -> Any:
        if code.co_filename in self.files and (code.co_filename, line) in self.wanted:
            self.lines.add((code.co_filename, line))
        return vars(sys)["monitoring"].DISABLE

    def _mutate(self) -> None:
        running: dict[int, tuple[int, int]] = {}
        waiting = list(enumerate(self.mutants))
        while waiting or running:
            while waiting and len(running) < self.jobs:
                number, mutant = waiting.pop(0)
                read, write = os.pipe()
                child = os.fork()
                if child == 0:
                    self._child(mutant, write)
                os.close(write)
                running[child] = number, read
            child, _ = os.wait()
            number, read = running.pop(child)
            with os.fdopen(read) as pipe:
                self.results[number] = pipe.read() or "killed by the clock"
            mutant = self.mutants[number]
            place = f"{mutant.path.relative_to(ROOT)}:{mutant.line}"
            self.say(f"{number:3} {place}  {mutant.before}  ->  {mutant.after}: {self.results[number]}")

    def _child(self, mutant: Mutant, write: int) -> None:
        """Run the tests of a mutant's line, then leave."""
        limit = int(3 * self.budget) + 60
        resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))
        tests = sorted(self.seen[str(mutant.path), mutant.line], key=lambda timed: timed[0])
        text = "no test executes it"
        if tests:
            text = f"SURVIVED {len(tests)} tests"
            with contextlib.suppress(BaseException):
                apply(mutant)
                forget()
                start = time.process_time()
                for tried, (_, item) in enumerate(tests):
                    if time.process_time() - start > self.budget:
                        text = f"SURVIVED {tried} of {len(tests)} tests"
                        break
                    if self._fails(item):
                        text = f"killed by {item.nodeid} (test {tried + 1} of {len(tests)})"
                        break
        os.write(write, text.encode())
        os._exit(0)

    @staticmethod
    def _fails(item: pytest.Item) -> bool:
        from _pytest.runner import runtestprotocol

        return any(report.failed for report in runtestprotocol(item, log=False, nextitem=None))


def main() -> int:
    """Draw, run, and print the rate."""
    sys.path.remove(str(Path(__file__).parent))  # where Python finds the helpers as modules of their own, too
    options = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    options.add_argument("package")
    options.add_argument("tests", nargs="*")
    options.add_argument("--number", type=int, default=20)
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--marks", default="not weekly")
    options.add_argument("--budget", type=float, default=20.0)
    options.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    asked = options.parse_args()
    if "monitoring" not in vars(sys):
        sys.exit("mutants.py needs Python 3.12 or newer: sys.monitoring tells which lines a test executes")
    mutants = draw(asked.package, asked.number, asked.seed)
    session = Session(mutants, asked.budget, asked.jobs, os.dup(1))
    os.chdir(ROOT)
    pytest.main(["-q", "-p", "no:xdist", "-p", "no:cacheprovider", "-m", asked.marks, *asked.tests], [session])
    killed = sum(text.startswith("killed") for text in session.results.values())
    session.say(f"{asked.package}: {killed} of {len(session.results)} mutants killed, seed {asked.seed}")
    return int(len(session.results) < len(mutants))


if __name__ == "__main__":
    sys.exit(main())
