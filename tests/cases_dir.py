"""Where the spacecraft files of earlier faults lie."""

from pathlib import Path

CASES = Path(__file__).parent / "cases"


def case(name: str) -> Path:
    """The file ``name`` of `tests/cases`, which must be there."""
    path = CASES / name
    assert path.is_file(), path
    return path
