"""``nutdamp init``: a commented spacecraft file to start from."""

from __future__ import annotations

import click
from click.shell_completion import CompletionItem

from nutdamp.cli.common import DEFAULT_FILE, quiet_option
from nutdamp.cli.job import remarks
from nutdamp.cli.parameters import FILE
from nutdamp.errors import printable


def _completed(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:  # noqa: ARG001
    from nutdamp.files.examples import example_names, example_subject

    return [CompletionItem(name, help=example_subject(name)) for name in example_names() if name.startswith(incomplete)]


@click.command("init")
@click.argument("file", type=FILE, default=DEFAULT_FILE, metavar="[FILE]")
@click.option(
    "--from", "name", metavar="NAME", shell_complete=_completed, help="One of the examples of --list instead."
)
@click.option("--list", "listed", is_flag=True, help="List the examples that there are, and write nothing.")
@click.option("--force", is_flag=True, help="Replace a file that is already there.")
@quiet_option
def command(file: str, name: str | None, listed: bool, force: bool, quiet: bool) -> None:
    """Write a commented spacecraft file (default spacecraft.yaml); a FILE of - is standard output.

    It is the built-in example, in which every key is described, or with --from one of the spacecraft that ship with
    nutdamp, each with the sources of its figures.
    """
    from nutdamp.errors import CannotWrite
    from nutdamp.files.examples import BUILT_IN, example_text
    from nutdamp.files.output import STDOUT, check_place, write_whole

    if listed:
        _list()
        return
    text = example_text(_known(name) if name else BUILT_IN)
    if file != STDOUT and check_place(file).exists() and not force:
        raise CannotWrite(file, "it is already there; --force replaces it")
    write_whole(file, text)
    if file != STDOUT:
        remarks(quiet)(f"wrote {printable(file)}; plan it with: nutdamp plan {printable(file)}")


def _list() -> None:
    """Prints the examples."""
    from nutdamp.cli.screen import show
    from nutdamp.files.examples import example_names, example_subject
    from nutdamp.presentation.explain_tables import examples_screen

    rows = tuple((name, example_subject(name)) for name in example_names())
    show(examples_screen(rows))


def _known(name: str) -> str:
    """The ``name`` if there is such an example; a usage error says which one a misspelt name may mean."""
    from nutdamp.errors import nearest
    from nutdamp.files.examples import example_names

    names = example_names()
    if name in names:
        return name
    close = nearest(name, names)
    raise click.BadParameter(
        f"there is no example {name!r}; "
        + (f"did you mean {close!r}?" if close else "`nutdamp init --list` lists those that there are"),
        param_hint="'--from'",
    )
