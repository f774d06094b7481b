"""UTC epochs, exact: leap seconds are counted, and nothing is rounded before it is written."""

from __future__ import annotations

import datetime
import math
import re
from dataclasses import dataclass
from fractions import Fraction

LEAP_DAYS = tuple(
    datetime.date(year, *((6, 30) if half == 1 else (12, 31))).toordinal()
    for year, half in (
        *(
            (1972, 1),
            (1972, 2),
            (1973, 2),
            (1974, 2),
            (1975, 2),
            (1976, 2),
            (1977, 2),
            (1978, 2),
            (1979, 2),
        ),
        *(
            (1981, 1),
            (1982, 1),
            (1983, 1),
            (1985, 1),
            (1987, 2),
            (1989, 2),
            (1990, 2),
            (1992, 1),
            (1993, 1),
        ),
        *(
            (1994, 1),
            (1995, 2),
            (1997, 1),
            (1998, 2),
            (2005, 2),
            (2008, 2),
            (2012, 1),
            (2015, 1),
            (2016, 2),
        ),
    )
)
"""Ordinals of the days with a leap second (IERS, Bulletin C); none is announced since 2016."""

FIRST_DAY = datetime.date(1972, 1, 1).toordinal()
"""Ordinal of the first day of UTC with whole leap seconds."""

DIGITS = 9  # of a second in texts: at 60 rpm a body turns by less than 1e-6 deg in a nanosecond

# s; a record that is farther from t = 0 is named: no state is carried on for a month without new
# telemetry, and a slip in a date is mostly one of a month or a year
MONTH = 30 * 86_400.0

_J2000 = Fraction(883_655_957_816, 1000)
"""Seconds from 1972-01-01T00:00:00 UTC, which was 00:00:42.184 TT, to 2000-01-01T12:00:00 TT."""

_TIME = re.compile(
    r"(?P<year>[0-9]{4})-(?:(?P<month>[0-9]{2})-(?P<day>[0-9]{2})|(?P<day_of_year>[0-9]{3}))"
    r"[T ](?P<hour>[0-9]{2}):(?P<minute>[0-9]{2})(?::(?P<second>[0-9]{2}(?:\.[0-9]+)?))?"
    r"(?:Z|(?P<sign>[+-])(?P<zone_hour>[0-9]{2}):(?P<zone_minute>[0-9]{2}))?"
)


UNIFORM = {
    "TAI": Fraction(10),
    "GPS": Fraction(-9),
    "TT": Fraction(42_184, 1000),
    "TDB": Fraction(42_184, 1000),
}
"""Time systems without leap seconds: clock, s, at 1972-01-01T00:00:00 UTC; GPS extrapolated."""


@dataclass(frozen=True, order=True, slots=True)
class Epoch:
    """Epoch as SI seconds since 1972-01-01T00:00:00 UTC."""

    elapsed: Fraction

    @classmethod
    def parse(cls, text: str, system: str = "UTC") -> Epoch:
        """Epoch of an ISO 8601 date and time, with month and day or day of the year; UTC without a
        zone.

        ``system``: UTC, or a time without leap seconds and zones, one of `UNIFORM`. Raises
        ValueError, which says what is wrong.
        """
        match = _TIME.fullmatch(text)
        if match is None:
            raise ValueError(f"{text!r} is no epoch; expected the form 2026-03-01T12:00:00.000")
        try:
            if match["day_of_year"] is None:
                day = datetime.date(
                    int(match["year"]), int(match["month"]), int(match["day"])
                ).toordinal()
            else:
                first = datetime.date(int(match["year"]), 1, 1)
                day = first.toordinal() + int(match["day_of_year"]) - 1
                if not first.toordinal() <= day <= datetime.date(first.year, 12, 31).toordinal():
                    raise ValueError("that year has no such day")
        except ValueError as reason:
            raise ValueError(f"{text!r} is no epoch: {reason}") from None
        hour, minute = int(match["hour"]), int(match["minute"])
        second = Fraction(match["second"] or "0")
        east = 60 * int(match["zone_hour"] or "0") + int(match["zone_minute"] or "0")
        minutes = 60 * hour + minute - (-east if match["sign"] == "-" else east)
        day = day + minutes // 1440
        minutes = minutes % 1440
        if system != "UTC" and (match["sign"] or text.endswith("Z")):
            raise ValueError(f"{text!r} has a zone, and {system} has none")
        within = 61 if system == "UTC" and minutes == 1439 and day in LEAP_DAYS else 60
        if hour > 23 or minute > 59 or second >= within:
            raise ValueError(
                f"{text!r} is no epoch: expected a time of day from 00:00:00 to 23:59:59.999…"
            )
        if day > datetime.date.max.toordinal():
            raise ValueError(f"{text!r} is after the year 9999 in UTC")
        elapsed = 86400 * (day - FIRST_DAY) + 60 * minutes + second
        elapsed += _leaps_before(day) if system == "UTC" else -UNIFORM[system]
        if system == "TDB":  # Kaplan 2005, USNO Circular 179, (2.6): to 10 µs
            centuries = float(elapsed - _J2000) / 86400.0 / 36525.0
            ahead = 0.001657 * math.sin(628.3076 * centuries + 6.2401)
            ahead += 0.000022 * math.sin(575.3385 * centuries + 4.2970)
            elapsed -= Fraction(round(ahead * 1e6), 1_000_000)
        if elapsed < 0:
            raise ValueError(f"{text!r} is before 1972, when the UTC second had another length")
        return cls(elapsed)

    def plus(self, seconds: float | Fraction) -> Epoch:
        """Epoch ``seconds`` SI seconds later; exact for the number as it is stored."""
        return Epoch(self.elapsed + Fraction(seconds))

    def since(self, earlier: Epoch) -> float:
        """SI seconds from the ``earlier`` epoch to this one."""
        return float(self.elapsed - earlier.elapsed)

    @property
    def days_of_j2000(self) -> float:
        """Days since J2000.0, which is 2000-01-01T12:00:00 TT."""
        return float(self.elapsed - _J2000) / 86400.0

    @property
    def text(self) -> str:
        """ISO 8601 text, `rounded` to `DIGITS`: ``2026-03-01T12:00:00.000000000``."""
        return self.rounded(DIGITS)

    def rounded(self, digits: int) -> str:
        """ISO 8601 text with ``digits`` digits of a second: ``2026-03-01T12:00:00.000``; 60 within
        a leap second.

        Rounding carries over to the next minute or day. Raises ValueError after the year 9999,
        where no such text can be written.
        """
        whole, part = divmod(round(self.elapsed * 10**digits), 10**digits)
        day = FIRST_DAY + whole // 86400
        while 86400 * (day - FIRST_DAY) + _leaps_before(day) > whole:  # the days before were longer
            day -= 1
        if day > datetime.date.max.toordinal():
            raise ValueError("the date lies after the year 9999")
        date = datetime.date.fromordinal(day).isoformat()
        second = whole - 86400 * (day - FIRST_DAY) - _leaps_before(day)
        clock = min(second // 60, 1439)
        return (
            f"{date}T{clock // 60:02d}:{clock % 60:02d}:{second - 60 * clock:02d}.{part:0{digits}d}"
        )


def _leaps_before(day: int) -> int:
    """Leap seconds inserted since 1972 before the day begins."""
    return sum(leap < day for leap in LEAP_DAYS)
