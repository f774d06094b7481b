"""Makes two-pulse.png, the picture in the README: the built-in example with its scheme two-pulse.

    python tests/golden/make_picture.py

The same as `nutdamp simulate --scheme two-pulse --flown --plot two-pulse.png --figure motion` in an empty folder.
"""

from __future__ import annotations

from pathlib import Path

from nutdamp import planning
from nutdamp.files.examples import example_text
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.presentation import figures

FILE = Path(__file__).with_name("two-pulse.png")


def main() -> None:
    """Draw it."""
    body = read_spacecraft(example_text(), "example.yaml")
    drawn = figures.flight_figure("motion", *figures.shown(planning.plan(body, "two-pulse")))
    FILE.write_bytes(figures.rendered(drawn, str(FILE)))


if __name__ == "__main__":
    main()
