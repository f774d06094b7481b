"""What files and screens make of results: declared here, below them all, and written in `nutdamp.page.results`.

So a `Plan` writes itself as CSV although its module knows no files. What is written there is in place as soon as a
public name of `nutdamp` is used; without it these functions raise TypeError.
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
"""A structured array: one row a pulse or a sample, fields named as the columns of the CSV files."""


@singledispatch
def data(result: object) -> dict[str, Any]:
    """What JSON files say of it."""
    raise _missing(result)


@singledispatch
def table(result: object) -> Table:
    """Its rows."""
    raise _missing(result)


@singledispatch
def write_csv(result: object, path: str | PathLike[str]) -> None:  # noqa: ARG001
    """Write its rows."""
    raise _missing(result)


@singledispatch
def html(result: object) -> str | None:
    """A small table, as notebooks show it; None without the extra plot, so that they show a line."""
    raise _missing(result)


@singledispatch
def figure(result: object, name: str | None) -> Figure:  # noqa: ARG001
    """A picture of it."""
    raise _missing(result)


@singledispatch
def sentences(result: object) -> tuple[str, ...]:
    """What a reader should know of it."""
    raise _missing(result)


@singledispatch
def reason(result: object) -> str:
    """Why it is so."""
    raise _missing(result)


@singledispatch
def line(result: object) -> str:
    """It in one line."""
    return object.__repr__(result)


def _missing(result: object) -> TypeError:
    return TypeError(f"expected what nutdamp.page.results can show, got a {type(result).__qualname__}")


class Shown:
    """A result that shows itself at a prompt and in notebooks."""

    def __repr__(self) -> str:
        return line(self)

    def _repr_html_(self) -> str | None:
        return html(self)


class Data:
    """A result that JSON files hold."""

    def to_dict(self) -> dict[str, Any]:
        """What ``plan --json`` gives, or says of it."""
        return finite(data(self))


class Tabled(Shown):
    """A result that has rows."""

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write the rows as the command of this result does with ``--csv`` (a comparison: ``--table``).

        Raises CannotWrite, and Infeasible for a plan without a schedule.
        """
        write_csv(self, path)

    def figure(self, name: str | None = None) -> Figure:
        """A matplotlib figure: of a comparison ``schemes``, else ``overview``, the default, or one of the motion.

        That is ``motion``, ``sphere``, ``history`` or ``timeline``. Raises BadRequest for other names, MissingExtra
        without matplotlib, Infeasible for a plan without a schedule.
        """
        return figure(self, name)

    def to_numpy(self) -> Table:
        """The rows with the columns of `to_csv` as fields: ``flight.to_numpy()["nutation_deg"]``."""
        return table(self)

    def to_pandas(self) -> DataFrame:
        """`to_numpy` as a DataFrame; raises MissingPandas where pandas is not installed."""
        try:
            import pandas
        except ImportError:
            raise MissingPandas from None
        rows = table(self)
        return pandas.DataFrame({name: rows[name] for name in rows.dtype.names or ()})
