"""``python -m nutdamp`` is the ``nutdamp`` command."""

import sys


def main() -> None:
    """Entry point of the command; ends quietly where it is interrupted before there is anything to
    interrupt.
    """
    try:
        from nutdamp.cli.main import main as run

        run()
    except KeyboardInterrupt:
        sys.stderr.write("interrupted\n")
        sys.exit(130)


if __name__ == "__main__":
    main()
