"""``nutdamp plan``: plan the schemes, compare them, recommend one."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from nutdamp.cli.boundary import INFEASIBLE, INTERNAL, REQUIREMENT_MISSED
from nutdamp.cli.common import (
    FIGURES,
    Input,
    Output,
    deliver,
    expect_picture,
    expect_places,
    load,
    plot_options,
    quiet_option,
    remarks,
    require_dispersions,
    spacecraft_argument,
)
from nutdamp.cli.failures import show_failures
from nutdamp.cli.impulses import expect_impulses, impulse_options
from nutdamp.cli.parameters import FILE, SchemeName
from nutdamp.cli.places import expect_outputs
from nutdamp.cli.scheme_options import Aim, PlanningCommand, expect_read, goal_options, scheme_options
from nutdamp.cli.screen import say
from nutdamp.errors import BadRequest
from nutdamp.schemes import PLANNED, Options
from nutdamp.words import listed

if TYPE_CHECKING:
    from rich.console import RenderableType

    from nutdamp.comparison import Comparison
    from nutdamp.decision import Decision
    from nutdamp.planning import Plan
    from nutdamp.robust import RobustComparison


SCHEMES = "schemes"
"""The picture of all plans; the others are of one."""


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
@click.option("--robust", is_flag=True, help="Recommend by how many dispersed cases comply.")
@impulse_options
@click.option("--csv", type=FILE, help="Write the pulses of the plan to fly.")
@click.option("--blocks", type=FILE, help="Write its command blocks (CSV).")
@click.option("--table", type=FILE, help="Write the comparison of schemes (CSV).")
@click.option("--json", type=FILE, help="Write all plans and residuals.")
@plot_options((*FIGURES, SCHEMES))
@quiet_option
def command(
    spacecraft: Input,
    names: tuple[str, ...],
    options: Options,
    aim: Aim,
    robust: bool,
    impulses: bool,
    force: bool,
    csv: str | None,
    blocks: str | None,
    table: str | None,
    json: str | None,
    plot: str | None,
    figure: str,
    quiet: bool,
) -> None:
    """Plan pulse schedules that damp the nutation, and compare them.

    SPACECRAFT is a YAML file, or - for standard input; default spacecraft.yaml here, else the built-in example.
    A FILE of - is standard output.
    """
    names = tuple(dict.fromkeys(names))
    expect_impulses(impulses, force, robust, "--robust")
    one_plan = plot if figure != SCHEMES else None
    for option, path in (("--csv", csv), ("--plot", one_plan)):
        if path is not None and len(names) > 1:
            raise click.UsageError(f"{option} writes one schedule: name one --scheme, or none for the recommended one")
    silent = expect_outputs(spacecraft, csv=csv, blocks=blocks, table=table, json=json, plot=plot)
    expect_picture(plot, figure)
    remark = remarks(quiet)
    body = load(spacecraft, remark, aim)
    expect_places(csv, blocks, table, json, plot)

    if robust:
        require_dispersions(body)

    from nutdamp.cli.progress import working
    from nutdamp.comparison import compare, usual
    from nutdamp.decision import decide

    names = names or usual(body)
    expect_read(names, options, body, remark)
    with working("planning", quiet=quiet):
        compared = compare(body, names, options)
    dispersed = _disperse(compared, options, quiet, impulses=impulses, force=force) if robust else None
    decided = decide(compared) if dispersed is None else dispersed.decision
    chosen = None if decided is None else decided.plan
    for path in (csv, blocks, one_plan):
        if path is not None and chosen is None:
            say(f"{path} was not written: no plan is feasible")
    commanded = None if blocks is None else _commanded(compared, chosen, remark)

    def data() -> dict[str, Any]:
        from nutdamp.library.views import comparison_data

        made = comparison_data(compared, decided)
        if dispersed is None:
            return made
        from nutdamp.files.robust_json import robust_json
        from nutdamp.presentation import verdicts

        return {**made, "robust": robust_json(dispersed, verdicts.robust_reason(dispersed))}

    outputs: list[Output] = [(json, data), (table, partial(_schemes, compared, decided))]
    if chosen is not None:
        outputs.append((csv, partial(_pulses, chosen)))
        outputs.append((one_plan, partial(_picture, chosen, figure, one_plan)))
    if commanded is not None:
        outputs.append((blocks, partial(_blocks, commanded)))
    if figure == SCHEMES:
        outputs.append((plot, partial(_schemes_picture, compared, decided, plot)))
    if silent:
        from nutdamp.presentation import verdicts

        for warning in verdicts.warnings(compared):
            remark(f"warning: {warning}")
    deliver(outputs, *[partial(_screen, compared, dispersed)] * (not silent))
    if show_failures(compared):
        sys.exit(INTERNAL)
    if chosen is None:
        sys.exit(INFEASIBLE)
    if decided is not None and decided.met is False:
        sys.exit(REQUIREMENT_MISSED)


def _disperse(compared: Comparison, options: Options, quiet: bool, *, impulses: bool, force: bool) -> RobustComparison:
    """Fly the plans and their variants in dispersed cases, with a bar."""
    from nutdamp import robust
    from nutdamp.cli.progress import progress

    trials = robust.attempts(compared, options)
    with progress("dispersing", len(trials), quiet=quiet) as advance:
        return robust.compare(compared, trials, advance, impulses=impulses, force=force)


def _commanded(compared: Comparison, chosen: Plan | None, remark: Callable[[str], None]) -> Plan | None:
    """The plan whose blocks are written: the one to fly, or else one that was compared; None without any plan.

    Raises BadRequest where plans have pulses, but no blocks.
    """
    plans = [one for one in (chosen, *compared) if one is not None and one.feasible]
    found = next((one for one in plans if one.pulses.blocks), None)
    if plans and found is None:
        raise BadRequest("--blocks: no plan is made of command blocks; --scheme command-block says why")
    if found is not None and found is not chosen:
        remark(f"writing the blocks of {found.scheme}, which is not the recommended plan")
    return found


def _pulses(chosen: Plan) -> str:
    from nutdamp.files.pulses_csv import pulses_csv

    return pulses_csv(chosen.flight)


def _blocks(chosen: Plan) -> str:
    from nutdamp.files.blocks_csv import blocks_csv

    return blocks_csv(chosen.flight)


def _schemes(compared: Comparison, decided: Decision | None) -> str:
    from nutdamp.files.schemes_csv import schemes_csv

    return schemes_csv(compared, decided)


def _picture(chosen: Plan, figure: str, path: str | None) -> bytes:
    from nutdamp.presentation import figures

    assert path is not None
    return figures.plan_picture(figure, chosen, path)


def _schemes_picture(compared: Comparison, decided: Decision | None, path: str | None) -> bytes:
    from nutdamp.presentation import figures

    assert path is not None
    return figures.rendered(figures.schemes_figure(compared, decided), path)


def _screen(compared: Comparison, dispersed: RobustComparison | None) -> RenderableType:
    if dispersed is not None:
        from nutdamp.presentation.robust_tables import robust_screen

        return robust_screen(dispersed)
    from nutdamp.presentation.plan_tables import comparison_screen

    return comparison_screen(compared)
