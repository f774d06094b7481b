"""The screen of ``plan``: the spacecraft, the schemes compared, the recommendation, its pulses."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from nutdamp.flight.end_state import at_start
from nutdamp.planning.decision import Comparison, decide
from nutdamp.planning.notes import plan_notes, reasons
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.requirements import Part
from nutdamp.views import verdicts
from nutdamp.views.decisions import decision_screen
from nutdamp.views.end_tables import add_aspects, blocks_screen, direction_text, spin_text
from nutdamp.views.layout import facts
from nutdamp.views.notes import joined, ordered, screen_line
from nutdamp.views.pulses import pulse_table
from nutdamp.views.schemes import beyond_floors, scheme_table, turning
from nutdamp.views.text import degrees, duration, quantity


def comparison_screen(compared: Comparison) -> RenderableType:
    """All tables of ``plan``, the decision on top."""
    decided, name = decide(compared), Text(compared.spacecraft.name, style="bold")
    results: list[RenderableType] = [
        Text(),
        derived_table(compared.spacecraft),
        Text(),
        scheme_table(compared, compared.recommended).transposed("full"),
    ]
    needless = verdicts.needless(compared)
    parts: list[RenderableType] = [name]
    if needless is not None:
        parts.append(Text.assemble(("No pulse needed: ", "bold"), f"{needless}."))
    remarks = [note for plan in compared.plans for note in plan_notes(plan)]
    results += [Text(), *map(screen_line, ordered(remarks))] if remarks else []
    if decided is None:
        return Group(*parts, Text(f"No recommendation: {joined(reasons(compared))}.", style="bold"), *results)
    if decided.plan.pulses.blocks:
        results += [Text(), blocks_screen(decided.plan.flight, decided.plan.delta_v)]
    elif len(decided.plan.pulses):
        results += [Text(), pulse_table(decided.plan.flight).screen("full")]
    return Group(*parts, *decision_screen(compared, decided), *results)


def header(spacecraft: Spacecraft, more: Iterable[tuple[str, str]] = ()) -> RenderableType:
    """Name and derived quantities of the spacecraft at t = 0, and ``more`` of them (name, value)."""
    return Group(Text(spacecraft.name, style="bold"), derived_table(spacecraft, more))


def derived_table(spacecraft: Spacecraft, more: Iterable[tuple[str, str]] = ()) -> Table:
    """Derived quantities of the spacecraft at t = 0, and ``more`` of them (name, value)."""
    inertia = spacecraft.inertia
    motion = spacecraft.widest
    table = facts()
    moments = f"A = {quantity(inertia.A, 'kg m²', 6)}, C = {quantity(inertia.C, 'kg m²', 6)}"
    table.add_row("inertia", f"{moments}: {inertia.shape}, a = {inertia.a:.4g}")
    if not inertia.symmetric:
        first, second, _ = inertia.moments
        table.add_row("", f"I1 = {first:.6g}, I2 = {second:.6g} kg m²; planned on the equivalent symmetric body")
    table.add_row("spin", spin_text(spacecraft.spin) + ": the spin axis is body axis -3" * (spacecraft.spin < 0.0))
    now = "" if inertia.symmetric else f"{degrees(spacecraft.tilt)} at t = 0, at most "
    cones = f"body cone {degrees(motion.body)} + space cone {degrees(motion.space)}"
    table.add_row("nutation", f"{now}{degrees(motion.nutation)} = {cones}")
    still = math.isinf(spacecraft.body_period)
    in_body = "none in the body, where ω does not turn" if still else f"{duration(spacecraft.body_period)} in the body"
    table.add_row("nutation period", f"{in_body}, {duration(spacecraft.inertial_period)} inertially")
    if spacecraft.dissipation is not None:
        table.add_row("dissipation", dissipation_text(spacecraft, spacecraft.dissipation))
    beyond = beyond_floors(spacecraft)
    floor = f"no least impulse with {beyond}" if beyond else "removing all nutation takes no less"
    name = "impulse" if beyond else "least impulse"
    table.add_row(name, f"A|ω0| = {quantity(spacecraft.least_impulse, 'N m s')}; {floor}")
    if spacecraft.goal.axis is not None:
        turn = quantity(turning(spacecraft), "N m s")
        least = "" if beyond else ", the least to turn H"
        table.add_row("target", direction_text(spacecraft, spacecraft.goal.axis))
        table.add_row("", f"β = {degrees(spacecraft.to_turn)} from H; C|ω3|β = {turn}{least}")
    if spacecraft.goal.spin is not None:
        table.add_row("final spin", spin_text(spacecraft.goal.spin))
    table.add_row("actuators", _actuators(spacecraft))
    for line, text in enumerate(_requirement(spacecraft)):
        table.add_row("" if line else "requirement", text)
    add_aspects(table, at_start(spacecraft))
    for name, value in more:
        table.add_row(name, value)
    return table


def _requirement(spacecraft: Spacecraft) -> Iterator[str]:
    """The requirement, and the differences from the key of the file."""
    bounds = requirements.required(spacecraft)
    if bounds:
        yield verdicts.required(spacecraft)
    if any(bound.part is Part.DISTANCE for bound in bounds):
        yield "momentum_shift bounds the axis error: the angle of H from the target"


def dissipation_text(spacecraft: Spacecraft, time_constant: float) -> str:
    """Effect of energy dissipation on the nutation, and a note where it is too fast for its model."""
    if spacecraft.growth == 0.0:
        return "none: a sphere has no energy to lose"
    what = "grows" if spacecraft.growth > 0.0 else "decays"
    slow = time_constant >= spacecraft.inertial_period
    rough = "" if slow else "; less than one inertial period: results are rough"
    return f"the nutation {what} e-fold in {duration(time_constant)}{rough}"


def _actuators(spacecraft: Spacecraft) -> str:
    torquer = spacecraft.torquer
    texts = []
    if torquer is not None:
        strength = "an ideal impulse" if torquer.torque is None else quantity(torquer.torque, "N m")
        assumed = " (assumed: the file names no actuator)" if spacecraft.steerable is None else ""
        texts.append(f"steerable torquer, {strength}{assumed}")
    if spacecraft.channels:
        texts.append("channels " + " ".join(channel.name for channel in spacecraft.channels))
    return "; ".join(texts)
