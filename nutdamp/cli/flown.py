"""Pulses that a command flies: those of the plan of a scheme, of a schedule file, or of command blocks."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar, cast

import click

from nutdamp.cli.options import FILE, SchemeName, expect_read
from nutdamp.cli.screen import show_failures
from nutdamp.schemes.catalogue import NAMES, Options, SchemeOptions

if TYPE_CHECKING:
    from nutdamp.api import Trade
    from nutdamp.cli.job import Job
    from nutdamp.planning.decision import Comparison
    from nutdamp.planning.plan import Plan
    from nutdamp.planning.robust import RobustComparison


Command = TypeVar("Command", bound=Callable[..., Any])

JITTER_SEED = 1
"""Seed of the errors of the Sun pulses from which blocks are fired: the same in every run."""


class FlownChoice(NamedTuple):
    """Source of the pulses that a command flies: the plan of a ``scheme``, a ``schedule`` file, the command blocks of a
    file, else the recommended plan.
    """

    scheme: str | None
    schedule: str | None
    blocks: str | None

    @property
    def file(self) -> str | None:
        """The file that is read, if any."""
        return self.schedule if self.blocks is None else self.blocks


def flown_options(verb: str, scheme: str | None = None) -> Callable[[Command], Command]:
    """``--scheme``, ``--schedule`` and ``--blocks``, gathered into ``flown`` (`FlownChoice`) for `plan_or_read`.

    ``verb`` says how the command uses the pulses, ``scheme`` is the help of ``--scheme`` where that is longer.
    A usage error for two of them.
    """
    default = f"{verb} this scheme with default options; without it the recommended one."

    def decorate(command: Command) -> Command:
        @functools.wraps(command)
        def gathered(
            *args: Any, scheme: str | None, schedule: str | None, blocks: str | None, **parameters: Any
        ) -> Any:
            flown = FlownChoice(scheme, schedule, blocks)
            if flown.count(None) < 2:
                raise click.UsageError(f"name what to {verb.lower()}: one of --scheme, --schedule and --blocks")
            return command(*args, flown=flown, **parameters)

        read = f"{verb} the pulses of a CSV file, as `plan --csv` writes it."
        fired = f"{verb} what the command blocks of a CSV file fire, as `plan --blocks` writes it."
        option = click.option("--blocks", type=FILE, help=fired)(gathered)
        option = click.option("--schedule", type=FILE, help=read)(option)
        return cast(Command, click.option("--scheme", type=SchemeName(NAMES), help=scheme or default)(option))

    return decorate


def compared_with(
    job: Job, names: Sequence[str], options: Options, samples: int | None = None, *, timed: bool = False
) -> Comparison:
    """Comparison of the schemes named, else the usual ones; a remark names the options that none of them reads."""
    from nutdamp.cli.job import working
    from nutdamp.planning.decision import compare, usual

    names = tuple(dict.fromkeys(names))
    expect_read(names or usual(job.spacecraft), options, job.spacecraft, job.remark)
    with working("planning", quiet=job.quiet):
        return compare(job.spacecraft, names, options, samples=samples, timed=timed)


def robust_of(job: Job, compared: Comparison, options: Options) -> RobustComparison:
    """The plans compared and their variants in dispersed cases, with a bar."""
    from nutdamp.cli.job import progress
    from nutdamp.planning import robust

    trials = robust.attempts(compared, options)
    with progress("dispersing", len(trials), quiet=job.quiet) as advance:
        return robust.compare(compared, trials, advance)


def fronts_of(job: Job, points: int, shifts: Sequence[float], least: str, options: Options) -> Trade:
    """The fronts of time against cost, with a bar."""
    from nutdamp.api import trade
    from nutdamp.cli.job import progress

    with progress("searching", points * len(set(shifts)), quiet=job.quiet) as step:
        known = options.with_disturbances
        return trade(job.spacecraft, points, shifts, least, with_disturbances=known, progress=step)


def plan_or_read(job: Job, flown: FlownChoice, options: Options, *, jitter: bool = False, judged: bool = False) -> Plan:
    """The pulses that a command flies, as a plan; raises Infeasible where there is none.

    ``jitter``: the Sun pulses that fire the blocks of a file have errors, drawn with `JITTER_SEED`.
    ``judged``: a verdict on the screen names the cones that are broken.
    """
    from nutdamp.errors import Infeasible
    from nutdamp.planning.decision import infeasibility
    from nutdamp.planning.notes import plan_notes

    if flown.schedule is not None:
        return _read(job, flown.schedule, options)
    if flown.blocks is not None:
        return _fired(job, flown.blocks, options, jitter=jitter)
    plan = _recommended(job, options, judged=judged) if flown.scheme is None else _planned(job, flown.scheme, options)
    if not plan.feasible:
        raise Infeasible(f"{plan.scheme} is infeasible: {infeasibility(plan)}")
    job.note(plan_notes(plan, cones=flown.scheme is not None and not judged))
    return plan


def _read(job: Job, schedule: str, options: Options) -> Plan:
    """The pulses of a file."""
    from nutdamp.files.schedules import read_plan

    expect_read((), options, job.spacecraft, job.remark)
    plan, warnings = read_plan(schedule, job.spacecraft, options.of(SchemeOptions))
    job.doubt(warnings)
    return plan


def _planned(job: Job, scheme: str, options: Options) -> Plan:
    """The plan of a scheme."""
    from nutdamp.cli.job import working
    from nutdamp.planning import plan as planning

    expect_read((scheme,), options, job.spacecraft, job.remark)
    with working("planning", quiet=job.quiet):
        return planning.plan(job.spacecraft, scheme, options)


def _recommended(job: Job, options: Options, *, judged: bool) -> Plan:
    """The plan that is recommended, its warnings beside a verdict or not; raises Infeasible where there is none."""
    from nutdamp.errors import Infeasible
    from nutdamp.planning.notes import comparison_warnings, reasons
    from nutdamp.views.notes import joined

    compared = compared_with(job, (), options)
    plan = compared.recommended
    show_failures(compared)
    if plan is not None:
        job.remark(f"using the recommended plan, {plan.scheme}")
    job.note(comparison_warnings(compared, cones=not judged))
    if plan is None:
        raise Infeasible(f"{joined(reasons(compared))}; `nutdamp plan` says more")
    return plan


def _fired(job: Job, path: str, options: Options, *, jitter: bool) -> Plan:
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
    job.doubt((*warnings, *broken_limits(body, pulses)))
    return Plan(body, printable(path), pulses, options=options.of(SchemeOptions), from_file=True)
