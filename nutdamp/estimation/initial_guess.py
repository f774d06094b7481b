"""Start of a fit: rate and size of the nutation from the spectrum of one signal, the rest by linear
least squares.

A symmetric body's ω = ω1 + iω2 turns in the body at -aω3, its axis in space about H at |H|/A: so
the peak of a spectrum gives C/A. Where signals come too seldom for a spectrum, each C/A that the
file allows is tried.

Aliases: seen every T s, a rate looks like any other that differs by a multiple of 2π/T. C/A is
known but for multiples of 2π/(|ω3| T), and one transverse signal alone does not show the sense of
the rate either.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from nutdamp.errors import Infeasible
from nutdamp.estimation.model import Fit, Model, named_of, scales_of
from nutdamp.estimation.parameters import (
    ACCELERATION,
    AXIS,
    BODY,
    CROSSING,
    DIRECTION,
    GYROS,
    KIND,
    QUATERNION,
    RATIO,
    SEEN,
    SPACE,
    TURN_AT_START,
    Record,
    Values,
    Vector,
    in_moments,
    wrapped,
)
from nutdamp.physics import attitude

FINER = 8  # frequencies of a spectrum for each of its samples
LONGEST_SPECTRUM = 1 << 16  # samples of a spectrum at most; of longer records the first
SMALL = 1e-3  # share of the spin that trial transverse rates have: the motion is linear there
STILL = (
    1e-3  # share of |H|/A up to which a spin counts as none, and trial rates are a share of that
)
# part by which a spin by Sun pulses may differ from that of the file before both are tried
OTHER = 0.05
MOST_TURNED = 2.1  # C/A at most, and a little more: 2 for a thin disc
# cosine of a nutation angle, 15 deg, from which on noise may decide in which plane a cone is
NARROW = 0.966
FLAT = 0.1  # cosine of the nutation angle from which on its rate is sought
TURNS = 8  # starting values of the angle by which the body is turned about its axis
TRIED = 60  # values of C/A tried at most where no spectrum shows the nutation
SLIP = 1.5  # phase, rad, by which the nutation of two of them differs at the end of a record


def starts(model: Model, share: float = 1.0) -> Iterator[dict[str, float]]:
    """Values to begin with: from the first ``share`` of the record,
    as the file has them otherwise.
    """
    spin = _spin(model)
    record = model.record
    if len(model.pulses):
        # Pulses break the line of the nutation in a spectrum: the file may know its rate better.
        yield {each.name: each.file for each in model.parameters}
    yield from _starts(model, share, spin)
    # The Sun does not go round a sensor once a turn where it is near the axis: then the file knows
    # better.
    by_pulses = len(record.sun_pulses) > 1 and not record.has(GYROS[2]) and _around(model) is None
    if by_pulses and abs(spin / model.spacecraft.spin - 1.0) > OTHER:
        yield from _starts(model, share, model.spacecraft.spin)


def _starts(model: Model, share: float, spin: float) -> Iterator[dict[str, float]]:
    of_file = {each.name: each.file for each in model.parameters}
    cone = _cone(model, share)
    if cone is not None and model.record.shows_spin and not model.record.has(GYROS[2]):
        # A direction goes round a sensor once a turn of the body about its axis and of the axis
        # about H.
        spin -= model.spacecraft.sense * cone.rate * (1.0 - cone.cosine)
    if "omega_3" in of_file:
        of_file["omega_3"] = spin
    rate = _peak(model, spin, share)
    linear = of_file | ({} if rate is None else _moments(model, rate, spin))
    if model.record.has(*AXIS):
        linear |= _towards(model, np.nanmean(_axes(model.record), axis=0))
    ratios: Sequence[float] | Vector = [linear[RATIO]]
    if rate is None and _seldom(model):
        # All that the file allows, so near to each other that one of them leads to the least.
        _, low, high = _range(model)
        count = math.ceil((high - low) * abs(spin) * model.record.length / SLIP) + 1
        ratios = np.linspace(low, high, min(count, TRIED))
    angles = (
        [2.0 * math.pi * turn / TURNS for turn in range(TURNS)] if "attitude_3" in of_file else []
    )
    if (around := _around(model)) is not None:
        angles = [around[1]]
    for turned in [{"attitude_3": angle} for angle in angles] or [{}]:
        if cone is not None:
            yield _on_cone(model, of_file | turned, spin, cone)
        for ratio in ratios:
            values = _linear(model, linear | turned | {RATIO: ratio})
            yield values
            if _seldom(model) and model.record.shows_spin:
                axial = axial_rate(model, ratio, spin)
                size = math.hypot(values["omega_1"], values["omega_2"])
                less = math.copysign(math.hypot(axial, size), axial) - axial
                yield _linear(model, values | {"omega_3": spin - less})


def _seldom(model: Model) -> bool:
    """True where only signals that come too seldom for a spectrum show a nutation."""
    return not any(
        KIND[name].nutation
        for name in model.signals
        if name == "axis" or KIND[name].nutation == BODY
    )


def _around(model: Model) -> tuple[float, float] | None:
    """Rate (rad/s) at which known directions go round the body, and the turn of the body at the
    start, rad.

    By the azimuths of those that crossed, or of one across the axis that quaternions turn; None
    without any.
    """
    record, reference = model.record, model.reference.quaternion
    of_file = attitude.from_matrix(model.spacecraft.inertia.axes)
    times, rows = record.samples((*SEEN, *DIRECTION))
    if len(times):
        shown, directions = rows[:, :3], rows[:, 3:]
    else:
        times, rows = record.samples(QUATERNION)
        if not len(times):
            return None
        directions = np.broadcast_to(
            attitude.rotate(reference, np.array([1.0, 0.0, 0.0])), (len(times), 3)
        )
        shown = attitude.rotate(attitude.conjugate(rows), directions)
    shown = attitude.rotate(attitude.conjugate(of_file), shown)
    before = attitude.rotate(attitude.conjugate(reference), directions)
    angles = np.arctan2(before[:, 1], before[:, 0]) - np.arctan2(shown[:, 1], shown[:, 0])
    gyro = record.samples(GYROS[2:])[1]
    spin = float(np.median(gyro)) if len(gyro) else model.spacecraft.spin
    # Turns between two samples by the spin as it is known; then a line through all.
    steps = spin * np.diff(times)
    steps = steps + wrapped(np.diff(angles) - steps)
    turned = angles[0] + np.concatenate([[0.0], np.cumsum(steps)])
    if len(times) < 2:
        return spin, float(angles[0] - spin * (times[0] - model.start))
    rate, turn = np.polyfit(times - model.start, turned, 1)
    return float(rate), float(turn)


def _spin(model: Model) -> float:
    """ω3 from the signal that shows it, rad/s; else as the file has it."""
    record, spin = model.record, model.spacecraft.spin
    if record.has(GYROS[2]) and np.isfinite(record.signals[GYROS[2]]).any():
        return float(np.nanmedian(record.signals[GYROS[2]]))
    if (around := _around(model)) is not None:
        return around[0]
    if len(record.sun_pulses) > 1:
        return math.copysign(spin_of(record.sun_pulses)[0], spin)
    return spin


def spin_of(pulses: Vector, step: float = 0.0) -> tuple[float, float]:
    """Mean rate of the turns between two Sun pulses or more, at rising times (k,) s, and its sigma,
    rad/s.

    That of a straight line through the times, by what they are off it, or by their ``step`` (s,
    full width).
    """
    gaps = np.diff(pulses)
    turns = np.concatenate([[0.0], np.cumsum(np.rint(gaps / gaps.min()))])
    rate = 2.0 * math.pi * float(turns[-1]) / float(pulses[-1] - pulses[0])
    if len(pulses) < 3:
        return rate, math.inf
    slope, squares = np.polyfit(turns, pulses, 1, full=True)[:2]
    variance = max(float(squares.sum()) / (len(pulses) - 2), step * step / 12.0)
    spread = math.sqrt(variance / float(np.sum((turns - turns.mean()) ** 2)))
    return 2.0 * math.pi / float(slope[0]), 2.0 * math.pi * spread / float(slope[0]) ** 2


def once_a_turn(record: Record) -> str:
    """Words on what Sun pulses tell by themselves; empty without them."""
    if len(record.sun_pulses) < 3:
        return ""
    spin, sigma = np.degrees(spin_of(record.sun_pulses, record.sun_step))
    return (
        f": Sun pulses come once a spin turn and tell the spin, {spin:.7g} deg/s, "
        f"with a sigma of {sigma:.2g} deg/s"
    )


def _peak(model: Model, spin: float, share: float) -> float | None:
    """The rate aω3 at which a nutation turns in the body, rad/s; None where no signal shows it."""
    record, spacecraft = model.record, model.spacecraft
    expected = spacecraft.inertia.nutation_rate(spin)
    fastest = abs(spin) if spacecraft.inertia.wheel == 0.0 else max(abs(spin), 2.0 * abs(expected))
    count = _count(record, share)
    times = record.times[:count]
    signals = {name: values[:count] for name, values in record.signals.items()}
    if record.has(*GYROS[:2]):
        return _strongest(times, signals[GYROS[0]], signals[GYROS[1]], -expected, fastest, -1.0)
    for name in (*GYROS[:2], ACCELERATION):
        if name in signals:
            turning = _strongest(times, signals[name], None, expected, fastest, 1.0)
            return None if turning is None else math.copysign(turning, expected)
    cone = _cone(model, share)
    return None if cone is None else spin - spacecraft.sense * cone.rate * cone.cosine


class _Cone(NamedTuple):
    """The axis goes round ``momentum``, a unit vector, at ``rate`` rad/s from ``begin``, a unit
    vector at the start.
    """

    momentum: Vector
    rate: float
    begin: Vector

    @property
    def cosine(self) -> float:
        """Of the nutation angle."""
        return float(self.momentum @ self.begin)


def _axes(record: Record) -> Vector:
    return np.column_stack([record.signals[name] for name in AXIS])


def _count(record: Record, share: float) -> int:
    """Samples of a spectrum of the first ``share`` of a record."""
    return min(max(int(share * len(record.times)), min(len(record.times), 16)), LONGEST_SPECTRUM)


def _cone(model: Model, share: float) -> _Cone | None:
    """The cone that the axis describes in space, of any angle; None where no axis is measured or
    shows none.
    """
    record, spacecraft = model.record, model.spacecraft
    if not record.has(*AXIS):
        return None
    count = _count(record, share)
    times, axis = record.times[:count], _axes(record)[:count]
    complete = np.isfinite(axis).all(axis=1)
    if complete.sum() < 4:
        return None
    mean = np.mean(axis[complete], axis=0)
    # A cone meets the unit sphere in a plane across H: the axis varies least along it.
    momentum = np.linalg.svd(axis[complete] - mean, full_matrices=False)[2][-1]
    momentum = momentum * math.copysign(1.0, float(momentum @ mean))
    if np.linalg.norm(mean) > NARROW:
        momentum = mean / np.linalg.norm(mean)
    first = attitude.square_to(momentum)
    second = np.cross(momentum, first)
    x, y = axis @ first, axis @ second
    # In the sense of H, with |H|/A = H3/(A cos θ).
    height = float(momentum @ mean)
    pace = abs(spacecraft.axial) / spacecraft.inertia.C / max(height, FLAT)
    rate = _strongest(
        times, x, y, spacecraft.inertia.C / spacecraft.inertia.A * pace, MOST_TURNED * pace, 1.0
    )
    if rate is None:
        return None
    begin = np.mean((x + 1j * y)[complete] * np.exp(-1j * rate * (times[complete] - model.start)))
    along = begin.real * first + begin.imag * second + height * momentum
    return _Cone(momentum, abs(rate), along / np.linalg.norm(along))


def _on_cone(model: Model, values: Values, spin: float, cone: _Cone) -> dict[str, float]:
    """Values by which the axis describes a cone: ω is that of the axis about H, besides what is
    along the axis.
    """
    moments = _moments(model, spin - model.spacecraft.sense * cone.rate * cone.cosine, spin)
    values = {**values, **moments, **_towards(model, cone.begin)}
    across = cone.rate * (cone.momentum - cone.cosine * cone.begin)
    x, y, _ = attitude.rotate(attitude.conjugate(model.turned(values)), across)
    return values | {"omega_1": float(x), "omega_2": float(y)}


def _strongest(
    times: Vector,
    real: Vector,
    imaginary: Vector | None,
    expected: float,
    fastest: float,
    sign: float,
) -> float | None:
    """Rate (rad/s, times ``sign``) at the peak of a spectrum, nearest to ``expected`` of those that
    look alike.
    """
    complete = (
        np.isfinite(real) if imaginary is None else np.isfinite(real) & np.isfinite(imaginary)
    )
    if complete.sum() < 4:
        return None
    at = times[complete]
    values = real[complete] + (0j if imaginary is None else 1j * imaginary[complete])
    step = float(np.median(np.diff(at)))
    count = min(math.ceil((at[-1] - at[0]) / step) + 1, LONGEST_SPECTRUM)
    place = np.rint((at - at[0]) / step).astype(int)
    inside = place < count
    even = np.zeros(count, dtype=complex)
    # Outliers are cut off at a few times the usual size.
    centred = values - np.median(values.real) - 1j * np.median(values.imag)
    limit = 3.0 * float(np.median(np.abs(centred))) or math.inf
    centred /= np.maximum(np.abs(centred) / limit, 1.0)
    even[place[inside]] = (centred - centred.mean())[inside]
    length = 1 << math.ceil(math.log2(FINER * count))
    power = np.abs(np.fft.fft(even, length)) ** 2
    rates = 2.0 * math.pi * np.fft.fftfreq(length, step)
    around = 2.0 * math.pi / step
    if imaginary is None:
        power = np.where(rates > 0.0, power, 0.0)
        rates = np.abs(rates)
        expected = abs(expected)
    else:
        rates = rates + around * np.rint((expected - rates) / around) * (fastest > 0.5 * around)
    power = np.where(
        (np.abs(rates) <= 1.02 * fastest) & (np.abs(rates) > 0.25 * 2.0 * math.pi / (count * step)),
        power,
        0,
    )
    if not power.any():
        return None
    return sign * float(rates[int(np.argmax(power))])


def _moments(model: Model, rate: float, spin: float) -> dict[str, float]:
    """A and C that give a body rate, each moved as far as the file's tolerances share it; nothing
    if impossible.
    """
    inertia = model.spacecraft.inertia
    if spin == 0.0:
        return {}
    if inertia.wheel == 0.0:
        wanted = inertia.C / inertia.A - (rate - inertia.nutation_rate(spin)) / spin
    else:  # of the A at which ω3 - H3/A is the rate
        wanted = inertia.C * (spin - rate) / float(inertia.axial(spin))
    wanted = min(max(wanted, 0.01), 1.999)
    A = model.parameter("A")
    ratio = model.parameters[_range(model)[0]]
    if A is None:
        return {RATIO: wanted}
    # Moments that are known together would be moved by many times what the ratio is: a start need
    # not be.
    part = min((A.prior / A.file) ** 2 / (ratio.prior / ratio.file) ** 2, 1.0)
    return {"A": A.file * (ratio.file / wanted) ** part, RATIO: wanted}


def _towards(model: Model, axis: Vector) -> dict[str, float]:
    """The attitude turned the shortest way so that the spin axis is along an ``axis`` (3,), of any
    length.
    """
    sense = model.spacecraft.sense
    wanted = sense * attitude.rotate(
        attitude.conjugate(model.reference.quaternion), axis / np.linalg.norm(axis)
    )
    across = np.cross([0.0, 0.0, 1.0], wanted)
    size = float(np.linalg.norm(across))
    angle = math.atan2(size, wanted[2])
    turn = angle * across / size if size > 0.0 else np.array([angle, 0.0, 0.0])
    return {"attitude_1": float(turn[0]), "attitude_2": float(turn[1])}


def _linear(model: Model, values: dict[str, float]) -> dict[str, float]:
    """The transverse rates, offsets and tilts by linear least squares, everything else as it is."""
    offsets = (
        ("bias", "attitude")
        if {CROSSING, "turn"} & set(model.signals)
        else ("bias", "attitude_1", "attitude_2")
    )
    names = ["omega_1", "omega_2", *(name for name in values if name.startswith(offsets))]
    base = values | {"omega_1": 0.0, "omega_2": 0.0}
    still = (
        STILL * 2.0 * math.pi / model.spacecraft.inertial_period
    )  # a wheel may hold a body that does not spin
    pace = max(abs(values.get("omega_3", model.spacecraft.spin)), still)
    steps = dict.fromkeys(names[:2], SMALL * pace)
    steps |= dict.fromkeys(names[2:], SMALL)
    at_rest = model.predicted(base)
    columns = [
        (model.predicted(base | {name: base[name] + steps[name]}) - at_rest) / steps[name]
        for name in names
    ]
    weights = 0.1 / scales_of(model)[model.signal]
    # Of one direction the attitude is not told about it.
    certainty = {
        each.name: 1.0 / each.prior for each in model.parameters if each.kind is TURN_AT_START
    }
    held = np.array([certainty.get(name, 0.0) for name in names])
    matrix = np.concatenate([np.column_stack(columns) * weights[:, None], np.diag(held)])
    target = np.concatenate(
        [(model.measured - at_rest) * weights, -held * [base[name] for name in names]]
    )
    solved = np.linalg.lstsq(matrix, target, rcond=1e-10)[0]
    return values | {
        name: base[name] + float(part) for name, part in zip(names, solved, strict=True)
    }


WITHIN = 3.0  # sigmas of the file within which another C/A is considered
ALIKE = 25.0  # difference of -2 ln(likelihood) below which two fits count as equally good
MOST_ALIASES = 6  # other values of C/A that are fitted at most, the nearest to the file first
POSSIBLE = (0.01, 1.999)  # range of C/A of a symmetric body


def neighbours(model: Model, values: Vector) -> list[Vector]:
    """Values of the parameters with the other C/A that equal sampling allows within the tolerances
    of the file.
    """
    at, low, high = _range(model)
    of_file = model.parameters[at]
    # Without a tolerance all that are possible, if the nutation found is itself sampled too slowly.
    if math.isinf(of_file.prior) and not too_slow(model, values):
        return []
    spin = named_of(model, values).get("omega_3", model.spacecraft.spin)
    step = 2.0 * math.pi / (abs(spin) * interval(model))
    # a -> a + k step; of one transverse signal also a -> -a + k step.
    shown = [KIND[name].nutation for name in model.signals]
    one_sided = shown.count(BODY) == 1 and SPACE not in shown
    mirrored = [(2.0 - values[at], False)] * one_sided + [(-values[at], False)] * _seldom(model)
    ratios = []
    for begin, itself in ((values[at], True), *mirrored):
        nearest = round((of_file.file - begin) / step)
        turns = range(nearest - MOST_ALIASES, nearest + MOST_ALIASES + 1)
        ratios += [begin + k * step for k in turns if k != 0 or not itself]
    possible = sorted(
        (ratio for ratio in ratios if low < ratio < high),
        key=lambda ratio: abs(ratio - of_file.file),
    )
    every = np.arange(len(values))
    return [np.where(every == at, ratio, values) for ratio in possible[:MOST_ALIASES]]


def likeliest(fits: Sequence[Fit]) -> Fit:
    """The one of some fits of one record that data and tolerances leave; raises Infeasible where
    that is several.
    """
    model = fits[0].model
    at, low, high = _range(model)
    counts = np.bincount(model.signal)
    costs = [2.0 * float(counts @ np.log(fitted.noise)) for fitted in fits]
    alike: list[Fit] = []
    for index in np.argsort(costs):
        fitted = fits[index]
        # A search from one value may end at that of another.
        again = any(abs(fitted.values[at] - other.values[at]) < other.sigmas[at] for other in alike)
        if costs[index] < min(costs) + ALIKE and not again:
            alike.append(fitted)
    allowed = [fitted for fitted in alike if low < fitted.values[at] < high]
    if not allowed and too_slow(model, alike[0].values):
        raise Infeasible(
            f"with a sample every {interval(model):.4g} s several nutation rates fit "
            "equally well, and none gives a C/A within the tolerances of the file; check A "
            "and C in the file (are the times in seconds?)"
        )
    allowed = allowed or alike[:1]
    if len(allowed) == 1:
        return allowed[0]
    ratios = sorted(float(fitted.values[at]) for fitted in allowed)
    fastest = max(abs(nutation_rate(model, fitted.values)) for fitted in allowed)
    raise Infeasible(
        f"with a sample every {interval(model):.4g} s several nutation rates fit "
        f"equally well: C/A may be {', '.join(f'{ratio:.4f}' for ratio in ratios)}; use "
        f"samples less than {math.pi / fastest:.3g} s apart or at uneven intervals, or "
        "smaller tolerances of A and C (are the times in seconds?)"
    )


def too_slow(model: Model, values: Vector) -> bool:
    """True where fewer than two samples fall in a nutation period."""
    return abs(nutation_rate(model, values)) * interval(model) > math.pi


def nutation_rate(model: Model, values: Vector) -> float:
    """Rate at which the signals show the nutation, rad/s: in the body, or in space where only the
    axis is seen.
    """
    named = named_of(model, values)
    spin = named.get("omega_3", model.spacecraft.spin)
    A, C = in_moments(model.spacecraft, named)
    axial = axial_rate(model, C / A, spin)
    return spin - axial if any(KIND[name].nutation == BODY for name in model.signals) else axial


def axial_rate(model: Model, ratio: float, spin: float) -> float:
    """H3/A in rad/s at a ``ratio`` C/A and a ``spin``."""
    inertia = model.spacecraft.inertia
    return ratio * (spin + inertia.wheel / inertia.C)


def interval(model: Model) -> float:
    """Usual time between the samples of the signal that is sampled fastest of those that show the
    nutation, s.
    """
    shown = [index for index, name in enumerate(model.signals) if KIND[name].nutation]
    steps = [
        np.diff(model.times[model.signal == index][: len(model.samples[index])]) for index in shown
    ]
    return min(
        (float(np.median(gaps)) for gaps in steps if len(gaps)), default=model.record.interval
    )


def _range(model: Model) -> tuple[int, float, float]:
    """Position of C/A among the parameters, and the range that the file leaves it."""
    at, of_file = next((at, each) for at, each in enumerate(model.parameters) if each.name == RATIO)
    (smallest, largest), reach = POSSIBLE, WITHIN * of_file.prior
    return at, max(of_file.file - reach, smallest), min(of_file.file + reach, largest)
