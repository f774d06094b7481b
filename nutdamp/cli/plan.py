"""``plan``, ``simulate`` and ``animate``; and the pulses that a command flies."""

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
    defaulted,
    deliver,
    plot_options,
    quiet_option,
    screen_options,
    spacecraft_argument,
)
from nutdamp.cli.main import leave
from nutdamp.cli.options import (
    END,
    FILE,
    OUTPUT,
    Command,
    NameType,
    expect_read,
    goal_options,
    scheme_options,
)
from nutdamp.cli.screen import say, show_failures
from nutdamp.errors import BadRequest, Infeasible, listed, printable
from nutdamp.schemes.catalogue import NAMES, OPTIMAL, PLANNED, SchemeOptions

if TYPE_CHECKING:
    from rich.console import RenderableType

    from nutdamp.errors import CannotWrite
    from nutdamp.planning.decision import Comparison
    from nutdamp.planning.plan import Plan
    from nutdamp.planning.robust import RobustComparison
    from nutdamp.planning.tradeoff import Trade


scheme_option = partial(
    click.option, "--scheme", metavar="SCHEME"
)  # a line does not hold all the names


def flown_options(verb: str, scheme: str | None = None) -> Callable[[Command], Command]:
    """``--scheme`` (its help may differ), ``--schedule`` and ``--blocks``: one alone."""
    default = f"{verb} this scheme with default options; without it the recommended one."

    def alone(ctx: click.Context, param: click.Parameter, value: str | None) -> str | None:
        named = [
            name
            for name in ("scheme", "schedule", "blocks")
            if name != param.name and ctx.params.get(name)
        ]
        if value is not None and named:
            raise click.UsageError(
                f"name what to {verb.lower()}: one of --scheme, --schedule and --blocks"
            )
        return value

    def decorate(command: Command) -> Command:
        read = f"{verb} the pulses of a CSV file, as `plan --csv` writes it."
        fired = f"{verb} what the command blocks of a CSV file fire, as `plan --blocks` writes it."
        command = click.option("--blocks", type=FILE, callback=alone, help=fired)(command)
        command = click.option("--schedule", type=FILE, callback=alone, help=read)(command)
        return scheme_option(type=NameType(NAMES), callback=alone, help=scheme or default)(command)

    return decorate


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
    from nutdamp.api import compare
    from nutdamp.planning.decision import usual

    expect_read(
        tuple(dict.fromkeys(names)) or usual(job.spacecraft), job.options, job.spacecraft, job.doubt
    )
    with job.working("planning"):
        return compare(
            job.spacecraft, names, job.options, samples=samples, timed=timed, robust=robust
        )


def robust_of(job: Job, compared: Comparison) -> RobustComparison:
    """The plans compared and their variants in dispersed cases."""
    from nutdamp.api import robust

    with job.working("dispersing"):
        return robust(compared, job.options)


def fronts_of(
    job: Job, points: int, shifts: Sequence[float], least: str, *, nominal: bool = False
) -> Trade:
    """The fronts of time against cost."""
    from nutdamp.api import trade

    known = job.options.with_disturbances
    with job.working("searching"):
        return trade(
            job.spacecraft, points, shifts, least, with_disturbances=known, nominal=nominal
        )


def plan_or_read(job: Job, *, judged: bool = False) -> Plan:
    """The pulses that a command flies, as a plan; raises Infeasible where there is none.

    ``judged``: a verdict names the cones that are broken.
    """
    from nutdamp import api
    from nutdamp.planning.notes import comparison_warnings, infeasibility, plan_notes, reasons
    from nutdamp.views.text import joined

    scheme, schedule, blocks = job.flown
    if schedule is not None:
        from nutdamp.files.schedules import read_plan

        expect_read((), job.options, job.spacecraft, job.doubt)
        plan, warnings = read_plan(schedule, job.spacecraft, job.options.of(SchemeOptions))
        job.doubt(*warnings)
        return plan
    if blocks is not None:
        return _fired(job, blocks)
    if scheme is None:
        compared = compared_with(job, ())
        recommended = compared.recommended
        show_failures(compared)
        if recommended is not None:
            job.remark(f"using recommended plan: {recommended.scheme}")
        job.note(comparison_warnings(compared, tabulated=judged))
        if recommended is None:
            raise Infeasible(f"{joined(reasons(compared))}; `nutdamp plan` says more")
        plan = recommended
    else:
        expect_read((scheme,), job.options, job.spacecraft, job.doubt)
        with job.working("planning"):
            plan = api.plan(job.spacecraft, scheme, job.options)
    if not plan.feasible:
        raise Infeasible(f"{plan.scheme} is infeasible: {infeasibility(plan)}")
    job.note(plan_notes(plan, cones=scheme is not None and not judged))
    return plan


def _fired(job: Job, path: str) -> Plan:
    """The pulses that a file of command blocks fires, as a plan; Infeasible without Sun pulses."""
    from nutdamp.files.schedules import read_blocks
    from nutdamp.planning.notes import broken_limits
    from nutdamp.planning.plan import Plan
    from nutdamp.schemes.block_model import fired

    spacecraft = job.spacecraft
    blocks, warnings = read_blocks(path, spacecraft)
    pulses = fired(spacecraft, blocks)
    job.doubt(*warnings, *broken_limits(spacecraft, pulses))
    return Plan(
        spacecraft, printable(path), pulses, options=job.options.of(SchemeOptions), from_file=True
    )


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
@plot_options(FIGURES)
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
    from nutdamp.views.glance import scheme_table
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
        more["csv"] = lambda: pulse_table(chosen.flight).csv()
        more["plot"] = partial(shown.figure, job.figure or FIGURES[0])
    more |= job.carried(chosen, at)
    more |= {} if blocks is None else _blocks_file(job, compared, chosen)
    if job.silent:
        job.note(comparison_warnings(compared))
    job.deliver(None, partial(_screen, compared, dispersed, verbose), more=more, unsaved=unproved)
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

    return {"blocks": lambda: block_table(source.flight).csv()}


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


def _screen(
    compared: Comparison, dispersed: RobustComparison | None, verbose: bool
) -> RenderableType:
    from nutdamp.views.glance import comparison_screen, glance

    if dispersed is None:
        return comparison_screen(compared) if verbose else glance(compared)
    from nutdamp.views.robust import robust_notes, robust_screen

    return (
        robust_screen(dispersed) if verbose else glance(dispersed.joined, robust_notes(dispersed))
    )


@click.command("animate", cls=SessionCommand)
@spacecraft_argument
@flown_options("Show")
@goal_options
@click.option(
    "-o",
    "--output",
    type=OUTPUT,
    required=True,
    help="The film: .gif, or .mp4 where ffmpeg is installed.",
)
@click.option("--until", type=END, help="End of the motion; default soon after the last pulse.")
@click.option(
    "--seconds", type=click.FloatRange(0.2, 600.0), help="Length of the film; default 6 s to 30 s."
)
@defaulted("--fps", click.IntRange(1, 50), 20, "Frames a second.")
@defaulted("--width", click.IntRange(320, 3840), 800, "Width in pixels; height 0.6 of it.")
@quiet_option
def animate_command(
    job: Job, until: float | None, seconds: float | None, fps: int, width: int
) -> None:
    """Film the body cone rolling on the space cone through the pulses, flown with their real
    widths.

    SPACECRAFT is a YAML file; without it spacecraft.yaml in this folder, else the built-in example.
    A FILE of - is standard output, as GIF.
    """
    from nutdamp.figures import image

    output = job.written["output"] or ""
    image.film_format(output)
    spacecraft = job.begin()
    plan = plan_or_read(job)

    from nutdamp.figures.geometry import shown_until

    end = shown_until(spacecraft, plan.pulses) if until is None else until
    timed = image.timing(spacecraft, end, fps, seconds)
    if not timed.smooth:
        job.remark(
            f"only {timed.frames / timed.turns:.1f} frames show a nutation turn, "
            "which may seem to run backwards: "
            f"--seconds {timed.turns * image.SMOOTH / fps:.0f} would show it, or an earlier --until"
        )
    flight = plan.reaching(end)
    with job.working("filming"):
        deliver([(output, lambda: lambda stream: image.film(stream, flight, timed, output, width))])
    if output != "-":
        job.remark(f"wrote {printable(output)}: {timed.frames} frames, {timed.pace:.3g}× real time")


@click.command("simulate", cls=SessionCommand)
@spacecraft_argument
@flown_options(
    "Propagate",
    (
        "Plan this scheme with default options and propagate it, not the recommended one; "
        "none is free motion."
    ),
)
@goal_options
@click.option(
    "--flown",
    "real",
    is_flag=True,
    help="Propagate real pulse widths instead of the impulse sum (17).",
)
@click.option(
    "--until",
    type=END,
    help="End, of which the outcome is shown; default last pulse + one inertial period.",
)
@defaulted("--samples", click.IntRange(2, 10_000_000), 1000, "Rows of the track.")
@click.option("--csv", type=OUTPUT, help="Write the track.")
@click.option("--json", type=OUTPUT, help="Write pulses, how both models end, and extremes.")
@carry_options("the end")
@plot_options(FIGURES)
@screen_options
def simulate_command(
    job: Job, real: bool, until: float | None, samples: int, at: float | None, verbose: bool
) -> None:
    """Propagate a schedule; show cone angles around each pulse, how it ends by both models, and the
    axis track.

    The verdict is on the whole schedule, in dispersed cases where the file has them; of free motion
    on its end. Exit status 4 where it is not FLY or NO PULSE. SPACECRAFT is a YAML file, or - for
    standard input; without it spacecraft.yaml in this folder, else the built-in example. A FILE of
    - is standard output, for --schedule standard input.
    """
    job.begin()
    plan = plan_or_read(job, judged=not job.silent)

    from nutdamp.api import simulate
    from nutdamp.planning.notes import model_warnings

    simulation = simulate(plan, until, flown=real, samples=samples)
    if job.silent:
        job.note(model_warnings(simulation.impulses, simulation.flown))
    job.deliver(simulation, more=job.carried(plan, at, simulation.until), verbose=verbose)
    leave(simulation.verdict.status)
