"""Long tracks come in pieces: the same rows and extremes, and no more memory for more of them."""

from __future__ import annotations

import csv
import io
import tracemalloc
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.builders import channel, spinner
from support.process import Run

from nutdamp import flight, track
from nutdamp.files.output import number
from nutdamp.files.track_csv import HEADER, track_array, write_track
from nutdamp.flight import Flight
from nutdamp.rounding import SAME_ANGLE
from nutdamp.schedule import Schedule, channel_pulse
from nutdamp.track import Track

UNTIL = 40.0
FEW = 7


def flown() -> Flight:
    """A flight with coasts, wide pulses and an impulse at once."""
    push = channel("T", 4.0, 1.0, 0.5)
    made = Schedule((channel_pulse(push, 0.25, 0.5), channel_pulse(push, 4.0, 0.7), channel_pulse(push, 20.0, 3.0)))
    return flight.flown(spinner(degrees=12.0, channels=(push,)), made, UNTIL)


@given(st.integers(1, 60), st.floats(0.0, 10.0), st.floats(0.0, 10.0), st.floats(0.1, 10.0))
def test_even_times_are_those_of_linspace(samples: int, first: float, second: float, until: float) -> None:
    start, end = min(first, second), max(first, second)
    even = np.linspace(0.0, until, samples)
    expected = even[(even > start) & (even < end)]
    parts = list(track.even_times(samples, until, start, end))
    assert np.concatenate([part.times for part in parts]).tolist() == expected.tolist()
    assert [part.first for part in parts] == [True] + [False] * (len(parts) - 1)
    assert [part.last for part in parts] == [False] * (len(parts) - 1) + [True]


@pytest.mark.parametrize("samples", [1, 2, 50, 333])
def test_the_pieces_of_a_track_are_its_rows(samples: int, monkeypatch: pytest.MonkeyPatch) -> None:
    made = flown()
    whole = made.sampled(samples, UNTIL)
    for module in (track, flight):
        monkeypatch.setattr(module, "PIECE", FEW)
    pieces = list(made.pieces(samples, UNTIL))
    assert len(pieces) >= len(whole.t) // (2 * FEW)
    assert max(len(piece.t) for piece in pieces) <= 2 * FEW + 4
    for one in fields(Track):
        joined = np.concatenate([getattr(piece, one.name) for piece in pieces])
        assert joined == pytest.approx(getattr(whole, one.name), rel=1e-14, abs=1e-13)


def test_extremes_of_pieces_are_those_of_the_whole() -> None:
    """Random walks, with values that come again: the first time of what is equal but for rounding counts."""
    generator = np.random.default_rng(4)
    made = flown()
    for count in (1, 5, 40, 500):
        whole = made.sampled(count, UNTIL)
        found = track.extremes([whole])
        cuts = np.sort(generator.integers(0, len(whole.t), 3))
        parts = [
            Track(**{one.name: getattr(whole, one.name)[begin:end] for one in fields(Track)})
            for begin, end in zip([0, *cuts], [*cuts, len(whole.t)], strict=True)
            if end > begin
        ]
        again = track.extremes(parts)
        assert again == found
        assert (found.rows, found.until) == (len(whole.t), UNTIL)


def test_the_first_of_equal_extremes_counts_across_pieces() -> None:
    angles = np.array([0.1, 0.3, 0.2, 0.3 + 0.4 * SAME_ANGLE, 0.25, 0.3 + 0.9 * SAME_ANGLE, 0.1])
    rows = len(angles)
    axis = np.column_stack([np.sin(angles), np.zeros(rows), np.cos(angles)])
    nothing, up = np.zeros(rows), np.tile([0.0, 0.0, 2.0], (rows, 1))
    whole = Track(
        np.arange(float(rows)), up, np.zeros((rows, 4)), axis, up, nothing, nothing, nothing, np.zeros(rows, dtype=int)
    )
    for size in (1, 2, 3, rows):
        parts = [
            Track(**{one.name: getattr(whole, one.name)[begin : begin + size] for one in fields(Track)})
            for begin in range(0, rows, size)
        ]
        found = track.extremes(parts)
        assert found.farthest == pytest.approx((0.3, 1.0), abs=1e-15)
        assert found.nearest == pytest.approx((0.1, 0.0), abs=1e-15)


def test_a_track_is_written_as_it_was_by_numbers() -> None:
    made = flown()
    whole = made.sampled(100, UNTIL)
    half = len(whole.t) // 2
    pieces = [
        Track(**{one.name: getattr(whole, one.name)[rows] for one in fields(Track)})
        for rows in (slice(None, half), slice(half, None))
    ]
    stream = io.BytesIO()
    write_track(pieces, made.spacecraft.inertia, stream)
    lines = stream.getvalue().decode().split("\r\n")
    assert lines[0] == ",".join(HEADER)
    assert lines[-1] == ""
    rows = track_array(whole, made.spacecraft.inertia).tolist()
    assert lines[1:-1] == [",".join([*map(number, row[:-1]), str(row[-1])]) for row in rows]


@pytest.mark.weekly
def test_memory_does_not_grow_with_the_rows() -> None:
    """What 4.5e5 rows of 18 columns take as one array alone is 65 MB; several of those stood side by side."""
    made = flown()
    peaks = []
    for samples in (150_000, 450_000):
        tracemalloc.start()
        try:
            track.extremes(made.pieces(samples, UNTIL))
            with io.BytesIO() as nowhere:
                nowhere.write = len  # type: ignore[method-assign, assignment]
                write_track(made.pieces(samples, UNTIL), made.spacecraft.inertia, nowhere)
            peaks.append(tracemalloc.get_traced_memory()[1])
        finally:
            tracemalloc.stop()
    assert peaks[1] < 1.2 * peaks[0]
    assert peaks[1] < 100e6


@pytest.mark.deep
def test_the_command_writes_every_row(run: Run, tmp_path: Path) -> None:
    done = run("simulate", "--scheme", "two-pulse", "--samples", "45000", "--csv", "track.csv", "--quiet")
    assert done.returncode == 0, done.stderr
    with (tmp_path / "track.csv").open(newline="") as stream:
        times = [float(row["t_s"]) for row in csv.DictReader(stream)]
    assert len(times) == 45_004
    assert times == sorted(times)
    assert "45004 rows" in done.stdout
