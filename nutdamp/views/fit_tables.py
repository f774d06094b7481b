"""The screen of ``fit``: estimates, their accuracy, and limits of the telemetry."""

from __future__ import annotations

import math
from collections.abc import Iterator

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from nutdamp.estimation.fit import Fit
from nutdamp.estimation.forecast import Outlook
from nutdamp.estimation.parameters import untold
from nutdamp.estimation.results import SHARED, TOLD, Estimate, correlated, doubts, estimates
from nutdamp.views.layout import columns, facts
from nutdamp.views.text import MISSING, degrees, mass, sentence
from nutdamp.views.verdicts import exact_percent, percent

SHOWN = {
    "axis": ("deg", 180.0 / math.pi),
    "acceleration": ("m/s²", 1.0),
    "sun_pulse": ("ms", 1e3),
}
"""Units of signals for people, and their factors; of all others deg/s."""

FAR = 4.0
"""Sigmas of the file from which on a change is remarked upon."""

NOTHING = 1e-3
"""Sigmas below which a value, or a change, is zero."""

MOST_PAIRS = 6
"""Largest number of correlations named."""

SOURCES = {TOLD: "data", SHARED: "both", "file": "file"}


def fit_screen(fit: Fit, time: float, ahead: Outlook | None = None) -> RenderableType:
    """All tables of ``fit``; the motion is that at ``time`` s, ``ahead`` the forecast with more telemetry."""
    rows = estimates(fit, time)
    parts: list[RenderableType] = [Text(fit.model.spacecraft.name, style="bold"), Text(), _record(fit), Text()]
    parts += [Text(f"Estimates; the motion is that at t = {time:g} s", style="bold"), _table(rows), Text()]
    parts += [Text(sentence(line)) for line in told(fit, rows)]
    if ahead is not None:
        parts += [Text(), _prospects(ahead), Text(), *(Text(sentence(line)) for line in advice(ahead))]
    return Group(*parts)


def _prospects(ahead: Outlook) -> Table:
    """A row for each coast and probe pulse of the forecast."""
    nutation = f"nutation\n{exact_percent(ahead.probability)}, deg"
    table = columns("coast\ns", "probe pulse\n", "sigma\nof C/A", "sigma of\nthrust", nutation, "comply\n%")
    for prospect in (*ahead.coasts, *ahead.probes):
        probe = f"{prospect.probe}, {prospect.on_time:.3g} s" if prospect.probe else MISSING
        thrust = f"{100.0 * prospect.thrust:.2g} %" if prospect.probe else MISSING
        met = MISSING if prospect.met is None else f"{100.0 * prospect.met:.4g}"
        length = f"{prospect.length:.4g}" + " (now)" * (prospect is ahead.now)
        table.add_row(length, probe, f"{prospect.ratio:.2g}", thrust, f"{math.degrees(prospect.nutation):.3g}", met)
    return table


def advice(ahead: Outlook) -> Iterator[str]:
    """Clauses on the value of more telemetry."""
    now, longer, probe = ahead.now, ahead.longer, ahead.probe
    level = exact_percent(ahead.probability)
    today = f"the {ahead.scheme} plan from this estimate leaves at most {degrees(now.nutation)} in {level} of cases"
    if ahead.enough:
        met = percent(now.met or 0.0, ahead.probability)
        yield f"{today}; {met} of cases comply ({level} required): neither a longer coast nor a probe pulse is needed"
        return
    if longer is None:
        last = ahead.coasts[-1]
        yield f"{today}; a coast of {last.length:.4g} s would leave {degrees(last.nutation)}: it does not pay"
    else:
        yield f"{today}; a coast of {longer.length:.4g} s would leave {degrees(longer.nutation)}: it pays"
    if probe is not None:
        pulse = f"one probe pulse of {probe.probe}, {probe.on_time:.3g} s, amid a coast of {probe.length:.4g} s"
        yield f"{pulse} would leave {degrees(probe.nutation)}: it pays; fit it with --schedule"
        if probe.propellant is not None and ahead.propellant is not None:
            spent = f"{mass(probe.propellant)} of propellant, besides the {mass(ahead.propellant)} of the plan"
            yield f"the probe pulse takes {spent}"
    elif ahead.probes:
        yield "no single probe pulse of a channel of the plan pays"


def in_shown(signal: str) -> tuple[str, float]:
    """Unit in which a signal is shown, and its factor from SI."""
    return SHOWN.get(signal, ("deg/s", 180.0 / math.pi))


def _record(fit: Fit) -> Table:
    model = fit.model
    record, table = model.record, facts()
    period = 2.0 * math.pi / abs(_rate(fit)) if _rate(fit) else math.inf
    turns = f", {record.length / period:.3g} nutation periods" if math.isfinite(period) else ""
    table.add_row("record", f"{record.start:g} s to {record.end:g} s{turns}")
    if len(record.schedule):
        count = len(record.fired)
        table.add_row("schedule", f"{count} pulse{'s' * (count != 1)} fired meanwhile")
    for index, name in enumerate(model.signals):
        rows = model.signal == index
        unit, factor = in_shown(name)
        count, out = int(rows.sum()), int((rows & ~fit.used).sum())
        left = f", {out} outliers left out" if out else ""
        white = ", residuals white" if fit.white(index) else ", residuals NOT white: the sigmas are too small"
        if not fit.resolved[index]:
            white = ", the least that its digits or steps allow"
        table.add_row(name, f"{count} samples{left}; noise {fit.noise[index] * factor:.3g} {unit}{white}")
    return table


def _rate(fit: Fit) -> float:
    """Rate of the nutation in the body, rad/s, for small angles."""
    values = fit.named
    return (1.0 - values["C/A"]) * values.get("omega_3", fit.model.spacecraft.spin)


def _table(rows: tuple[Estimate, ...]) -> Table:
    table = columns("quantity", "value", "sigma", "unit", "file", "change\nsigmas", "from", text=("unit", "from"))
    for estimate in rows:
        digits = _digits(estimate)
        file = MISSING if estimate.file is None else f"{estimate.file * estimate.factor:.{max(digits - 2, 4)}g}"
        change = (
            MISSING if estimate.change is None else _changed(estimate.change) if abs(estimate.change) > NOTHING else "0"
        )
        shown = estimate.value if math.isinf(estimate.sigma) or abs(estimate.value) > NOTHING * estimate.sigma else 0.0
        value, sigma = (
            f"{shown * estimate.factor:.{digits}g}",
            f"{estimate.sigma * estimate.factor:.2g}" if math.isfinite(estimate.sigma) else MISSING,
        )
        table.add_row(estimate.label, value, sigma, estimate.unit, file, change, SOURCES[estimate.source])
    return table


def _changed(change: float) -> str:
    """A change in sigmas, to two digits or to whole ones."""
    return f"{change:+.2g}" if abs(change) < 99.5 else f"{change:+.0f}"


def _digits(estimate: Estimate) -> int:
    """Significant digits of a value that its sigma leaves, and one more."""
    if estimate.value == 0.0 or estimate.sigma <= 0.0 or math.isinf(estimate.sigma):
        return 4
    return min(max(2 + math.ceil(math.log10(max(abs(estimate.value) / estimate.sigma, 1.0))), 2), 9)


def told(fit: Fit, rows: tuple[Estimate, ...]) -> Iterator[str]:
    """Clauses on parameters that the data do not determine, or only together, and on unexpected estimates."""
    yield from doubts(fit)
    yield from untold(fit.model.record)
    kept = [estimate.label for estimate in rows if estimate.source == "file"]
    if kept:
        yield f"the data do not tell {', '.join(kept)}: kept as the file has it"
    tied = [f"{first} and {second} {value:+.4f}" for first, second, value in _moments(fit)]
    tied += [f"{first} and {second} {value:+.3f}" for first, second, value in correlated(fit)[:MOST_PAIRS]]
    if tied:
        yield f"correlated: {', '.join(tied)}"
    changes = [(row.label, row.change) for row in rows if row.change is not None]
    far = [f"{label} ({_changed(change)})" for label, change in changes if abs(change) > FAR]
    if far:
        yield f"farther from the file than its tolerances allow, in their sigmas: {', '.join(far)}"
    if fit.model.unequal and fit.model.spacecraft.inertia.symmetric:
        yield "I1 and I2 differ: the file has one A for both"


def _moments(fit: Fit) -> Iterator[tuple[str, str, float]]:
    """The correlation of A and C, where both are estimated."""
    from nutdamp.estimation.results import carried

    known = carried(fit, fit.model.start)
    if known.sigmas[0] > 0.0:
        yield "A", "C", float(known.correlation[0, 1])
