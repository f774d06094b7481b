"""The schemes compared: one row each, with cost, residuals, final motion and verdict."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from nutdamp.errors import listed
from nutdamp.flight.end_state import at_start
from nutdamp.flight.propagation import REAL_WIDTHS, model_name
from nutdamp.planning.decision import Comparison, infeasibility
from nutdamp.planning.plan import Plan
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.model import SLACK, Spacecraft, Vector
from nutdamp.spacecraft.requirements import Bound, Part
from nutdamp.views import decisions
from nutdamp.views.decisions import COUNT, limit, size
from nutdamp.views.spacecraft import angle_names, angle_texts, cone_margins, turn_floor, turning
from nutdamp.views.tables import TEXT, WHOLE, YES_NO, Column, DataTable, Shared, angle_of
from nutdamp.views.text import degrees, digits, short_angle, small_angle

NOT = "✗"
"""Sign before a value above the requirement."""

SHORT_NAMES = ("RA", "dec")
"""Right ascension and declination, where there is little room."""


Getter = Callable[[Plan], Any]


class SchemeRow(NamedTuple):
    """A plan among those ``compared``; without a schedule most values are unknown."""

    plan: Plan
    compared: Comparison


def scheme_table(compared: Comparison, chosen: Plan | None) -> DataTable:
    """One row a scheme; the ``chosen`` one stands out.

    Residuals are those of the flight through real widths; ``met_fraction`` is the share of cases that comply, where all
    have flown.
    """
    rows = [SchemeRow(plan, compared) for plan in compared.plans]
    mark = next((index for index, plan in enumerate(compared.plans) if plan is chosen), None)
    title = f"Cost and residuals of each scheme with nominal values, by {flown_by(compared)}"
    return DataTable(title, tuple(_columns(compared, chosen)), rows, compared, mark)


def flown_by(compared: Comparison) -> str:
    """Model by which schemes are flown beside each other, with those that alone fire ideal impulses."""
    how = model_name(plan.pulses for plan in compared.plans)
    ideal = [plan.scheme for plan in compared.plans if plan.pulses.idealised]
    return how if how != REAL_WIDTHS or not ideal else f"{how} (ideal impulses: {listed(ideal)})"


def limits(body: Spacecraft) -> tuple[float, float]:
    """Limits, rad, of the nutation and of the end of H, infinite where there are none."""
    most = {bound.part: bound.most for bound in requirements.required(body)}
    ends = [most[part] for part in (Part.SHIFT, Part.DISTANCE) if part in most]
    return most.get(Part.NUTATION, math.inf), min(ends, default=math.inf)


def _feasible(get: Getter) -> Callable[[SchemeRow], Any]:
    """A value of plans that have a schedule."""
    return lambda row: get(row.plan) if row.plan.feasible else None


def _met(row: SchemeRow) -> bool | None:
    return row.compared.meets(row.plan) if row.plan.feasible else None


def verdict(row: SchemeRow) -> str:
    """Verdict on a plan, or the reason in a word why there is none."""
    if not row.plan.feasible:
        return decisions.no_plan(row.plan)
    return decisions.VERDICT[_met(row)] + ", timed" * (not row.plan.commandable)


def _share(row: SchemeRow) -> str:
    return decisions.share_text(row.compared.shares.get(row.plan)).removesuffix(" %")


def _exact_share(row: SchemeRow) -> float | None:
    share = row.compared.shares.get(row.plan)
    return None if share is None else share.exact


def _four(value: float) -> str:
    return digits(value, 4) if value else "0"


def _columns(compared: Comparison, chosen: Plan | None) -> Iterator[Column]:
    body, least = compared.spacecraft, limits(compared.spacecraft)
    feasible = [plan for plan in compared.plans if plan.feasible]
    fuelled = any(plan.pulses.propellant is not None for plan in feasible)
    aimed, cases = body.goal.axis is not None, bool(compared.shares)

    def shortly(largest: float) -> Callable[[float], str]:
        return lambda angle: short_angle(math.radians(angle), largest)

    yield Column("scheme", Shared.SCHEME, "", lambda row: row.plan.scheme, where="screen full page csv", kind=TEXT)
    yield Column("feasible", "", "", lambda row: row.plan.feasible, where="csv", kind=YES_NO)
    yield Column("recommended", "", "", lambda row: row.plan is chosen, where="csv", kind=YES_NO)
    yield Column("meets_requirement", "", "", lambda row: row.compared.meets(row.plan), where="csv", kind=YES_NO)
    yield Column("met_fraction", "", "", _exact_share, where="csv")
    yield Column(
        "pulses",
        Shared.PULSES,
        "",
        lambda row: len(row.plan.pulses) if row.plan.feasible else None,
        where="screen full page",
        kind=WHOLE,
    )
    yield Column("pulses", "", "", lambda row: len(row.plan.pulses), where="csv", kind=WHOLE)
    end, impulse = _feasible(lambda plan: plan.pulses.end), _feasible(lambda plan: plan.pulses.total_impulse)
    yield Column("", "end", "s", end, lambda value: f"{value:.4g}", "screen")
    yield Column("end_s", "end", "s", end, lambda value: f"{value:.3f}", "full page csv")
    yield Column(
        "total_impulse_Nms", Shared.IMPULSE, "N m s", impulse, _four, "full page csv" + " screen" * (not fuelled)
    )
    yield Column("least_impulse_Nms", "", "", _feasible(lambda plan: plan.spacecraft.least_impulse), where="csv")
    for name, whole in ratios(body):
        yield Column("", f"impulse over {name}", "", _feasible(_over(whole)), lambda value: f"{value:.4f}", "full page")
    propellant = _feasible(lambda plan: plan.pulses.propellant)
    yield Column("propellant_kg", Shared.PROPELLANT, "kg", propellant, where="csv")
    if fuelled:
        spent = _feasible(lambda plan: None if plan.pulses.propellant is None else 1e3 * plan.pulses.propellant)
        yield Column("", Shared.PROPELLANT, "g", spent, _four, "full page")
        yield Column("", Shared.PROPELLANT, "g", spent, lambda value: f"{value:.4g}", "screen")
    for name in ("nutation", "momentum_shift"):
        yield Column(
            "", f"{_words(name)}, impulses (17)", "deg", angle_of(f"plan.residual.{name}"), small_angle, "full"
        )
    names = ("nutation", "body_cone", "space_cone", "momentum_shift", "axis_error")
    shown = {"nutation": "screen full page", "axis_error": "screen full page" if aimed else "",
             "momentum_shift": "full page" if aimed else "screen full page"}  # fmt: skip
    for name in names:
        where, angle = shown.get(name, "full"), angle_of(f"plan.flown.{name}")
        largest = least[0] if name == "nutation" else least[1]
        if "screen" in where:
            yield Column("", _words(name), "", angle, shortly(largest), "screen")
        yield Column(f"{name}_deg", _words(name), "deg", angle, small_angle, where.removeprefix("screen ") + " csv")
    yield from _directions(body)
    yield Column("spin_rad_s", "", "", _feasible(lambda plan: plan.flight.final.spin), where="csv")
    if body.goal.spin is not None:
        yield Column(
            "",
            "final spin",
            "rad/s",
            _feasible(lambda plan: plan.flight.settled.spin),
            lambda value: f"{value:.6g}",
            "full",
        )
    yield Column(
        "spin_change_rad_s",
        "spin change",
        "rad/s",
        lambda row: row.plan.spin_change,
        _four,
        "full csv" + " page" * any(plan.spin_change for plan in compared.plans),
    )
    speed = any(plan.delta_v is not None for plan in compared.plans)
    yield Column("delta_v_m_s", "|ΔV|", "m/s", lambda row: _speed(row.plan), _four, "csv" + " full page" * speed)
    if cases:
        yield Column("", Shared.CASES, "%", _share, where="screen", kind=TEXT)
        yield Column("", COUNT, "%", _share, where="full page", kind=TEXT)
    yield from _bounds(compared)
    yield Column("", Shared.VERDICT, "", verdict, where="screen full page", kind=TEXT, met=_met)
    yield Column("why", "", "", lambda row: infeasibility(row.plan), where="csv", kind=TEXT)


def _words(name: str) -> str:
    return name.replace("_", " ")


def _speed(plan: Plan) -> float | None:
    return None if plan.delta_v is None else math.hypot(*plan.delta_v)


def ratios(body: Spacecraft) -> Iterator[tuple[str, float]]:
    """The floors of impulse, N m s, by name: A|ω0|, and with a target C|ω3|β."""
    yield "A|ω0|", body.least_impulse
    if body.goal.axis is not None:
        yield turn_floor(body), turning(body)


def _over(whole: float) -> Getter:
    return lambda plan: plan.pulses.total_impulse / whole if whole > 0.0 else None


def _directions(body: Spacecraft) -> Iterator[Column]:
    """The two angles of the final spin axis, and of H in files."""
    keys = ("tilt_deg", "azimuth_deg") if body.attitude is None else ("right_ascension_deg", "declination_deg")
    names = angle_names(body) if body.attitude is None else SHORT_NAMES
    for which in ("axis", "momentum"):
        for at, key in enumerate(keys):
            yield Column(f"{which}_{key}", "", "", _feasible(_direction(which, at)), where="csv")
            if which == "axis":
                yield Column("", f"axis {names[at]}", "deg", _feasible(_shown_direction(at)), where="full page")


def _direction(which: str, at: int) -> Getter:
    def degree(plan: Plan) -> float | None:
        body, final = plan.spacecraft, plan.flight.final
        vector: Vector = final.axis if which == "axis" else final.momentum
        around, other = body.angles_of(vector)
        angle = ((other, around) if body.attitude is None else (around, other))[at]
        return None if angle is None else math.degrees(angle)

    return degree


def _shown_direction(at: int) -> Getter:
    return lambda plan: angle_texts(plan.spacecraft, plan.flight.final.axis)[at].removesuffix(" deg")


def _bounds(compared: Comparison) -> Iterator[Column]:
    """Residuals of each plan in the parts of the requirement, and of the cones; a sign where that breaks a bound."""
    if not requirements.judged(compared.spacecraft):
        return
    for bound in requirements.required(compared.spacecraft):
        yield Column("", f"{bound.part.label} {limit(bound)}", "", _feasible(_part(bound)), where="full", kind=TEXT)
    for at, cone in enumerate(at_start(compared.spacecraft)[: len(compared.spacecraft.keep)]):
        for kept, _, _ in cone_margins(cone):
            name = f"axis from {cone.keep.name} {kept}"
            yield Column("", name, "", _feasible(_cone(at, kept)), where="full", kind=TEXT)


def _part(bound: Bound) -> Getter:
    def cell(plan: Plan) -> str:
        (part,) = (part for part in plan.held if part.bound == bound)
        shown = size(bound, part.left).removesuffix(" deg")  # the heading has the unit
        return shown if part.met else f"{NOT} {shown}"

    return cell


def _cone(at: int, kept: str) -> Getter:
    def cell(plan: Plan) -> str:
        angles = ((angle, left) for bound, angle, left in cone_margins(plan.aspects[at]) if bound == kept)
        return next(f"{NOT} " * (left < -SLACK) + degrees(angle).removesuffix(" deg") for angle, left in angles)

    return cell
