"""The verdict in words: its headline, its sentence, a row for each bound, and the same as JSON.

All screens, pages, figures and files take these; no other module has a word for a status.
"""

from __future__ import annotations

import math
from operator import attrgetter
from typing import Any

from rich.text import Text

from nutdamp.common.numerics import MISSING, RPM
from nutdamp.errors import NotFound
from nutdamp.planning.decision import Comparison
from nutdamp.planning.notes import reasons
from nutdamp.planning.plan import Plan
from nutdamp.planning.verdict import Cases, Light, Line, Status, Verdict
from nutdamp.schemes.catalogue import SCHEMES
from nutdamp.spacecraft.model import required_share
from nutdamp.spacecraft.requirements import Bound, Part
from nutdamp.spacecraft.schedule import Schedule
from nutdamp.views.tables import TEXT, Column, DataTable, Shared, values_of
from nutdamp.views.text import (
    degrees,
    duration,
    joined,
    limit_text,
    mass,
    quantity,
    short_angle,
    text,
)

HEADLINES = {
    Status.FLY: "FLY",
    Status.NOT_SHOWN: "NOT SHOWN",
    Status.NOT_ENOUGH: "NOT ENOUGH",
    Status.NO_PULSE: "NO PULSE",
    Status.NO_PLAN: "NO PLAN",
    Status.NOT_COMMANDABLE: "CANNOT BE COMMANDED",
}
"""Words of a status."""

STYLES = {Light.GREEN: "green", Light.AMBER: "yellow", Light.RED: "bold red"}
"""Colours of a verdict on a terminal."""

MET = {True: "met", False: "NOT met", None: MISSING}
"""Words for one bound, or for the requirement as a whole."""

DAMPED = {Part.DISTANCE: "reached"}
"""Words for a bound that nobody requires; of others damped, of one by a loop held."""

SHORTLY = {"why-single-pulses": "single pulses"}
"""Words for reasons that are too long for a table."""

FIGURES = 8  # of a value beside its limit, at most


def lead(verdict: Verdict) -> str:
    """Words of the status; where nothing is required they say so."""
    words = HEADLINES[verdict.status]
    return f"{words}, nothing required" if verdict.flies and not verdict.required else words


def spent(schedule: Schedule) -> str:
    """Propellant, or the impulse where it is not known."""
    if schedule.propellant is None:
        return quantity(schedule.total_impulse, "N m s")
    return mass(schedule.propellant)


def fired(schedule: Schedule) -> str:
    """Number of blocks and pulses, cost, and end of the last one."""
    blocks = f"blocks {len(schedule.blocks)}, " if schedule.blocks else ""
    count = f"{blocks}pulses {len(schedule)}"
    return f"{count}, {spent(schedule)}, ends at {duration(schedule.end)}"


def headline(verdict: Verdict, compared: Comparison | None = None) -> tuple[str, str]:
    """Headline in two parts, the status and what it is about; of no plan the reasons of the
    comparison.
    """
    words = lead(verdict)
    pulses = verdict.schedule
    if verdict.status is Status.NO_PLAN:
        why = verdict.why if compared is None else joined(reasons(compared))
        return words, f": {why}" if why else ""
    if verdict.idle:
        return words, f" needed: {idle(verdict)}"
    colon = "" if words == HEADLINES[Status.FLY] else ":"
    ideal = " (ideal impulses)" if pulses.idealised else ""
    date = verdict.spacecraft.utc(pulses.end)
    day = "" if date is None else f", {date[:10]}"
    return words, f"{colon} {verdict.scheme}{ideal}: {fired(pulses)}{day}"


def idle(verdict: Verdict) -> str:
    """Clause on a motion that needs no pulse."""
    spacecraft = verdict.spacecraft
    motion = f"nutation {degrees(spacecraft.nutation)} at t = 0"
    if spacecraft.goal.axis is not None:
        motion += f", H {degrees(spacecraft.to_turn)} from the target"
    if spacecraft.growth > 0.0:
        motion += f", kept up to the horizon of {duration(spacecraft.horizon)}"
    return motion


def statement(verdict: Verdict) -> str:
    """Sentence on the requirement, in words that leave no doubt about its subject; without a full
    stop.
    """
    cases, spacecraft = verdict.cases, verdict.spacecraft
    if verdict.status is Status.NO_PLAN:
        return verdict.why or "no plan is feasible"
    broken = ""
    if not all(aspect.kept for aspect in verdict.aspects):
        from nutdamp.planning.causes import strays  # a cone is broken

        broken = " and ".join(strays(aspect) for aspect in verdict.aspects if not aspect.kept)
    counted = ""
    if cases is not None and cases.complying is not None:
        counted = (
            f"{share_text(cases)} of cases comply ({exact_percent(cases.probability)} required)"
        )
    if not verdict.required:
        bounds = [line for line in verdict.lines if not line.bound.required]
        return f"no requirement in file; {', '.join(map(bound_word, bounds))} with nominal values"
    if verdict.status is Status.NOT_ENOUGH and not verdict.nominally_met:
        return "; ".join(filter(None, (f"{MET[False]} with nominal values", broken, counted)))
    if cases is None or cases.complying is None:
        if verdict.unshown:
            share = exact_percent(required_share(spacecraft.requirement))
            untold = spacecraft.dispersions is None
            lacks = "the file gives no dispersions" if untold else "cases could not be flown"
            return f"{share} of cases required, {lacks}; {MET[True]} with nominal values"
        return f"{MET[True]} with nominal values"
    if verdict.unshown:
        low, high = (percent(share, cases.probability) for share in (cases.low, cases.high))
        return f"{counted}; 95 % interval {low} to {high}"
    return counted


def stated(verdict: Verdict) -> tuple[str, Light]:
    """Status and sentence on one line, and their colour."""
    if verdict.flight is None and verdict.cases is not None:  # a closed loop in dispersed cases
        return loop_sentence(verdict), verdict.light
    return f"{lead(verdict)}: {statement(verdict)}", verdict.light


def loop_sentence(verdict: Verdict) -> str:
    """Status and sentence of a closed loop, which fires by what it sees and not by a plan."""
    words = "ENOUGH" if verdict.flies else lead(verdict)
    if not verdict.required:
        words = "HELD" if all(line.met for line in verdict.lines) else "NOT HELD"
        return f"{words}: the loop falls quiet; {', '.join(map(bound_word, verdict.lines))}"
    return f"{words}: {statement(verdict)}"


def bound_word(line: Line) -> str:
    """Verdict on one bound with its subject, where it is not required."""
    subject = "target" if line.bound.part is Part.DISTANCE else line.bound.label
    return f"{subject} {line_word(line)}"


def line_word(line: Line) -> str:
    """Verdict on one bound."""
    if line.bound.required:
        return MET[line.met]
    word = "held" if line.bound.by_loop else DAMPED.get(line.bound.part, "damped")
    return word if line.met else f"NOT {word}"


def share_text(cases: Cases | None) -> str:
    """Share that complies; where not all cases have flown, the end of its interval towards the
    share required.
    """
    if cases is None or cases.complying is None:
        return MISSING
    if cases.final:
        return percent(cases.complying, cases.probability)
    if cases.enough:
        return f"at least {percent(cases.low, cases.probability)}"
    return f"at most {percent(cases.high, cases.probability)}"


def percent(share: float, *others: float) -> str:
    """A share in percent to one decimal; to more where it would be taken for one of the ``others``,
    or for all.
    """
    distinct = [other for other in (*others, 0.0, 1.0) if other != share]
    for digits in range(1, 12):
        shown = f"{100.0 * share:.{digits}f}" if share else "0"
        if all(float(shown) != float(f"{100.0 * other:.10g}") for other in distinct):
            return f"{shown} %"
    return f"{100.0 * share:.12g} %"


def exact_percent(share: float) -> str:
    """A share that a file gives, in percent as it was written."""
    return f"{100.0 * share:.10g} %"


def coloured(words: str, light: Light) -> Text:
    """A verdict in its colour."""
    return Text(words, STYLES[light])


# --- a row for each bound


def limit(bound: Bound) -> str:
    """The limit of a bound with its sign and unit."""
    size = f"{RPM * bound.limit:.4g} rpm" if bound.part is Part.SPIN else limit_text(bound.limit)
    return f"≥ {size}" if bound.inner else f"≤ {size}"


def value(bound: Bound, number: float | None) -> str:
    """Value of a bound's part, with as many digits as it takes to stand on its side of the limit;
    rounding is 0.
    """
    if number is None or math.isnan(number):
        return MISSING
    scale, unit = (RPM, "rpm") if bound.part is Part.SPIN else (math.degrees(1.0), "deg")
    if bound.part is Part.SPIN:
        shown = "0" if abs(number) < SMALL * bound.limit else f"{scale * number:.3g}"
    else:
        shown = short_angle(number, bound.limit)
    edge = float(f"{scale * bound.limit:.4g}")
    figures = 3
    while (
        (float(shown) > edge) != (number > bound.limit)
        and number != bound.limit
        and figures < FIGURES
    ):
        figures += 1
        shown = f"{scale * number:.{figures}g}"
    return f"{shown} {unit}"


SMALL = 1e-3  # share of a limit of the spin below which what is left of it is shown as 0


def margin(line: Line) -> str:
    """Margin of a bound."""
    if line.bound.part is Part.SPIN:
        return f"{RPM * line.margin:.3g} rpm"
    return f"{short_angle(line.margin, line.bound.limit)} deg"


def bound_table(verdict: Verdict) -> DataTable:
    """One row a bound: limit, nominal value, that in the share of cases required, cases that keep
    it alone, margin.
    """
    cases = verdict.cases
    where = "page screen"
    columns = [
        Column("", "requirement", "", attrgetter("bound.label"), where=where, kind=TEXT),
        Column("", "limit", "", lambda line: limit(line.bound), where=where),
        Column("", Shared.NOMINAL, "", lambda line: value(line.bound, line.nominal), where=where),
    ]
    if cases is not None:
        share = cases.probability
        level = f"{exact_percent(share)} within"
        columns += [
            Column("", level, "", lambda line: value(line.bound, line.dispersed), where=where),
            Column(
                "",
                "keep it",
                "",
                attrgetter("share"),
                lambda alone: percent(alone, share),
                where,
                rank=1,
            ),
        ]
    columns += [
        Column("", "margin", "", margin, where=where, rank=2),
        Column("", "", "", line_word, where=where, kind=TEXT, met=attrgetter("met")),
    ]
    return DataTable("Requirement", columns, verdict.lines)


def scheme_word(compared: Comparison, plan: Plan) -> str:
    """Verdict on one of the plans compared, or in short why it is not recommended, or why there is
    none.
    """
    if plan._failure is not None:
        return f"internal error,\nplease report:\n{type(plan._failure).__name__}"
    if not plan.feasible:
        if SCHEMES[plan.scheme].body_fixed and not plan.spacecraft.channels:
            return "no thrusters"
        return "not found" if isinstance(plan._why, NotFound) else "infeasible"
    why = compared.shortcoming(plan)
    if why is not None:
        return SHORTLY.get(why.code) or text(why)
    verdict = compared.verdicts[plan]
    if verdict.required:
        return MET[True]
    return ", ".join(line_word(line) for line in verdict.lines)


# --- files


def line_json(line: Line) -> dict[str, Any]:
    """A bound: its limit, values, share of the cases that keep it alone, and margin."""
    bound = line.bound
    named = {"part": bound.key, "required": bound.required}
    if bound.part is Part.CONE and bound.keep is not None:
        named |= {"name": bound.keep.name, "edge": "min" if bound.inner else "max"}
    unit, scale = ("rad_s", 1.0) if bound.part is Part.SPIN else ("deg", math.degrees(1.0))
    sizes = (bound.limit, line.nominal, line.dispersed, line.margin)
    named_sizes = zip(("limit", "nominal", "dispersed", "margin"), sizes, strict=True)
    values = {
        f"{name}_{unit}": None if size is None else scale * size for name, size in named_sizes
    }
    return {**named, **values, "share": line.share, "met": line.met}


def cases_json(cases: Cases | None) -> dict[str, Any] | None:
    """Share of the cases that comply, its interval, and the share required; None where none were
    flown.
    """
    if cases is None or cases.complying is None:
        return None
    return values_of(
        cases, "samples", "seed", "met_fraction=complying", "low", "high", "probability"
    )


def verdict_json(verdict: Verdict) -> dict[str, Any]:
    """The object ``decision`` of every JSON file."""
    return {
        "status": verdict.status.value,
        "scheme": verdict.scheme or None,
        "met": verdict.met,
        "verdict": statement(verdict),
        "requirement": [line_json(line) for line in verdict.lines],
        "causes": [cause._asdict() for cause in verdict.causes],
        "cheaper": [
            {"scheme": cheaper.scheme, "code": cheaper.why.code, "text": text(cheaper.why)}
            for cheaper in verdict.cheaper
        ],
        "cases": cases_json(verdict.cases),
    }
