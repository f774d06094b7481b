"""What makes a fit doubtful though its sigmas are small: in words, or as the reason why there is none."""

from __future__ import annotations

from collections.abc import Iterator

from nutdamp.estimation import aliases
from nutdamp.estimation.fit import Fit
from nutdamp.estimation.parameters import shows_turn
from nutdamp.estimation.unexplained import step

LATE = 0.1
"""Delay of a channel from which on the times of the schedule are doubted, s: valves are faster."""

SURE = 3.0
"""Standard deviations from which on a doubt is said."""


def doubts(found: Fit) -> Iterator[str]:
    """Remarks on a fit: what it rests on besides the data, and where record, schedule and file disagree."""
    if aliases.too_slow(found.model, found.values):
        yield (
            f"sampled below the nutation rate, every {aliases.interval(found.model):.4g} s: which C/A it is rests on "
            "the tolerance of the file (are the times in seconds?)"
        )
    spin = found.model.spacecraft.spin
    if found.named.get("omega_3", spin) * spin < 0.0:
        yield "the body spins the other way than the file has it: is omega_3 reversed, or state.spin?"
    if not shows_turn(found.model.record):
        yield (
            "the axis alone does not show how the body is turned about it: the phase, and so the firing times of a "
            "plan, rest on the attitude of the file; omega_1 or omega_2, an acceleration or Sun pulses would show it"
        )
    yield from _of_residuals(found)
    yield from _of_schedule(found)


def _of_residuals(found: Fit) -> Iterator[str]:
    """What residuals that are not white may come from, and what helps."""
    left = [index for index in range(len(found.model.signals)) if found.resolved[index] and not found.white(index)]
    if not left:
        return
    says = f"the residuals of {', '.join(found.model.signals[index] for index in left)} are not white"
    time = step(found, left, small=True)
    if time is None:
        yield f"{says}: the noise of neighbouring samples is correlated, or a small motion is not in the model"
        return
    what = "check --schedule" if found.model.record.fired else "give the pulses fired with --schedule"
    yield f"{says}: the nutation steps at about {time:.3g} s, as by a small pulse; {what}, or end the record before it"


def _of_schedule(found: Fit) -> Iterator[str]:
    """Where the schedule is not what was fired in the record."""
    record = found.model.record
    outside = len(record.schedule) - len(record.fired)
    if outside:
        span = f"the record, {record.start:g} s to {record.end:g} s"
        count = f"{outside} of {len(record.schedule)} pulses of the schedule" if record.fired else "the whole schedule"
        yield f"{count} is outside {span}: of its channels the record tells nothing"
    for index, one in enumerate(found.model.parameters):
        kind, _, channel = one.name.partition(" ")
        value, sigma = float(found.values[index]), float(found.sigmas[index])
        if kind == "delay" and abs(value) > max(LATE, SURE * sigma):
            way = "late" if value < 0.0 else "early"
            yield (
                f"the times of {channel} in the schedule are {abs(value):.3f} s {way} against the record: do both "
                "count from the same t = 0?"
            )
        if kind == "thrust" and value < -SURE * sigma:
            way = "it pushes the other way: another channel, or reversed?"
            yield f"the thrust factor of {channel} is {value:.3g}: {way}"
