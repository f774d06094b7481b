"""Estimates of a fit with their standard deviations, the spacecraft at an epoch, and checks of
consistency.

The checks name what makes a fit doubtful though its sigmas are small. `Fitted` is the result in the
library.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import combinations
from os import PathLike
from typing import Any, NamedTuple

import numpy as np

from nutdamp.common import results, work
from nutdamp.common.numerics import RPM, finite
from nutdamp.common.results import Note, note
from nutdamp.common.time import MONTH
from nutdamp.errors import Infeasible
from nutdamp.estimation import initial_guess
from nutdamp.estimation.fit import expect_alive, expect_enough, fit, step
from nutdamp.estimation.model import Body, Fit, Model, unmoved
from nutdamp.estimation.parameters import (
    ACCELERATION,
    AXIS,
    DEG,
    EXACT,
    GYROS,
    RATIO,
    SEEN,
    THRUST_FACTOR,
    TURN_AT_START,
    Matrix,
    Record,
    Values,
    Vector,
    in_moments,
    prior_of,
    thrust_prior,
)
from nutdamp.physics import attitude
from nutdamp.spacecraft.model import Spacecraft, SpinState
from nutdamp.spacecraft.tolerances import Dispersions, Tolerance

WHEEL = "wheel momentum"  # input of a wheel that is estimated

# sources of an estimate: the file's tolerances, both, the data, or the ratio that these tell
UNTOLD, SHARED, TOLD, BY_RATIO = "file", "both", "data", "ratio"

FROM_DATA = 0.5  # share of its prior that a sigma is below where the data tell a value
CORRELATED = 1e-3  # correlations below are left out of files
DIGITS = 9  # decimals of correlations in files
# thrust factor down to which a channel did not fire: it is not calibrated by that
LEAST_THRUST = 0.05
WORTH_NAMING = 0.9  # correlation from which on it is named


class Estimate(NamedTuple):
    """A ``value`` with its ``sigma`` (infinite where the data do not tell it), shown times
    ``factor`` in ``unit``.

    ``file`` and its sigma ``prior`` are None where the file says nothing.
    """

    key: str
    label: str
    unit: str
    factor: float
    value: float
    sigma: float
    file: float | None
    prior: float | None
    by_ratio: bool = False  # of C/A by the other moment, which the file has without a tolerance

    @property
    def source(self) -> str:
        """Its source."""
        if self.by_ratio:
            return BY_RATIO
        if math.isinf(self.sigma):
            return UNTOLD
        if self.prior is None or self.sigma <= FROM_DATA * self.prior:
            return TOLD
        assert self.file is not None
        return UNTOLD if unmoved(self.value - self.file, self.sigma, self.prior) else SHARED

    @property
    def change(self) -> float | None:
        """Difference of the value from that of the file, in the file's sigmas."""
        return (
            None if self.file is None or not self.prior else (self.value - self.file) / self.prior
        )


@dataclass(frozen=True, eq=False)
class Carried:
    """The spacecraft at ``time`` s: ``values`` (k,) and ``covariance`` (k, k) of the inputs
    ``names`` of dispersions.

    They are A, C (kg m², unless the spin is steady), omega0_1 … omega0_3 (rad/s, axes of the file)
    and ``thrust`` of thrusters (factors).
    """

    time: float
    names: tuple[str, ...]
    values: Vector
    covariance: Matrix
    body: Body
    state: SpinState  # in its own principal axes
    tilt: (
        float | None
    )  # one sigma of the axis about each of two axes across it, rad; None if not estimated

    @property
    def sigmas(self) -> Vector:
        """Standard deviations, (k,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def factors(self) -> dict[str, tuple[float, float]]:
        """Thrust factors and their sigmas by thruster."""
        rows = zip(self.names, self.values.tolist(), self.sigmas.tolist(), strict=True)
        return {
            name.removeprefix("thrust "): (value, sigma)
            for name, value, sigma in rows
            if name.startswith("thrust ")
        }

    @property
    def quaternion(self) -> Vector:
        """Attitude of the file's axes, (4,), scalar first."""
        return attitude.multiply(
            self.state.quaternion, attitude.from_matrix(self.body.inertia.axes.T)
        )

    @property
    def correlation(self) -> Matrix:
        """Correlations (k, k); zero with what is exactly known."""
        scale = np.where(self.sigmas > 0.0, self.sigmas, 1.0)
        return np.asarray(self.covariance / np.outer(scale, scale))


def carried(fitted: Fit, time: float) -> Carried:
    """The spacecraft as it is at ``time`` s, and how well that is known."""
    model = fitted.model
    channels = {channel.name: channel for channel in model.spacecraft.channels}
    factors: dict[str, str] = {}
    for parameter in model.parameters:
        name = parameter.which
        if parameter.kind is THRUST_FACTOR and name in channels:
            value, sigma = _at(fitted, parameter.name)
            # It fired, and the data tell its thrust better than the file.
            if value > LEAST_THRUST and sigma < thrust_prior(model.spacecraft, name)[1]:
                factors |= {
                    f"thrust {member.name}": parameter.name for member in channels[name].thrusters
                }
    more = ({WHEEL: "wheel"} if fitted.index("wheel") is not None else {}) | factors
    moments = () if fitted.steady else ("A", "C")
    names = (*moments, "omega0_1", "omega0_2", "omega0_3", *more)

    def inputs(values: Values) -> Vector:
        body, state = model.at(values, time)
        rates = body.inertia.axes @ state.rates
        return np.array(
            [
                *in_moments(model.spacecraft, values)[: len(moments)],
                *rates,
                *(values[name] for name in more.values()),
            ]
        )

    def axis(values: Values) -> Vector:
        return attitude.rotate(
            model.at(values, time)[1].quaternion, np.array([0.0, 0.0, model.spacecraft.sense])
        )

    tilt = None
    if fitted.index("attitude_1") is not None:
        tilt = math.sqrt(0.5 * float(np.trace(_told(fitted, axis)[1])))
    return Carried(time, names, *_told(fitted, inputs), *moving(fitted, time), tilt)


class Pointing(NamedTuple):
    """Inertial ``direction`` (3,), and the ``covariance`` (2, 2) rad² of its errors in right
    ascension times cosine of declination, and in declination.
    """

    name: str
    direction: Vector
    covariance: Matrix
    source: str

    @property
    def along(self) -> float:
        """One sigma of right ascension times cosine of declination, rad."""
        return math.sqrt(self.covariance[0, 0])

    @property
    def across(self) -> float:
        """One sigma of declination, rad."""
        return math.sqrt(self.covariance[1, 1])

    @property
    def correlation(self) -> float | None:
        """Correlation of the two."""
        sigmas = self.along * self.across
        return float(self.covariance[0, 1]) / sigmas if sigmas > 0.0 else None


def pointings(fitted: Fit, time: float) -> tuple[Pointing, ...]:
    """Directions of spin axis and H at ``time`` s; none where the record does not show them."""
    first = fitted.index("attitude_1")
    if first is None:
        return ()
    prior = fitted.model.parameters[first].prior
    of_tilts = fitted.covariance[first : first + 2, first : first + 2]
    low, high = np.sqrt(np.maximum(np.linalg.eigvalsh(of_tilts), 0.0))
    if low > FROM_DATA * prior:
        return ()

    def directions(values: Values) -> Vector:
        body, state = fitted.model.at(values, time)
        momentum = body.inertia.momentum(state.rates)
        axes = np.array([[0.0, 0.0, body.sense], momentum / np.linalg.norm(momentum)])
        return attitude.rotate(state.quaternion, axes).ravel()

    vectors, covariance = _told(fitted, directions)
    rows = []
    for name, part in (("spin axis", slice(0, 3)), ("H", slice(3, 6))):
        direction = vectors[part]
        x, y, _ = direction.tolist()
        east = np.array([-y, x, 0.0]) / math.hypot(x, y) if x or y else np.array([0.0, 1.0, 0.0])
        across = np.stack([east, np.cross(direction, east)])
        shared = across @ covariance[part, part] @ across.T
        source = TOLD if high <= FROM_DATA * prior else SHARED
        rows.append(Pointing(name, direction, shared, source))
    return tuple(rows)


def moving(fitted: Fit, time: float) -> tuple[Body, SpinState]:
    """The body, and its motion at ``time`` s."""
    model = fitted.model
    body, state = model.at(fitted.named, time)
    if fitted.index("attitude_1") is None and fitted.index("attitude_3") is None:
        # Rates say nothing of where the body points: at t = 0 it is as the file has it.
        first, at_first = model.at(fitted.named, 0.0)
        spacecraft = model.spacecraft
        of_file = attitude.multiply(
            spacecraft.initial.quaternion, attitude.from_matrix(spacecraft.inertia.axes.T)
        )
        back = attitude.conjugate(
            attitude.multiply(at_first.quaternion, attitude.from_matrix(first.inertia.axes.T))
        )
        state = replace(
            state, quaternion=attitude.multiply(attitude.multiply(of_file, back), state.quaternion)
        )
    return body, state


def replaced(spacecraft: Spacecraft, estimate: Carried) -> Spacecraft:
    """The ``spacecraft`` of the file with moments, motion and attitude of the estimate, and nothing
    else of it.
    """
    return replace(
        spacecraft,
        inertia=estimate.body.inertia,
        omega0=estimate.state.rates,
        attitude=None
        if spacecraft.attitude is None
        else replace(spacecraft.attitude, quaternion=estimate.quaternion),
    )


def correlations(
    estimate: Carried, dispersions: Dispersions | None
) -> tuple[tuple[str, str, float], ...]:
    """Correlations by pairs of inputs, rounded as in files, positive definite; ``dispersions`` of
    others stay. A and C are no inputs beside the whole tensor.
    """
    matrix = estimate.correlation
    tensor = dispersions is not None and dispersions.inertia_tensor is not None
    uncertain = [
        index
        for index, (name, sigma) in enumerate(zip(estimate.names, estimate.sigmas, strict=True))
        if sigma > 0.0 and not (tensor and name in ("A", "C"))
    ]
    rounded = np.round(np.where(np.abs(matrix) < CORRELATED, 0.0, matrix), DIGITS)[
        np.ix_(uncertain, uncertain)
    ]
    apart = rounded - np.diag(np.diag(rounded))
    possible = np.eye(len(uncertain))
    for shrunk in (0.0, *(10.0**power for power in range(-DIGITS, 0))):
        # What is rounded may be impossible by a hair: then all correlations are taken a hair
        # smaller.
        possible = np.eye(len(uncertain)) + np.round(apart * (1.0 - shrunk), DIGITS)
        if np.linalg.eigvalsh(possible)[0] > 0.5 * 10.0**-DIGITS:
            break
    names = [estimate.names[index] for index in uncertain]
    pairs = [
        (names[i], names[j], float(possible[i, j]))
        for i in range(len(names))
        for j in range(i + 1, len(names))
    ]
    others = () if dispersions is None else dispersions.correlation
    of_others = [
        pair for pair in others if pair[0] not in estimate.names and pair[1] not in estimate.names
    ]
    return (*(pair for pair in pairs if pair[2] != 0.0), *of_others)


def _told(fitted: Fit, function: Callable[[Values], Vector]) -> tuple[Vector, Matrix]:
    """Values (k,) that a function makes of body and motion, and their covariance (k, k), by central
    differences.
    """
    columns: list[Vector] = []
    for parameter in fitted.model.parameters:
        if parameter.kind.of_sensor:
            columns.append(np.zeros_like(columns[0]))  # the motion comes first of the parameters
            continue
        name, size = parameter.name, parameter.step
        above, below = (
            function(fitted.named | {name: fitted.named[name] + way}) for way in (size, -size)
        )
        columns.append((above - below) / (2.0 * size))
    slopes = np.column_stack(columns)
    return function(fitted.named), np.asarray(slopes @ fitted.covariance @ slopes.T)


MOTION = ("spin", "nutation", "omega", "phase")  # estimates that differ with the time


def estimates(fitted: Fit, time: float) -> tuple[Estimate, ...]:
    """All that is estimated: the motion at ``time`` s, the body, and the sensors and thrusters."""
    model, spacecraft = fitted.model, fitted.model.spacecraft
    of_file, dispersions = spacecraft.inertia, spacecraft.dispersions or EXACT
    first, begun = model.at(fitted.named, time)
    x0, y0, _ = first.inertia.axes @ begun.rates  # in the axes of the file
    phase0 = math.atan2(y0, x0)

    def shown(values: Values) -> Vector:
        body, state = model.at(values, time)
        x, y, _ = body.inertia.axes @ state.rates
        turned = math.remainder(math.atan2(y, x) - phase0, 2.0 * math.pi)
        sense = math.copysign(1.0, body.inertia.axial(state.spin))
        # |ω| by its part along ω as estimated: at no nutation |ω| has no derivative.
        along = x * math.cos(phase0) + y * math.sin(phase0)
        across = y * math.cos(phase0) - x * math.sin(phase0)
        nutation = math.copysign(body.inertia.cones(state.rates, sense).nutation, along)
        A, C = in_moments(spacecraft, values)
        # A small nutation turns so: told much better than C/A and ω3 where the file has the spin.
        rate = body.inertia.nutation_rate(model.body(values).state.spin)
        motion = [state.spin, nutation, along, phase0 + turned]
        return np.array([*motion, C / A, 1.0 - C / A, A, C, rate, across])

    omega = complex(*spacecraft.rates[:2])
    # Carried to another time the phase is not comparable with that of the file.
    phase = math.atan2(omega.imag, omega.real) if time == 0.0 else None
    largest = "" if first.inertia.symmetric else "largest "
    spin_prior = _sigma_of(dispersions.omega0[2], spacecraft.spin)
    of_A = _sigma_of(dispersions.A or dispersions.inertia_tensor, of_file.A)
    of_C = _sigma_of(dispersions.C or dispersions.inertia_tensor, of_file.C)
    ratio, rate = of_file.C / of_file.A, of_file.nutation_rate(spacecraft.spin)
    both = ratio * math.hypot((of_A or 0.0) / of_file.A, (of_C or 0.0) / of_file.C) or None
    rows = (
        ("spin", "spin ω3", "deg/s", spacecraft.spin, spin_prior),
        ("nutation", f"{largest}nutation", "deg", spacecraft.nutation, None),
        ("omega", "transverse rate |ω|", "deg/s", abs(omega), None),
        ("phase", "phase arg(ω1 + iω2)", "deg", phase, None),
        ("C/A", "C/A", "", ratio, both),
        ("a", "a = 1 - C/A", "", 1.0 - ratio, both),
        ("A", "A", "kg m²", of_file.A, of_A),
        ("C", "C", "kg m²", of_file.C, of_C),
        ("rate", "nutation rate in the body", "deg/s", rate, None),
    )
    values, covariance = _told(fitted, shown)
    sigmas = np.sqrt(np.diag(covariance))
    if fitted.steady:
        # Neither part of ω is seen, and |ω| is off by both: their mean squares add.
        sigmas[1:3] *= math.hypot(1.0, sigmas[9] / sigmas[2])
    if not model.record.shows_turn:
        sigmas[3] = math.inf
    left_out = {"phase"} if fitted.steady else set()  # without nutation there is none
    if model.record.shows_spin or not model.record.shows_turn:
        left_out.add("rate")
    made = []
    for (key, label, unit, file, prior), value, sigma in zip(
        rows, values.tolist(), sigmas.tolist(), strict=False
    ):
        if key not in left_out and (sigma > 0.0 or key in MOTION):
            factor = 1.0 / DEG if unit.startswith("deg") else 1.0
            by_ratio = key in ("A", "C") and fitted.index("A") is None
            made.append(Estimate(key, label, unit, factor, value, sigma, file, prior, by_ratio))
    for parameter in sorted(model.parameters, key=lambda each: not each.kind.of_body):
        name, kind = parameter.name, parameter.kind
        prior = parameter.prior
        if kind is THRUST_FACTOR:
            prior = thrust_prior(spacecraft, parameter.which)[1]
        # An attitude without tolerance is told by the data alone.
        if not kind.label or (kind is TURN_AT_START and math.isinf(prior)):
            continue
        known = prior if math.isfinite(prior) else None
        shown_as = parameter.label, kind.shown, kind.factor
        made.append(Estimate(name, *shown_as, *_at(fitted, name), parameter.file, known))
    return tuple(made)


def _sigma_of(tolerance: Tolerance | None, nominal: float) -> float | None:
    return None if tolerance is None else prior_of(tolerance, nominal)[1]


def _at(fitted: Fit, name: str) -> tuple[float, float]:
    index = fitted.index(name)
    assert index is not None
    return float(fitted.values[index]), float(fitted.sigmas[index])


def correlated(fitted: Fit) -> tuple[tuple[str, str, float], ...]:
    """Pairs of parameters that are known together much better than apart,
    and their correlations.
    """
    scale = np.where(fitted.sigmas > 0.0, fitted.sigmas, 1.0)
    matrix = fitted.covariance / np.outer(scale, scale)
    names = [parameter.name for parameter in fitted.model.parameters]
    pairs = [(names[i], names[j], float(matrix[i, j])) for i in range(len(names)) for j in range(i)]
    return tuple(
        sorted(
            (pair for pair in pairs if abs(pair[2]) > WORTH_NAMING), key=lambda pair: -abs(pair[2])
        )
    )


# sigmas of the file by which a constant is off that is said, and that is not accepted
FAR, REFUSED = 3.0, 5.0
UNSAID = 0.1  # tolerance of C/A, of unequal moments and of thrust where the file gives none
OTHER_SPIN = 0.01  # part by which a spin is off that is said


def far_from_file(fitted: Fit, beyond: float = FAR) -> list[tuple[Estimate, float]]:
    """The constants that are farther off than ``beyond`` sigmas of the file, with their own, and by
    how many.
    """
    far = []
    for row in estimates(fitted, fitted.model.start):
        file = row.file or 0.0
        usual = row.key.startswith((RATIO, "unequal", "thrust"))
        unsaid = UNSAID * (file if row.key == RATIO else 1.0) if usual else math.inf
        off = (row.value - file) / math.hypot(row.prior or unsaid, row.sigma)
        if row.key not in (*MOTION, "a") and abs(off) > beyond:
            far.append((row, off))
    return far


def spin_off(fitted: Fit) -> tuple[float, float] | None:
    """The spin at the start of the record and that of the file, rad/s, where they differ."""
    row = estimates(fitted, fitted.model.start)[0]
    file = fitted.model.spacecraft.spin
    noticed = min(FAR * row.prior if row.prior else math.inf, OTHER_SPIN * abs(file) or math.inf)
    return (row.value, file) if abs(row.value - file) > max(noticed, FAR * row.sigma) else None


def refused(fitted: Fit) -> bool:
    """True where an estimate is not accepted: constants much too far from the file, H turned, wrong
    columns, or a search that ended early with a value far from the file or coloured residuals.
    """
    # A bias belongs to the sensor, and what the file says of it is usual, not of this one.
    far = any(not row.key.startswith("bias") for row, _ in far_from_file(fitted, REFUSED))
    unfinished = not fitted.finished and bool(_coloured(fitted) or far_from_file(fitted))
    model = fitted.model
    # Of a mirrored record the mirrored motion is as likely, with H the other way.
    turned = model.body(fitted.named).sense != model.spacecraft.sense
    return far or turned or unfinished or bool(fitted.causes)


TURNED = {AXIS[1]: "axis_y, or of the right ascension,", AXIS[2]: "axis_z, or of the declination,",
          SEEN[1]: "the azimuth of crossing", SEEN[2]: "the elevation of crossing"}  # fmt: skip
UNITS = (
    (180.0 / math.pi, "57.3, rad for deg"),
    (30.0 / math.pi, "9.55, rad/s for rpm"),
    (6.0, "6, rpm for deg/s"),
)
FASTER = 5.0  # times the file's transverse rate from which on units are doubted
SAME = 1.3  # times it up to which a motion is the file's
ALIKE = 2.0  # times the distance of the nearest motion from the file up to which others count too
# part of C/A and of the spin by which the start of a fit may be off the file to be followed
NEAR = 0.35


def compared(spacecraft: Spacecraft, record: Record) -> Fit:
    """The `fit` of a record; where it is far from the file, with what done to its columns would
    bring it back.

    Raises as `fit` does, with that in its words.
    """
    model = Model(spacecraft, record)
    expect_enough(model)
    expect_alive(model)  # nothing done to the columns makes up for a sensor that is dead
    try:
        fitted = fit(spacecraft, record)
    except Infeasible as error:
        if causes := _causes(spacecraft, record):
            raise Infeasible(f"{error}; {' or '.join(causes)} would explain the record") from None
        raise
    if _near(fitted, FASTER):
        return fitted
    # A nutation that is many times that of the file may be true: only a unit that leads to the
    # file's explains it.
    return replace(
        fitted, causes=_causes(spacecraft, record, SAME if _near(fitted, math.inf) else FASTER)
    )


def _near(fitted: Fit, times: float) -> bool:
    """True where constants and spin are those of the file, and the transverse rate at ``times`` so
    many times.
    """
    size = math.hypot(fitted.named["omega_1"], fitted.named["omega_2"])
    slow = size < times * float(np.linalg.norm(fitted.model.reference.rates[:2])) or math.isinf(
        times
    )
    return slow and not far_from_file(fitted) and spin_off(fitted) is None


def _causes(spacecraft: Spacecraft, record: Record, times: float = FASTER) -> tuple[str, ...]:
    """Mistakes by which a motion and a body near to the file explain a record,
    the nearest first.
    """
    explained = []
    of_file = {RATIO: spacecraft.inertia.C / spacecraft.inertia.A, "omega_3": spacecraft.spin}
    with work.budget("causes", 0.5 * work.FIT):
        for words, changes in _mistakes():
            if not record.has(*changes) or work.exhausted():
                continue
            changed = {
                name: factor * record.signals[source] for name, (source, factor) in changes.items()
            }
            mended = replace(record, signals={**record.signals, **changed})
            try:
                begin = next(initial_guess.starts(Model(spacecraft, mended)))
                near = all(
                    abs(begin.get(name, file) - file) <= NEAR * abs(file)
                    for name, file in of_file.items()
                )
                fitted = fit(spacecraft, mended) if near else None
            except (Infeasible, np.linalg.LinAlgError):
                continue
            if (
                fitted is not None
                and fitted.finished
                and _near(fitted, times)
                and _shows(fitted, changes)
            ):
                off = fitted.model.reference.rates[:2] - [
                    fitted.named["omega_1"],
                    fitted.named["omega_2"],
                ]
                explained.append((float(np.linalg.norm(off)), words))
    return tuple(words for off, words in sorted(explained) if off < ALIKE * min(explained)[0])


def _shows(fitted: Fit, names: Iterable[str]) -> bool:
    """True where motion explains the signals of these names, and not noise."""
    model = fitted.model
    loud = [each for each in (*GYROS[:2], ACCELERATION) if each in names]
    rows = ((model.signals.index(each), model.record.signals[each]) for each in loud)
    return all(fitted.noise[at] < 0.5 * np.nanstd(samples) for at, samples in rows)


def _mistakes() -> Iterator[tuple[str, Mapping[str, tuple[str, float]]]]:
    """Mistakes that columns commonly have, in words, and their cures: signals by others, times a
    factor.
    """
    for first, second in (*combinations(GYROS, 2), *combinations(AXIS, 2)):
        yield f"{first} and {second} swapped", {first: (second, 1.0), second: (first, 1.0)}
    for name in (*GYROS, ACCELERATION, *AXIS, *SEEN[1:]):
        yield f"the sign of {TURNED.get(name, name)} turned", {name: (name, -1.0)}
    for names in (GYROS, GYROS[:2], *((name,) for name in (*GYROS, ACCELERATION))):
        for factor, words in UNITS:
            which = ", ".join(names)
            yield f"{which} too large ({words})", {name: (name, 1.0 / factor) for name in names}
            yield f"{which} too small ({words})", {name: (name, factor) for name in names}


LATE = 0.1  # delay of a channel up to which it is that of a valve, s


def doubts(fitted: Fit) -> Iterator[Note]:
    """Notes on a fit: what it rests on besides the data, and where record, schedule and file
    disagree.
    """
    model = fitted.model
    if not fitted.finished:
        yield note("fit-cut")
    if abs(model.record.start) > MONTH:
        yield note("record-far", apart_lasting_s=abs(model.record.start))
    if far := far_from_file(fitted):
        pairs = (
            (row, row.factor * row.value, row.factor * (row.file or 0.0), off) for row, off in far
        )
        texts = (
            f"{row.label} {value:.6g} for {f'{file:.6g} {row.unit}'.strip()} ({off:+.1f})"
            for row, value, file, off in pairs
        )
        yield note("fit-far", estimates=", ".join(texts))
    if (spins := spin_off(fitted)) is not None:
        yield note("fit-spin", spin_rpm=RPM * spins[0], file_rpm=RPM * spins[1])
    if fitted.causes:
        yield note("fit-cause", causes=" or ".join(fitted.causes))
    if refused(fitted):
        yield note("fit-refused")
    if fitted.constant:
        yield note("signal-constant", signals=", ".join(fitted.constant))
    elif fitted.steady:
        yield note("nutation-not-seen")
    if fitted.coarse:
        yield note("fit-coarse", signals=", ".join(fitted.coarse))
    if initial_guess.too_slow(model, fitted.values):
        yield note("fit-sampled-below", every_s=initial_guess.interval(model))
    if model.unequal and model.spacecraft.inertia.symmetric:
        apart = 200.0 * math.hypot(fitted.named["unequal_1"], fitted.named["unequal_2"])
        yield note("fit-unequal-moments", apart_percent=apart)
    if not model.record.shows_turn:
        yield note("fit-phase-of-file", signals=", ".join(model.signals))
    record = model.record
    if coloured := _coloured(fitted):
        signals = ", ".join(model.signals[index] for index in coloured)
        if (time := step(fitted, coloured, small=True)) is None:
            yield note("fit-not-white", signals=signals)
        else:
            yield note(
                "fit-steps-beside-schedule" if record.fired else "fit-steps",
                signals=signals,
                at_s=time,
            )
    outside = len(record.schedule) - len(record.fired)
    if outside:
        span = {"start_s": record.start, "end_s": record.end}
        yield note("fit-pulses-outside", outside=outside, pulses=len(record.schedule), **span)


def _coloured(fitted: Fit) -> list[int]:
    """Numbers of the signals with residuals that are not white."""
    return [
        index
        for index in range(len(fitted.model.signals))
        if fitted.resolved[index] and not fitted.white(index)
    ]


@dataclass(frozen=True, eq=False, repr=False)
class Fitted(results.Data, results.Drawn):
    """Spacecraft estimated from telemetry; ``core`` holds parameters, covariance, noise and
    residuals.

    ``warnings`` are those of reading the record.
    """

    core: Fit
    warnings: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"<Fitted {self.core.model.spacecraft.name}: {len(self.core.named)} parameters>"

    def estimates(self, at: float = 0.0) -> tuple[Estimate, ...]:
        """Estimates with their sigmas; the motion is that at ``at`` s."""
        return estimates(self.core, at)

    def text(self, at: float = 0.0) -> str:
        """Spacecraft file with the estimates in it and t = 0 at ``at`` s, as ``fit -o`` writes it.

        Raises BadRequest for a spacecraft that was not read from a file.
        """
        return str(results.view(self.core, "text", carried(self.core, at)))

    def spacecraft(self, at: float = 0.0) -> Spacecraft:
        """Spacecraft of that file."""
        spacecraft: Spacecraft = results.view(self, "spacecraft", self.text(at))
        return spacecraft

    def write(self, path: str | PathLike[str], at: float = 0.0) -> None:
        """Write `text` to a file, as ``fit -o`` does; raises BadRequest or CannotWrite."""
        results.view(self, "write", path, self.text(at))

    def to_dict(self, at: float = 0.0) -> dict[str, Any]:
        """Contents of the file of ``fit --json``."""
        return finite(results.view(self, "data", carried(self.core, at)))
