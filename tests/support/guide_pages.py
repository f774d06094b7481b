"""Pages and lists of the guide that are made from the code: ``python tests/support/guide_pages.py`` writes them."""

from __future__ import annotations

import re
from collections.abc import Iterator

from nutdamp.units import KINDS, Kind
from nutdamp.views.explain import file_topic
from nutdamp.views.guide import FOLDER, Topic, TopicRows


def markdown(title: str, summary: str, topic: Topic) -> str:
    """A topic as a page; names of keys are anchors of their sections."""
    return "\n\n".join([f"# {title}", summary, *_parts(topic)]) + "\n"


def _parts(topic: Topic) -> Iterator[str]:
    for part in topic.parts:
        if part.title == "See also":
            continue
        if part.title:
            yield f"## {part.title}"
        for block in part.blocks:
            if isinstance(block, TopicRows):
                yield "\n".join(f"- **{name}**: {_listed(text)}" for name, text in block.rows)
            else:
                yield str(block)


def _listed(text: str) -> str:
    """Description and facts on one line, an example as code."""
    description, _, facts = text.partition("\n")
    before, example, value = facts.partition("example: ")
    return " ".join(filter(None, [description, f"{before}{example}`{value}`" if example else before]))


BEGIN = """`nutdamp init` writes one with comments, `nutdamp init --from ace` one of the
examples in `configs/`, each with its sources (`--list` names them):

```yaml
name: Sounder-1
inertia: {A: 120 kg m^2, C: 80 kg m^2}       # transverse, axial
state: {spin: 30 rpm, nutation: 5 deg}
thrusters:
  - {name: T1, position: [0, 0.5, 0.8], direction: [1, 0, 0], force: 10 N, isp: 220 s, max_on_time: 2 s}
```

A number that is unlikely in SI, such as a position of 800, is accepted with a warning that names the likely unit."""


def _line(kind: Kind) -> str:
    """The SI unit first, then the others and their values in it."""
    if not kind.factors:
        return "no unit"
    named = ((unit, "" if factor == 1.0 else f" = {factor:.6g} {kind.si}") for unit, factor in kind.factors.items())
    others = [f"{unit}{worth}".rstrip() for unit, worth in named if unit != kind.si]
    return "; ".join([kind.si, *others] if kind.si else others)


def pages() -> dict[str, str]:
    """The text of each such page."""
    file = markdown(
        "The spacecraft file", "every key of the spacecraft file; file.thrusters, file.limits.tick", file_topic()
    )
    title, summary, rest = file.split("\n\n", 2)
    rows = "".join(f"- **{kind.noun.partition(' ')[2]}**: {_line(kind)}\n" for kind in KINDS.values())
    units = re.sub(r"(- \*\*.*\n)+", lambda _: rows, (FOLDER / "units.md").read_text(encoding="utf-8"))
    return {"file": "\n\n".join([title, summary, BEGIN, rest]), "units": units}


if __name__ == "__main__":
    for name, text in pages().items():
        (FOLDER / f"{name}.md").write_text(text, encoding="utf-8")
