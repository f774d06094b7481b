"""How the results show and write themselves: what `nutdamp.views` declares, for each of the public types."""

from __future__ import annotations

from functools import partial
from os import PathLike
from typing import TYPE_CHECKING, Any

from nutdamp import arguments, views
from nutdamp.comparison import Comparison
from nutdamp.decision import Decision, decide
from nutdamp.errors import BadRequest, Infeasible, MissingExtra
from nutdamp.files.decision_json import decision_json
from nutdamp.files.output import write_whole
from nutdamp.files.plan_json import comparison_json, plan_json, spacecraft_json
from nutdamp.files.pulses_csv import pulses_array, pulses_csv
from nutdamp.files.schemes_csv import schemes_array, schemes_csv
from nutdamp.files.track_csv import track_array, write_track
from nutdamp.flight import Flight
from nutdamp.planning import Plan
from nutdamp.presentation import decisions, verdicts
from nutdamp.presentation.text import degrees
from nutdamp.remarks import infeasibility, remarks
from nutdamp.spacecraft import Spacecraft

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from nutdamp.presentation.page.document import Block
    from nutdamp.track import Track

views.sentences.register(Plan, remarks)
views.sentences.register(Comparison, verdicts.warnings)
views.reason.register(Plan, infeasibility)
views.reason.register(Comparison, verdicts.reason)


views.data.register(Spacecraft, spacecraft_json)
views.data.register(Plan, plan_json)


@views.data.register
def _(compared: Comparison) -> dict[str, Any]:
    return comparison_data(compared, decide(compared))


def comparison_data(compared: Comparison, decided: Decision | None) -> dict[str, Any]:
    """What ``plan --json`` gives: the plans, the decision on one of them, and the words of both."""
    made = comparison_json(compared, verdicts.spoken(compared))
    return {**made, "decision": None if decided is None else decision_json(decided, decisions.verdict(decided))}


@views.table.register
def _(plan: Plan) -> views.Table:
    return pulses_array(plan.flight)


@views.table.register
def _(compared: Comparison) -> views.Table:
    return schemes_array(compared, decide(compared))


@views.table.register
def _(flight: Flight) -> views.Table:
    return track_array(flight.sampled(flight.samples, flight.shown_to), flight.spacecraft.inertia)


@views.write_csv.register
def _(plan: Plan, path: str | PathLike[str]) -> None:
    write_whole(arguments.path("path", path), pulses_csv(feasible(plan).flight))


@views.write_csv.register
def _(compared: Comparison, path: str | PathLike[str]) -> None:
    write_whole(arguments.path("path", path), schemes_csv(compared, decide(compared)))


@views.write_csv.register
def _(flight: Flight, path: str | PathLike[str]) -> None:
    pieces = flight.pieces(flight.samples, flight.shown_to)
    write_whole(arguments.path("path", path), partial(write_track, pieces, flight.spacecraft.inertia))


@views.figure.register(Flight)
def _(flight: Flight, name: str | None) -> Figure:
    from nutdamp.presentation import figures

    return _drawn(name, flight, flight.sampled(flight.samples, figures.until(flight)))


@views.figure.register(Plan)
def _(plan: Plan, name: str | None) -> Figure:
    from nutdamp.presentation import figures

    return _drawn(name, *figures.shown(feasible(plan)))


@views.figure.register(Comparison)
def _(compared: Comparison, name: str | None) -> Figure:
    from nutdamp.presentation import figures

    if name not in (None, "schemes"):
        raise BadRequest(f"there is no figure {name!r}; expected 'schemes'")
    return figures.schemes_figure(compared, decide(compared))


def _drawn(name: str | None, flight: Flight, track: Track) -> Figure:
    """A figure of a flight by its name; raises BadRequest."""
    from nutdamp.presentation import figures

    chosen = "overview" if name is None else arguments.instance("name", name, str, "the name of a figure")
    try:
        return figures.flight_figure(chosen, flight, track)
    except KeyError:
        raise BadRequest(f"there is no figure {name!r}") from None


@views.line.register
def _(spacecraft: Spacecraft) -> str:
    inertia = spacecraft.inertia
    return (
        f"<Spacecraft {spacecraft.name}: {inertia.shape}, a = {inertia.a:.4g}, nutation {degrees(spacecraft.nutation)}>"
    )


@views.line.register
def _(plan: Plan) -> str:
    left = plan.flown
    if left is None:
        return f"<Plan {plan.scheme}: infeasible, {plan.why}>"
    return f"<Plan {plan.scheme}: {len(plan)} pulses until {plan.end:.4g} s, nutation left {degrees(left.nutation)}>"


@views.line.register
def _(flight: Flight) -> str:
    left = flight.residual
    ended = f"nutation left {degrees(left.nutation)}, shift of H {degrees(left.momentum_shift)}"
    return f"<Flight of {_summary(flight)}: {ended}>"


@views.line.register
def _(compared: Comparison) -> str:
    chosen = compared.recommended
    verdict = compared.reason if chosen is None else f"recommended {chosen.scheme}, {compared.reason}"
    return f"<Comparison of {', '.join(one.scheme for one in compared)}: {verdict}>"


@views.html.register
def _(spacecraft: Spacecraft) -> str | None:
    from nutdamp.presentation.page.craft import spacecraft_facts

    return _block(spacecraft_facts(spacecraft, title=spacecraft.name))


@views.html.register
def _(plan: Plan) -> str | None:
    from nutdamp.presentation.page.document import Prose
    from nutdamp.presentation.page.sheets import pulse_sheet

    if not plan.feasible:
        return _block(Prose(repr(plan)[1:-1]))
    return _beside(_block(pulse_sheet(plan)), plan)


@views.html.register
def _(flight: Flight) -> str | None:
    from nutdamp.presentation.page.sheets import residual_sheet

    return _beside(_block(residual_sheet(f"{flight.spacecraft.name}: {_summary(flight)}", flight.residual)), flight)


@views.html.register
def _(compared: Comparison) -> str | None:
    from nutdamp.presentation.page.sheets import comparison_sheet

    return _beside(_block(comparison_sheet(compared)), compared.recommended)


def _beside(table: str | None, result: Plan | Flight | None) -> str | None:
    """A table with the picture of the motion beside it, or below where there is no room."""
    from nutdamp.presentation.figures.export import svg

    if table is None or result is None:
        return table
    try:
        picture = svg(result.figure("motion"))
    except MissingExtra:
        return table
    return (
        '<div style="display: flex; flex-wrap: wrap; gap: 1.5rem; align-items: flex-start">'
        f'<div>{table}</div><div style="flex: 1 1 26rem; max-width: 44rem">{picture}</div></div>'
    )


def _block(content: Block) -> str | None:
    from nutdamp.presentation.page.html import block_html

    try:
        return block_html(content)
    except MissingExtra:
        return None


def _summary(flight: Flight) -> str:
    return f"{len(flight.schedule)} pulses until {flight.shown_to:.4g} s by {flight.model}"


def feasible(plan: Plan) -> Plan:
    """A plan with a schedule; raises BadRequest for what is no `Plan`, Infeasible for one without."""
    arguments.instance("plan", plan, Plan, "a Plan, as nutdamp.plan gives it")
    if not plan.feasible:
        raise Infeasible(f"{plan.scheme} is infeasible: {plan.why}")
    return plan
