"""Display and output of the results: functions for `nutdamp.common.results`, by their names."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from functools import partial
from os import PathLike
from typing import IO, TYPE_CHECKING, Any

from nutdamp import units
from nutdamp.common import results
from nutdamp.errors import BadRequest, Infeasible, MissingExtra, NotFound
from nutdamp.files.tabular import track_array, write_track, write_whole
from nutdamp.flight.cones import Aspect
from nutdamp.flight.propagation import Flight
from nutdamp.planning.decision import Comparison
from nutdamp.planning.notes import comparison_warnings, plan_notes, reasons
from nutdamp.planning.plan import Plan, Worse, feasible
from nutdamp.planning.simulation import Simulation
from nutdamp.planning.verdict import Verdict
from nutdamp.spacecraft.constraints import Breach
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.views.decisions import comparison_json
from nutdamp.views.glance import scheme_table
from nutdamp.views.parts import pulse_table
from nutdamp.views.tables import DataTable
from nutdamp.views.text import degrees, joined, sentence, sentences

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from nutdamp.page.document import Block
    from nutdamp.planning.robust import RobustComparison
    from nutdamp.planning.screening import Dispersion


# Functions of results by the class of a result and a subject, see `nutdamp.common.results.view`.
VIEWS = {
    "object.save": "page.results:save",
    "object.write": "page.results:write",
    "Spacecraft.data": "views.decisions:spacecraft_json",
    **{
        f"{kind}.{what}": f"page.results:{what}"
        for kind in ("Spacecraft", "Plan", "Comparison", "Flight", "Simulation", "RobustComparison")
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
    "Dispersion.html": "page.results:html",
    "Dispersion.table": "files.export:samples_array",
    "Dispersion.csv": "files.export:samples_file",
    "Dispersion.percentiles": "files.export:percentiles_array",
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
    "Plan.former": "page.results:former",
    "Plan.simulated": "api:simulate",
    "Plan.carried": "files.carried:carried_spacecraft",
    "Fitted.spacecraft": "files.carried:fitted_spacecraft",
    "Verified.data": "views.simulation:verification_json",
    "Verified.screen": "views.simulation:verification_screen",
    "Budget.data": "views.loop:budget_json",
    "Budget.csv": "views.loop:budget_csv",
    "Budget.figure": "figures.signals:budget_figure",
    "Budget.screen": "views.loop:budget_screen",
}


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
    return pulse_table(result._flight, scheme=result.scheme)


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
    from nutdamp.figures import overview, studies

    named = units.instance("name", name, str, "the name of a figure")
    judged = None if isinstance(result, Flight) else result.verdict
    others: tuple[Verdict, ...] = ()
    if isinstance(result, Comparison):
        if result.recommended is None:
            raise Infeasible(result.reason)
        others = result.others
        result = result.recommended
    box = None
    names: tuple[str, ...] = overview.FIGURES
    if isinstance(result, Plan):
        assert judged is not None
        feasible(result)
        box = partial(studies.acceptance, judged=judged, others=others)
        names = (*names, "box")
        flight, track = overview.shown(result)
    elif isinstance(result, Flight):
        flight = result
        track = result.sampled(result.samples, overview.until(result))
    else:
        flight, track = result.shown, result.pictured
    if named not in names:
        raise BadRequest(f"there is no figure {name!r}; expected one of {', '.join(names)}")
    if judged is not None and named == "box":
        return studies.acceptance_figure(judged, others)
    return overview.flight_figure(named, flight, track, judged, box=box)


def save(result: object, path: str | PathLike[str]) -> None:
    """Write the CSV file of a result; raises CannotWrite."""
    write_whole(units.path("path", path), results.view(result, "csv"))


def write(_: object, path: str | PathLike[str], text: str) -> None:
    """Write a text of a result; raises CannotWrite."""
    write_whole(units.path("path", path), text)


def line(
    result: Spacecraft | Plan | Flight | Comparison | Simulation | RobustComparison,
) -> str:
    """Summary of a result in one line."""
    if not isinstance(result, Spacecraft | Plan | Flight | Comparison | Simulation):
        return line(result.joined)
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
        nutation, shift = map(degrees, (result.residual.nutation, result.residual.momentum_shift))
        ended = f"nutation left {nutation}, momentum shift {shift}"
        return f"<Flight of {_summary(result)}: {ended}>"
    if result.flown is None:
        return f"<Plan {result.scheme}: infeasible, {result.why}>"
    ended = (
        f"{len(result)} pulses until {result.end:.4g} s, "
        f"nutation left {degrees(result.flown.nutation)}"
    )
    return f"<Plan {result.scheme}: {ended}>"


def html(
    result: Spacecraft | Plan | Flight | Comparison | Simulation | Dispersion | RobustComparison,
) -> str | None:
    """HTML of a result for notebooks: headline and bounds of what is judged, a table, and a picture
    beside them; None without the extra plot.
    """
    from nutdamp.figures.image import svg
    from nutdamp.page.report import block_html
    from nutdamp.planning.screening import Dispersion

    if isinstance(result, Simulation):
        return html(result.shown)
    if not isinstance(result, Spacecraft | Plan | Flight | Comparison | Dispersion):
        return html(result.joined)
    try:
        shown = "".join(map(block_html, _blocks(result)))
    except MissingExtra:
        return None
    if isinstance(result, Spacecraft):
        return shown
    named = () if isinstance(result, Dispersion) or hasattr(result, "flown_run") else ("motion",)
    try:
        picture = svg(result.figure(*named))
    except (Infeasible, MissingExtra):
        return shown
    # The picture is beside the tables, or below where there is no room.
    return (
        '<div style="display: flex; flex-wrap: wrap; gap: 1.5rem; align-items: flex-start">'
        f'<div>{shown}</div><div style="flex: 1 1 26rem; max-width: 44rem">{picture}</div></div>'
    )


def _blocks(result: Spacecraft | Plan | Flight | Comparison | Dispersion) -> Iterator[Block]:
    from nutdamp.page.document import FactList, Prose, fact_list, sheet
    from nutdamp.views import dispersion, verdict
    from nutdamp.views.decisions import derived_facts

    if isinstance(result, Spacecraft):
        yield fact_list(result.name, derived_facts(result))
        return
    if isinstance(result, Flight):
        names = ("nutation", "body_cone", "space_cone", "momentum_shift")
        left = [(name.replace("_", " "), degrees(getattr(result.residual, name))) for name in names]
        yield FactList(f"{result.spacecraft.name}: {_summary(result)}", tuple(left))
        return
    judged = result.verdict
    about = "".join(verdict.headline(judged, result if isinstance(result, Comparison) else None))
    stated = "" if judged.why else f". {sentence(verdict.statement(judged))}"
    of_loop = verdict.loop_sentence(judged) if hasattr(result, "flown_run") else ""
    yield Prose(of_loop or about + stated)
    if judged.lines:
        yield sheet(verdict.bound_table(judged))
    if isinstance(result, Plan | Comparison):
        if not isinstance(result, Plan) or result.feasible:
            yield sheet(_rows(result))
    else:
        nominal = result.core.study.outputs_of({})
        table = dispersion.percentile_table(result.core, dispersion.FLOWN_OUTPUTS, nominal)
        yield sheet(table, "screen")


def _summary(flight: Flight) -> str:
    return f"{len(flight.schedule)} pulses until {flight.shown_to:.4g} s by {flight.model}"


FORMER = {
    **{"remarks": "notes", "to_numpy": "numpy.asarray(plan)", "flight": "fly()"},
    "to_pandas": "pandas.DataFrame(numpy.asarray(plan))",
    **{"refusal": "why", "left": "flown", "held": "verdict.lines", "shortfalls": "verdict.lines"},
    **dict.fromkeys(("failure", "breach", "astray", "worse", "worse_at", "from_file", "cut"), ""),
    **dict.fromkeys(("found_none", "carried_at", "reaching", "disturbed", "commandable"), ""),
    **dict.fromkeys(("ends_well", "standing", "severity", "spin_change", "delta_v"), ""),
    **{"aspects": "verdict.aspects", "kept": "verdict.lines"},
}
"""Names of `Plan` that were public to version 0.3, and what to write for some."""


def former(result: Plan, name: str) -> Any:
    """Attribute of a plan by its former name, with a warning; AttributeError for any other."""
    if name not in FORMER:
        raise AttributeError(f"{type(result).__name__!r} object has no attribute {name!r}")
    instead = f": {FORMER[name]} has it" if FORMER[name] else ""
    warning = f"{name} of a plan goes with version 0.5{instead}"
    warnings.warn(warning, DeprecationWarning, stacklevel=4)  # of who asks the plan
    if name == "remarks":
        return result.notes
    why = result._why
    gone = {
        "refusal": result.why if isinstance(why, Exception) else None,
        "breach": why if isinstance(why, Breach) else None,
        "astray": why if isinstance(why, Aspect) else None,
        "worse": why.nutation if isinstance(why, Worse) else None,
        "worse_at": why.at if isinstance(why, Worse) else 0.0,
        "found_none": isinstance(why, NotFound),
    }
    return gone[name] if name in gone else getattr(result, f"_{name}")
