"""``plan``: the schemes compared, and the plan to fly."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

import click

from nutdamp.cli.job import (
    FIGURES,
    Files,
    Job,
    SessionCommand,
    carry_options,
    plot_options,
    screen_options,
    spacecraft_argument,
)
from nutdamp.cli.main import leave, say, show_failures
from nutdamp.cli.options import (
    OUTPUT,
    NameType,
    expect_read,
    goal_options,
    scheme_options,
)
from nutdamp.errors import BadRequest, listed, printable
from nutdamp.schemes.catalogue import OPTIMAL, PLANNED

if TYPE_CHECKING:
    from rich.console import RenderableType

    from nutdamp.errors import CannotWrite
    from nutdamp.planning.decision import Comparison
    from nutdamp.planning.plan import Plan
    from nutdamp.planning.robust import RobustComparison


scheme_option = partial(
    click.option, "--scheme", metavar="SCHEME"
)  # a line does not hold all the names


def compared_with(
    job: Job,
    names: Sequence[str],
    samples: int | None = None,
    *,
    timed: bool = False,
    robust: bool = True,
) -> Comparison:
    """Comparison of the schemes named, else the usual ones; a remark names the options that none of
    them reads.

    ``robust``: of the usual ones a robust plan is tried where too few cases comply.
    """
    from nutdamp.planning.decision import compare, usual

    names = tuple(dict.fromkeys(names))
    expect_read(names or usual(job.spacecraft), job.options, job.spacecraft, job.doubt)
    with job.working("planning"):
        compared = compare(job.spacecraft, names, job.options, samples=samples, timed=timed)
    if not robust or samples is not None or not compared.too_few_comply:
        return compared
    from nutdamp.planning.robust import with_robust  # dispersions that few cases of a plan bear

    with job.working("planning for the dispersions"):
        return with_robust(compared, job.options)


def robust_of(job: Job, compared: Comparison) -> RobustComparison:
    """The plans compared and their variants in dispersed cases."""
    from nutdamp.planning.robust import compare

    with job.working("dispersing"):
        return compare(compared, job.options)


@click.command("plan", cls=SessionCommand)
@spacecraft_argument
@scheme_option(
    "names", multiple=True, type=NameType(PLANNED), help=f"Repeatable: {listed(PLANNED, 'or')}."
)
@scheme_options
@goal_options
@click.option("--robust", is_flag=True, help="Cheapest plan with which enough cases comply.")
@click.option("--nominal", is_flag=True, help="Judge nominal values alone, no dispersed cases.")
@click.option("--timed", is_flag=True, help="Recommend pulses no command block fires, too.")
@click.option("--csv", type=OUTPUT, help="Write the pulses of the plan to fly.")
@click.option("--blocks", type=OUTPUT, help="Write its command blocks (CSV).")
@click.option("--table", type=OUTPUT, help="Write the comparison of schemes (CSV).")
@click.option("--json", type=OUTPUT, help="Write all plans and residuals.")
@click.option("--certificate", type=OUTPUT, help="Write the proof of the least cost (JSON).")
@carry_options("end of the last pulse")
@plot_options((*FIGURES, "box"))
@screen_options
def plan_command(
    job: Job,
    names: tuple[str, ...],
    robust: bool,
    nominal: bool,
    timed: bool,
    at: float | None,
    verbose: bool,
) -> None:
    """Plan pulse schedules that damp the nutation, and compare them.

    SPACECRAFT is a YAML file, or - for standard input; default spacecraft.yaml here, else the
    built-in example. A FILE of - is standard output.
    """
    csv, blocks, certificate, plot = (
        job.written[name] for name in ("csv", "blocks", "certificate", "plot")
    )
    for option, path in (("csv", csv), ("plot", plot)):
        if path is not None and len(set(names)) > 1:
            cure = "name one --scheme, or none for the recommended one"
            raise click.UsageError(f"--{option} writes one schedule: {cure}")
    spacecraft = job.begin()
    if robust and nominal:
        raise click.UsageError(
            "--robust goes by dispersed cases, which --nominal leaves out: name one of them"
        )

    from nutdamp.planning.decision import usual
    from nutdamp.planning.notes import comparison_warnings
    from nutdamp.spacecraft.tolerances import expect_dispersions
    from nutdamp.views.glance import glance, scheme_table
    from nutdamp.views.parts import pulse_table

    if robust:
        expect_dispersions(spacecraft.dispersions)
    if certificate is not None:
        if OPTIMAL.name not in (names or usual(spacecraft)):
            raise BadRequest(
                f"a certificate is of {OPTIMAL.name}, which is not planned: name it with --scheme"
            )
        if not spacecraft.channels:
            raise BadRequest(
                f"a certificate is of {OPTIMAL.name}, which fires channels, "
                "and the spacecraft has none"
            )
    compared = compared_with(job, names, 0 if nominal else None, timed=timed, robust=not robust)
    dispersed = robust_of(job, compared) if robust else None
    shown = compared if dispersed is None else dispersed.joined
    judged, chosen = shown.verdict, shown.recommended
    for path in filter(None, () if chosen is not None else (csv, blocks, plot)):
        say(f"{printable(path)} was not written: no plan is feasible")
    files, unproved = _certified(job, compared, chosen, certificate)
    more: Files = {"json": (compared if dispersed is None else dispersed).to_dict, **files}
    more["table"] = lambda: scheme_table(shown, chosen).csv()
    if chosen is not None:
        more["csv"] = lambda: pulse_table(chosen._flight).csv()
        more["plot"] = partial(shown.figure, job.figure or FIGURES[0])
    more |= job.carried(chosen, at)
    more |= {} if blocks is None else _blocks_file(job, compared, chosen)
    if job.silent:
        job.note(comparison_warnings(compared))
    screen: Callable[[], RenderableType]
    if verbose or dispersed is not None:
        from nutdamp.views.robust import comparison_screen, robust_screen  # not for a glance

        screen = partial(comparison_screen, compared)
        if dispersed is not None:
            screen = partial(robust_screen, dispersed, verbose=verbose)
    else:
        screen = partial(glance, compared)
    job.deliver(None, screen, more=more, unsaved=unproved)
    leave(judged.status, failed=show_failures(compared))


def _blocks_file(job: Job, compared: Comparison, chosen: Plan | None) -> Files:
    """The file of command blocks of the plan to fly, or another; BadRequest without blocks."""
    plans: list[Plan] = [plan for plan in (chosen, *compared) if plan is not None and plan.feasible]
    source = next((plan for plan in plans if plan.pulses.blocks), None)
    if source is None:
        if plans:
            raise BadRequest(
                "--blocks: no plan is made of command blocks; "
                "run --scheme command-block for the reason"
            )
        return {}
    if source is not chosen:
        job.doubt(f"writing the blocks of {source.scheme}, which is not the recommended plan")
    from nutdamp.views.parts import block_table

    return {"blocks": lambda: block_table(source._flight).csv()}


def _certified(
    job: Job, compared: Comparison, chosen: Plan | None, path: str | None
) -> tuple[Files, list[CannotWrite]]:
    """File of the certificate of optimal; else the error of the ``path`` that is not written."""
    if path is None:
        return {}, []
    from nutdamp.errors import CannotWrite
    from nutdamp.planning.tradeoff import certificate
    from nutdamp.views.decisions import certificate_json

    try:
        proof = certificate(next(plan for plan in compared if plan.scheme == OPTIMAL.name))
    except BadRequest as reason:
        return {}, [CannotWrite(path, f"there is no certificate: {reason}")]
    if proof.plan is not chosen:
        job.doubt(
            f"the certificate is of {proof.plan.scheme} for nominal values, "
            "which is not the recommended plan"
        )
    return {"certificate": partial(certificate_json, proof)}, []
