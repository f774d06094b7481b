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
from nutdamp.page.document import (
    UNCONTROLLED,
    Block,
    Control,
    Details,
    Download,
    FactList,
    Listing,
    Moving,
    Page,
    PageSection,
    Picture,
    Points,
    Prose,
    fact_list,
    manoeuvre_blocks,
    sheet,
)
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
from nutdamp.views.check import check_parts
from nutdamp.views.glance import scheme_table
from nutdamp.views.parts import NOTES, block_table, pulse_table
from nutdamp.views.simulation import BUDGET_NOTE, budget_table, conservation, methods_table, verdict
from nutdamp.views.text import WARNING, joined, screen_line, sentence, severity, text
from nutdamp.views.trade import front_notes, front_tables, trade_notes

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup
    from matplotlib.figure import Figure

    from nutdamp.montecarlo.study import Results


ENDINGS = (".html", ".htm")  # endings of the files that a page is written to

# text in which no line may break: an option of a command, a relation with its number and unit, a
# date
WHOLE = re.compile(r"((?<!\S)--?[a-z][\w-]*|[<≤≥] \d\S*(?: deg)?|\d{4}-\d\d-\d\d[\dT:.Z]*)")


def expect_html(path: str) -> None:
    """Refuse a page that cannot be made, or not in this form, before the work; ``-`` is standard
    output.

    Raises BadRequest for an ending other than `ENDINGS`, MissingExtra without Jinja or matplotlib.
    """
    if path != "-" and Path(path).suffix.lower() not in ENDINGS:
        raise BadRequest(
            f"--output {path}: a report is written as HTML (.html); a browser prints that as PDF"
        )
    if find_spec("jinja2") is None:
        raise MissingExtra("plot", "a page")
    require()


def page_html(page: Page) -> str:
    """The whole file. All text of a spacecraft file is escaped; the policy in its head allows no
    other script.
    """
    styles, scripts = ["page.css"], ["page.js"]
    if isinstance(page.motion, Moving):
        styles.append("view.css")
        scripts += ["motion.js", "bench.js", "view.js"]
    folder = files("nutdamp.page")
    style, script = (
        "\n".join(folder.joinpath(name).read_text("utf-8").strip() for name in names)
        for names in (styles, scripts)
    )
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    template = _templates().get_template("page.html")
    return template.render(page=page, style=style, script=script, digest=digest)


def block_html(block: Block) -> str:
    """One block of a page, in a box of its own to scroll in where it may be wide."""
    template = _templates().from_string('{% from "blocks.html" import block %}{{ block(made) }}')
    return template.render(made=block)


@cache
def _templates() -> Environment:
    if find_spec("jinja2") is None:
        raise MissingExtra("plot", "a page")
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
    environment.filters["whole"] = _whole
    return environment


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

    @property
    def file(self) -> str:
        """Name and digest of the input file; empty without one."""
        name = printable(Path(self.name).name)
        return f"{name}, SHA-256 {self.digest}" if self.text else ""


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


SHOWN = 8  # pulses on the first screen; of more the first and the last


def report_page(
    compared: Comparison,
    repeat: Repeat,
    *,
    traded: Sequence[Front] = (),
    control: Control = UNCONTROLLED,
) -> Page:
    """The page; raises MissingExtra without matplotlib. ``traded``: fronts of time against cost."""
    spacecraft, judged, chosen = compared.spacecraft, compared.verdict, compared.recommended
    remarks = glance.notes(compared)
    notes = [text(note) for note in remarks if severity(note) != WARNING]
    warnings = [text(note) for note in remarks if severity(note) == WARNING]
    with work.steps(2.0) as task:  # pictures, and the flights of the verification
        page = Page(
            title=_titled(control.title, spacecraft),
            control=control,
            source=f"input {repeat.digest[:8]}" if repeat.digest else "",
            state=judged.light.value,
            headline=verdicts.headline(judged, compared),
            notes=tuple(notes[:NOTES]),
            made_by=f"nutdamp {__version__}",
            verdict="" if chosen is None else verdicts.statement(judged),
            warnings=tuple(warnings),
        )
        if chosen is not None:
            # Schemes break no limit.
            broken = broken_limits(spacecraft, chosen.pulses) if chosen._from_file else []
            blocks = bool(chosen.pulses.blocks)
            limit, _ = glance.limits(spacecraft)
            fired = sheet(
                block_table(chosen._flight) if blocks else pulse_table(chosen._flight, limit=limit),
                "screen",
                title="Blocks" if blocks else "Pulses",
            )
            few = fired.rows if len(fired.rows) <= SHOWN else (fired.rows[0], fired.rows[-1])
            flown, track = overview.shown(chosen)
            outlines = studies.accepted(flown, judged)
            course = partial(overview.flight_figure, "course", flown, track, judged)
            box = partial(studies.acceptance_figure, judged, compared.others)
            page = replace(
                page,
                broken=tuple(broken),
                state=Light.AMBER.value if broken and judged.light is Light.GREEN else page.state,
                bounds=sheet(verdicts.bound_table(judged)),
                lines=tuple(judged.lines),
                pulses=fired._replace(rows=few),
                count=len(fired.rows),
                facts=fact_list("Final state, after the last pulse", glance.ends(chosen)),
                acceptance=picture("acceptance", box),
                warnings=(*warnings, *broken),
                motion=moving_of(chosen, repeat.craft(built_in=spacecraft.built_in), outlines),
                still=picture("course", partial(course, outlines=outlines)),
            )
        task.reach(1.0)
        sections = tuple(_sections(compared, repeat, page, traded, notes[NOTES:]))
        return replace(page, sections=sections)


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
    return " · ".join(filter(None, (spacecraft.name, ", ".join(aims))))


# Captions and descriptions of the pictures, and whether a title stands above them: those of the
# first screen stand beside its headline.
PICTURES = {
    "course": (
        "Axis track: the spin axis in space, with the places of the angular momentum H; "
        "nutation on a log axis with what is required; the firings of each channel.",
        "Track of the spin axis in space, nutation and firings over time, with numbered pulses",
        False,
    ),
    "acceptance": (
        "A scheme whose point, or whole contour, lies in the grey box keeps both limits. Dashed: "
        "too few cases comply. Schemes far outside are arrows at the edge.",
        "Acceptance box: nutation left against the tightest other limit, one contour a scheme",
        False,
    ),
    "trade": (
        "Each mark is a schedule for one of the end times tried, numbered along each front.",
        "Cost of schedules over the end of the last pulse",
        True,
    ),
    "momentum": (
        "Where H ends in each case, with the ellipse that holds as many cases as must comply.",
        "Scatter of the final angular momentum with ellipse",
        True,
    ),
}


def picture(name: str, draw: Callable[..., Figure]) -> Picture:
    """One of `PICTURES`, with its title as text of the page, and its ``narrow`` drawing for a
    phone.
    """
    caption, described, titled = PICTURES[name]
    figures = [draw(narrow=narrow) for narrow in (False, True)]
    title = str(figures[0].get_label()) if titled else ""
    return Picture(title, caption, *(image.svg(figure, described) for figure in figures))


def _sections(
    compared: Comparison,
    repeat: Repeat,
    page: Page,
    traded: Sequence[Front],
    more_notes: Sequence[str],
) -> Iterator[PageSection]:
    """Sections below the first screen; ``more_notes``: those that have no room on it."""
    from nutdamp.montecarlo.study import Results

    spacecraft, judged, chosen = compared.spacecraft, compared.verdict, compared.recommended
    why = Prose(sentence(joined(reasons(compared))))
    schemes: list[Block] = [why, sheet(scheme_table(compared, chosen))]
    rows = [("", note) for note in more_notes]
    for plan in compared.plans:
        if plan.feasible and plan is not chosen:
            told = (text(note).removeprefix(f"{plan.scheme}: ") for note in plan_notes(plan))
            rows += [(plan.scheme, words) for words in told]
    if rows:
        schemes.append(Details("Notes on the schemes", (Points(tuple(rows)),)))
    yield PageSection("schemes", "Schemes compared", tuple(schemes))
    if chosen is not None:
        yield PageSection("verification", "Verification", tuple(_verification(chosen)))
        if isinstance(judged.results, Results):
            blocks = tuple(_dispersion(chosen, judged, judged.results))
            yield PageSection("dispersion", "Dispersion", blocks)
    if traded:
        blocks = tuple(_trade(compared, traded, repeat.craft(built_in=spacecraft.built_in)))
        yield PageSection("trade", "Time against cost", blocks)
    if chosen is not None:
        title = f"Manoeuvre sheet: {spacecraft.name}, {chosen.scheme}"
        identity = [("document", page.control.line), ("input file", repeat.file)]
        entries = [(name, text) for name, text in identity if text]
        blocks = tuple(manoeuvre_blocks(chosen, judged, entries, page.summary))
        yield PageSection("manoeuvre", title, blocks)
    yield PageSection("background", "Background", tuple(_background(compared, repeat)))


def _verification(chosen: Plan) -> Iterator[Block]:
    known = chosen.options.with_disturbances
    verified = verify(chosen.spacecraft, chosen.pulses, unrounded(chosen), expected=known)
    yield Prose(f"{verdict(verified)} {sentence(text(conservation(verified)))}")
    blocks: list[Block] = [sheet(methods_table(verified), "screen")]
    missing = [(each.name, f"not flown; {each.missing}") for each in verified.methods
               if each.missing]  # fmt: skip
    if missing:
        blocks.append(Points(tuple(missing)))
    budget = sheet(budget_table(chosen.spacecraft, verified), "screen")
    yield Details("Independent flights and error budget", (*blocks, budget, Prose(BUDGET_NOTE)))


def _dispersion(chosen: Plan, judged: Verdict, results: Results) -> Iterator[Block]:
    """Verdict, and the final H of the cases; percentiles, budget and worst cases behind a title."""
    from nutdamp.planning.screening import Dispersion
    from nutdamp.views import dispersion

    study = results.study
    for line in dispersion.verdict_lines(judged, results):
        if isinstance(line, Text):
            yield Prose(line.plain)
    if study.lightening_error:
        yield Prose(f"Note: {study.lightening_error}.")
    dispersed = Dispersion(results, plan=chosen)
    vars(dispersed)["verdict"] = judged
    yield picture("momentum", partial(studies.dispersion_figure, dispersed, "momentum"))
    yield Details(
        "Percentiles, tolerance budget and worst cases",
        (
            Prose(f"{chosen.scheme}; {dispersion.drawn(results)}"),
            *_cases(chosen, results),
        ),
    )


def _cases(chosen: Plan, results: Results) -> Iterator[Block]:
    """Percentiles, the nominal case, tolerance budget and worst cases of a study."""
    from nutdamp.views import dispersion

    study = results.study
    nominal = study.outputs_of({})
    table = dispersion.percentile_table(results, dispersion.FLOWN_OUTPUTS, nominal, alone=True)
    yield sheet(table, "full", title="What is left, by share of the cases")
    if not results.exact:
        yield Prose(dispersion.ACCURACY)
    yield fact_list("Nominal case", glance.end_rows(chosen._flight, chosen._aspects))
    budget, caption = dispersion.budget_of(results)
    if budget is not None:
        yield sheet(budget, "screen")
    yield Prose(caption)
    if budget is not None:
        yield sheet(dispersion.worst_cases(results, 5), "screen")
        inspect = f"nutdamp disperse, as here, with {dispersion.again(results)}"
        yield Prose(f"Inspect one: {inspect}")
    for note in dispersion.unused_notes(study.model.inputs.unused):
        yield Prose(screen_line(note).plain)


def _trade(compared: Comparison, traded: Sequence[Front], craft: str) -> Iterator[Block]:
    spacecraft, chosen = compared.spacecraft, compared.recommended
    if any(len(front.points) > 1 for front in traded):  # one point for each shows no trade
        trade = Trade(spacecraft, tuple(traded), chosen)
        yield picture("trade", partial(studies.trade_figure, trade))
    notes = () if chosen is None else trade_notes(traded, chosen, compared.verdict, craft)
    for note in notes:
        yield Prose(sentence(text(note)))
    for name, reason, table in front_tables(spacecraft, traded):
        if reason or not table.rows:
            yield Prose(": ".join((name, *reason)))
        if table.rows:
            yield sheet(table, "full", title=name)
    yield from map(Prose, front_notes(traded))


# equations of Magnus that every plan and flight rest on, as the guide numbers them
EQUATIONS = ("1", "17", "18", "19")

PACKAGES = {
    "numpy": "numpy",
    "scipy": "scipy",
    "highspy": "highspy",
    "matplotlib": "matplotlib",
    "bsk": "Basilisk",
}  # that numbers and pictures depend on, with their names for people


def _background(compared: Comparison, repeat: Repeat) -> Iterator[Block]:
    spacecraft, judged, chosen = compared.spacecraft, compared.verdict, compared.recommended
    facts, tables, notes = check_parts(spacecraft)
    told = (Prose(screen_line(note).plain) for note in notes)
    sheets = (sheet(table, "screen") for table in tables)
    yield Details("Spacecraft", (fact_list(spacecraft.name, facts), *sheets, *told))
    if chosen is not None:
        ends = fact_list("Final state", glance.final_rows(chosen))
        fired = sheet(pulse_table(chosen._flight, scheme=chosen.scheme))
        yield Details("Pulses and final state, all values", (fired, ends))
    yield Details("Method and symbols", tuple(_method(compared)))
    yield Details("Assumptions", (Points(tuple(("", limit) for limit in assumptions(compared))),))
    versions = [("nutdamp", __version__), ("Python", platform.python_version())]
    for package, name in PACKAGES.items():
        try:
            versions.append((name, version(package)))
        except PackageNotFoundError:
            versions.append((name, "not installed"))
    if judged.cases is not None:
        versions.append(("seed of the dispersed cases", str(judged.cases.seed)))
    if repeat.file:
        versions.append(("input file", repeat.file))
    again: list[Block] = [Listing("Command", printable(repeat.command))]
    again.append(FactList("Versions", tuple(versions)))
    if repeat.settings:
        again.append(FactList("Set in place of what the file says", repeat.settings))
    if repeat.text:
        stem = "spacecraft" if repeat.name == "-" else printable(Path(repeat.name).stem)
        again.append(Download(f"{stem}.yaml", repeat.text))
    yield Details("Input file, and how to repeat the page", tuple(again))


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
    # Of an equation the last formula, which is in use, of a scheme the first one.
    formulas = [(guide.topic_of(number), -1) for number in EQUATIONS]
    lines: list[str] = []
    symbols: dict[str, str] = {}
    if chosen is not None and chosen.scheme in guide.NAMES:
        formulas.append((guide.topic_of(chosen.scheme), 0))
    for topic, which in formulas:
        lines += [f"{topic.name}  {topic.summary}", topic.formulas[which].rstrip("\n"), ""]
    yield Listing("Equations", "\n".join(lines))
    listed = " ".join([*lines, "θ"])
    for topic, which in formulas:  # each symbol once; those of the scheme as its formula has them
        if which:
            symbols |= {name: of for name, of in topic.rows if name.removesuffix(")") in listed}
        else:
            _, rest = topic.text.split(topic.formulas[0])
            symbols[topic.name] = " ".join(rest.partition("\n###")[0].split())
    yield FactList("Symbols", tuple(symbols.items()))
    yield Points((("", guide.SOURCE),))


def _any_of(*schemes: str) -> Callable[[Comparison], bool]:
    return lambda compared: any(plan.scheme in schemes for plan in compared.plans)


# beginnings of the limits of the guide that apply only to some comparisons, and to which
CONDITIONS: dict[str, Callable[[Comparison], bool]] = {
    "The closed forms hold": lambda compared: not compared.spacecraft.inertia.symmetric,
    "Disturbances": lambda compared: bool(compared.spacecraft.disturbances),
    "Energy dissipation": lambda compared: compared.spacecraft.dissipation is not None,
    "`optimal`": _any_of("optimal"),
    "Small angles are magnified": lambda _: False,
    "`two-pulse`": _any_of("two-pulse", "half-cone", "rhumb-line"),
}


def assumptions(compared: Comparison) -> Iterator[str]:
    """Assumptions and limits of the guide that apply here."""
    for limit in guide.limits():
        if all(
            applies(compared) for begin, applies in CONDITIONS.items() if limit.startswith(begin)
        ):
            yield limit.replace("`", "")
