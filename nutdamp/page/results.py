"""Display and output of the results: functions for `nutdamp.common.results`, by their names."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from os import PathLike
from typing import IO, TYPE_CHECKING, Any

from nutdamp import units
from nutdamp.common import results
from nutdamp.errors import BadRequest, Infeasible, MissingExtra
from nutdamp.files.tabular import track_array, write_track, write_whole
from nutdamp.flight.propagation import Flight
from nutdamp.planning.decision import Comparison
from nutdamp.planning.notes import comparison_warnings, plan_notes, reasons
from nutdamp.planning.plan import Plan, feasible
from nutdamp.planning.simulation import Simulation
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.views.decisions import comparison_json
from nutdamp.views.glance import scheme_table
from nutdamp.views.parts import pulse_table
from nutdamp.views.tables import DataTable
from nutdamp.views.text import degrees, joined, sentences

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from nutdamp.page.document import Block
    from nutdamp.planning.robust import RobustComparison


VIEWS = {
    "object.save": "page.results:save",
    "object.write": "page.results:write",
    "Spacecraft.data": "views.decisions:spacecraft_json",
    **{
        f"{kind}.{what}": f"page.results:{what}"
        for kind in ("Spacecraft", "Plan", "Comparison", "Flight", "Simulation")
        for what in ("line", "html")
    },
    **{
        f"{kind}.{what}": f"page.results:{what}"
        for kind in ("Plan", "Comparison", "Flight", "Simulation")
        for what in ("csv", "table", "figure")
    },
    "Plan.data": "views.decisions:plan_json",
    "Plan.sentences": "page.results:remarks",
    "Plan.verdict": "planning.screening:verdict_of",
    "Plan.reason": "planning.causes:infeasibility",
    "Comparison.data": "views.decisions:comparison_json",
    "Comparison.sentences": "page.results:remarks",
    "Comparison.reason": "page.results:comparison_reason",
    "RobustComparison.data": "page.results:robust_data",
    "Simulation.data": "views.simulation:simulation_json",
    "Simulation.screen": "views.simulation:simulation_screen",
    "Trade.data": "views.trade:trade_json",
    "Trade.csv": "views.trade:trade_csv",
    "Trade.figure": "figures.studies:trade_figure",
    "Trade.screen": "views.trade:trade_screen",
    "Dispersion.data": "views.dispersion:dispersion_json",
    "Dispersion.figure": "figures.studies:dispersion_figure",
    "Dispersion.screen": "views.dispersion:dispersion_screen",
    "LoopDispersion.data": "views.loop_cases:loop_cases_json",
    "LoopDispersion.figure": "figures.studies:loop_cases_figure",
    "LoopDispersion.screen": "views.loop_cases:loop_cases_screen",
    "LoopPlan.data": "views.loop:loop_json",
    "LoopPlan.figure": "figures.signals:loop_figure",
    "LoopPlan.screen": "views.loop:loop_screen",
    "LoopVerification.data": "views.loop:verified_json",
    "LoopVerification.screen": "views.loop:verification_screen",
    "Fitted.data": "views.fit:fit_json",
    "Fitted.figure": "figures.signals:fit_figure",
    "Fit.text": "files.carried:fitted_text",
    "Plan.carried": "files.carried:carried_spacecraft",
    "Fitted.spacecraft": "files.carried:fitted_spacecraft",
    "Verified.data": "views.simulation:verification_json",
    "Verified.screen": "views.simulation:verification_screen",
    "Budget.data": "views.loop:budget_json",
    "Budget.csv": "views.loop:budget_csv",
    "Budget.figure": "figures.signals:budget_figure",
    "Budget.screen": "views.loop:budget_screen",
}
"""Functions of results, see `nutdamp.common.results.view`."""


def remarks(result: Plan | Comparison) -> tuple[str, ...]:
    """Notes on a plan, or warnings on the recommended one."""
    if isinstance(result, Comparison):
        return sentences(comparison_warnings(result))
    return sentences(plan_notes(result) if result.feasible else ())


def comparison_reason(compared: Comparison) -> str:
    """Reason for the recommendation."""
    return joined(reasons(compared))


def robust_data(robust: RobustComparison) -> dict[str, Any]:
    """The object of ``plan --robust --json``."""
    from nutdamp.views.robust import robust_json

    return {**comparison_json(robust.joined), "robust": robust_json(robust)}


def _rows(result: Plan | Comparison) -> DataTable:
    if isinstance(result, Comparison):
        return scheme_table(result, result.recommended)
    return pulse_table(result.flight)


def table(result: Plan | Comparison | Flight | Simulation) -> results.Table:
    """Rows of the pulses, the schemes, or the track."""
    if isinstance(result, Plan | Comparison):
        return _rows(result).array()
    flight, until = (
        (result, result.shown_to) if isinstance(result, Flight) else (result.shown, result.until)
    )
    return track_array(flight.sampled(result.samples, until), flight.spacecraft.inertia)


def csv(result: Plan | Comparison | Flight | Simulation) -> str | Callable[[IO[bytes]], None]:
    """File of the rows of `table`; raises Infeasible."""
    if isinstance(result, Plan | Comparison):
        return _rows(feasible(result) if isinstance(result, Plan) else result).csv()
    if isinstance(result, Flight):
        return partial(
            write_track, result.pieces(result.samples, result.shown_to), result.spacecraft.inertia
        )
    return partial(write_track, result.pieces(), result.plan.spacecraft.inertia)


def figure(result: Plan | Comparison | Flight | Simulation, name: str = "overview") -> Figure:
    """Figure by its name of a flight, of that of a plan or of the recommended one; raises
    BadRequest, Infeasible.
    """
    from nutdamp.figures import overview

    judged = None if isinstance(result, Flight) else result.verdict
    if isinstance(result, Comparison):
        if result.recommended is None:
            raise Infeasible(result.reason)
        result = result.recommended
    if isinstance(result, Plan):
        flight, track = overview.shown(feasible(result))
    elif isinstance(result, Flight):
        flight = result
        track = result.sampled(result.samples, overview.until(result))
    else:
        flight, track = result.shown, result.pictured
    named = units.instance("name", name, str, "the name of a figure")
    try:
        return overview.flight_figure(named, flight, track, judged)
    except KeyError:
        raise BadRequest(
            f"there is no figure {name!r}; expected one of {', '.join(overview.DRAWN)}"
        ) from None


def save(result: object, path: str | PathLike[str]) -> None:
    """Write the CSV file of a result; raises CannotWrite."""
    write_whole(units.path("path", path), results.view(result, "csv"))


def write(_: object, path: str | PathLike[str], text: str) -> None:
    """Write a text of a result; raises CannotWrite."""
    write_whole(units.path("path", path), text)


def line(result: Spacecraft | Plan | Flight | Comparison | Simulation) -> str:
    """Summary of a result in one line."""
    if isinstance(result, Simulation):
        return line(result.shown)
    if isinstance(result, Spacecraft):
        inertia = result.inertia
        shape = f"{inertia.shape}, a = {inertia.a:.4g}, nutation {degrees(result.nutation)}"
        return f"<Spacecraft {result.name}: {shape}>"
    if isinstance(result, Comparison):
        chosen = result.recommended
        verdict = (
            result.reason if chosen is None else f"recommended {chosen.scheme}, {result.reason}"
        )
        return f"<Comparison of {', '.join(plan.scheme for plan in result)}: {verdict}>"
    if isinstance(result, Flight):
        residual = result.residual
        shift = degrees(residual.momentum_shift)
        ended = f"nutation left {degrees(residual.nutation)}, momentum shift {shift}"
        return f"<Flight of {_summary(result)}: {ended}>"
    if result.flown is None:
        return f"<Plan {result.scheme}: infeasible, {result.why}>"
    ended = (
        f"{len(result)} pulses until {result.end:.4g} s, "
        f"nutation left {degrees(result.flown.nutation)}"
    )
    return f"<Plan {result.scheme}: {ended}>"


def html(result: Spacecraft | Plan | Flight | Comparison | Simulation) -> str | None:
    """HTML table of a result for notebooks, with the picture of its motion; None without the extra
    plot.
    """
    if isinstance(result, Simulation):
        return html(result.shown)
    from nutdamp.figures.image import svg
    from nutdamp.page.report import block_html

    try:
        table = block_html(_block(result))
    except MissingExtra:
        return None
    moves = result.recommended if isinstance(result, Comparison) else result
    if (
        moves is None
        or isinstance(moves, Spacecraft)
        or (isinstance(moves, Plan) and not moves.feasible)
    ):
        return table
    try:
        picture = svg(moves.figure("motion"))
    except MissingExtra:
        return table
    # The picture is beside the table, or below where there is no room.
    return (
        '<div style="display: flex; flex-wrap: wrap; gap: 1.5rem; align-items: flex-start">'
        f'<div>{table}</div><div style="flex: 1 1 26rem; max-width: 44rem">{picture}</div></div>'
    )


def _block(result: Spacecraft | Plan | Flight | Comparison) -> Block:
    from nutdamp.page.document import FactList, Prose, facts_of, sheet
    from nutdamp.views.decisions import derived_table

    if isinstance(result, Spacecraft):
        return facts_of(result.name, derived_table(result))
    if isinstance(result, Comparison):
        return sheet(scheme_table(result, result.recommended))
    if isinstance(result, Flight):
        names = ("nutation", "body_cone", "space_cone", "momentum_shift")
        rows = tuple(
            (name.replace("_", " "), degrees(getattr(result.residual, name))) for name in names
        )
        return FactList(f"{result.spacecraft.name}: {_summary(result)}", rows)
    if not result.feasible:
        return Prose(repr(result)[1:-1])
    return sheet(pulse_table(result.flight, scheme=result.scheme))


def _summary(flight: Flight) -> str:
    return f"{len(flight.schedule)} pulses until {flight.shown_to:.4g} s by {flight.model}"
