"""Pulses that a command flies: those of the plan of a scheme, of a schedule file, or of command blocks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import click

from nutdamp.cli.options import FILE, Command, SchemeName, expect_read
from nutdamp.cli.screen import show_failures
from nutdamp.schemes.catalogue import NAMES, SchemeOptions

if TYPE_CHECKING:
    from nutdamp.cli.job import Job
    from nutdamp.planning.decision import Comparison
    from nutdamp.planning.plan import Plan
    from nutdamp.planning.robust import RobustComparison
    from nutdamp.planning.tradeoff import Trade


JITTER_SEED = 1
"""Seed of the errors of the Sun pulses from which blocks are fired: the same in every run."""


def flown_options(verb: str, scheme: str | None = None) -> Callable[[Command], Command]:
    """``--scheme``, ``--schedule`` and ``--blocks``, the `FlownChoice` of the job for `plan_or_read`.

    ``verb`` says how the command uses the pulses, ``scheme`` is the help of ``--scheme`` where that is longer.
    A usage error for two of them.
    """
    default = f"{verb} this scheme with default options; without it the recommended one."

    def alone(ctx: click.Context, param: click.Parameter, value: str | None) -> str | None:
        named = [name for name in ("scheme", "schedule", "blocks") if name != param.name and ctx.params.get(name)]
        if value is not None and named:
            raise click.UsageError(f"name what to {verb.lower()}: one of --scheme, --schedule and --blocks")
        return value

    def decorate(command: Command) -> Command:
        read = f"{verb} the pulses of a CSV file, as `plan --csv` writes it."
        fired = f"{verb} what the command blocks of a CSV file fire, as `plan --blocks` writes it."
        command = click.option("--blocks", type=FILE, callback=alone, help=fired)(command)
        command = click.option("--schedule", type=FILE, callback=alone, help=read)(command)
        named = click.option("--scheme", type=SchemeName(NAMES), callback=alone, help=scheme or default)
        return named(command)

    return decorate


def compared_with(job: Job, names: Sequence[str], samples: int | None = None, *, timed: bool = False) -> Comparison:
    """Comparison of the schemes named, else the usual ones; a remark names the options that none of them reads."""
    from nutdamp.api import compare
    from nutdamp.planning.decision import usual

    expect_read(tuple(dict.fromkeys(names)) or usual(job.spacecraft), job.options, job.spacecraft, job.remark)
    with job.working("planning"):
        return compare(job.spacecraft, names, job.options, samples=samples, timed=timed)


def robust_of(job: Job, compared: Comparison) -> RobustComparison:
    """The plans compared and their variants in dispersed cases."""
    from nutdamp.api import robust

    with job.working("dispersing"):
        return robust(compared, job.options)


def fronts_of(job: Job, points: int, shifts: Sequence[float], least: str) -> Trade:
    """The fronts of time against cost."""
    from nutdamp.api import trade

    known = job.options.with_disturbances
    with job.working("searching"):
        return trade(job.spacecraft, points, shifts, least, with_disturbances=known)


def plan_or_read(job: Job, *, jitter: bool = False, judged: bool = False) -> Plan:
    """The pulses that a command flies, as a plan; raises Infeasible where there is none.

    ``jitter``: the Sun pulses that fire the blocks of a file have errors, drawn with `JITTER_SEED`.
    ``judged``: a verdict on the screen names the cones that are broken.
    """
    from nutdamp.errors import Infeasible
    from nutdamp.planning.decision import infeasibility
    from nutdamp.planning.notes import plan_notes

    scheme, schedule, blocks = job.flown
    if schedule is not None:
        return _read(job, schedule)
    if blocks is not None:
        return _fired(job, blocks, jitter=jitter)
    plan = _recommended(job, judged=judged) if scheme is None else _planned(job, scheme)
    if not plan.feasible:
        raise Infeasible(f"{plan.scheme} is infeasible: {infeasibility(plan)}")
    job.note(plan_notes(plan, cones=scheme is not None and not judged))
    return plan


def _read(job: Job, schedule: str) -> Plan:
    """The pulses of a file."""
    from nutdamp.files.schedules import read_plan

    expect_read((), job.options, job.spacecraft, job.remark)
    plan, warnings = read_plan(schedule, job.spacecraft, job.options.of(SchemeOptions))
    job.doubt(*warnings)
    return plan


def _planned(job: Job, scheme: str) -> Plan:
    """The plan of a scheme."""
    from nutdamp.api import plan

    expect_read((scheme,), job.options, job.spacecraft, job.remark)
    with job.working("planning"):
        return plan(job.spacecraft, scheme, job.options)


def _recommended(job: Job, *, judged: bool) -> Plan:
    """The plan that is recommended, its warnings beside a verdict or not; raises Infeasible where there is none."""
    from nutdamp.errors import Infeasible
    from nutdamp.planning.notes import comparison_warnings, reasons
    from nutdamp.views.text import joined

    compared = compared_with(job, ())
    plan = compared.recommended
    show_failures(compared)
    if plan is not None:
        job.remark(f"using recommended plan: {plan.scheme}")
    job.note(comparison_warnings(compared, cones=not judged))
    if plan is None:
        raise Infeasible(f"{joined(reasons(compared))}; `nutdamp plan` says more")
    return plan


def _fired(job: Job, path: str, *, jitter: bool) -> Plan:
    """The pulses that the command blocks of a file fire, as a plan; raises Infeasible where there is no Sun pulse."""
    from nutdamp.errors import printable
    from nutdamp.files.schedules import read_blocks
    from nutdamp.planning.decision import broken_limits
    from nutdamp.planning.plan import Plan
    from nutdamp.schemes.block_model import fired

    body = job.spacecraft
    blocks, warnings = read_blocks(path, body)
    if jitter and body.sun_sensor is not None and body.sun_sensor.jitter > 0.0:
        job.remark(f"the Sun pulses come with a jitter of {body.sun_sensor.jitter:g} s (one sigma, seed {JITTER_SEED})")
    pulses = fired(body, blocks, JITTER_SEED if jitter else None)
    job.doubt(*warnings, *broken_limits(body, pulses))
    return Plan(body, printable(path), pulses, options=job.options.of(SchemeOptions), from_file=True)
