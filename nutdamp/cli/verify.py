"""``nutdamp verify``: fly a schedule by independent means, with an error budget."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

import click

from nutdamp.cli.boundary import INFEASIBLE, UNREADABLE
from nutdamp.cli.common import (
    Flown,
    Input,
    deliver,
    expect_places,
    flown_options,
    load,
    plan_or_read,
    quiet_option,
    remarks,
    spacecraft_argument,
)
from nutdamp.cli.parameters import FILE
from nutdamp.cli.places import expect_outputs
from nutdamp.cli.scheme_options import Aim, PlanningCommand, goal_options
from nutdamp.cli.screen import say
from nutdamp.schemes import Options

if TYPE_CHECKING:
    from rich.console import RenderableType

    from nutdamp.spacecraft import Spacecraft


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
    if looped and flown != (None, None):
        raise click.UsageError("name what to verify: one of --scheme, --schedule and --loop")
    silent = expect_outputs(spacecraft, flown.schedule, json=json)
    body = load(spacecraft, remarks(quiet), aim)
    expect_places(json)
    if looped:
        _loop(body, json, silent=silent, quiet=quiet)
        return

    from nutdamp.cli.progress import working
    from nutdamp.library.studies import verify

    plan = plan_or_read(body, flown, options, remarks(quiet), quiet=quiet)
    with working("verifying", quiet=quiet):
        verified = verify(plan)
    found = verified.core

    def screen() -> RenderableType:
        from nutdamp.presentation.verify_tables import verification_screen

        return verification_screen(body, plan.scheme, found)

    deliver([(json, verified.to_dict)], *[screen] * (not silent))
    if found.disagreeing:
        others = " and ".join(found.disagreeing)
        say(f"nutdamp: the flown motion and {others} do not agree; please report this")
        sys.exit(UNREADABLE)
    if not found.checks:
        say("nutdamp: no independent integration was flown to the end, so the flown motion is not confirmed")
        sys.exit(INFEASIBLE)


def _loop(body: Spacecraft, json: str | None, *, silent: bool, quiet: bool) -> None:
    """The closed loop of the file against the same by DOP853."""
    from nutdamp.cli.common import require_loop
    from nutdamp.cli.progress import working

    require_loop(body)
    from nutdamp.loop.verify import verify_loop

    with working("verifying", quiet=quiet):
        found = verify_loop(body)

    def data() -> dict[str, Any]:
        from nutdamp.files.loop_json import verified_json

        return verified_json(found)

    def screen() -> RenderableType:
        from nutdamp.presentation.loop_tables import verification_screen

        return verification_screen(found)

    deliver([(json, data)], *[screen] * (not silent))
    if found.missing:
        say(f"nutdamp: DOP853 did not fly the loop to its end, so it is not confirmed: {found.missing}")
        sys.exit(INFEASIBLE)
    if not found.agree:
        say("nutdamp: the loop and the same by DOP853 do not agree; please report this")
        sys.exit(UNREADABLE)
