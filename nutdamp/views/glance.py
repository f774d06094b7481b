"""The screens of ``plan``: what to fire on top, then the schemes compared, one row each."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from operator import attrgetter
from typing import TYPE_CHECKING, Any

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from nutdamp.common.numerics import RPM
from nutdamp.common.results import Note, note
from nutdamp.errors import listed
from nutdamp.flight.propagation import REAL_WIDTHS, Flight, model_name
from nutdamp.planning.decision import Comparison, speed
from nutdamp.planning.notes import (
    alternatives,
    comparison_warnings,
    plan_notes,
    reasons,
    verdict_notes,
)
from nutdamp.planning.plan import Plan
from nutdamp.schemes import catalogue
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.requirements import Bound, Part
from nutdamp.spacecraft.schedule import Schedule
from nutdamp.views import parts
from nutdamp.views import verdict as verdicts
from nutdamp.views.tables import (
    TEXT,
    WHOLE,
    YES_NO,
    Column,
    DataTable,
    Shared,
    angle_of,
    facts,
    to_figures,
)
from nutdamp.views.text import (
    degrees,
    digits,
    joined,
    moment,
    ordered,
    screen_line,
    sentence,
    short_angle,
    small_angle,
    text,
)

if TYPE_CHECKING:
    from nutdamp.flight.cones import Aspect

NOT = "✗"  # sign before a value above the requirement
SHORT_NAMES = ("RA", "dec")  # right ascension and declination, where there is little room


def scheme_table(compared: Comparison, chosen: Plan | None) -> DataTable:
    """One row a scheme, with residuals of the flight through real widths; the ``chosen`` one stands
    out.
    """
    mark = next((index for index, plan in enumerate(compared.plans) if plan is chosen), None)
    how = model_name(plan.pulses for plan in compared.plans)
    ideal = [plan.scheme for plan in compared.plans if plan.pulses.idealised]
    alone = f" (ideal impulses: {listed(ideal)})" if how == REAL_WIDTHS and ideal else ""
    subject = f"Cost and residuals of each scheme with nominal values, by {how}{alone}"
    return DataTable(subject, tuple(_columns(compared, chosen)), compared.plans, compared, mark)


def limits(spacecraft: Spacecraft) -> tuple[float, float]:
    """Limits, rad, of the nutation and of the end of H, infinite where there are none."""
    most = {bound.part: bound.limit for bound in requirements.required(spacecraft)}
    ends = [most[part] for part in (Part.SHIFT, Part.DISTANCE) if part in most]
    return most.get(Part.NUTATION, math.inf), min(ends, default=math.inf)


def _feasible(get: Callable[[Plan], Any] | str) -> Callable[[Plan], Any]:
    """A value of plans that have a schedule, or an attribute of them."""
    value = attrgetter(get) if isinstance(get, str) else get
    return lambda plan: value(plan) if plan.feasible else None


def scheme_verdict(compared: Comparison, plan: Plan) -> str:
    """Verdict on a plan, or why it is not recommended, or why there is none."""
    return verdicts.scheme_word(compared, plan) if plan.feasible else no_plan(plan)


def no_plan(plan: Plan) -> str:
    """Text in the column of a scheme that has no plan."""
    if plan.failure is None:
        without = catalogue.SCHEMES[plan.scheme].body_fixed and not plan.spacecraft.channels
        word = "not found" if plan.found_none else "infeasible"
        return "no thrusters" if without else word
    return f"internal error,\nplease report:\n{type(plan.failure).__name__}"


def cost(schedule: Schedule) -> Iterator[tuple[str, str]]:
    """Cost and end of a schedule: names and values."""
    yield (
        "impulse" if schedule.propellant is None else "propellant",
        f"{verdicts.spent(schedule)}, pulses: {len(schedule)}",
    )
    yield "last pulse ends", moment(schedule.end) if len(schedule) else "no pulse is needed"


def end_facts(plan: Plan) -> Table:
    """Final spin axis, H and spin, cost, and end time."""
    return facts([*end_rows(plan.flight, plan.aspects), *cost(plan.pulses)])


def end_rows(flown: Flight, watched: Iterable[Aspect]) -> Iterator[tuple[str, str]]:
    """Spin axis and H after the last pulse, beside the target and directions ``watched``, and the
    motion from there.
    """
    spacecraft, final = flown.spacecraft, flown.final
    yield "spin axis ends at", parts.direction_text(spacecraft, final.axis)
    yield "H ends at", parts.direction_text(spacecraft, final.momentum)
    if spacecraft.goal.axis is not None:
        off = degrees(flown.residual.axis_error)
        yield (
            "target",
            f"{parts.direction_text(spacecraft, spacecraft.goal.axis)}; H ends {off} off",
        )
    yield "final state", f"spin {parts.spin_text(final.spin)}, nutation {degrees(final.nutation)}"
    if lasting(flown):
        yield "", lasting(flown)
    yield from parts.aspect_facts(watched)
    if spacecraft.attitude is None:
        yield "", text(note("frame-n"))
    elif spacecraft.attitude.frame is not None:
        yield "frame", spacecraft.attitude.frame


def lasting(flown: Flight) -> str:
    """Time of the end shown where the motion does not last, and the cause of its change; empty
    where it lasts.
    """
    spacecraft = flown.spacecraft
    causes = [
        *["dissipation"] * (spacecraft.growth != 0.0),
        *["disturbances"] * bool(spacecraft.disturbances),
    ]
    end = moment(flown.schedule.end if flown.until is None else flown.until)
    return f"at {end}; then changing by {' and '.join(causes)}" if causes else ""


def _four(value: float) -> str:
    return digits(value, 4) if value else "0"


def _columns(compared: Comparison, chosen: Plan | None) -> Iterator[Column]:
    spacecraft = compared.spacecraft
    least = limits(compared.spacecraft)
    feasible = [plan for plan in compared.plans if plan.feasible]
    fuelled = any(plan.pulses.propellant is not None for plan in feasible)
    aimed = spacecraft.goal.axis is not None
    everywhere = "screen full page"

    def met(plan: Plan) -> bool | None:
        return compared.verdicts[plan].met if plan.feasible else None

    def share(plan: Plan) -> float | None:
        cases = compared.verdicts[plan].cases
        return None if cases is None or not cases.final else cases.complying

    def shortly(largest: float) -> Callable[[float], str]:
        return lambda angle: short_angle(math.radians(angle), largest)

    yield Column(
        "scheme", Shared.SCHEME, "", attrgetter("scheme"), where=f"{everywhere} csv", kind=TEXT
    )
    yield Column("feasible", "", "", attrgetter("feasible"), where="csv", kind=YES_NO)
    yield Column("recommended", "", "", lambda plan: plan is chosen, where="csv", kind=YES_NO)
    yield Column(
        "status", "", "", lambda plan: compared.verdicts[plan].status.value, where="csv", kind=TEXT
    )
    yield Column("meets_requirement", "", "", met, where="csv", kind=YES_NO)
    yield Column("met_fraction", "", "", share, where="csv")
    count = _feasible(lambda plan: len(plan.pulses))
    yield Column("", Shared.PULSES, "", count, where=everywhere, kind=WHOLE)
    yield Column("pulses", "", "", lambda plan: len(plan.pulses), where="csv", kind=WHOLE)
    end, impulse = _feasible("pulses.end"), _feasible("pulses.total_impulse")
    yield Column("", "end", "s", end, to_figures(4), "screen")
    yield Column("end_s", "end", "s", end, lambda value: f"{value:.3f}", "full page csv")
    where = "full page csv" + " screen" * (not fuelled)
    yield Column("total_impulse_Nms", Shared.IMPULSE, "N m s", impulse, _four, where)
    yield Column("least_impulse_Nms", "", "", _feasible("spacecraft.least_impulse"), where="csv")
    spent = _feasible("pulses.propellant")
    yield Column("propellant_kg", Shared.PROPELLANT, "kg", spent, where="csv")
    if fuelled:
        yield Column("", Shared.PROPELLANT, "g", spent, lambda mass: _four(1e3 * mass), "full page")
        yield Column("", Shared.PROPELLANT, "g", spent, to_figures(4, 1e3), "screen")
    for name in ("nutation", "momentum_shift"):
        heading = f"{name.replace('_', ' ')}, impulses (17)"
        yield Column("", heading, "deg", angle_of(f"residual.{name}"), small_angle, "full")
    ends = ("full page", everywhere) if aimed else (everywhere, "")
    shown = {
        "nutation": everywhere,
        "body_cone": "full",
        "space_cone": "full",
        "momentum_shift": ends[0],
        "axis_error": ends[1],
    }
    for name, where in shown.items():
        heading = name.replace("_", " ")
        angle = angle_of(f"flown.{name}")
        if "screen" in where:
            yield Column("", heading, "", angle, shortly(least[name != "nutation"]), "screen")
        yield Column(
            f"{name}_deg",
            heading,
            "deg",
            angle,
            small_angle,
            where.removeprefix("screen ") + " csv",
        )
    angles = (  # and their places among `angles_of`
        {"tilt_deg": 1, "azimuth_deg": 0}
        if spacecraft.attitude is None
        else {"right_ascension_deg": 0, "declination_deg": 1}
    )
    names = parts.angle_names(spacecraft) if spacecraft.attitude is None else SHORT_NAMES
    for at, (key, place) in enumerate(angles.items()):
        yield Column(
            f"axis_{key}", "", "", _feasible(partial(_direction, "axis", place)), where="csv"
        )
        yield Column(
            "",
            f"axis {names[at]}",
            "deg",
            _feasible(partial(_shown_direction, at)),
            where="full page",
        )
    for key, place in angles.items():
        yield Column(
            f"momentum_{key}",
            "",
            "",
            _feasible(partial(_direction, "momentum", place)),
            where="csv",
        )
    yield Column("spin_rad_s", "", "", _feasible("flight.final.spin"), where="csv")
    if spacecraft.goal.spin is not None:
        yield Column(
            "", "final spin", "rad/s", _feasible("flight.settled.spin"), to_figures(6), "full"
        )
    where = "full csv" + " page" * any(plan.spin_change for plan in compared.plans)
    yield Column(
        "spin_change_rad_s", "spin change", "rad/s", attrgetter("spin_change"), _four, where
    )
    yield Column("delta_v_m_s", "", "", speed, where="csv")
    for bound in (*requirements.required(spacecraft), *requirements.cones(spacecraft)):
        name = f"{bound.label} {verdicts.limit(bound)}"
        yield Column("", name, "", _feasible(partial(_bound, bound)), where="full", kind=TEXT)
    yield Column(
        "",
        Shared.VERDICT,
        "",
        partial(scheme_verdict, compared),
        where=everywhere,
        kind=TEXT,
        met=met,
    )
    yield Column("why", "", "", _why, where="csv", kind=TEXT)


def _why(plan: Plan) -> str:
    from nutdamp.planning.causes import infeasibility  # the CSV file of the schemes

    return infeasibility(plan)


def _direction(which: str, at: int, plan: Plan) -> float | None:
    angle = plan.spacecraft.angles_of(getattr(plan.flight.final, which))[at]
    return None if angle is None else math.degrees(angle)


def _shown_direction(at: int, plan: Plan) -> str:
    return parts.angle_texts(plan.spacecraft, plan.flight.final.axis)[at].removesuffix(" deg")


def _bound(bound: Bound, plan: Plan) -> str:
    line = next(line for line in plan.held if line.bound == bound)
    shown = verdicts.value(bound, line.left).removesuffix(" deg")  # the heading has the unit
    return shown if line.met else f"{NOT} {shown}"


def glance(compared: Comparison, robust: Sequence[Note] | None = None) -> RenderableType:
    """The screen of a comparison and the plan to fly, one of those compared, or of the reason why
    there is none.

    ``robust``: notes on the choice, where dispersed cases made it.
    """
    judged, plan = compared.verdict, compared.recommended
    head = [*parts.title(compared.spacecraft), headline(compared)]
    fired = None
    ending: list[RenderableType] = []
    if plan is not None:
        head.append(verdicts.coloured(verdicts.statement(judged), judged.light))
        ending = [verdicts.bound_table(judged).screen("screen"), ends(plan), Text()]
        least = limits(compared.spacecraft)[0]
        fired = (
            parts.block_table(plan.flight)
            if plan.pulses.blocks
            else parts.pulse_table(plan.flight, least=least)
        )
    schemes = scheme_table(compared, plan).screen("screen", between=" ")

    def table(first: int | None = None) -> RenderableType:
        rows = (
            [*ending, fired.screen("screen", first=first), Text()]
            if fired is not None and fired.rows
            else ending
        )
        return Group(*rows, schemes)

    written = (
        "--blocks blocks.csv" if plan is not None and plan.pulses.blocks else "--csv pulses.csv"
    )
    every = [*(robust or ()), *notes(compared, robust=robust is not None)]
    return parts.summary(head, table, every, f"{written} · --plot plan.png · nutdamp report")


def notes(compared: Comparison, *, robust: bool = False) -> list[Note]:
    """Warnings, then notes in the order of their worth; a ``robust`` plan was made for what others
    miss.
    """
    chosen = compared.recommended
    infeasible = [note for plan in compared.plans if not plan.feasible for note in plan_notes(plan)]
    if chosen is None:
        return ordered(infeasible)
    own = plan_notes(chosen, cones=False)
    missed = () if robust else comparison_warnings(compared, tabulated=True)
    beside = verdict_notes(compared.verdict, chosen)
    return ordered([*missed, *beside, *alternatives(compared), *infeasible, *own])


def headline(compared: Comparison) -> Text:
    """Headline of the plan to fly: scheme, pulses, cost and end; or that it is not enough, not
    needed, not found.
    """
    judged = compared.verdict
    lead, about = verdicts.headline(judged, compared)
    return Text.assemble((lead, f"bold {verdicts.STYLES[judged.light]}"), about)


def ends(plan: Plan) -> Table:
    """End of the flight, flown and by the impulse sum (17), and where the spin axis points."""
    flight, spacecraft = plan.flight, plan.spacecraft
    left = flight.residual
    formula, (least, turn) = plan.residual, limits(spacecraft)
    angles = [f"nutation {short_angle(left.nutation, least)}"]
    if (
        not spacecraft.inertia.wheel and left.body_cone < 0.5 * math.pi
    ):  # where ω need not lie near H, cones tell nothing
        angles += [f"body cone {short_angle(left.body_cone, least)}"]
        angles += [f"space cone {short_angle(left.space_cone, least)}"]
    if (
        formula is not None
        and (by_impulses := short_angle(formula.nutation, least)) not in angles[0].split()
    ):
        angles[0] += f" (17: {by_impulses})"
    rows = [("after pulses, deg", "  ".join(angles))]
    first, second = parts.angle_texts(spacecraft, flight.final.axis)
    names = parts.angle_names(spacecraft) if spacecraft.attitude is None else SHORT_NAMES
    turned = f"turned by {short_angle(left.momentum_shift, turn)} deg"
    turned = (
        turned
        if spacecraft.goal.axis is None
        else f"{short_angle(left.axis_error, turn)} deg off target"
    )
    final = flight.final.spin
    spin = f"; spin {final * RPM:.5g} rpm" * (not requirements.spins_at(spacecraft, final))
    rows.append(("axis", f"{names[0]} {first}, {names[1]} {second}; H {turned}{spin}"))
    if len(plan.pulses) and lasting(flight):
        rows.append(("", lasting(flight)))
    return facts(rows)


def comparison_screen(compared: Comparison) -> RenderableType:
    """All tables of ``plan``, the verdict on top."""
    judged, chosen = compared.verdict, compared.recommended
    schemes = scheme_table(compared, chosen).transposed("full")
    results: list[RenderableType] = [
        Text(),
        parts.derived_table(compared.spacecraft),
        Text(),
        schemes,
    ]
    lead: list[RenderableType] = [parts.named(compared.spacecraft), headline(compared)]
    remarks = [note for plan in compared.plans for note in plan_notes(plan)]
    results += [Text(), *map(screen_line, ordered(remarks))] if remarks else []
    if chosen is None:
        return Group(*lead, *results)
    pulses = chosen.pulses
    if pulses.blocks:
        results += [Text(), parts.blocks_screen(chosen.flight, chosen.delta_v)]
    elif len(pulses):
        totals: dict[str, float] = {}
        for pulse in pulses:
            totals[pulse.channel] = totals.get(pulse.channel, 0.0) + pulse.loaded[1]
        on_times = facts(
            (f"on-time of {channel}", f"{total:.4f} s") for channel, total in totals.items()
        )
        results += [Text(), parts.pulse_table(chosen.flight).screen("full"), Text(), on_times]
    why = joined(reasons(compared))
    warnings = comparison_warnings(compared, tabulated=True)
    beside = [*warnings, *verdict_notes(judged, chosen), *alternatives(compared)]
    return Group(
        *lead,
        Text(sentence(verdicts.statement(judged)), verdicts.STYLES[judged.light]),
        Text(sentence(f"{chosen.scheme}: {why}")),
        *(
            Text(
                (
                    f"cheaper: {cheaper.scheme}, {verdicts.spent(cheaper.schedule)}, "
                    f"{text(cheaper.why)}"
                ),
                "dim",
            )
            for cheaper in judged.cheaper
        ),
        *map(screen_line, ordered(beside)),
        *(Text(), verdicts.bound_table(judged).screen("screen")),
        *(Text(), end_facts(chosen)),
        *results,
    )
