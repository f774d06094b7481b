"""The command line. Each command is one thin module: load, call, show; errors end in `nutdamp.cli.boundary`."""
