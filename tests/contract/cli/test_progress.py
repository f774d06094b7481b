"""The bar of long runs, and how they are stopped."""

from __future__ import annotations

import io
import os
import signal
import sys
import time

import pytest

from nutdamp.cli import progress as module
from nutdamp.cli.progress import progress, stoppable, working

pytestmark = pytest.mark.usefixtures("plans_shared")


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def shown(monkeypatch: pytest.MonkeyPatch, stream: io.StringIO, patience: float, *, quiet: bool = False) -> str:
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr(module, "PATIENCE", patience)
    monkeypatch.setenv("TERM", "xterm")
    with progress("flying", 1_000, quiet=quiet) as tell:
        for done in (200, 500, 900):
            tell(done)
    return stream.getvalue()


def test_a_long_run_shows_share_rate_and_time_left(monkeypatch: pytest.MonkeyPatch) -> None:
    text = shown(monkeypatch, Terminal(), 0.0)
    assert "flying" in text
    assert "90%" in text
    assert "/s" in text
    assert "0:00:" in text


def test_a_short_run_shows_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    assert shown(monkeypatch, Terminal(), 60.0) == ""


def test_only_a_terminal_is_shown_a_bar_and_only_where_it_is_wanted(monkeypatch: pytest.MonkeyPatch) -> None:
    assert shown(monkeypatch, io.StringIO(), 0.0) == ""
    assert shown(monkeypatch, Terminal(), 0.0, quiet=True) == ""


@pytest.mark.parametrize(("long", "quiet", "lines"), [(0.0, False, 1), (60.0, False, 0), (0.0, True, 0)])
def test_elsewhere_one_line_says_how_far_long_work_is(
    monkeypatch: pytest.MonkeyPatch, long: float, quiet: bool, lines: int
) -> None:
    monkeypatch.setattr(module, "LONG", long)
    text = shown(monkeypatch, io.StringIO(), 0.0, quiet=quiet)
    assert text.count("\n") == lines
    assert not lines or text.startswith("flying: 200 of 1,000 done after 0 s, about 0 s left")


@pytest.mark.parametrize(
    ("patience", "quiet", "reported"), [(0.0, False, True), (60.0, False, False), (0.0, True, False)]
)
def test_what_takes_long_is_named_while_it_is_done(
    monkeypatch: pytest.MonkeyPatch, patience: float, quiet: bool, reported: bool
) -> None:
    stream = Terminal()
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr(module, "PATIENCE", patience)
    monkeypatch.setenv("TERM", "xterm")
    with working("planning", quiet=quiet):
        while reported and "planning" not in stream.getvalue():
            time.sleep(0.01)
    assert ("planning" in stream.getvalue()) is reported


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_run_is_requested_to_stop_and_a_second_ctrl_c_interrupts(number: signal.Signals) -> None:
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    with stoppable() as stopped:
        assert not stopped()
        os.kill(os.getpid(), number)
        assert stopped()
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before


@pytest.mark.parametrize(
    ("patience", "terminal", "seen"), [(0.0, True, True), (60.0, True, False), (0.0, False, False)]
)
def test_work_of_unknown_length_says_what_is_done_once_it_takes_long(
    monkeypatch: pytest.MonkeyPatch, patience: float, terminal: bool, seen: bool
) -> None:
    stream = Terminal() if terminal else io.StringIO()
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr(module, "PATIENCE", patience)
    monkeypatch.setenv("TERM", "xterm")
    with working("planning"):
        while seen and "planning" not in stream.getvalue():  # until the timer has had its turn
            time.sleep(0.01)
    assert ("planning" in stream.getvalue()) is seen
