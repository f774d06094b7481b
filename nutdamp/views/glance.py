"""The screens of ``plan``: what to fire on top, then the schemes compared, one row each."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from operator import attrgetter
from typing import TYPE_CHECKING, Any

from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from nutdamp.common.numerics import MISSING, RPM
from nutdamp.common.results import Note, note
from nutdamp.errors import listed
from nutdamp.flight.propagation import REAL_WIDTHS, Flight, model_name
from nutdamp.planning.decision import Comparison, speed
from nutdamp.planning.notes import (
    alternatives,
    comparison_warnings,
    plan_notes,
    spacecraft_notes,
    verdict_notes,
)
from nutdamp.planning.plan import Plan
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.requirements import Bound, Part
from nutdamp.spacecraft.schedule import STEERABLE
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
    moment,
    ordered,
    short_angle,
    small_angle,
    text,
)

if TYPE_CHECKING:
    from nutdamp.flight.cones import Aspect

NOT = "✗"  # sign before a value above the requirement
# names of angles of directions where there is little room
SHORT_NAMES = {
    "right ascension": "RA",
    "declination": "dec",
    "longitude": "lon",
    "latitude": "lat",
}


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
    largest = {bound.part: bound.limit for bound in requirements.required(spacecraft)}
    ends = [largest[part] for part in (Part.SHIFT, Part.DISTANCE) if part in largest]
    return largest.get(Part.NUTATION, math.inf), min(ends, default=math.inf)


def _feasible(get: Callable[[Plan], Any] | str) -> Callable[[Plan], Any]:
    """A value of plans that have a schedule, or an attribute of them."""
    value = attrgetter(get) if isinstance(get, str) else get
    return lambda plan: value(plan) if plan.feasible else None


def end_facts(plan: Plan) -> Table:
    """Final spin axis, H and spin, cost, and end time."""
    return facts(final_rows(plan))


def final_rows(plan: Plan) -> list[tuple[str, str]]:
    """Names and values of the final spin axis, H and spin, cost, and end time."""
    pulses = plan.pulses
    name = "impulse" if pulses.propellant is None else "propellant"
    end = moment(pulses.end) if len(pulses) else "no pulse is needed"
    return [
        *end_rows(plan._flight, plan._aspects),
        (name, f"{verdicts.spent(pulses)}, pulses: {len(pulses)}"),
        ("last pulse ends", end),
    ]


def end_rows(flown: Flight, watched: Iterable[Aspect]) -> Iterator[tuple[str, str]]:
    """Spin axis and H after the last pulse, beside the target and directions ``watched``, and the
    motion from there.
    """
    spacecraft, final = flown.spacecraft, flown.final
    yield "spin axis ends at", parts.direction_text(spacecraft, final.axis)
    yield "H ends at", parts.direction_text(spacecraft, final.momentum)
    if spacecraft.goal.axis is not None:
        off = degrees(flown.residual.axis_error)
        yield "target", f"{parts.target_text(spacecraft)}; H ends {off} off"
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
    causes = parts.changing(spacecraft)
    end = moment(flown.schedule.end if flown.until is None else flown.until)
    return f"at {end}; then changing by {' and '.join(causes)}" if causes else ""


def _four(value: float) -> str:
    return digits(value, 4) if value else "0"


def _columns(compared: Comparison, chosen: Plan | None) -> list[Column]:
    spacecraft = compared.spacecraft
    largest = limits(compared.spacecraft)
    feasible = [plan for plan in compared.plans if plan.feasible]
    fuelled = any(plan.pulses.propellant is not None for plan in feasible)
    aimed = spacecraft.goal.axis is not None
    everywhere = "screen full page"

    def met(plan: Plan) -> bool | None:
        return compared.verdicts[plan].met if plan.feasible else None

    def share(plan: Plan) -> float | None:
        cases = compared.verdicts[plan].cases
        return None if cases is None or not cases.final else cases.complying

    def status(plan: Plan) -> str:
        return compared.verdicts[plan].status.value

    def count(plan: Plan) -> int | None:
        return len(plan.pulses) if plan.feasible else None

    def shortly(largest: float) -> Callable[[float], str]:
        return lambda angle: short_angle(math.radians(angle), largest)

    ends = ("full page", everywhere) if aimed else (everywhere, "")
    shown = {
        "nutation": everywhere,
        "body_cone": "full",
        "space_cone": "full",
        "momentum_shift": ends[0],
        "axis_error": ends[1],
    }
    residuals = []
    for name, where in shown.items():
        heading = name.replace("_", " ")
        angle = angle_of(f"flown.{name}")
        order = 0 if name == "nutation" else 2
        if "screen" in where:
            short = shortly(largest[name != "nutation"])
            residuals.append(Column("", heading, "", angle, short, "screen", rank=order))
        where = f"{where.removeprefix('screen ')} csv"
        residuals.append(
            Column(f"{name}_deg", heading, "deg", angle, small_angle, where, rank=order)
        )
    axes, momenta = [], []
    for column in parts.direction_columns(spacecraft):
        name = SHORT_NAMES.get(column.heading, column.heading)
        value = _feasible(partial(_direction, "axis", column))
        where = "full page csv"
        axis = Column(
            f"axis_{column.key}", f"axis {name}", "deg", value, column.text, where, rank=3
        )
        axes.append(axis)
        value = _feasible(partial(_direction, "momentum", column))
        momenta.append(Column(f"momentum_{column.key}", "", "", value, where="csv"))
    bounds = [
        Column(
            "",
            f"{bound.label} {verdicts.limit(bound)}",
            "",
            _feasible(partial(_bound, bound)),
            where="full",
            kind=TEXT,
        )
        for bound in (*requirements.required(spacecraft), *requirements.cones(spacecraft))
    ]
    return [
        Column.named("scheme", Shared.SCHEME, "", where=f"{everywhere} csv", kind=TEXT),
        Column.named("feasible", "", "", where="csv", kind=YES_NO),
        Column("recommended", "", "", lambda plan: plan is chosen, where="csv", kind=YES_NO),
        Column("status", "", "", status, where="csv", kind=TEXT),
        Column("meets_requirement", "", "", met, where="csv", kind=YES_NO),
        Column("met_fraction", "", "", share, where="csv"),
        Column("", Shared.PULSES, "", count, where=everywhere, kind=WHOLE, rank=3),
        Column("pulses", "", "", lambda plan: len(plan.pulses), where="csv", kind=WHOLE),
        Column("", "end", "s", _feasible("schedule.end"), to_figures(4), "screen", rank=1),
        Column.named("end_s=schedule.end", "end", "s", "{:.3f}".format, "full page csv", rank=1),
        Column.named(
            "total_impulse_Nms=schedule.total_impulse",
            Shared.IMPULSE,
            "N m s",
            _four,
            "full page csv" if fuelled else "full page csv screen",
            rank=2 if fuelled else 0,
        ),
        Column("least_impulse_Nms", "", "", _feasible("spacecraft.least_impulse"), where="csv"),
        Column.named(
            "propellant_kg=schedule.propellant",
            Shared.PROPELLANT,
            "g",
            lambda mass: _four(1e3 * mass),
            "csv full page" if fuelled else "csv",
        ),
        Column(
            "",
            Shared.PROPELLANT,
            "g",
            _feasible("schedule.propellant"),
            to_figures(4, 1e3),
            "screen" if fuelled else "",
        ),
        *(
            Column("", f"{name}, impulses (17)", "deg", angle, small_angle, "full")
            for name, angle in (
                ("nutation", angle_of("residual.nutation")),
                ("momentum shift", angle_of("residual.momentum_shift")),
            )
        ),
        *residuals,
        *axes,
        *momenta,
        Column("spin_rad_s", "", "", _feasible("_flight.final.spin"), where="csv"),
        Column(
            "",
            "final spin",
            "rad/s",
            _feasible("_flight.settled.spin"),
            to_figures(6),
            "" if spacecraft.goal.spin is None else "full",
        ),
        Column.named(
            "spin_change_rad_s=_spin_change",
            "spin change",
            "rad/s",
            _four,
            "full csv page" if any(plan._spin_change for plan in compared.plans) else "full csv",
            rank=3,
        ),
        Column("delta_v_m_s", "", "", speed, where="csv"),
        *bounds,
        Column(
            "",
            Shared.VERDICT,
            "",
            partial(verdicts.scheme_word, compared),
            where=everywhere,
            kind=TEXT,
            met=met,
        ),
        Column("why", "", "", _why, where="csv", kind=TEXT),
    ]


def _direction(which: str, angle: Column, plan: Plan) -> Any:
    return angle.value(getattr(plan._flight.final, which))


def _why(plan: Plan) -> str:
    from nutdamp.planning.causes import infeasibility  # the CSV file of the schemes

    return infeasibility(plan)


def _bound(bound: Bound, plan: Plan) -> str:
    line = next(line for line in plan._held if line.bound == bound)
    shown = verdicts.value(bound, line.left).removesuffix(" deg")  # the heading has the unit
    return shown if line.met else f"{NOT} {shown}"


def glance(compared: Comparison, robust: Sequence[Note] | None = None) -> RenderableType:
    """The screen of a comparison and the plan to fly, one of those compared, or of the reason why
    there is none.

    ``robust``: notes on the choice, where dispersed cases made it.
    """
    judged, plan = compared.verdict, compared.recommended
    head = [parts.title(compared.spacecraft), headline(compared)]
    fired = None
    ending: list[RenderableType] = []
    if plan is not None:
        head.append(verdicts.coloured(verdicts.statement(judged), judged.light))
        later = f" {lasting(plan._flight)}" if len(plan.pulses) else ""
        axis = Text.assemble(("axis  ", "dim"), f"{_axis(plan)}{later}".rstrip())
        ending = [verdicts.bound_table(judged).screen("screen"), axis, Text()]
        if plan.pulses.blocks:
            fired = parts.block_table(plan._flight)
        else:
            fired = parts.pulse_table(plan._flight, limit=limits(compared.spacecraft)[0])
    schemes = scheme_table(compared, plan).screen("screen")

    def tables(first: int | None = None) -> list[RenderableType]:
        if fired is None or not fired.rows:
            return [*ending, schemes]
        return [*ending, fired.screen("screen", first=first), Text(), schemes]

    every = [*(robust or ()), *notes(compared, robust=robust is not None)]
    return parts.Summary(head, tables, every, parts.STEP.join(steps(plan)), lines=LINES)


LINES = (24, 30)  # of the screen, and of one narrower than 80 characters


def steps(plan: Plan | None) -> Iterator[str]:
    """Next steps: commands and options that tell more of the plan to fly, or take it further."""
    blocks = plan is not None and bool(plan.pulses.blocks)
    channel = (
        next((pulse.channel for pulse in plan.pulses if pulse.channel != STEERABLE), "")
        if plan
        else ""
    )
    if channel:
        yield f"nutdamp explain {channel}"
    yield "--blocks blocks.csv" if blocks else "--csv pulses.csv"
    yield "--plot plan.png"
    yield "nutdamp report"


def notes(compared: Comparison, *, robust: bool = False, verbose: bool = False) -> list[Note]:
    """Warnings, then notes in the order of their worth; a ``robust`` plan was made for what others
    miss. ``verbose``: with those on every plan compared.
    """
    chosen = compared.recommended
    plans = [plan for plan in compared.plans if verbose or not plan.feasible]
    of_plans = [note for plan in plans for note in plan_notes(plan)]
    before = spacecraft_notes(compared.spacecraft)
    if chosen is None:
        return ordered([*before, *of_plans])
    own = () if verbose else plan_notes(chosen, cones=False)
    missed = () if robust else comparison_warnings(compared, tabulated=True)
    beside = verdict_notes(compared.verdict, chosen)
    return ordered([*missed, *before, *beside, *alternatives(compared), *of_plans, *own])


def headline(compared: Comparison) -> Text:
    """Headline of the plan to fly: scheme, pulses, cost and end; or that it is not enough, not
    needed, not found.
    """
    judged = compared.verdict
    lead, about = verdicts.headline(judged, compared)
    return Text.assemble((lead, f"bold {verdicts.STYLES[judged.light]}"), about)


def ends(plan: Plan) -> list[tuple[str, str]]:
    """End of the flight, flown and by the impulse sum (17), and where the spin axis points."""
    flight, spacecraft = plan._flight, plan.spacecraft
    residual = flight.residual
    limit, turn = limits(spacecraft)
    nutation = short_angle(residual.nutation, limit)
    angles = [f"nutation {nutation}"]
    if plan.residual is not None:
        by_impulses = short_angle(plan.residual.nutation, limit)
        if by_impulses != nutation:
            angles[0] += f" (17: {by_impulses})"
    # Where ω need not lie near H, cones tell nothing.
    if not spacecraft.inertia.wheel and residual.body_cone < 0.5 * math.pi:
        angles.append(f"body cone {short_angle(residual.body_cone, limit)}")
        angles.append(f"space cone {short_angle(residual.space_cone, limit)}")
    if spacecraft.goal.axis is None:
        momentum = f"turned by {short_angle(residual.momentum_shift, turn)} deg"
    else:
        momentum = f"{short_angle(residual.axis_error, turn)} deg off target"
        momentum += parts.by_the_sun(spacecraft)
    rows = [("after pulses, deg", "  ".join(angles)), ("H", momentum), ("axis", _axis(plan))]
    if len(plan.pulses) and lasting(flight):
        rows.append(("", lasting(flight)))
    return rows


def _axis(plan: Plan) -> str:
    spacecraft, final = plan.spacecraft, plan._flight.final
    angles = [
        (SHORT_NAMES.get(column.heading, column.heading), column.shown(final.axis))
        for column in parts.direction_columns(spacecraft)
    ]
    axis = ", ".join(f"{name} {angle}" for name, angle in angles) + " deg"
    if MISSING in axis:
        axis = "along H of t = 0"
    spin = (
        ""
        if requirements.spins_at(spacecraft, final.spin)
        else f"; spin {final.spin * RPM:.5g} rpm"
    )
    return f"{axis}{spin}"
