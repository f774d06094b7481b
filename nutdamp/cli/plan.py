"""``nutdamp plan``: plan the schemes, compare them, recommend one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from nutdamp.cli.flown import compared_with, robust_of
from nutdamp.cli.job import (
    FIGURES,
    FileInput,
    Output,
    begin,
    plot_options,
    quiet_option,
    require_dispersions,
    spacecraft_argument,
)
from nutdamp.cli.main import leave
from nutdamp.cli.options import FILE, Aim, PlanningCommand, SchemeName, goal_options, scheme_options
from nutdamp.cli.screen import say, show_failures
from nutdamp.errors import BadRequest, listed, printable
from nutdamp.schemes.catalogue import PLANNED, Options

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import RenderableType

    from nutdamp.errors import CannotWrite
    from nutdamp.planning.decision import Comparison, Decision
    from nutdamp.planning.plan import Plan
    from nutdamp.planning.robust import RobustComparison
    from nutdamp.planning.tradeoff import Certificate
    from nutdamp.spacecraft.model import Spacecraft


PRIMER = "primer"
"""The picture of the certificate; the others are of one plan."""


@click.command("plan", cls=PlanningCommand)
@spacecraft_argument
@click.option(
    "--scheme",
    "names",
    multiple=True,
    type=SchemeName(PLANNED),
    help=f"Plan it alone; repeatable: {listed(PLANNED, 'or')}.",
)
@scheme_options
@goal_options
@click.option("--robust", is_flag=True, help="Cheapest plan with which enough cases comply.")
@click.option("--nominal", is_flag=True, help="Judge nominal values alone, no dispersed cases.")
@click.option("--timed", is_flag=True, help="Recommend pulses no command block fires, too.")
@click.option("--csv", type=FILE, help="Write the pulses of the plan to fly.")
@click.option("--blocks", type=FILE, help="Write its command blocks (CSV).")
@click.option("--table", type=FILE, help="Write the comparison of schemes (CSV).")
@click.option("--json", type=FILE, help="Write all plans and residuals.")
@click.option("--certificate", type=FILE, help="Write the proof of the least cost (JSON).")
@plot_options((*FIGURES, PRIMER))
@click.option("-v", "--verbose", is_flag=True, help="Show all values and remarks.")
@quiet_option
def command(
    spacecraft: FileInput,
    names: tuple[str, ...],
    options: Options,
    aim: Aim,
    robust: bool,
    nominal: bool,
    timed: bool,
    csv: str | None,
    blocks: str | None,
    table: str | None,
    json: str | None,
    certificate: str | None,
    plot: str | None,
    figure: str,
    verbose: bool,
    quiet: bool,
) -> None:
    """Plan pulse schedules that damp the nutation, and compare them.

    SPACECRAFT is a YAML file, or - for standard input; default spacecraft.yaml here, else the built-in example.
    A FILE of - is standard output.
    """
    one_plan, curve = (None, plot) if figure == PRIMER else (plot, None)
    _expect_one_scheme(names, csv=csv, plot=one_plan)
    files = {"csv": csv, "blocks": blocks, "table": table, "json": json, "certificate": certificate, "plot": plot}
    job = begin(spacecraft, aim=aim, quiet=quiet, figure=figure, **files)
    if robust and nominal:
        raise click.UsageError("--robust goes by dispersed cases, which --nominal leaves out: name one of them")
    if robust:
        require_dispersions(job.spacecraft)
    if certificate is not None or curve is not None:
        _expect_certified(names, job.spacecraft)

    from nutdamp.planning.decision import decide
    from nutdamp.views import verdicts
    from nutdamp.views.schemes import scheme_table

    compared = compared_with(job, names, options, 0 if nominal else None, timed=timed)
    dispersed = robust_of(job, compared, options) if robust else None
    decided = decide(compared) if dispersed is None else dispersed.decision
    chosen = None if decided is None else decided.plan
    for path in filter(None, () if chosen else (csv, blocks, one_plan)):
        say(f"{printable(path)} was not written: no plan is feasible")
    proof, unproved = _certified(compared, [certificate, curve])
    if proof is not None and proof.plan is not chosen:
        job.remark(f"the certificate is of {proof.plan.scheme} for nominal values, which is not the recommended plan")
    outputs: list[Output] = [
        (json, partial(_data, compared, decided, dispersed)),
        (table, lambda: scheme_table(compared, chosen).csv()),
        *_outputs_of_proof(proof, certificate, curve),
        *_outputs_of(chosen, csv, one_plan, figure),
        *_outputs_of_blocks(compared, chosen, blocks, job.remark),
    ]
    if job.silent:
        job.warn(verdicts.warnings(compared))
    job.deliver(outputs, partial(_screen, compared, decided, dispersed, verbose), unsaved=unproved)
    missed = decided is not None and decided.met is False
    leave(failed=show_failures(compared), infeasible=decided is None, missed=missed)


def _expect_one_scheme(names: Sequence[str], **written: str | None) -> None:
    """A usage error where the pulses of one plan are to be written, and several schemes are named."""
    for option, path in written.items():
        if path is not None and len(set(names)) > 1:
            raise click.UsageError(
                f"--{option} writes one schedule: name one --scheme, or none for the recommended one"
            )


def _outputs_of(chosen: Plan | None, csv: str | None, plot: str | None, figure: str) -> list[Output]:
    """The files of the plan to fly, if there is one."""
    if chosen is None:
        return []
    from nutdamp.views.pulses import pulse_table

    return [(csv, lambda: pulse_table(chosen.flight).csv()), (plot, partial(_picture, chosen, figure))]


def _outputs_of_blocks(
    compared: Comparison, chosen: Plan | None, path: str | None, remark: Callable[[str], None]
) -> list[Output]:
    """The file of command blocks: of the plan to fly, or else of one that was compared; none without any plan.

    Raises BadRequest where plans have pulses, but no blocks.
    """
    plans: list[Plan] = [plan for plan in (chosen, *compared) if plan is not None and plan.feasible]
    if path is None or not plans:
        return []
    source = next((plan for plan in plans if plan.pulses.blocks), None)
    if source is None:
        raise BadRequest("--blocks: no plan is made of command blocks; --scheme command-block says why")
    if source is not chosen:
        remark(f"writing the blocks of {source.scheme}, which is not the recommended plan")
    from nutdamp.views.pulses import block_table

    return [(path, lambda: block_table(source.flight).csv())]


def _expect_certified(names: Sequence[str], body: Spacecraft) -> None:
    """Raise BadRequest, before any work, where the scheme that certificates belong to is not to be planned.

    Also where it cannot plan, as without channels.
    """
    from nutdamp.planning.decision import usual
    from nutdamp.schemes.catalogue import OPTIMAL

    if OPTIMAL.name not in (names or usual(body)):
        raise BadRequest(f"a certificate is of {OPTIMAL.name}, which is not planned: name it with --scheme")
    if not body.channels:
        raise BadRequest(f"a certificate is of {OPTIMAL.name}, which fires channels, and the spacecraft has none")


def _certified(compared: Comparison, paths: Sequence[str | None]) -> tuple[Certificate | None, list[CannotWrite]]:
    """The certificate of the plan of optimal; where it has none, the errors of the ``paths`` that are not written.

    None where no path is named.
    """
    files = [path for path in paths if path is not None]
    if not files:
        return None, []
    from nutdamp.errors import CannotWrite
    from nutdamp.planning.tradeoff import SCHEME, certificate

    try:
        return certificate(next(plan for plan in compared if plan.scheme == SCHEME)), []
    except BadRequest as reason:
        return None, [CannotWrite(path, f"there is no certificate: {reason}") for path in files]


def _outputs_of_proof(proof: Certificate | None, path: str | None, plot: str | None) -> list[Output]:
    """The files of a certificate, if there is one."""
    if proof is None:
        return []
    from nutdamp.views.certificate_json import certificate_json

    def picture() -> Figure:
        from nutdamp.figures import certificate

        return certificate.certificate_figure(proof)

    return [(path, partial(certificate_json, proof)), (plot, picture)]


def _data(compared: Comparison, decided: Decision | None, dispersed: RobustComparison | None) -> dict[str, Any]:
    from nutdamp.page.results import comparison_data

    data = comparison_data(compared, decided)
    if dispersed is None:
        return data
    from nutdamp.views import robust_verdicts
    from nutdamp.views.robust import robust_json

    return {**data, "robust": robust_json(dispersed, robust_verdicts.robust_reason(dispersed))}


def _picture(chosen: Plan, figure: str) -> Figure:
    from nutdamp.figures import overview

    return overview.flight_figure(figure, *overview.shown(chosen))


def _screen(
    compared: Comparison, decided: Decision | None, dispersed: RobustComparison | None, verbose: bool
) -> RenderableType:
    from nutdamp.views import robust_verdicts, verdicts
    from nutdamp.views.glance import glance

    if dispersed is not None:
        from nutdamp.views.robust import robust_screen

        reason = robust_verdicts.robust_reason(dispersed)
        return robust_screen(dispersed) if verbose else glance(dispersed.joined, decided, reason, dispersed.name)
    if verbose:
        from nutdamp.views.plan_tables import comparison_screen

        return comparison_screen(compared)
    return glance(compared, decided, verdicts.reason(compared))
