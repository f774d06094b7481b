"""The page of ``nutdamp report``, from Python and for the command."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from os import PathLike

from nutdamp import arguments
from nutdamp.comparison import Comparison
from nutdamp.dispersion.study import Results
from nutdamp.errors import BadRequest
from nutdamp.files.output import write_whole
from nutdamp.files.yaml_tree import dotted
from nutdamp.fronts import Front
from nutdamp.library.calls import compare
from nutdamp.library.craft import Source, load
from nutdamp.library.studies import trade
from nutdamp.presentation.page.content import Repeat, report_page
from nutdamp.presentation.page.document import UNCONTROLLED, Control, Page
from nutdamp.presentation.page.html import expect_html, page_html
from nutdamp.schemes import Choice, Options
from nutdamp.spacecraft import Spacecraft


@dataclass(frozen=True, eq=False)
class Report:
    """A page: of what comparison, with which dispersed cases, what it says, and ``content``, what is in its file."""

    comparison: Comparison
    dispersed: Results | None
    page: Page = field(repr=False)
    content: str = field(repr=False)

    @property
    def verdict(self) -> str:
        """What is on top of the page."""
        return self.page.verdict

    @property
    def met(self) -> bool | None:
        """Whether the requirement is met; None where nothing is required, and without a feasible plan."""
        return self.page.met

    @property
    def good(self) -> bool:
        """Whether nothing is missed, what is not required either."""
        return self.page.good


def report(
    spacecraft: Spacecraft | str | PathLike[str] | Mapping[str, object],
    output: str | PathLike[str] = "report.html",
    names: Sequence[str] = (),
    options: Choice = None,
    *,
    disperse: int | None = None,
    points: int | None = None,
    **control: str,
) -> Report:
    """Compare the schemes named, as `compare` does, and write the page of ``nutdamp report``.

    ``spacecraft``: one as `load` gives it, or what `load` takes; ``output``: an HTML file; ``disperse``: in how many
    dispersed cases to fly the plans, as ``samples`` of `compare`; ``points``: how many horizons to try for each front
    of time against cost, none by default; ``control``: title, document, issue, author, date, as `controlled` takes
    them. Raises as `load` and `compare` do, BadRequest for another ending, MissingExtra without the extra plot,
    CannotWrite.
    """
    name, kept = arguments.path("output", output), controlled(**control)
    expect_html(name)
    body = spacecraft if isinstance(spacecraft, Spacecraft) else load(spacecraft)
    samples = disperse if disperse in (None, 0) else arguments.count("disperse", disperse)
    compared = compare(body, names, options, samples=samples)
    known = isinstance(options, Options) and options.with_disturbances
    fronts = () if points is None else trade(body, points, with_disturbances=known).fronts
    given = {"options": options and f"nutdamp.{options!r}", "disperse": disperse}
    given["points"] = points
    given |= {key: repr(value) for key, value in control.items()}
    more = "".join(f", {key}={value}" for key, value in given.items() if value is not None)
    named = f", {list(names)!r}" if names else ""
    made = made_of(compared, _repeat(body, f"{name!r}{named}{more}"), kept, fronts)
    write_whole(name, made.content)
    return made


def controlled(**given: str) -> Control:
    """What configuration control writes on a page; without a date that of SOURCE_DATE_EPOCH, where it is set.

    Raises BadRequest for other names, and for a SOURCE_DATE_EPOCH that is no number of seconds.
    """
    unknown = sorted(set(given) - set(Control._fields))
    if unknown:
        raise BadRequest(f"{unknown[0]}: expected one of {', '.join(Control._fields)}")
    control, epoch = Control(**given), os.environ.get("SOURCE_DATE_EPOCH", "")
    if control.date or not epoch:
        return control
    try:
        return control._replace(date=datetime.fromtimestamp(int(epoch), UTC).date().isoformat())
    except (ValueError, OverflowError, OSError):
        raise BadRequest(f"SOURCE_DATE_EPOCH = {epoch!r}: expected a number of seconds since 1970") from None


def made_of(
    compared: Comparison, repeat: Repeat, control: Control = UNCONTROLLED, traded: Sequence[Front] = ()
) -> Report:
    """The report, not yet written. Raises MissingExtra without the extra plot."""
    chosen = compared.recommended
    page = report_page(compared, repeat, traded=traded, control=control)
    return Report(compared, None if chosen is None else compared.results(chosen), page, page_html(page))


def _repeat(body: Spacecraft, how: str) -> Repeat:
    """How to make the page again in Python; where fields were replaced, no file says of what."""
    source = body.source
    if not isinstance(source, Source):
        return Repeat(f"nutdamp.report(spacecraft, {how})", "", "")
    settings = tuple((dotted(one.path), str(one.value)) for one in source.settings)
    return Repeat(f"nutdamp.report({source.name!r}, {how})", source.name, source.text, settings)
