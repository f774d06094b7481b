"""The page of ``report``: its first screen, the sections below, and the one HTML file that they
become.

The file needs nothing else: style, script and pictures are inside, and nothing is asked of a
network.
"""

from __future__ import annotations

import base64
import hashlib
import math
import platform
import re
import shlex
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial
from html import escape
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from rich.console import Group
from rich.text import Text

from nutdamp import __version__
from nutdamp.common import work
from nutdamp.common.numerics import RPM
from nutdamp.errors import BadRequest, MissingExtra, printable
from nutdamp.figures import image, overview, studies
from nutdamp.figures.style import require
from nutdamp.files.reader import Source
from nutdamp.files.yaml import dotted
from nutdamp.flight.verification import verify
from nutdamp.page import document
from nutdamp.page.document import (
    Block,
    Control,
    Details,
    FactList,
    Page,
    PageSection,
    Picture,
    Points,
    Prose,
)
from nutdamp.page.manoeuvre import manoeuvre_blocks
from nutdamp.page.moving import moving_of
from nutdamp.planning.causes import broken_limits
from nutdamp.planning.decision import Comparison
from nutdamp.planning.notes import plan_notes, reasons
from nutdamp.planning.plan import NO_NUTATION, Plan
from nutdamp.planning.simulation import unrounded
from nutdamp.planning.tradeoff import Front, Trade
from nutdamp.planning.verdict import Light, Verdict
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.views import glance, guide
from nutdamp.views import verdict as verdicts
from nutdamp.views.check import check_screen
from nutdamp.views.glance import scheme_table
from nutdamp.views.guide import Topic
from nutdamp.views.parts import NOTES, block_table, pulse_table
from nutdamp.views.simulation import (
    BUDGET_NOTE,
    budget_table,
    conservation,
    methods_table,
    verdict,
)
from nutdamp.views.text import WARNING, joined, sentence, severity, text
from nutdamp.views.trade import front_parts, trade_notes

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup
    from matplotlib.figure import Figure

    from nutdamp.planning.screening import Dispersion


ENDINGS = (".html", ".htm")  # endings of the files that a page is written to


def expect_html(path: str) -> None:
    """Refuse a page that cannot be made, or not in this form, before the work; ``-`` is standard
    output.

    Raises BadRequest for an ending other than `ENDINGS`, MissingExtra without Jinja or matplotlib.
    """
    if path != "-" and Path(path).suffix.lower() not in ENDINGS:
        raise BadRequest(
            f"--output {path}: a report is written as HTML (.html); a browser prints that as PDF"
        )
    _require_jinja()
    require()


def _require_jinja() -> None:
    if find_spec("jinja2") is None:
        raise MissingExtra("plot", "a page")


def page_html(page: Page) -> str:
    """The whole file. All text of a spacecraft file is escaped; the policy in its head allows no
    other script.
    """
    moves = isinstance(page.motion, document.Moving)
    style, script = (
        "\n".join(
            files("nutdamp.page").joinpath(name).read_text("utf-8").strip()
            for name in (first, *views * moves)
        )
        for first, views in (
            ("page.css", ["view.css"]),
            ("page.js", ["motion.js", "bench.js", "view.js"]),
        )
    )
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    return (
        _templates()
        .get_template("page.html")
        .render(page=page, style=style, script=script, digest=digest)
    )


def block_html(block: Block) -> str:
    """One block of a page, in a box of its own to scroll in where it may be wide."""
    return (
        _templates()
        .from_string('{% from "blocks.html" import block %}{{ block(made) }}')
        .render(made=block)
    )


@cache
def _templates() -> Environment:
    _require_jinja()
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("nutdamp", "page"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    # Text within a string of a style sheet: all but letters and digits by their numbers.
    environment.filters["css"] = lambda text: re.sub(
        "[^A-Za-z0-9]", lambda char: f"\\{ord(char[0]):x} ", text
    )
    environment.filters.update(whole=_whole, number=document.number_in)
    return environment


WHOLE = re.compile(r"((?<!\S)--?[a-z][\w-]*|[<≤≥] \d\S*(?: deg)?|\d{4}-\d\d-\d\d[\dT:.Z]*)")
"""Text in which no line may break: an option of a command, a relation with its number and unit, a
date.
"""


def _whole(text: str) -> Markup:
    """Text in which options of commands and relations stay in one line."""
    from markupsafe import Markup

    parts = [escape(part) for part in WHOLE.split(text)]
    parts[1::2] = [f'<span class="whole-word">{part}</span>' for part in parts[1::2]]
    return Markup("".join(parts))


@dataclass(frozen=True, eq=False)
class Report:
    """The report page: its comparison, the page itself, and ``content``, the text of its file."""

    comparison: Comparison
    page: Page = field(repr=False)
    content: str = field(repr=False)

    @property
    def verdict(self) -> Verdict:
        """Judgement of the plan of the page."""
        return self.comparison.verdict

    @property
    def summary(self) -> str:
        """Headline, verdict and warnings at the top of the page."""
        return self.page.summary

    @property
    def good(self) -> bool:
        """True where nothing is missed, whether required or not."""
        return self.verdict.good and not self.page.broken


def made_of(
    compared: Comparison, repeat: Repeat, control: Control, traded: Sequence[Front] = ()
) -> Report:
    """The report, not yet written. Raises MissingExtra without the extra plot."""
    page = report_page(compared, repeat, traded=traded, control=control)
    return Report(compared, page, page_html(page))


class Repeat(NamedTuple):
    """Data to make the page again: the command, and the input file by name and text.

    ``settings``: keys that the command sets in place of those in the file, and their values;
    ``goal``: its options of the goal.
    """

    command: str
    name: str
    text: str
    settings: tuple[tuple[str, str], ...] = ()
    goal: tuple[str, ...] = ()

    def craft(self, *, built_in: bool = False) -> str:
        """Words of a command for the spacecraft: none for the built-in one, SPACECRAFT where no
        file has it.
        """
        if not built_in and not Path(self.name).is_file():
            return "SPACECRAFT"
        keys = (f"--set={key}={value}" for key, value in self.settings)
        words = [*keys, *self.goal] if built_in else [self.name, *keys, *self.goal]
        return printable(shlex.join(words))

    @property
    def digest(self) -> str:
        """SHA-256 of the input file; empty without one."""
        return hashlib.sha256(self.text.encode()).hexdigest() if self.text else ""


def called(spacecraft: Spacecraft, how: str) -> Repeat:
    """The call in Python that makes a page again; where fields were replaced, no file stands for
    the spacecraft.
    """
    if isinstance(spacecraft.source, Source):
        return repeated(f"nutdamp.report({spacecraft.source.name!r}, {how})", spacecraft.source)
    return Repeat(f"nutdamp.report(spacecraft, {how})", "", "")


def repeated(command: str, source: Source, goal: tuple[str, ...] = ()) -> Repeat:
    """The command or call that makes a page again from a file."""
    settings = tuple((dotted(setting.path), str(setting.value)) for setting in source.settings)
    return Repeat(command, source.name, source.text, settings, goal)


def report_page(
    compared: Comparison,
    repeat: Repeat,
    *,
    traded: Sequence[Front] = (),
    control: Control = document.UNCONTROLLED,
) -> Page:
    """The page; raises MissingExtra without matplotlib. ``traded``: fronts of time against cost."""
    spacecraft, judged, chosen = compared.spacecraft, compared.verdict, compared.recommended
    lead, about = verdicts.headline(judged, compared)
    remarks = glance.notes(compared)
    notes = [text(note) for note in remarks if severity(note) != WARNING]
    warnings = [text(note) for note in remarks if severity(note) == WARNING]
    with work.steps(2.0) as task:  # pictures, and the flights of the verification
        page = Page(
            title=_titled(control.title, spacecraft),
            control=control,
            source=f"input {repeat.digest[:8]}" if repeat.digest else "",
            state=judged.light.value,
            headline=(lead, about),
            notes=tuple(notes[:NOTES]),
            made_by=f"nutdamp {__version__}",
            verdict="" if chosen is None else verdicts.statement(judged),
            warnings=tuple(warnings),
        )
        if chosen is not None:
            broken = (
                broken_limits(spacecraft, chosen.pulses) if chosen._from_file else []
            )  # schemes break none
            page = replace(
                page,
                broken=tuple(broken),
                state=Light.AMBER.value if broken and judged.light is Light.GREEN else page.state,
                bounds=document.sheet(verdicts.bound_table(judged)),
                lines=tuple(judged.lines),
                pulses=_fired(chosen),
                count=len(chosen.pulses.blocks) or len(chosen.pulses),
                facts=document.facts_of("Final state, after the last pulse", glance.ends(chosen)),
                acceptance=acceptance_picture(compared),
                warnings=(*warnings, *broken),
                motion=moving_of(
                    chosen,
                    repeat.craft(built_in=spacecraft.built_in),
                    studies.accepted(chosen._flight, judged),
                ),
                still=flight_picture(chosen, judged),
            )
        task.reach(1.0)
        sections = _sections(compared, judged, repeat, page, traded, notes[NOTES:])
        return replace(page, sections=tuple(sections))


SHOWN = 8  # pulses on the first screen; of more the first and the last


def _fired(chosen: Plan) -> document.Sheet:
    """Pulses of the first screen, or command blocks."""
    limit = glance.limits(chosen.spacecraft)[0]
    blocks = bool(chosen.pulses.blocks)
    table = block_table(chosen._flight) if blocks else pulse_table(chosen._flight, limit=limit)
    shown = document.sheet(table, "screen")._replace(title="Blocks" if blocks else "Pulses")
    if len(shown.rows) <= SHOWN:
        return shown
    return shown._replace(rows=(shown.rows[0], shown.rows[-1]))


def _sections(
    compared: Comparison,
    judged: Verdict,
    repeat: Repeat,
    page: Page,
    traded: Sequence[Front],
    more_notes: Sequence[str],
) -> Iterator[PageSection]:
    """Sections below the first screen."""
    chosen = compared.recommended
    dispersed = _cases_of(compared)
    yield PageSection("schemes", "Schemes compared", tuple(_schemes(compared, more_notes)))
    if chosen is not None:
        yield PageSection("verification", "Verification", tuple(_verification(chosen)))
    if dispersed is not None:
        yield PageSection("dispersion", "Dispersion", tuple(_dispersion(dispersed)))
    if traded:
        craft = repeat.craft(built_in=compared.spacecraft.built_in)
        yield PageSection("trade", "Time against cost", tuple(_trade(compared, traded, craft)))
    if chosen is not None:
        title = f"Manoeuvre sheet: {compared.spacecraft.name}, {chosen.scheme}"
        identity = [("document", page.control.line), ("input file", _file_line(repeat))]
        entries = [(name, text) for name, text in identity if text]
        blocks = manoeuvre_blocks(chosen, judged, entries, page.summary)
        yield PageSection("manoeuvre", title, tuple(blocks))
    yield PageSection("background", "Background", tuple(_background(compared, judged, repeat)))


def _cases_of(compared: Comparison) -> Dispersion | None:
    """Dispersed cases of the plan of the page; None where they were not flown."""
    from nutdamp.montecarlo.study import Results
    from nutdamp.planning.screening import Dispersion

    judged, chosen = compared.verdict, compared.recommended
    if chosen is None or not isinstance(judged.results, Results):
        return None
    dispersion = Dispersion(judged.results, plan=chosen)
    vars(dispersion)["verdict"] = judged
    return dispersion


def _titled(title: str, spacecraft: Spacecraft) -> str:
    """Title of the page, which names the spacecraft whatever ``title`` is given."""
    if title:
        return title if spacecraft.name in title else f"{spacecraft.name} · {title}"
    aims = []
    if spacecraft.tilt > NO_NUTATION:
        aims.append(f"damp {math.degrees(spacecraft.tilt):.4g}° nutation")
    if spacecraft.goal.axis is not None:
        aims.append(f"turn by {math.degrees(spacecraft.to_turn):.4g}°")
    if spacecraft.goal.spin is not None:
        aims.append(f"spin at {RPM * spacecraft.goal.spin:.4g} rpm")
    if spacecraft.built_in:
        aims.append("built-in example")
    return " · ".join([spacecraft.name, ", ".join(aims)]) if aims else spacecraft.name


def _dispersion(dispersed: Dispersion) -> Iterator[Block]:
    """Verdict, and the final H of the cases; percentiles, budget and worst cases behind a title."""
    from nutdamp.views.dispersion import dispersion_screen, verdict_lines

    judged, results = dispersed.verdict, dispersed.core
    told = [line for line in verdict_lines(judged, results) if isinstance(line, Text)]
    lines = [Prose(document.plain(line)) for line in told]
    note = results.study.lightening_error
    lines += [Prose(f"Note: {note}.")] if note else []
    required = document.sheet(verdicts.bound_table(judged))
    yield from lines
    yield dispersion_picture(dispersed)
    rest = [
        block
        for block in document.blocks_of(
            "What is left, by share of the cases", dispersion_screen(dispersed, worst=5)
        )
        if block not in lines and getattr(block, "rows", ()) != required.rows
    ]
    yield Details("Percentiles, tolerance budget and worst cases", tuple(rest))


def _schemes(compared: Comparison, more_notes: Sequence[str]) -> Iterator[Block]:
    """The comparison with the reason of the recommendation, and remarks that have no room on the
    first screen.
    """
    yield Prose(sentence(joined(reasons(compared))))
    chosen = compared.recommended
    yield document.sheet(scheme_table(compared, chosen))
    rows = [("", note) for note in more_notes]
    for plan in compared.plans:
        if plan.feasible and plan is not chosen:
            told = (text(note).removeprefix(f"{plan.scheme}: ") for note in plan_notes(plan))
            rows += [(plan.scheme, words) for words in told]
    if rows:
        yield Details("Notes on the schemes", (Points(tuple(rows)),))


def _trade(compared: Comparison, traded: Sequence[Front], craft: str) -> Iterator[Block]:
    if any(len(front.points) > 1 for front in traded):  # one point for each shows no trade
        yield trade_picture(compared, traded)
    chosen = compared.recommended
    notes = () if chosen is None else trade_notes(traded, chosen, compared.verdict, craft)
    yield from (Prose(sentence(text(note))) for note in notes)
    yield from document.blocks_of(
        "Schedules by their ends", Group(*front_parts(compared.spacecraft, traded))
    )


def _verification(chosen: Plan) -> Iterator[Block]:
    spacecraft = chosen.spacecraft
    verified = verify(
        spacecraft, chosen.pulses, unrounded(chosen), expected=chosen.options.with_disturbances
    )
    yield Prose(f"{verdict(verified)} {sentence(text(conservation(verified)))}")
    blocks: list[Block] = [document.sheet(methods_table(verified), "screen")]
    missing = [
        (method.name, f"not flown; {method.missing}")
        for method in verified.methods
        if method.missing
    ]
    if missing:
        blocks.append(Points(tuple(missing)))
    budget = budget_table(spacecraft, verified)
    blocks += [document.sheet(budget, "screen"), Prose(BUDGET_NOTE)]
    yield Details("Independent flights and error budget", tuple(blocks))


def _background(compared: Comparison, judged: Verdict, repeat: Repeat) -> Iterator[Block]:
    spacecraft = compared.spacecraft
    yield Details(
        "Spacecraft",
        tuple(document.blocks_of("What actuators and tolerances do", check_screen(spacecraft))),
    )
    chosen = compared.recommended
    if chosen is not None:
        ends = document.facts_of("Final state", glance.end_facts(chosen))
        fired = pulse_table(chosen._flight, scheme=chosen.scheme)
        yield Details("Pulses and final state, all values", (document.sheet(fired), ends))
    yield Details("Method and symbols", tuple(_method(compared)))
    yield Details("Assumptions", (Points(tuple(("", limit) for limit in assumptions(compared))),))
    yield Details("Input file, and how to repeat the page", tuple(_repeat(repeat, judged)))


def _file_line(repeat: Repeat) -> str:
    """Name and digest of the input file; empty without one."""
    return f"{printable(Path(repeat.name).name)}, SHA-256 {repeat.digest}" if repeat.text else ""


def _repeat(repeat: Repeat, judged: Verdict) -> Iterator[Block]:
    yield document.Listing("Command", printable(repeat.command))
    facts = (
        [] if judged.cases is None else [("seed of the dispersed cases", str(judged.cases.seed))]
    )
    facts += [("input file", _file_line(repeat))] if repeat.text else []
    yield FactList("Versions", (*_versions(), *facts))
    if repeat.settings:
        yield FactList("Set in place of what the file says", repeat.settings)
    if repeat.text:
        stem = "spacecraft" if repeat.name == "-" else printable(Path(repeat.name).stem)
        yield document.Download(f"{stem}.yaml", repeat.text)


def _versions() -> Iterator[tuple[str, str]]:
    """Versions of the packages that numbers and pictures depend on."""
    yield "nutdamp", __version__
    yield "Python", platform.python_version()
    packages = {
        "numpy": "numpy",
        "scipy": "scipy",
        "highspy": "highspy",
        "matplotlib": "matplotlib",
        "bsk": "Basilisk",
    }
    for package, name in packages.items():
        try:
            yield name, version(package)
        except PackageNotFoundError:
            yield name, "not installed"


PICTURES = {
    "course": (
        "Axis track: the spin axis in space, with the places of the angular momentum H; "
        "nutation on a log axis with what is required; the firings of each channel.",
        "Track of the spin axis in space, nutation and firings over time, with numbered pulses",
    ),
    "acceptance": (
        "A scheme whose point, or whole contour, lies in the grey box keeps both limits. Dashed: "
        "too few cases comply. Schemes far outside are arrows at the edge.",
        "Acceptance box: nutation left against the tightest other limit, one contour a scheme",
    ),
    "trade": (
        "Each mark is a schedule for one of the end times tried, numbered along each front.",
        "Cost of schedules over the end of the last pulse",
    ),
    "momentum": (
        "Where H ends in each case, with the ellipse that holds as many cases as must comply.",
        "Scatter of the final angular momentum with ellipse",
    ),
}
"""Captions and descriptions of the pictures."""


FIRST = ("course", "acceptance")  # pictures of the first screen


def flight_picture(plan: Plan, judged: Verdict) -> Picture:
    """Axis track and history of a plan, from its flight through the real widths; raises
    MissingExtra.
    """
    flown, track = overview.shown(plan)
    outlines = studies.accepted(flown, judged)
    draw = partial(overview.flight_figure, "course", flown, track, judged, outlines=outlines)
    return _picture("course", draw)


def acceptance_picture(compared: Comparison) -> Picture:
    """Schemes beside the limits; raises MissingExtra."""
    draw = partial(studies.acceptance_figure, compared.verdict, compared.others)
    return _picture("acceptance", draw)


def trade_picture(compared: Comparison, fronts: Sequence[Front]) -> Picture:
    """Time against cost, with the recommended plan among the schedules of the fronts; raises
    MissingExtra.
    """
    traded = Trade(compared.spacecraft, tuple(fronts), compared.recommended)
    return _picture("trade", partial(studies.trade_figure, traded))


def dispersion_picture(dispersed: Dispersion) -> Picture:
    """Final directions of H in the cases of a study; raises MissingExtra."""
    return _picture("momentum", partial(studies.dispersion_figure, dispersed, "momentum"))


def _picture(name: str, draw: Callable[..., Figure]) -> Picture:
    """A picture with its title as text of the page, and the ``narrow`` drawing for a phone; those
    of the first screen stand beside its headline and have no other.
    """
    figures = [draw(narrow=narrow) for narrow in (False, True)]
    title = "" if name in FIRST else str(figures[0].get_label())
    caption, described = PICTURES[name]
    return Picture(title, caption, *(image.svg(figure, described) for figure in figures))


EQUATIONS = (
    "1",
    "17",
    "18",
    "19",
)  # equations of Magnus that every plan and flight rest on, as the guide numbers them


def _method(compared: Comparison) -> Iterator[Block]:
    """A paragraph on the method, the equations used with their symbols, the sources."""
    inertia = compared.spacecraft.inertia
    moves = "; with I1 ≠ I2 the true tensor moves freely in between"
    unequal = "" if inertia.symmetric else moves
    holds = " With the wheel H3 = Cω3 + h stands for the Cω3 below, and ω3 - H3/A for aω3."
    wheel = holds if inertia.wheel else ""
    yield Prose(
        "Schemes plan on the nominal values of the input file "
        f"({', '.join(plan.scheme for plan in compared.plans)}). "
        "Each schedule is then flown: Euler's equations with the true principal moments are "
        "integrated through the "
        "real pulse widths by Taylor series, coasts of symmetric bodies as exact arcs. "
        "Recommendation, requirement and "
        "verdict go by that flight. By M(17), the impulse sum, "
        "each pulse acts at its centre with its effective "
        f"impulse{unequal}.{wheel}"
    )
    chosen = compared.recommended
    topics = [guide.topic_of(number) for number in EQUATIONS]
    scheme = (
        guide.topic_of(chosen.scheme)
        if chosen is not None and chosen.scheme in guide.NAMES
        else None
    )
    formulas = [(topic, -1) for topic in topics]  # of an equation the last one, which is in use
    formulas += [] if scheme is None else [(scheme, 0)]
    lines: list[str] = []
    for topic, which in formulas:
        lines += [f"{topic.name}  {topic.summary}", topic.formulas[which].rstrip("\n"), ""]
    yield document.Listing("Equations", "\n".join(lines))
    yield FactList("Symbols", tuple(_symbols(topics, scheme, " ".join([*lines, "θ"]))))
    yield Points((("", guide.SOURCE),))


def _symbols(
    topics: Sequence[Topic], scheme: Topic | None, listed: str
) -> Iterator[tuple[str, str]]:
    """Each symbol of the equations that are ``listed`` once, and those of the formula of the
    scheme, as it has them.
    """
    rows = (row for topic in topics for row in topic.rows)
    yield from {symbol: text for symbol, text in rows if symbol.removesuffix(")") in listed}.items()
    if scheme is not None:
        _, rest = scheme.text.split(scheme.formulas[0])
        yield scheme.name, " ".join(rest.partition("\n###")[0].split())


def _any_of(*schemes: str) -> Callable[[Comparison], bool]:
    return lambda compared: any(plan.scheme in schemes for plan in compared.plans)


CONDITIONS: dict[str, Callable[[Comparison], bool]] = {
    "The closed forms hold": lambda compared: not compared.spacecraft.inertia.symmetric,
    "Disturbances": lambda compared: bool(compared.spacecraft.disturbances),
    "Energy dissipation": lambda compared: compared.spacecraft.dissipation is not None,
    "`optimal`": _any_of("optimal"),
    "Small angles are magnified": lambda _: False,
    "`two-pulse`": _any_of("two-pulse", "half-cone", "rhumb-line"),
}
"""Beginnings of the limits of the guide that apply only to some comparisons, and to which."""


def assumptions(compared: Comparison) -> Iterator[str]:
    """Assumptions and limits of the guide that apply here."""
    for limit in guide.limits():
        if all(
            applies(compared) for begin, applies in CONDITIONS.items() if limit.startswith(begin)
        ):
            yield limit.replace("`", "")
