"""``nutdamp verify``: fly a schedule by independent means, with an error budget."""

from __future__ import annotations

import click

from nutdamp.cli.boundary import leave
from nutdamp.cli.common import Input, quiet_option, require_loop, spacecraft_argument
from nutdamp.cli.flown import Flown, flown_options, plan_or_read
from nutdamp.cli.job import Job, begin
from nutdamp.cli.parameters import FILE
from nutdamp.cli.scheme_options import Aim, PlanningCommand, goal_options
from nutdamp.cli.screen import say
from nutdamp.schemes import Options


@click.command("verify", cls=PlanningCommand)
@spacecraft_argument
@flown_options("Verify")
@goal_options
@click.option("--loop", "looped", is_flag=True, help="Verify the closed loop of the file: each firing, by DOP853.")
@click.option("--json", type=FILE, help="Write methods, differences and error budget.")
@quiet_option
def command(
    spacecraft: Input,
    flown: Flown,
    options: Options,
    aim: Aim,
    looped: bool,
    json: str | None,
    quiet: bool,
) -> None:
    """Fly a schedule by impulse sum, Taylor series, DOP853 and Basilisk (where installed), side by side.

    Shows the largest differences, what is conserved, and what each imperfection alone costs. Motions too long for
    DOP853 and Basilisk are not confirmed: exit status 3.
    """
    if looped and flown != (None, None, None):
        raise click.UsageError("name what to verify: one of --scheme, --schedule, --blocks and --loop")
    job = begin(spacecraft, flown.file, aim=aim, quiet=quiet, json=json)
    if looped:
        _verify_loop(job, json)
        return

    from nutdamp.cli.progress import working
    from nutdamp.library.studies import verify
    from nutdamp.presentation.verify_tables import verification_screen

    plan = plan_or_read(job, flown, options)
    with working("verifying", quiet=quiet):
        verified = verify(plan)
    found = verified.core
    job.deliver([(json, verified.to_dict)], lambda: verification_screen(job.spacecraft, plan.scheme, found))
    if found.disagreeing:
        others = " and ".join(found.disagreeing)
        say(f"nutdamp: the flown motion and {others} do not agree; please report this")
    elif not found.checks:
        say("nutdamp: no independent integration was flown to the end, so the flown motion is not confirmed")
    for one in found.drifting:
        say(f"nutdamp: {one} is not constant on coasts, where nothing changes it; please report this")
    leave(failed=bool(found.disagreeing or found.drifting), infeasible=not found.checks)


def _verify_loop(job: Job, json: str | None) -> None:
    """The closed loop of the file against the same by DOP853."""
    from nutdamp.cli.progress import working
    from nutdamp.files.loop_json import verified_json
    from nutdamp.loop.verify import verify_loop
    from nutdamp.presentation.loop_tables import verification_screen

    require_loop(job.spacecraft)
    with working("verifying", quiet=job.quiet):
        found = verify_loop(job.spacecraft)
    job.deliver([(json, lambda: verified_json(found))], lambda: verification_screen(found))
    if found.missing:
        say(f"nutdamp: DOP853 did not fly the loop to its end, so it is not confirmed: {found.missing}")
        leave(infeasible=True)
    if not found.agree:
        say("nutdamp: the loop and the same by DOP853 do not agree; please report this")
        leave(failed=True)
