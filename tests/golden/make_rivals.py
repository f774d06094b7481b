"""Makes rivals.json: what the independent search of tests/rivals.py finds for 300 layouts of strong thrusters.

    python tests/golden/make_rivals.py

Nothing of nutdamp's planning takes part. Takes some ten minutes of processor time.
"""

from __future__ import annotations

import json
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[1]))

from support import rivals

FILE = Path(__file__).with_name("rivals.json")

LAYOUTS = 300

STARTS = 30
"""Random starts for each layout."""


def row(seed: int) -> dict[str, Any]:
    """The cheapest schedule found for one layout: cost in kg (null: none), pulses as channel, start, on-time."""
    found = rivals.cheapest(*rivals.strong_layout(seed), starts=STARTS, seed=seed)
    if found is None:
        return {"seed": seed, "cost_kg": None}
    return {"seed": seed, "cost_kg": found.cost, "pulses": [pulse for pulse in found.pulses if pulse[2] > 0.0]}


def main() -> None:
    """Search and write."""
    with ProcessPoolExecutor() as pool:
        rows = list(pool.map(row, range(LAYOUTS)))
    text = ",\n".join(json.dumps(one) for one in rows)
    FILE.write_text(f"[\n{text}\n]\n", encoding="utf-8")


if __name__ == "__main__":
    main()
