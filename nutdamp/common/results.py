"""Public interface of results (to_dict, to_csv, figure ...), implemented per type in `nutdamp.page.results`.

A `Plan` thus writes itself as CSV although its module knows no files. The implementations are registered as soon as a
public name of `nutdamp` is used; without them these functions raise TypeError.
"""

from __future__ import annotations

from functools import singledispatch
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from nutdamp.common.numerics import finite
from nutdamp.errors import MissingPandas

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Figure
    from pandas import DataFrame


Table = NDArray[np.void]
"""Structured array: one row per pulse or sample, fields named as the columns of the CSV files."""


@singledispatch
def data(result: object) -> dict[str, Any]:
    """Contents of the JSON file."""
    raise _missing(result)


@singledispatch
def table(result: object) -> Table:
    """Rows of the CSV file."""
    raise _missing(result)


@singledispatch
def write_csv(result: object, path: str | PathLike[str]) -> None:  # noqa: ARG001
    """Write the rows as CSV."""
    raise _missing(result)


@singledispatch
def html(result: object) -> str | None:
    """Small HTML table for notebooks; None without the extra plot, so that they show a line."""
    raise _missing(result)


@singledispatch
def figure(result: object, name: str | None) -> Figure:  # noqa: ARG001
    """Figure called ``name``."""
    raise _missing(result)


@singledispatch
def sentences(result: object) -> tuple[str, ...]:
    """Notes for the reader."""
    raise _missing(result)


@singledispatch
def reason(result: object) -> str:
    """Reason for the outcome."""
    raise _missing(result)


@singledispatch
def line(result: object) -> str:
    """Summary in one line."""
    return object.__repr__(result)


def _missing(result: object) -> TypeError:
    return TypeError(f"expected what nutdamp.page.results can show, got a {type(result).__qualname__}")


class Shown:
    """Mixin of results that show themselves at a prompt and in notebooks."""

    def __repr__(self) -> str:
        return line(self)

    def _repr_html_(self) -> str | None:
        return html(self)


class Data:
    """Mixin of results that are written as JSON."""

    def to_dict(self) -> dict[str, Any]:
        """Contents of the file that ``plan --json`` writes, or the part of it that holds this result."""
        return finite(data(self))


class Tabled(Shown):
    """Mixin of results with rows."""

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write the rows as the command of this result does with ``--csv`` (a comparison: ``--table``).

        Raises CannotWrite, and Infeasible for a plan without a schedule.
        """
        write_csv(self, path)

    def figure(self, name: str | None = None) -> Figure:
        """Matplotlib figure ``overview`` (the default), ``motion``, ``sphere`` or ``history``.

        Of a comparison that of the recommended plan. Raises BadRequest for other names, MissingExtra without
        matplotlib, Infeasible where there is no schedule.
        """
        return figure(self, name)

    def to_numpy(self) -> Table:
        """Rows with the columns of `to_csv` as fields: ``flight.to_numpy()["nutation_deg"]``."""
        return table(self)

    def to_pandas(self) -> DataFrame:
        """`to_numpy` as a DataFrame; raises MissingPandas where pandas is not installed."""
        try:
            import pandas
        except ImportError:
            raise MissingPandas from None
        rows = table(self)
        return pandas.DataFrame({name: rows[name] for name in rows.dtype.names or ()})
