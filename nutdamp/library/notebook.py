"""Tables as notebooks show them and as pandas holds them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from nutdamp.errors import MissingPandas

if TYPE_CHECKING:
    from pandas import DataFrame

    from nutdamp.presentation.page.document import Block


def block(content: Block) -> str:
    """A block of a report page as HTML."""
    from nutdamp.presentation.page.html import block_html

    return block_html(content)


def data_frame(rows: NDArray[np.void]) -> DataFrame:
    """A structured array as a DataFrame, a column a field; raises MissingPandas."""
    try:
        import pandas
    except ImportError:
        raise MissingPandas from None
    return pandas.DataFrame({name: rows[name] for name in rows.dtype.names or ()})
