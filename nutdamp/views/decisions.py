"""Derived quantities of spacecraft; and plans, comparisons and certificates as JSON-ready
dictionaries.

Vectors are in the axes of the file, angles in degrees.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from nutdamp import __version__
from nutdamp.common.numerics import cleaned
from nutdamp.flight.cones import Aspect, at_start
from nutdamp.flight.propagation import Flight, Residual
from nutdamp.planning.causes import infeasibility
from nutdamp.planning.decision import Comparison
from nutdamp.planning.notes import (
    alternatives,
    comparison_warnings,
    plan_notes,
    reasons,
    spacecraft_notes,
    verdict_notes,
)
from nutdamp.planning.plan import NO_NUTATION, Plan
from nutdamp.planning.verdict import Verdict, lines_of
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.units import screen_unit
from nutdamp.views.parts import (
    RESIDUALS,
    aspect_facts,
    changing,
    commanded,
    direction_columns,
    named,
    required,
    spin_text,
    target_text,
    title,
)
from nutdamp.views.tables import facts, values_of
from nutdamp.views.text import degrees, duration, joined, note_json, ordered, quantity
from nutdamp.views.verdict import cases_json, line_json, verdict_json

if TYPE_CHECKING:
    from nutdamp.planning.tradeoff import Certificate


def heading(spacecraft: Spacecraft) -> dict[str, Any]:
    """Head of the JSON of every command: the version, and the spacecraft."""
    return {"nutdamp": __version__, "spacecraft": spacecraft_json(spacecraft)}


def comparison_json(compared: Comparison) -> dict[str, Any]:
    """The object of ``plan --json``: the plans, the verdict on one of them,
    and the words of both.
    """
    judged, chosen = compared.verdict, compared.recommended
    beside = () if chosen is None else verdict_notes(judged, chosen)
    return {
        **heading(compared.spacecraft),
        "plans": [compared_json(compared, plan) for plan in compared.plans],
        "recommended": None if chosen is None else chosen.scheme,
        "no_pulse_needed": judged.idle,
        "reason": joined(reasons(compared)),
        "notes": [
            note_json(note)
            for note in ordered(
                (
                    *spacecraft_notes(compared.spacecraft),
                    *comparison_warnings(compared),
                    *beside,
                    *alternatives(compared),
                )
            )
        ],
        "decision": decision_json(judged),
    }


def compared_json(compared: Comparison, plan: Plan) -> dict[str, Any]:
    """One of the plans compared; ``cases``: the share of dispersed cases that comply, with its
    interval.
    """
    data = plan_json(plan)
    judged = compared.verdicts[plan]
    data |= {"status": judged.status.value, "meets_requirement": judged.met}
    if plan.spacecraft.commands is not None:
        data["can_be_commanded"] = plan._commandable if plan.feasible else None
    if judged.lines:
        data["requirement"] = [line_json(line) for line in judged.lines]
    if compared.cases:
        data["cases"] = cases_json(judged.cases)
    return data


def spacecraft_json(spacecraft: Spacecraft) -> dict[str, Any]:
    """Derived quantities of a spacecraft at t = 0."""
    inertia = spacecraft.inertia
    return {
        **values_of(
            spacecraft,
            "name",
            "A_kgm2=inertia.A",
            "C_kgm2=inertia.C",
            "a=inertia.a",
            "shape=inertia.shape",
        ),
        "moments_kgm2": list(inertia.moments),
        "wheel_momentum_Nms": inertia.wheel,
        "principal_axes": cleaned(inertia.axes.T).tolist(),
        "omega0_rad_s": inertia.in_file(spacecraft.omega0).tolist(),
        **values_of(
            spacecraft.widest, "nutation_deg", "body_cone_deg=body", "space_cone_deg=space"
        ),
        **values_of(
            spacecraft, "nutation_at_start_deg=tilt", "body_nutation_period_s=motion_period"
        ),
        "inertial_nutation_period_s": spacecraft.inertial_period,
        "target_axis": cleaned(spacecraft.target_axis).tolist(),
        **values_of(spacecraft, "target_angle_deg=to_turn", "target_spin_rad_s=goal.spin"),
    }


def opening(spacecraft: Spacecraft, verbose: bool) -> tuple[RenderableType, ...]:
    """Name and motion of a spacecraft at t = 0; ``verbose``: all its derived quantities."""
    if verbose:
        return named(spacecraft), derived_table(spacecraft), Text()
    return (title(spacecraft),)


def derived_table(spacecraft: Spacecraft) -> Table:
    """Derived quantities of the spacecraft at t = 0."""
    return facts(derived_facts(spacecraft))


def derived_facts(spacecraft: Spacecraft) -> Iterator[tuple[str, str]]:
    """Names and values of the derived quantities of the spacecraft at t = 0."""
    inertia = spacecraft.inertia
    motion = spacecraft.widest
    moments = f"A = {quantity(inertia.A, 'kg m²', 6)}, C = {quantity(inertia.C, 'kg m²', 6)}"
    yield "inertia", f"{moments}: {inertia.shape}, a = {inertia.a:.4g}"
    if not inertia.symmetric:
        unit, factor = screen_unit("kg m²")
        first, second, _ = factor * np.asarray(inertia.moments)
        yield (
            "",
            f"I1 = {first:.6g}, I2 = {second:.6g} {unit}; schemes but optimal plan on their mean",
        )
    if inertia.wheel:
        whole = f"H3 = C ω3 + h = {quantity(spacecraft.axial, 'N m s')}"
        yield "wheel", f"h = {quantity(inertia.wheel, 'N m s')} along axis 3: {whole}"
    reversed_ = ": the spin axis is body axis -3" if spacecraft.sense < 0.0 else ""
    yield "spin", f"{spin_text(spacecraft.spin)}{reversed_}"
    now = "" if inertia.symmetric else f"{degrees(spacecraft.tilt)} at t = 0, at most "
    cones = f"body cone {degrees(motion.body)} + space cone {degrees(motion.space)}"
    yield "nutation", f"{now}{degrees(motion.nutation)} = {cones}"
    period = spacecraft.motion_period
    still = math.isinf(period)
    in_body = (
        "none in the body, where ω does not turn" if still else f"{duration(period)} in the body"
    )
    yield "nutation period", f"{in_body}, {duration(spacecraft.inertial_period)} inertially"
    if spacecraft.dissipation is not None:
        what = "grows" if spacecraft.growth > 0.0 else "decays"
        slow = spacecraft.dissipation >= spacecraft.inertial_period
        rough = "" if slow else "; less than one inertial period: results are rough"
        effect = f"the nutation {what} e-fold in {duration(spacecraft.dissipation)}{rough}"
        sphere = spacecraft.growth == 0.0
        yield "dissipation", "none: a sphere has no energy to lose" if sphere else effect
    # Causes that break the floors A|ω0| and C|ω3|β.
    unequal = [] if inertia.symmetric else ["I1 ≠ I2"]
    beyond = " and ".join([*unequal, *changing(spacecraft)])
    floor = f"no least impulse with {beyond}" if beyond else "lower bound"
    name = "impulse" if beyond else "least impulse"
    yield name, f"A|ω0| = {quantity(spacecraft.least_impulse, 'N m s')}; {floor}"
    if spacecraft.goal.axis is not None:
        symbol = "|H3|β" if inertia.wheel else "C|ω3|β"
        turned = spacecraft.to_turn < NO_NUTATION  # but for rounding
        turn = quantity(0.0 if turned else spacecraft.turning_impulse, "N m s")
        bound = "" if beyond else ", the least to turn H"
        yield "target", target_text(spacecraft)
        yield "", f"β = {degrees(spacecraft.to_turn)} from H; {symbol} = {turn}{bound}"
    if spacecraft.goal.spin is not None:
        yield "final spin", spin_text(spacecraft.goal.spin)
    actuators = []
    torquer = spacecraft.torquer
    if torquer is not None:
        strength = "an ideal impulse" if torquer.torque is None else quantity(torquer.torque, "N m")
        assumed = " (assumed: the file names no actuator)" if spacecraft.steerable is None else ""
        actuators.append(f"steerable torquer, {strength}{assumed}")
    if spacecraft.channels:
        actuators.append("channels " + " ".join(channel.name for channel in spacecraft.channels))
    yield "actuators", "; ".join(actuators)
    bounds = required(spacecraft)
    if bounds:
        yield "requirement", bounds
    yield from aspect_facts(at_start(spacecraft))


def plan_json(plan: Plan) -> dict[str, Any]:
    """One plan; an infeasible one has no pulses, nulls, and the reason."""
    schedule, spacecraft = plan.schedule, plan.spacecraft
    return {
        **values_of(plan, "scheme", "feasible"),
        "why": infeasibility(plan) or None,
        "meets_requirement": plan.meets_requirement,
        "requirement": [line_json(line) for line in lines_of(plan._held, None, 1.0)] or None,
        "pulses": commanded(plan.pulses, spacecraft).json(),
        **values_of(schedule, "total_impulse_Nms"),
        "least_impulse_Nms": None if schedule is None else spacecraft.least_impulse,
        **values_of(schedule, "propellant_kg", "end_s"),
        "delta_v_m_s": None if plan._delta_v is None else cleaned(plan._delta_v).tolist(),
        "spin_change_rad_s": plan._spin_change,
        "residual": residual_json(plan.residual),
        "flown": residual_json(plan.flown),
        "final": None if schedule is None else final_json(plan._flight),
        "target": target_json(spacecraft),
        **aspects_json(plan._aspects if plan.feasible else ()),
        "bounds": None if plan.pulses.bounds is None else plan.pulses.bounds._asdict(),
        "notes": [note_json(note) for note in plan_notes(plan)] if plan.feasible else [],
    }


def final_json(flown: Flight) -> dict[str, Any]:
    """Final spin axis and angular momentum, and the motion from then on."""
    spacecraft, final, settled = flown.spacecraft, flown.final, flown.settled
    rates, quaternion = spacecraft.inertia.in_file_axes(settled.rates, settled.quaternion)
    return {
        "axis": direction_json(spacecraft, final.axis),
        "momentum": direction_json(spacecraft, final.momentum),
        **values_of(final, "spin_rad_s", "nutation_deg"),
        "omega_rad_s": rates.tolist(),
        "quaternion": quaternion.tolist(),
    }


def target_json(spacecraft: Spacecraft) -> dict[str, Any] | None:
    """The requirement on the end, in the form of `final_json`; None where nothing is required."""
    axis, spin = spacecraft.goal.axis, spacecraft.goal.spin
    if axis is None and spin is None:
        return None
    return {
        "axis": None if axis is None else direction_json(spacecraft, axis),
        **values_of(spacecraft.goal, "sun_angle_deg"),
        "spin_rad_s": spin,
    }


def aspects_json(aspects: tuple[Aspect, ...]) -> dict[str, Any]:
    """Range of angles of the spin axis from each direction that is watched; nothing for a file that
    names none.
    """
    names = ("least_deg", "least_s=least_at", "largest_deg", "largest_s=largest_at")
    bounds = ("min_deg=keep.least", "max_deg=keep.most")
    entries = [values_of(aspect, "name=keep.name", *names, *bounds, "kept") for aspect in aspects]
    return {"aspects": entries} if entries else {}


def direction_json(spacecraft: Spacecraft, direction: Vector) -> dict[str, float | None]:
    """The two angles that name an inertial direction (3,), as `Spacecraft.angles_of`."""
    return {column.key: column.value(direction) for column in direction_columns(spacecraft)}


def residual_json(residual: Residual | None) -> dict[str, float | None]:
    """Cone angles and shifts in degrees; nulls where there is no schedule."""
    return values_of(residual, *(f"{name}_deg" for name in RESIDUALS))


def decision_json(judged: Verdict) -> dict[str, Any]:
    """The verdict on a plan, its end and cost."""
    data = verdict_json(judged)
    if judged.flight is None:
        return data
    return {
        **data,
        "final": final_json(judged.flight),
        **aspects_json(judged.aspects),
        **values_of(judged.schedule, "propellant_kg", "total_impulse_Nms", "end_s"),
    }


PROVES = (
    "No firing of these channels within the windows that reaches the goal by the "
    "equations costs less than bound. bound = sum of price times goal - off times "
    "|prices of shift| - gained. For channels that act at once, q is at most 1 at "
    "every moment. For the others, gained is at least the integral of cost_per_s "
    "times (q - 1) where q is above 1."
)

MODEL = (
    "Small angles, spin as at t = 0. Exact for the nutation of symmetric bodies "
    "while nothing changes the spin; of first order for other bodies and for the "
    "direction of H. Channels with acts_at_once give impulses of any size at once, "
    "the others at most the full torque at a time."
)

NOT_COUNTED = (
    "Gaps, ticks, shortest and longest on-times, max_pulses, channels that may not "
    "be on together, valves, cold nozzles and falling pressure. Each can only "
    "raise the cost of the same equations."
)


def certificate_json(certificate: Certificate) -> dict[str, Any]:
    """The file of ``plan --certificate``: all data to check a least cost by hand, in SI.

    It is about the transverse impulse at small angles. With E1 = e^{i α t} min(1, e^{-κ (t -
    t_last)}) and E2 = e^{i ω t}, where α is ``nutation_rad_s``, ω is ``spin_rad_s`` and κ is
    ``growth_per_s``, a second of a channel of the torque (m1, m2, m3) at t adds E1 (f1 m1 + i f2
    m2), f being ``circle``, to the equations nutation, E2 (m1 + i m2) to the equations shift, and
    m3 to the equation spin. Of each equation the file has the goal and the price y, and q(t) of a
    channel is the sum of y times what it adds, over ``cost_per_s``.
    """
    spacecraft = certificate.spacecraft
    program = certificate.program
    prices = certificate.proof.prices.tolist()
    equations = zip(certificate.rows, program.influence.goal.tolist(), prices, strict=True)
    names = [channel.name for channel in program.channels]
    pulses = certificate.plan.pulses
    return {
        "nutdamp": __version__,
        "certificate": 1,
        "spacecraft": spacecraft.name,
        "proves": PROVES,
        "model": MODEL,
        "not_counted": NOT_COUNTED,
        "circle": spacecraft.inertia.circle(spacecraft.spin).tolist(),
        **values_of(
            spacecraft, "spin_rad_s", "nutation_rad_s=nutation_rate", "growth_per_s=growth"
        ),
        "last_s": certificate.last,
        "windows_s": [list(span) for span in certificate.windows],
        "unit": certificate.problem.unit,
        "equations": [
            {"name": name, "goal_Nms": goal + 0.0, "price": price + 0.0}
            for name, goal, price in equations
        ],
        "off_Nms": program.off,
        "channels": [
            {
                **values_of(channel, "name", "torque_Nm"),
                "cost_per_s": float(cost),
                "acts_at_once": bool(strong),
            }
            for channel, cost, strong in zip(
                program.channels, program.costs, program.strong, strict=True
            )
        ],
        **values_of(certificate.proof, "gained", "bound"),
        "burns": [
            {
                **values_of(burn, "channel=channel.name", "t_s", "on_time_s"),
                "q": float(
                    certificate.primer(np.array([burn.t]))[0, program.channels.index(burn.channel)]
                ),
            }
            for burn in certificate.burns
        ],
        "burns_cost": certificate.cost,
        "plan": {
            "cost": pulses.cost_in(certificate.problem.unit),
            "pulses": [values_of(pulse, "channel", "t_s", "on_time_s") for pulse in pulses],
        },
        "primer": [
            {
                "t_s": times.tolist(),
                "q": dict(zip(names, certificate.primer(times).T.tolist(), strict=True)),
            }
            for times in certificate.moments()
        ],
    }
