"""The page of ``nutdamp report``, from Python and for the command."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike

from nutdamp import arguments, dispersion
from nutdamp.dispersion.study import Results
from nutdamp.files.output import write_whole
from nutdamp.files.yaml_tree import dotted
from nutdamp.library.calls import compare
from nutdamp.library.craft import Source, load
from nutdamp.library.studies import disperse as fly_cases
from nutdamp.planning import Comparison
from nutdamp.presentation.page.content import Repeat, report_page
from nutdamp.presentation.page.document import Page
from nutdamp.presentation.page.formats import form_of
from nutdamp.schemes import Choice
from nutdamp.spacecraft import Spacecraft


@dataclass(frozen=True, eq=False)
class Report:
    """A page: of what comparison, with which dispersed cases, what it says, and ``content``, what is in its file."""

    comparison: Comparison
    dispersed: Results | None
    page: Page = field(repr=False)
    content: str | bytes = field(repr=False)

    @property
    def verdict(self) -> str:
        """What is on top of the page."""
        return self.page.verdict

    @property
    def good(self) -> bool:
        """Whether nothing is missed."""
        return self.page.good


def report(
    spacecraft: Spacecraft | str | PathLike[str] | Mapping[str, object],
    output: str | PathLike[str] = "report.html",
    names: Sequence[str] = (),
    options: Choice = None,
    *,
    disperse: int | None = None,
    seed: int = dispersion.SEED,
) -> Report:
    """Compare the schemes named, as `compare` does, and write the page of ``nutdamp report``.

    ``spacecraft``: one as `load` gives it, or what `load` takes; ``output``: .html, .md or .pdf; ``disperse``: in how
    many dispersed cases to fly the recommended plan. Raises as `load`, `compare` and `disperse` do, BadRequest for
    another ending, MissingExtra without the extra plot, CannotWrite.
    """
    name = arguments.path("output", output)
    form_of(name)
    body = spacecraft if isinstance(spacecraft, Spacecraft) else load(spacecraft)
    compared = compare(body, names, options)
    cases = None
    if disperse is not None and compared.recommended is not None:
        cases = fly_cases(compared.recommended, disperse, seed=seed).core
    given = {"options": options and f"nutdamp.{options!r}", "disperse": disperse, "seed": disperse and seed}
    more = "".join(f", {key}={value}" for key, value in given.items() if value is not None)
    named = f", {list(names)!r}" if names else ""
    made = made_of(compared, _repeat(body, f"{name!r}{named}{more}"), name, cases)
    write_whole(name, made.content)
    return made


def made_of(
    compared: Comparison, repeat: Repeat, output: str, dispersed: Results | None = None, note: str = ""
) -> Report:
    """The report that goes to ``output``, not yet written; raises as `form_of` does."""
    form = form_of(output)
    page = report_page(compared, repeat, pictured=form.pictured, dispersed=dispersed, note=note)
    return Report(compared, dispersed, page, form.write(page, output))


def _repeat(body: Spacecraft, how: str) -> Repeat:
    """How to make the page again in Python; where fields were replaced, no file says of what."""
    source = body.source
    if not isinstance(source, Source):
        return Repeat(f"nutdamp.report(spacecraft, {how})", "", "", language="python")
    settings = tuple((dotted(one.path), str(one.value)) for one in source.settings)
    return Repeat(f"nutdamp.report({source.name!r}, {how})", source.name, source.text, settings, "python")
