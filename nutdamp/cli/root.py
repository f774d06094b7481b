"""The ``nutdamp`` command: its subcommands, loaded when they are used."""

from __future__ import annotations

import gc
import os
from importlib import import_module
from keyword import iskeyword

import click

from nutdamp import __version__
from nutdamp.cli.boundary import run
from nutdamp.errors import Infeasible, nearest

COMMANDS = {
    "plan": "Plan pulse schedules that damp the nutation, and compare them.",
    "simulate": "Propagate a scheme or a schedule; cone angles and axis track.",
    "trade": "What an earlier end costs: a front of cheapest schedules.",
    "loop": "Fire from a gyro or an accelerometer, in a closed loop.",
    "budget": "Hold the nutation: pulses a day, propellant a year.",
    "fit": "Estimate motion, C/A and thrust from telemetry; re-plan.",
    "disperse": "Fly many dispersed cases; percentiles, tolerance budget.",
    "verify": "Fly a schedule by independent means; an error budget.",
    "report": "One page to hand on, in HTML.",
    "animate": "Film the body cone rolling on the space cone.",
    "check": "Check spacecraft files: all faults, derived quantities.",
    "export": "A schedule for other tools: CCSDS, STK, Basilisk, JSON.",
    "import": "A spacecraft file from a CCSDS attitude parameter message.",
    "explain": "The schemes, the equations, the keys of the file, the units.",
    "init": "Write a commented spacecraft file to start from.",
    "schema": "JSON Schema of the spacecraft file, for editors.",
}
"""The subcommands in the order of a first use, and what the help page says of each."""


class Commands(click.Group):
    """Subcommands live in modules of their name, so that a command loads nothing of another."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002 - signature of click
        """Names in the order of a first use."""
        return list(COMMANDS)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        """The commands on the help page, without loading any of them."""
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The command that a command line names; a usage error says which one a misspelt name may mean."""
        name = args[0]
        if name not in COMMANDS and not name.startswith("-"):
            close = nearest(name, COMMANDS)
            ctx.fail(f"there is no command {name!r}" + (f"; did you mean {close!r}?" if close else ""))
        return super().resolve_command(ctx, args)

    def invoke(self, ctx: click.Context) -> object:
        """Run the command; where nothing that was asked for is feasible, its JSON file says so all the same."""
        try:
            return super().invoke(ctx)
        except Infeasible as reason:
            from nutdamp.cli.job import write_infeasible

            write_infeasible(ctx, reason)
            raise

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002
        """The command of that name."""
        if cmd_name not in COMMANDS:
            return None
        module = f"{cmd_name}_" if iskeyword(cmd_name) else cmd_name
        command: click.Command = import_module(f"nutdamp.cli.{module}").command
        return command


@click.command(
    cls=Commands,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog=(
        "Exit status: 0 done; 1 could not read or write; 2 bad command line or bad file; 3 none of the "
        "schemes is feasible; 4 no feasible plan meets the requirement; 130 interrupted; 143 terminated."
    ),
)
@click.version_option(__version__, prog_name="nutdamp")
def group() -> None:
    """Plan which thruster of a nutating spinner to fire, when and for how long.

    Begin with `nutdamp plan`: it plans the built-in example. `nutdamp init` writes a commented spacecraft file to
    start from.
    """


RARELY = 100_000
"""New objects between two searches for cycles: loading modules makes very many objects, and few that are garbage."""


def main() -> None:
    """Entry point: run the command line and leave with its exit status."""
    gc.set_threshold(RARELY)
    # Read when numpy is loaded. Matrices are small here, so that threads within their products cost more than they
    # save; dispersed cases have threads of their own.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    run(group)
