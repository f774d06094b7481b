"""Texts of messages and notes: kept in one file, asserted by key, so that a change of wording is
one change.

A test names a text by its key: ``check_text("plan.not-met", screen.stderr)``. After a change of
wording

    python tests/support/golden.py [PYTEST ARGUMENTS …]

writes the texts of the tests that run (without arguments of all but the weekly ones, and drops keys
that none uses). Read the difference as one would read the screen.
"""

import contextlib
import fcntl
import os
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

FILE = Path(__file__).parents[1] / "golden" / "texts.txt"
WRITE = "NUTDAMP_WRITE_TEXTS"
"""Variable of the environment that makes `check_text` write instead of compare."""
RESIDUE = re.compile(r"\d(?:\.\d+)?e-(?:1\d|[2-9]\d)\b")
"""Numbers that are residue of rounding: other versions of numpy give other digits."""


def check_text(key: str, text: str) -> None:
    """Fails where ``text`` is not the one kept as ``key``; residue of rounding does not count."""
    text = RESIDUE.sub("<residue>", text).rstrip("\n")
    text = "\n".join(line.rstrip() for line in text.split("\n"))
    if os.environ.get(WRITE):
        _store(key, text)
        return
    kept = load_texts().get(key)
    if kept is None:
        pytest.fail(
            f"no text {key!r} in {FILE.name}: write it by `python tests/support/golden.py "
            f"TEST`\n{text}"
        )
    assert text == kept, (
        f"text {key!r} has changed: is it right? then `python tests/support/golden.py TEST`"
    )


@contextlib.contextmanager
def refused(error: type[Exception], key: str) -> Iterator[None]:
    """Fails where the body does not raise ``error`` with the text kept as ``key``."""
    with pytest.raises(error) as raised:
        yield
    check_text(key, str(raised.value))


def refusal(error: type[Exception], call: Callable[..., object], *given: Any, **named: Any) -> str:
    """The text of the ``error`` with which a call is refused."""
    with pytest.raises(error) as raised:
        call(*given, **named)
    return str(raised.value)


def load_texts() -> dict[str, str]:
    """All texts by their keys."""
    content = FILE.read_text(encoding="utf-8") if FILE.exists() else ""
    sections = (section.partition("\n") for section in content.split("=== ")[1:])
    return {key: text.rstrip("\n") for key, _, text in sections}


def _store(key: str, text: str) -> None:
    """Put one text into the file, whichever processes do the same."""
    assert "\n" not in key and "=== " not in text, key  # noqa: PT018
    with FILE.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        texts = load_texts() | {key: text}
        fresh = FILE.with_suffix(".new")
        fresh.write_text(
            "".join(f"=== {name}\n{texts[name]}\n" for name in sorted(texts)), encoding="utf-8"
        )
        fresh.replace(FILE)


def main() -> int:
    """Write the texts of the tests that run."""
    arguments = sys.argv[1:]
    if not arguments:
        FILE.unlink(missing_ok=True)
        arguments = ["-n", "auto", "-m", "not weekly"]
    os.environ[WRITE] = "1"
    return pytest.main(arguments)


if __name__ == "__main__":
    sys.exit(main())
