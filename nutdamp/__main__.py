"""``python -m nutdamp`` is the ``nutdamp`` command."""

from nutdamp.cli import main

if __name__ == "__main__":
    main()
