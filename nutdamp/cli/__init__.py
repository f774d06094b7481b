"""The command line. Each command is one thin module: load, call, show; errors end in `nutdamp.cli.boundary`."""

from nutdamp.cli.root import main

__all__ = ["main"]
