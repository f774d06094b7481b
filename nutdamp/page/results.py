"""Display and output of the results: the functions of `nutdamp.common.results`, for each of the public types."""

from __future__ import annotations

from functools import partial
from os import PathLike
from typing import TYPE_CHECKING, Any

from nutdamp import units
from nutdamp.common import results
from nutdamp.errors import BadRequest, Infeasible, MissingExtra
from nutdamp.files.tabular import track_array, write_track, write_whole
from nutdamp.flight.propagation import Flight
from nutdamp.planning.decision import Comparison, Decision, decide, infeasibility, remarks
from nutdamp.planning.plan import Plan
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.views import decisions, verdicts
from nutdamp.views.decision_json import decision_json
from nutdamp.views.plan_json import comparison_json, plan_json, spacecraft_json
from nutdamp.views.pulses import pulse_table
from nutdamp.views.schemes import scheme_table
from nutdamp.views.text import degrees

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from nutdamp.flight.track import Track
    from nutdamp.page.document import Block


results.sentences.register(Plan, remarks)
results.sentences.register(Comparison, verdicts.warnings)
results.reason.register(Plan, infeasibility)
results.reason.register(Comparison, verdicts.reason)


results.data.register(Spacecraft, spacecraft_json)
results.data.register(Plan, plan_json)


@results.data.register
def _(compared: Comparison) -> dict[str, Any]:
    return comparison_data(compared, decide(compared))


def comparison_data(compared: Comparison, decided: Decision | None) -> dict[str, Any]:
    """The object of ``plan --json``: the plans, the decision on one of them, and the words of both."""
    data = comparison_json(compared, verdicts.spoken(compared))
    return {**data, "decision": None if decided is None else decision_json(decided, decisions.verdict(decided))}


@results.table.register
def _(plan: Plan) -> results.Table:
    return pulse_table(plan.flight).array()


@results.table.register
def _(compared: Comparison) -> results.Table:
    return scheme_table(compared, compared.recommended).array()


@results.table.register
def _(flight: Flight) -> results.Table:
    return track_array(flight.sampled(flight.samples, flight.shown_to), flight.spacecraft.inertia)


@results.write_csv.register
def _(plan: Plan, path: str | PathLike[str]) -> None:
    write_whole(units.path("path", path), pulse_table(feasible(plan).flight).csv())


@results.write_csv.register
def _(compared: Comparison, path: str | PathLike[str]) -> None:
    write_whole(units.path("path", path), scheme_table(compared, compared.recommended).csv())


@results.write_csv.register
def _(flight: Flight, path: str | PathLike[str]) -> None:
    pieces = flight.pieces(flight.samples, flight.shown_to)
    write_whole(units.path("path", path), partial(write_track, pieces, flight.spacecraft.inertia))


@results.figure.register(Flight)
def _(flight: Flight, name: str | None) -> Figure:
    from nutdamp.figures import overview

    return _drawn(name, flight, flight.sampled(flight.samples, overview.until(flight)))


@results.figure.register(Plan)
def _(plan: Plan, name: str | None) -> Figure:
    from nutdamp.figures import overview

    return _drawn(name, *overview.shown(feasible(plan)))


@results.figure.register(Comparison)
def _(compared: Comparison, name: str | None) -> Figure:
    decided = decide(compared)
    if decided is None:
        raise Infeasible(compared.reason)
    return decided.plan.figure(name)


def _drawn(name: str | None, flight: Flight, track: Track) -> Figure:
    """A figure of a flight by its name; raises BadRequest."""
    from nutdamp.figures import overview

    chosen = "overview" if name is None else units.instance("name", name, str, "the name of a figure")
    try:
        return overview.flight_figure(chosen, flight, track)
    except KeyError:
        raise BadRequest(f"there is no figure {name!r}; expected one of {', '.join(overview.DRAWN)}") from None


@results.line.register
def _(spacecraft: Spacecraft) -> str:
    inertia = spacecraft.inertia
    return (
        f"<Spacecraft {spacecraft.name}: {inertia.shape}, a = {inertia.a:.4g}, nutation {degrees(spacecraft.nutation)}>"
    )


@results.line.register
def _(plan: Plan) -> str:
    left = plan.flown
    if left is None:
        return f"<Plan {plan.scheme}: infeasible, {plan.why}>"
    return f"<Plan {plan.scheme}: {len(plan)} pulses until {plan.end:.4g} s, nutation left {degrees(left.nutation)}>"


@results.line.register
def _(flight: Flight) -> str:
    left = flight.residual
    ended = f"nutation left {degrees(left.nutation)}, momentum shift {degrees(left.momentum_shift)}"
    return f"<Flight of {_summary(flight)}: {ended}>"


@results.line.register
def _(compared: Comparison) -> str:
    chosen = compared.recommended
    verdict = compared.reason if chosen is None else f"recommended {chosen.scheme}, {compared.reason}"
    return f"<Comparison of {', '.join(plan.scheme for plan in compared)}: {verdict}>"


@results.html.register
def _(spacecraft: Spacecraft) -> str | None:
    from nutdamp.page.craft import spacecraft_facts

    return _block(spacecraft_facts(spacecraft, title=spacecraft.name))


@results.html.register
def _(plan: Plan) -> str | None:
    from nutdamp.page.document import Prose, sheet

    if not plan.feasible:
        return _block(Prose(repr(plan)[1:-1]))
    return _beside(_block(sheet(f"Pulses of {plan.scheme}", pulse_table(plan.flight, phased=True))), plan)


@results.html.register
def _(flight: Flight) -> str | None:
    from nutdamp.page.sheets import residual_sheet

    return _beside(_block(residual_sheet(f"{flight.spacecraft.name}: {_summary(flight)}", flight.residual)), flight)


@results.html.register
def _(compared: Comparison) -> str | None:
    from nutdamp.page.document import sheet

    table = scheme_table(compared, compared.recommended)
    return _beside(_block(sheet(table.title, table)), compared.recommended)


def _beside(table: str | None, result: Plan | Flight | None) -> str | None:
    """A table with the picture of the motion beside it, or below where there is no room."""
    from nutdamp.figures.image import svg

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
    from nutdamp.page.html import block_html

    try:
        return block_html(content)
    except MissingExtra:
        return None


def _summary(flight: Flight) -> str:
    return f"{len(flight.schedule)} pulses until {flight.shown_to:.4g} s by {flight.model}"


def feasible(plan: Plan) -> Plan:
    """A plan with a schedule; raises BadRequest for anything but a `Plan`, Infeasible for one without."""
    units.instance("plan", plan, Plan, "a Plan, as nutdamp.plan gives it")
    if not plan.feasible:
        raise Infeasible(f"{plan.scheme} is infeasible: {plan.why}")
    return plan
