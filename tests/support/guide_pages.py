"""Pages of the guide made from the code: ``python tests/support/guide_pages.py``."""

import re
from collections.abc import Iterator
from typing import NamedTuple

from support.builders import present

from nutdamp.files import fields
from nutdamp.files.keys import SPACECRAFT
from nutdamp.units import KINDS, Kind
from nutdamp.views.guide import FOLDER


class KeyGuide(NamedTuple):
    """A key of the file: its ``path`` as `explain` takes it, such as ``thrusters.force``, and its
    declaration.

    ``section`` is the model of its value, where that is a mapping or a list of mappings.
    """

    path: str
    field: fields.Key
    section: fields.ValueKind | None

    @property
    def parent(self) -> str:
        """Path of the mapping it is in; empty at the root."""
        return self.path.rpartition(".")[0]

    @property
    def name(self) -> str:
        """Last step of the path."""
        return self.path.rpartition(".")[2]

    @property
    def text(self) -> str:
        """Description, unit, default and example."""
        unit = ""
        default = ""
        example = next(iter(self.field.examples), None)
        if self.section is None:
            forms = (part.form for part in self.field.kind.within() if part.form not in PLAIN)
            unit = self.field.kind.form or next(forms, "")
        else:
            unit = self.section.form
        value = self.field.default
        if value is fields.REQUIRED:
            default = "required"
        elif "default" not in self.field.description.casefold():
            default = "optional" if value is None or value == [] else f"default {value:g}"
        facts = [unit, default, "" if example is None else f"example: `{example}`"]
        told = "; ".join(filter(None, facts))
        return f"{self.field.description} {told[:1].upper()}{told[1:]}"


PLAIN = ("", "a text", "a whole number")
"""Forms that are not told of the entries of a list."""


def keys(model: fields.ValueKind = SPACECRAFT, prefix: str = "") -> Iterator[KeyGuide]:
    """All keys of the file, each before those below it."""
    for name, field in model.keys.items():
        section = next((part for part in field.kind.within() if part.keys), None)
        yield KeyGuide(f"{prefix}{name}", field, section)
        if section is not None:
            yield from keys(section, f"{prefix}{name}.")


def _sections(key: KeyGuide, every: list[KeyGuide]) -> Iterator[str]:
    """The keys below ``key``, section by section; those of tolerances, all alike, once."""
    if key.section is None:
        return
    children = [entry for entry in every if entry.parent == key.path]
    about = key.section.about
    yield f"## {key.path}\n\n{about}\n\n{_listed(children)}"
    below = [child for child in children if child.section is not None]
    if below and all(present(child.section).form for child in below):
        alike = [entry for entry in every if entry.parent == below[0].path]
        names = ", ".join(child.name for child in below)
        yield f"## {key.path}: each of {names}\n\n{_listed(alike)}"
        return
    for child in below:
        yield from _sections(child, every)


def _listed(keys: list[KeyGuide]) -> str:
    return "\n".join(f"- **{key.name}**: {key.text}" for key in keys)


BEGIN = """# The spacecraft file

every key of the spacecraft file; file.thrusters, file.limits.tick

A spacecraft file is a YAML file. `nutdamp init` writes one with comments. `nutdamp init --from ace`
writes one of the examples in `configs/`, with its sources; `--list` names them. A short one:

```yaml
name: Sounder-1
inertia: {A: 120 kg m^2, C: 80 kg m^2}       # transverse, axial
state: {spin: 30 rpm, nutation: 5 deg}
thrusters:
  - {name: T1, position: [0, 0.5, 0.8], direction: [1, 0, 0], force: 10 N, isp: 220 s,
     max_on_time: 2 s}
```

1. A value is a number in SI, or a text with a unit: `2`, `2 s`, `30 rpm`.
2. A number that is unlikely in SI, such as a position of 800, gives a warning with the likely
   unit.
3. Each key can also be set by an option: `--set limits.horizon=90s`. Entries of a list have a name
   or a number: `--set thrusters.T1.force=12N`, `--set omega0[2]=3`.
4. Vectors have the axes of the file. Spin axis 3 is the principal axis nearest to its third axis.
   The two are one unless `inertia.tensor` tilts the principal axis."""


def _file() -> str:
    every = list(keys())
    roots = [key for key in every if not key.parent]
    sections = [part for key in roots for part in _sections(key, every)]
    return "\n\n".join([BEGIN, _listed(roots), *sections]) + "\n"


def _line(kind: Kind) -> str:
    """The SI unit first, then the others and their values in it."""
    if not kind.factors:
        return "no unit"
    named = (
        (unit, "" if factor == 1.0 else f" = {factor:.6g} {kind.si}")
        for unit, factor in kind.factors.items()
    )
    others = [f"{unit}{worth}".rstrip() for unit, worth in named if unit != kind.si]
    return "; ".join([kind.si, *others] if kind.si else others)


def pages() -> dict[str, str]:
    """The text of each such page."""
    rows = "".join(
        f"- **{kind.noun.partition(' ')[2]}**: {_line(kind)}\n" for kind in KINDS.values()
    )
    units = re.sub(
        r"(- \*\*.*\n)+", lambda _: rows, (FOLDER / "units.md").read_text(encoding="utf-8")
    )
    return {"file": _file(), "units": units}


if __name__ == "__main__":
    for name, text in pages().items():
        (FOLDER / f"{name}.md").write_text(text, encoding="utf-8")
