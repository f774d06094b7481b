"""Folders and files that tests read."""

from pathlib import Path

TESTS = Path(__file__).parents[1]
ROOT = TESTS.parent
CONFIGS = ROOT / "configs"
GOLDEN = TESTS / "golden"
CASES = TESTS / "cases"
"""Spacecraft files of earlier faults."""


def case(name: str) -> Path:
    """The file ``name`` of `tests/cases`, which must be there."""
    path = CASES / name
    assert path.is_file(), path
    return path
