"""``nutdamp verify``: fly a schedule by independent means, with an error budget."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

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


@click.command("verify", cls=PlanningCommand)
@spacecraft_argument
@flown_options("Verify")
@goal_options
@click.option("--json", type=FILE, help="Write methods, differences and error budget.")
@quiet_option
def command(
    spacecraft: Input,
    flown: Flown,
    options: Options,
    aim: Aim,
    json: str | None,
    quiet: bool,
) -> None:
    """Fly a schedule by impulse sum, Taylor series, DOP853 and Basilisk (where installed), side by side.

    Shows the largest differences, what is conserved, and what each imperfection alone costs. Motions too long for
    DOP853 and Basilisk are not confirmed: exit status 3.
    """
    silent = expect_outputs(spacecraft, flown.schedule, json=json)
    body = load(spacecraft, remarks(quiet), aim)
    expect_places(json)

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
