"""Everything wrong in a spacecraft file at once: spelling of keys, types and ranges, and what `rules` finds."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, get_args, get_origin

from nutdamp.errors import Fault, FaultyFile, in_order, nearest
from nutdamp.files.dispersion_models import by_name
from nutdamp.files.dispersion_rules import dispersion_findings
from nutdamp.files.facts import MOMENT, Finding
from nutdamp.files.kinds import foreign
from nutdamp.files.models import SpacecraftFile
from nutdamp.files.plausibility import doubts
from nutdamp.files.rules import findings
from nutdamp.files.sections import Problems, Section, section_of
from nutdamp.files.settings import Setting, overlay
from nutdamp.files.thrust_rules import thrust_findings
from nutdamp.files.yaml_tree import KeyPath, Node, dotted, read_tree
from nutdamp.units import shown


def read_contents(
    text: str, name: str, settings: Sequence[Setting] = (), warn: Callable[[Fault], None] = lambda _: None
) -> SpacecraftFile:
    """The checked contents of a spacecraft file with ``settings`` in place of what it says.

    ``warn`` is given what is hardly meant. Raises `FaultyFile` with all faults, sorted by place.
    """
    other = foreign(text.removeprefix("\ufeff"))
    if other is not None:
        raise FaultyFile([Fault(name, 1, 1, "", other)])
    root, faults = read_tree(text, name)
    root, unplaced = overlay(root, settings)
    faults += unplaced
    found = [*_spelling(root, SpacecraftFile, ()), *findings(root), *dispersion_findings(root), *thrust_findings(root)]
    if root.get("loop") is not None:
        from nutdamp.files.loop_rules import loop_findings  # few files have one

        found += loop_findings(root)
    problems: Problems = []
    contents = SpacecraftFile.read(root.plain(), problems)
    judged = {finding.path for finding in found if not finding.at_key}
    found += [Finding(path, problem) for path, problem in problems if path not in judged]
    faults += [_placed(finding, root, name) for finding in found]
    for doubt in in_order(_placed(finding, root, name) for finding in doubts(root)):
        warn(doubt)
    if faults or contents is None:
        raise FaultyFile(faults)
    return contents


def _placed(finding: Finding, root: Node, name: str) -> Fault:
    """The finding with its place; what is missing is reported at the key of its parent."""
    path = finding.path
    if finding.at_key:
        place = root.key_place_of(path)
    elif root.get(*path) is None:
        place = root.key_place_of(path[:-1])
    else:
        place = root.place_of(path)
    return place.fault(name, dotted(path), finding.problem)


def _spelling(node: Node, model: type[Section] | None, path: KeyPath, named: bool = False) -> Iterator[Finding]:
    """Unknown keys and empty values below ``node``, whose keys are the fields of ``model``.

    A misspelt key is put right in the tree, so that one slip makes one fault and what it holds is checked too; any
    other unknown key is dropped, as is one that was set for a key that the file has. ``named``: the keys may also be
    names, of entries of the ``model``.
    """
    fields = model.fields() if model else {}
    named = named and isinstance(node.value, dict) and by_name(node.value)
    if fields and isinstance(node.value, dict) and not named:
        for key in [key for key in node.value if key not in fields]:
            dropped = node.value.pop(key)
            beside = bool(node.keys[key].setting)
            meant = nearest(key, [field for field in fields if beside or field not in node.value])
            cure = f"did you mean {shown(meant)}?" if meant else f"known here: {', '.join(fields)}"
            if meant and meant not in node.value:
                node.value[meant], node.keys[meant] = dropped, node.keys[key]
            elif "tensor" in fields and MOMENT.fullmatch(key):
                cure = "write tensor: [[Ixx, Ixy, Ixz], [Ixy, Iyy, Iyz], [Ixz, Iyz, Izz]], or A and C"
            elif key == "<<":
                cure = "merge keys are of YAML 1.1; write the keys out"
            elif ":" in key:
                cure = "put a space behind the colon"
            yield Finding((*path, key), f"unknown key; {cure}", at_key=True)
    for step, child in node.children():
        annotation = fields[step].type if isinstance(step, str) and fields and not named else model
        if child.value is None:
            cure = "give a value, or leave the key out" if isinstance(step, str) else "expected a value"
            yield Finding((*path, step), f"empty; {cure}")
        below = section_of(annotation) if fields else None
        yield from _spelling(child, below, (*path, step), _holds_names(annotation))


def _holds_names(annotation: Any) -> bool:
    """Whether the type of a field is that of a mapping by names."""
    return get_origin(annotation) is dict or any(map(_holds_names, get_args(annotation)))
