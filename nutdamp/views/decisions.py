"""Words of a decision, for all screens, pages and files: requirement met or not, margins, and final motion.

And plans, decisions, certificates and spacecraft as JSON-ready dictionaries: vectors in the axes of the file, degrees.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from operator import itemgetter
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from nutdamp import __version__
from nutdamp.common.numerics import cleaned
from nutdamp.common.results import note
from nutdamp.flight.end_state import Aspect
from nutdamp.flight.propagation import Flight, Residual
from nutdamp.planning.decision import Comparison, Decision, Line, decide, infeasibility, strays
from nutdamp.planning.notes import alternatives, comparison_warnings, decision_notes, plan_notes, reasons
from nutdamp.planning.plan import Plan, Share
from nutdamp.schemes import catalogue
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.model import SLACK, Spacecraft, Vector
from nutdamp.spacecraft.requirements import Bound, Part
from nutdamp.spacecraft.schedule import Schedule
from nutdamp.views.parts import aspect_facts, commanded, cone_margins, direction_text, required, spin_text
from nutdamp.views.tables import TEXT, Column, DataTable, Shared, facts, values_of
from nutdamp.views.text import MISSING, degrees, duration, joined, mass, moment, most, note_json, quantity, text

if TYPE_CHECKING:
    from nutdamp.planning.tradeoff import Certificate
    from nutdamp.schemes.optimal.linear_program import Burn


VERDICT = {True: "met", False: "NOT met", None: MISSING}  # words for the values of `Plan.meets_requirement`


def no_plan(plan: Plan) -> str:
    """Text in the column of a scheme that has no plan."""
    if plan.failure is None:
        without = catalogue.SCHEMES[plan.scheme].body_fixed and not plan.spacecraft.channels
        return "no thrusters" if without else "infeasible"
    return f"internal error,\nplease report:\n{type(plan.failure).__name__}"


def needless(compared: Comparison) -> str | None:
    """Clause that nothing has to be done, where that is so."""
    body = compared.spacecraft
    if not compared.needless:
        return None
    there, verdict = f"nutation {degrees(body.nutation)} at t = 0", "damped"
    if body.goal.axis is not None:
        there += f", H {degrees(body.to_turn)} from the target"
    if requirements.required(body):
        nominal = ", with nominal values" * (body.dispersions is not None and compared.flown is None)
        verdict = f"requirement met ({required(body)}){nominal}"
    lasting = f", up to the horizon of {duration(body.horizon)}" if body.growth > 0.0 else ""
    return f"{there}: {verdict}{lasting}"


UNDECIDED = "the share of cases that comply is undecided"  # verdict on dispersed cases that do not decide
ROUNDING = 1e-9  # share by which costs that are equal may differ
FARTHER = 1.1  # factor of distance or of time by which H ends farther off, or later, for a plan to be worse in it


def cases_verdict(share: float, probability: float) -> str:
    """Verdict on the share of cases: "met: 99.9 % of cases comply (99.7 % required)"."""
    return f"{VERDICT[share >= probability]}: {cases_share(share, probability)}"


def cases_share(share: float, probability: float) -> str:
    """Share of cases that comply, and the share required."""
    return f"{percent(share, probability)} of cases comply ({exact_percent(probability)} required)"


def share_text(share: Share | None) -> str:
    """The share of cases that comply with a plan; where not all have flown, the side of the required one it is on."""
    if share is None or (share.exact is None and share.met is None):
        return MISSING
    if share.exact is not None:
        return percent(share.exact, share.probability)
    return f"{'≥' if share.met else '<'} {exact_percent(share.probability)}"


def percent(share: float, *others: float) -> str:
    """A share in percent to one decimal; to more where it would be taken for one of the ``others``, or for all."""
    distinct = [other for other in (*others, 0.0, 1.0) if other != share]
    for digits in range(1, 12):
        text = f"{100.0 * share:.{digits}f}"
        if all(float(text) != float(f"{100.0 * other:.10g}") for other in distinct):
            return f"{text} %"
    return f"{100.0 * share:.12g} %"


def exact_percent(share: float) -> str:
    """A share that a file gives, in percent as it was written."""
    return f"{100.0 * share:.10g} %"


KEPT = {True: "kept", False: "NOT kept"}  # words for a cone about a direction that the spin axis has to keep
COUNT = "cases that comply"  # name of the row of the decision and of the column of the comparison


def verdict(decision: Decision) -> str:
    """Verdict on the requirement, in words that leave no doubt about its subject."""
    broken, cases = " and ".join(map(strays, decision.strays)), decision.cases
    if not broken:
        return _at_end(decision)
    # Cases that break a cone do not comply, so that a verdict on cases covers more than the end.
    if cases is not None and cases.complying is not None:
        return f"NOT met: {broken}; {cases_share(cases.complying, cases.probability)}"
    return f"NOT met: {broken}; otherwise {_at_end(decision)}"


def statement(decision: Decision) -> Text:
    """The verdict as a sentence."""
    lead = "Requirement: " if decision.nominal is None and not decision.strays else "Requirement "
    return Text.assemble(lead, coloured(verdict(decision), decision.met), ".")


def _at_end(decision: Decision) -> str:
    """Verdict on the end, regardless of cones on the way."""
    cases, nominal = decision.cases, decision.nominal
    if nominal is None:
        what, done = ("nutation", "damped") if decision.plan.spacecraft.goal.axis is None else ("target", "reached")
        return f"no requirement in file; {what} {'NOT ' * (not decision.damped)}{done} with nominal values"
    if decision.unknown:
        return f"NOT met{' with nominal values' * (not nominal)}: {UNDECIDED}"
    if cases is not None and cases.complying is not None:
        if nominal:
            return cases_verdict(cases.complying, cases.probability)
        return f"NOT met with nominal values; {cases_share(cases.complying, cases.probability)}"
    return f"{'met' if nominal else 'NOT met'} with nominal values"


def decision_table(decision: Decision, values: str = Shared.NOMINAL) -> DataTable:
    """One row a part of the requirement, and one for the share of cases that comply; ``values`` heads the residuals."""
    cases = decision.cases
    level = "" if cases is None else f"({exact_percent(cases.probability)})"
    columns = (
        Column("", "requirement", "", itemgetter(0), where="screen", kind=TEXT),
        Column("", "limit", "", itemgetter(1), where="screen"),
        Column("", values, "", itemgetter(2), where="screen"),
        Column("", "dispersed", level, itemgetter(3), where="screen" * bool(level)),
        Column("", "margin", "", itemgetter(4), where="screen"),
        Column("", Shared.VERDICT, "", itemgetter(5), where="screen", kind=TEXT, met=itemgetter(6)),
    )
    return DataTable("Requirement", columns, list(_margins(decision)))


def _margins(decision: Decision) -> Iterator[tuple[str, str, str, str, str, str, bool | None]]:
    """Requirement, limit, value with nominal values and in cases, margin and verdict as text; whether it is met."""
    cases = decision.cases
    for line in decision.lines:
        nominal, dispersed, margin = (size(line.bound, each) for each in (line.nominal, line.dispersed, line.margin))
        words = VERDICT[line.met]
        if not line.bound.required and line.met is not None:
            words = "NOT " * (not line.met) + ("reached" if line.bound.part is Part.DISTANCE else "damped")
        yield line.bound.part.label, limit(line.bound), nominal, dispersed, margin, words, line.met
    for aspect in decision.aspects:
        for bound, angle, left in cone_margins(aspect):
            words = KEPT[left >= -SLACK] + " (nominal)" * (cases is not None)
            name = f"axis from {aspect.keep.name}"
            yield name, bound, degrees(angle), "", degrees(left), words, left >= -SLACK
    if cases is not None and cases.complying is not None:
        least, share = exact_percent(cases.probability), percent(cases.complying, cases.probability)
        margin = f"{100.0 * (cases.complying - cases.probability):.3g} points"
        yield COUNT, f"≥ {least}", "", share, margin, VERDICT[cases.met], cases.met


def coloured(text: str, met: bool | None) -> Text:
    """A verdict in its colour."""
    return Text(text, "" if met is None else "green" if met else "bold red")


def limit(bound: Bound) -> str:
    """The bound of a part."""
    return f"≤ {quantity(bound.most, 'rad/s') if bound.part is Part.SPIN else most(bound.most)}"


def size(bound: Bound, value: float | None) -> str:
    """The residual of a part, in rad/s or degrees."""
    return quantity(value, "rad/s") if bound.part is Part.SPIN else degrees(value)


def spent(pulses: Schedule) -> str:
    """The propellant, or the impulse where it is not known."""
    return quantity(pulses.total_impulse, "N m s") if pulses.propellant is None else mass(pulses.propellant)


def cost(decision: Decision) -> Iterator[tuple[str, str]]:
    """Cost and end of the plan: names and values."""
    pulses = decision.flight.schedule
    yield "impulse" if pulses.propellant is None else "propellant", f"{spent(pulses)}, pulses: {len(pulses)}"
    yield "last pulse ends", moment(pulses.end) if len(pulses) else "no pulse is needed"


def end_facts(decision: Decision) -> Table:
    """Final spin axis, H and spin, cost, and end time."""
    return facts([*end_rows(decision.flight, decision.aspects), *cost(decision)])


def figures(decision: Decision) -> list[RenderableType]:
    """The numbers of a decision on a screen: margins, then the final motion."""
    return [Text(), decision_table(decision).screen("screen"), Text(), end_facts(decision)]


def margin_lines(decision: Decision, values: str = Shared.NOMINAL) -> list[RenderableType]:
    """The margins of a flight, where there are any; ``values`` heads the residuals."""
    return [decision_table(decision, values).screen("screen")] if decision.lines or decision.aspects else []


def end_rows(flown: Flight, watched: Iterable[Aspect]) -> Iterator[tuple[str, str]]:
    """Spin axis and H after the last pulse, beside the target and directions ``watched``, and the motion from there."""
    body, final = flown.spacecraft, flown.final
    yield "spin axis ends at", direction_text(body, final.axis)
    yield "H ends at", direction_text(body, final.momentum)
    if body.goal.axis is not None:
        off = degrees(flown.residual.axis_error)
        yield "target", f"{direction_text(body, body.goal.axis)}; H ends {off} off"
    yield "final state", f"spin {spin_text(final.spin)}, nutation {degrees(final.nutation)}"
    if lasting(flown):
        yield "", lasting(flown)
    yield from aspect_facts(watched)
    if body.attitude is None:
        yield "", text(note("frame-n"))
    elif body.attitude.frame is not None:
        yield "frame", body.attitude.frame


def lasting(flown: Flight) -> str:
    """Time of the end shown where the motion does not last, and the cause of its change; empty where it lasts."""
    body = flown.spacecraft
    causes = [*["dissipation"] * (body.growth != 0.0), *["disturbances"] * bool(body.disturbances)]
    end = moment(flown.schedule.end if flown.until is None else flown.until)
    return f"at {end}; then changing by {' and '.join(causes)}" if causes else ""


def heading(spacecraft: Spacecraft) -> dict[str, Any]:
    """Head of the JSON of every command: the version, and the spacecraft."""
    return {"nutdamp": __version__, "spacecraft": spacecraft_json(spacecraft)}


def comparison_json(compared: Comparison) -> dict[str, Any]:
    """The object of ``plan --json``: the plans, the decision on one of them, and the words of both."""
    return decided_json(compared, decide(compared))


def decided_json(compared: Comparison, decided: Decision | None) -> dict[str, Any]:
    """`comparison_json` with a decision that is known already."""
    beside = () if decided is None else decision_notes(decided)
    return {
        **heading(compared.spacecraft),
        "plans": [compared_json(compared, plan) for plan in compared.plans],
        **values_of(compared, "recommended=recommended.scheme", "no_pulse_needed=needless"),
        "reason": joined(reasons(compared)),
        "notes": [note_json(note) for note in (*comparison_warnings(compared), *beside, *alternatives(compared))],
        "decision": None if decided is None else decision_json(decided),
    }


def compared_json(compared: Comparison, plan: Plan) -> dict[str, Any]:
    """One of the plans compared; ``cases``: the share of dispersed cases that comply, null where not all have flown."""
    data, share, cases = plan_json(plan), compared.shares.get(plan), compared.cases(plan)
    data["meets_requirement"] = compared.meets(plan)
    if plan.spacecraft.commands is not None:
        data["can_be_commanded"] = plan.commandable if plan.feasible else None
    if compared.shares:
        data["cases"] = share and {
            "samples": 0 if cases is None else cases.samples,
            **values_of(share, "met_fraction=exact", "low", "high", "probability", "met"),
        }
    return data


def spacecraft_json(spacecraft: Spacecraft) -> dict[str, Any]:
    """Derived quantities of a spacecraft at t = 0."""
    inertia = spacecraft.inertia
    return {
        **values_of(spacecraft, "name", "A_kgm2=inertia.A", "C_kgm2=inertia.C", "a=inertia.a", "shape=inertia.shape"),
        "moments_kgm2": list(inertia.moments),
        "wheel_momentum_Nms": inertia.wheel,
        "principal_axes": cleaned(inertia.axes.T).tolist(),
        "omega0_rad_s": inertia.in_file(spacecraft.omega0).tolist(),
        **values_of(spacecraft.widest, "nutation_deg", "body_cone_deg=body", "space_cone_deg=space"),
        **values_of(spacecraft, "nutation_at_start_deg=tilt", "body_nutation_period_s=body_period"),
        "inertial_nutation_period_s": spacecraft.inertial_period,
        "target_axis": cleaned(spacecraft.target_axis).tolist(),
        **values_of(spacecraft, "target_angle_deg=to_turn", "target_spin_rad_s=goal.spin"),
    }


def plan_json(plan: Plan) -> dict[str, Any]:
    """One plan; an infeasible one has no pulses, nulls, and the reason."""
    schedule, body = plan.schedule, plan.spacecraft
    return {
        **values_of(plan, "scheme", "feasible"),
        "why": infeasibility(plan) or None,
        "meets_requirement": plan.meets_requirement,
        "requirement": requirement_json(plan),
        "pulses": commanded(plan.pulses, body).json(),
        **values_of(schedule, "total_impulse_Nms"),
        "least_impulse_Nms": None if schedule is None else body.least_impulse,
        **values_of(schedule, "propellant_kg", "end_s"),
        "delta_v_m_s": None if plan.delta_v is None else cleaned(plan.delta_v).tolist(),
        "spin_change_rad_s": plan.spin_change,
        "residual": residual_json(plan.residual),
        "flown": residual_json(plan.flown),
        "final": None if schedule is None else final_json(plan.flight),
        "target": target_json(body),
        **aspects_json(plan.aspects if plan.feasible else ()),
        "bounds": None if plan.pulses.bounds is None else plan.pulses.bounds._asdict(),
        "notes": [note_json(note) for note in plan_notes(plan)] if plan.feasible else [],
    }


def requirement_json(plan: Plan) -> list[dict[str, Any]] | None:
    """The requirement and the residuals, part by part; None where nothing is required, or without a schedule."""
    return [
        {"part": part.bound.part.value, **_in_unit(part.bound, left=part.left, most=part.bound.most), "met": part.met}
        for part in plan.held
        if part.bound.required
    ] or None


def _in_unit(bound: Bound, **values: float | None) -> dict[str, float | None]:
    """Values of a part by their names, in the unit that the names get in files."""
    unit, scale = ("rad_s", 1.0) if bound.part is Part.SPIN else ("deg", 180.0 / math.pi)
    return {f"{name}_{unit}": None if value is None else scale * value for name, value in values.items()}


def final_json(flown: Flight) -> dict[str, Any]:
    """Final spin axis and angular momentum, and the motion from then on."""
    body, final, settled = flown.spacecraft, flown.final, flown.settled
    rates, quaternion = body.inertia.in_file_axes(settled.rates, settled.quaternion)
    return {
        "axis": direction_json(body, final.axis),
        "momentum": direction_json(body, final.momentum),
        **values_of(final, "spin_rad_s", "nutation_deg"),
        "omega_rad_s": rates.tolist(),
        "quaternion": quaternion.tolist(),
    }


def target_json(body: Spacecraft) -> dict[str, Any] | None:
    """The requirement on the end, in the form of `final_json`; None where nothing is required."""
    axis, spin = body.goal.axis, body.goal.spin
    if axis is None and spin is None:
        return None
    return {"axis": None if axis is None else direction_json(body, axis), "spin_rad_s": spin}


def aspects_json(aspects: tuple[Aspect, ...]) -> dict[str, Any]:
    """Range of angles of the spin axis from each direction that is watched; nothing for a file that names none."""
    names = ("least_deg", "least_s=least_at", "largest_deg", "largest_s=largest_at")
    bounds = ("min_deg=keep.least", "max_deg=keep.most")
    entries = [values_of(aspect, "name=keep.name", *names, *bounds, "kept") for aspect in aspects]
    return {"aspects": entries} if entries else {}


def direction_json(body: Spacecraft, direction: Vector) -> dict[str, float | None]:
    """The two angles that name an inertial direction (3,), as `Spacecraft.angles_of`."""
    around, other = (None if angle is None else math.degrees(angle) for angle in body.angles_of(direction))
    named = {"tilt_deg": other, "azimuth_deg": around}
    return named if body.attitude is None else {"right_ascension_deg": around, "declination_deg": other}


def residual_json(residual: Residual | None) -> dict[str, float | None]:
    """Cone angles and shifts in degrees; nulls where there is no schedule."""
    return values_of(
        residual, "nutation_deg", "body_cone_deg", "space_cone_deg", "momentum_shift_deg", "axis_error_deg"
    )


def decision_json(decision: Decision) -> dict[str, Any]:
    """The verdict on a plan, part by part with margins, its end and cost; ``cases`` is null where none were flown."""
    cases = decision.cases
    return {
        **values_of(decision, "scheme=plan.scheme", "met"),
        "verdict": verdict(decision),
        "requirement": [_line_json(line) for line in decision.lines],
        "cases": cases and values_of(cases, "samples", "seed", "met_fraction=complying", "probability", "met"),
        "final": final_json(decision.flight),
        **aspects_json(decision.aspects),
        **values_of(decision.flight.schedule, "propellant_kg", "total_impulse_Nms", "end_s"),
    }


def _line_json(line: Line) -> dict[str, Any]:
    """A part: its limit, its residual with nominal values and in the share of cases required, and the margin."""
    values = {"limit": line.bound.most, "nominal": line.nominal, "dispersed": line.dispersed, "margin": line.margin}
    part = values_of(line.bound, "part=part.value", "required")
    return {**part, **_in_unit(line.bound, **values), "met": line.met}


PROVES = (
    "no firing of these channels within the windows that reaches the goal by the equations costs less than bound = "
    "sum of price times goal - off times |prices of shift| - gained: q is at most 1 at every moment for channels that "
    "act at once, and for the others gained is at least the integral of cost_per_s times (q - 1) where q is above 1"
)

MODEL = (
    "small angles, symmetric body, spin as at t = 0: exact for the nutation as long as nothing changes the spin, of "
    "first order for the direction of H; impulses of any size at once for channels with acts_at_once, at most the full "
    "torque at a time for the others"
)

NOT_COUNTED = (
    "gaps, ticks, least and longest on-times, max_pulses, that channels may not be on together, valves, cold nozzles "
    "and falling pressure: each can only raise the cost of the same equations"
)


def certificate_json(certificate: Certificate) -> dict[str, Any]:
    """The file of ``plan --certificate``: all data to check a least cost by hand, in SI.

    It is about the transverse impulse of a symmetric body of small angles. With E1 = e^{i α t} min(1, e^{-κ (t -
    t_last)}) and E2 = e^{i ω t}, where α is ``nutation_rad_s``, ω is ``spin_rad_s`` and κ is ``growth_per_s``, a second
    of a channel of the torque (m1, m2, m3) at t adds E1 (m1 + i m2) to the equations nutation, E2 (m1 + i m2) to the
    equations shift, and m3 to the equation spin. Of each equation the file has the goal and the price y, and q(t) of a
    channel is the sum of y times what it adds, over ``cost_per_s``.
    """
    body, program, prices = certificate.spacecraft, certificate.program, certificate.proof.prices.tolist()
    equations = zip(certificate.rows, program.influence.goal.tolist(), prices, strict=True)
    names, pulses = [channel.name for channel in program.channels], certificate.plan.pulses
    return {
        "nutdamp": __version__,
        "certificate": 1,
        "spacecraft": body.name,
        "proves": PROVES,
        "model": MODEL,
        "not_counted": NOT_COUNTED,
        **values_of(body, "a=inertia.a", "spin_rad_s", "nutation_rad_s=nutation_rate", "growth_per_s=growth"),
        "last_s": certificate.last,
        "windows_s": [list(span) for span in certificate.windows],
        "unit": certificate.problem.unit,
        "equations": [{"name": name, "goal_Nms": goal + 0.0, "price": price + 0.0} for name, goal, price in equations],
        "off_Nms": program.off,
        "channels": [
            {**values_of(channel, "name", "torque_Nm"), "cost_per_s": float(cost), "acts_at_once": bool(strong)}
            for channel, cost, strong in zip(program.channels, program.costs, program.strong, strict=True)
        ],
        **values_of(certificate.proof, "gained", "bound"),
        "burns": [_burn(certificate, burn) for burn in certificate.burns],
        "burns_cost": certificate.cost,
        "plan": {
            "cost": pulses.cost_in(certificate.problem.unit),
            "pulses": [values_of(pulse, "channel", "t_s", "on_time_s") for pulse in pulses],
        },
        "primer": [
            {"t_s": times.tolist(), "q": dict(zip(names, certificate.primer(times).T.tolist(), strict=True))}
            for times in certificate.moments()
        ],
    }


def _burn(certificate: Certificate, burn: Burn) -> dict[str, Any]:
    at = certificate.program.channels.index(burn.channel)
    q = certificate.primer(np.array([burn.t]))[0, at]
    return {**values_of(burn, "channel=channel.name", "t_s", "on_time_s"), "q": float(q)}
