"""The contents of the page of ``report``: spacecraft, schemes, schedule, pictures, error budget, repetition."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Iterator, Sequence
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, NamedTuple

from rich.console import Group

from nutdamp import __version__
from nutdamp.errors import listed, printable
from nutdamp.files.reader import Source
from nutdamp.files.yaml import dotted
from nutdamp.flight.end_state import Aspect
from nutdamp.flight.verification import verify
from nutdamp.page.craft import ends_note, ends_sheet, spacecraft_blocks
from nutdamp.page.document import (
    UNCONTROLLED,
    Block,
    Control,
    FactList,
    Figure,
    Listing,
    Page,
    PageSection,
    Prose,
    Remarks,
    blocks_of,
    sheet,
    sheet_of,
)
from nutdamp.page.manoeuvre import manoeuvre_section
from nutdamp.page.method import assumption_blocks, checks_sheet, method_blocks
from nutdamp.page.moving import moving_of
from nutdamp.page.pictures import dispersion_pictures_of, pictures_of, trade_picture_of
from nutdamp.page.sheets import aspects_sheet
from nutdamp.planning.decision import Comparison, Decision, broken_limits, decide, notes_on
from nutdamp.planning.plan import Plan, unrounded
from nutdamp.planning.recommendation import Gain, Standing
from nutdamp.planning.tradeoff import Front
from nutdamp.schemes import catalogue
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.views import decisions, verdicts
from nutdamp.views.end_tables import bounds_text, direction_text, lasting, spin_text, target_text
from nutdamp.views.pulses import pulse_table
from nutdamp.views.schemes import scheme_table
from nutdamp.views.text import degrees, sentence
from nutdamp.views.trade_tables import apart, beats, front_parts, outdone
from nutdamp.views.verify_tables import BUDGET, budget_note, budget_table, conservation, methods_table, verdict

if TYPE_CHECKING:
    from nutdamp.montecarlo.study import Results


class Repeat(NamedTuple):
    """Data to make the page again: the command, and the input file by name and text.

    ``settings``: keys that the command sets in place of those in the file, and their values.
    """

    command: str
    name: str
    text: str
    settings: tuple[tuple[str, str], ...] = ()


def called(body: Spacecraft, how: str) -> Repeat:
    """The call in Python that makes a page again; where fields were replaced, no file stands for the spacecraft."""
    if not isinstance(body.source, Source):
        return Repeat(f"nutdamp.report(spacecraft, {how})", "", "")
    return repeated(f"nutdamp.report({body.source.name!r}, {how})", body.source)


def repeated(command: str, source: Source) -> Repeat:
    """The command or call that makes a page again from a file."""
    settings = tuple((dotted(setting.path), str(setting.value)) for setting in source.settings)
    return Repeat(command, source.name, source.text, settings)


def report_page(
    compared: Comparison,
    repeat: Repeat,
    *,
    traded: Sequence[Front] = (),
    control: Control = UNCONTROLLED,
) -> Page:
    """The page; raises MissingExtra without matplotlib. ``traded``: fronts of time against cost."""
    body, decided = compared.spacecraft, decide(compared)
    sections = [
        PageSection("spacecraft", "Spacecraft", tuple(spacecraft_blocks(body))),
        PageSection("method", "Method", tuple(method_blocks(compared))),
        _schemes(compared),
    ]
    if traded:
        sections.append(_trade(compared, traded))
    dispersed: Results | None = None
    if decided is not None:
        chosen = decided.plan
        sections.append(_schedule(chosen))
        dispersed = compared.results(chosen)
        sections.append(manoeuvre_section(chosen, dispersed))
        sections.append(PageSection("pictures", "Pictures", (moving_of(chosen), *pictures_of(chosen))))
        sections.append(_verification(chosen))
        if dispersed is not None:
            sections.append(_dispersion(chosen, dispersed))
    sections.append(PageSection("assumptions", "Assumptions and limits", tuple(assumption_blocks())))
    return Page(
        title=control.title or _title(body),
        control=control,
        verdict=_verdict(compared, decided, traded),
        met=None if decided is None else decided.met,
        good=decided is not None
        and decided.met is not False
        and decided.plan.standing is Standing.COMPLIES
        and decided.plan.commandable
        and not _broken(decided.plan),
        decision=() if decided is None else tuple(_decision(decided)),
        figures=tuple(_unplanned(body) if decided is None else _figures(decided)),
        sections=(*sections, _repeat(repeat, dispersed)),
        made_by=f"Made by nutdamp {__version__}.",
    )


def _title(body: Spacecraft) -> str:
    """Title of the page: the task."""
    turn = "" if body.goal.axis is None else f" and turning the spin axis by {degrees(body.to_turn)}"
    return f"{body.name}: damping {degrees(body.tilt)} of nutation{turn}"


def _verdict(compared: Comparison, decided: Decision | None, traded: Sequence[Front]) -> str:
    reason = verdicts.reason(compared)
    if decided is None:
        return f"No recommendation: {reason}. “Schemes compared” says why, and what would help."
    recommended = f"Recommended: {decided.plan.scheme} – {reason}."
    schedule = f"Schedule of the file {decided.plan.scheme}, as it is."
    recommendation = f"{decisions.statement(decided)} {schedule if decided.plan.from_file else recommended}"
    needless = verdicts.needless(compared)
    nothing = [] if needless is None else [f"no pulse is needed: {needless}"]
    others = map(compared.recommendation.alternatives.get, (Gain.REAL, Gain.COMMANDED))
    fired = [verdicts.hint(compared, entry) for entry in dict.fromkeys(others) if entry is not None]
    notes = [sentence(note.removesuffix(".")) for note in (*nothing, *decisions.notes(decided), *fired)]
    notes += map(sentence, _broken(decided.plan))
    notes += filter(None, [outdone(traded, decided.plan)])
    return " ".join((recommendation, *notes, *verdicts.warnings(compared, beside_verdict=True)))


def _decision(decided: Decision) -> Iterator[Block]:
    """The parts of the requirement with their margins, and the directions that are watched."""
    cases = decided.cases
    how = "nominal values" if cases is None else f"nominal values, and in {cases.samples:,} dispersed cases"
    when = lasting(decided.flight)
    title = f"The requirement, what {decided.plan.scheme} leaves with {how}, and the margin{when and f' ({when})'}"
    yield replace(sheet_of(title, decisions.decision_table(decided)), sortable=False, stacked=True)
    if decided.aspects:
        yield aspects_sheet(decided)


def _figures(decided: Decision) -> Iterator[Figure]:
    """The numbers to read first: the verdict, the final pointing, the cost; all but the first nominal."""
    body, final = decided.plan.spacecraft, decided.final
    yield Figure("requirement", decisions.verdict(decided))
    nominal = "" if decided.cases is None else ", nominal"
    for name, end in (("spin axis ends at", final.axis), ("H ends at", final.momentum)):
        yield Figure(f"{name}{nominal}", direction_text(body, end), target_text(body, end))
    goal = "" if body.goal.spin is None else f"target: {spin_text(body.goal.spin)}"
    yield Figure(f"final spin{nominal}", spin_text(final.spin), goal)
    for aspect in decided.aspects:
        angles = f"{degrees(aspect.least)} to {degrees(aspect.largest)}"
        yield Figure(f"axis from {aspect.keep.name}", angles, _keeping(aspect))
    for name, value in decisions.cost(decided):
        yield Figure(name, value)


def _keeping(aspect: Aspect) -> str:
    """Limits of the spin axis to a direction, and the verdict on them; empty where it is only watched."""
    bounds = bounds_text(aspect.keep)
    return f"{bounds}: {decisions.KEPT[aspect.kept]}" if bounds else ""


def _unplanned(body: Spacecraft) -> Iterator[Figure]:
    """The numbers to read first where there is no plan: the requirement."""
    yield Figure("requirement", "NOT met: no scheme is feasible", verdicts.required(body))
    if body.goal.axis is not None:
        way = f"{degrees(body.to_turn)} from H at t = 0"
        yield Figure("target", direction_text(body, body.goal.axis), way)
    yield Figure("nutation at t = 0", degrees(body.tilt))


def _schemes(compared: Comparison) -> PageSection:
    """The comparison, the reasons why schemes are infeasible, and the remarks of the others."""
    remarks = tuple((plan.scheme, remark) for plan in compared.plans for remark in (*notes_on(plan), *_broken(plan)))
    hints = tuple(Prose(hint) for hint in verdicts.hints(compared))
    table = scheme_table(compared, compared.recommended)
    blocks: list[Block] = [sheet(table.title, table), *hints, *map(Prose, _reading(compared))]
    if remarks:
        blocks.append(Remarks(remarks))
    return PageSection("schemes", "Schemes compared", tuple(blocks))


def _broken(plan: Plan) -> list[str]:
    """The limits that the schedule of a file breaks; schemes never do."""
    return broken_limits(plan.spacecraft, plan.pulses) if plan.from_file else []


def _reading(compared: Comparison) -> Iterator[str]:
    """Notes on names and numbers of the comparison."""
    feasible = [plan for plan in compared.plans if plan.feasible]
    if any(COUNTS.get(plan.scheme, len(plan.pulses)) != len(plan.pulses) for plan in feasible):
        yield (
            "A scheme fires more pulses than its name says where the thrusters cannot give its impulse in so many, "
            "and fewer where fewer take out the nutation."
        )
    commanded = [plan.scheme for plan in feasible if plan.scheme in catalogue.COMMANDED]
    if commanded and len(commanded) < len(feasible):
        yield (
            f"Command blocks can fire the plan of {listed(commanded)} only; the pulses of the others have to be timed "
            "one by one."
        )


COUNTS = {"one-pulse": 1, "two-pulse": 2, "four-pulse": 4}
"""Pulses by the names of schemes."""


def _trade(compared: Comparison, traded: Sequence[Front]) -> PageSection:
    """The cost of an earlier end, as ``trade`` has it."""
    tables: list[Block] = [*blocks_of("Schedules by their ends", Group(*front_parts(compared.spacecraft, traded)))]
    chosen = compared.recommended
    notes = [] if chosen is None else [note for say in (beats, apart) if (note := say(traded, chosen))]
    tables += [Remarks((("Note", note),)) for note in notes]
    drawn = any(len(front.points) > 1 for front in traded)  # one point for each shows no trade
    pictures = (trade_picture_of(compared, traded),) if drawn else ()
    return PageSection("trade", "Time against cost", (*tables, *pictures))


def _schedule(chosen: Plan) -> PageSection:
    title = f"Recommended schedule: {chosen.scheme}"
    ends = (ends_sheet(chosen.flight), ends_note(chosen.flight))
    if not len(chosen.pulses):
        return PageSection("schedule", title, (Prose("No pulse is needed."), *ends))
    note = Prose(
        "A pulse is on from its start for its on-time. Spin phase: ∫ω3 dt from t = 0 to the start, the angle by which "
        "the body has turned about axis 3, modulo 360 deg. The cones are those before and after the pulse"
        f"{', the largest of the free motion then' * (not chosen.spacecraft.inertia.symmetric)}."
    )
    return PageSection(
        "schedule", title, (sheet(f"Pulses of {chosen.scheme}", pulse_table(chosen.flight, phased=True)), note, *ends)
    )


def _verification(chosen: Plan) -> PageSection:
    expected = chosen.options.with_disturbances
    verified = verify(chosen.spacecraft, chosen.pulses, unrounded(chosen), expected=expected)
    missing = tuple((method.name, f"not flown; {method.missing}") for method in verified.methods if method.missing)
    blocks: list[Block] = [
        Prose(f"{verdict(verified)} {conservation(verified)}"),
        checks_sheet(chosen, verified),
        sheet_of(
            "The schedule flown by independent means; differences are the largest on the way", methods_table(verified)
        ),
        *([Remarks(missing)] if missing else []),
        sheet_of(
            BUDGET,
            budget_table(chosen.spacecraft, verified),
        ),
        *[Prose(note) for note in (budget_note(verified, aimed=chosen.spacecraft.goal.axis is not None),) if note],
    ]
    return PageSection("budget", "Verification and error budget", tuple(blocks))


def _dispersion(chosen: Plan, dispersed: Results) -> PageSection:
    from nutdamp.views.dispersion_tables import dispersion_screen

    blocks = [*blocks_of("What is left, by cases", dispersion_screen(dispersed, scheme=chosen.scheme, worst=5))]
    if note := dispersed.study.lightening_error:
        blocks.append(Prose(f"Note: {note}."))
    blocks += dispersion_pictures_of(dispersed, chosen.scheme)
    return PageSection("dispersion", "Dispersion", tuple(blocks))


def _repeat(repeat: Repeat, dispersed: Results | None) -> PageSection:
    blocks: list[Block] = [Listing("Command", printable(repeat.command)), FactList("Versions", tuple(_versions()))]
    facts = [] if dispersed is None else [("seed of the dispersed cases", str(dispersed.study.seed))]
    if repeat.text:
        facts.append(("SHA-256 of the input file", hashlib.sha256(repeat.text.encode()).hexdigest()))
    if facts:
        blocks.append(FactList("Input", tuple(facts)))
    if repeat.text:
        blocks.append(Listing(f"Input file {printable(repeat.name)}", repeat.text.rstrip("\n")))
    if repeat.settings:
        blocks.append(FactList("Set in place of what the file says", repeat.settings))
    return PageSection("repeat", "To repeat it", tuple(blocks))


def _versions() -> Iterator[tuple[str, str]]:
    """Versions of the packages that numbers and pictures depend on."""
    yield "nutdamp", __version__
    yield "Python", platform.python_version()
    packages = {"numpy": "numpy", "scipy": "scipy", "highspy": "highspy", "matplotlib": "matplotlib", "bsk": "Basilisk"}
    for package, name in packages.items():
        try:
            yield name, version(package)
        except PackageNotFoundError:
            yield name, "not installed"
