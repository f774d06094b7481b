"""Makes rivals.json: what the independent search of support/rivals.py finds for 300 layouts of
strong thrusters.

    python tests/golden/make_rivals.py

Nothing of nutdamp's planning takes part. Takes some ten minutes of processor time. Each row is the
cheapest schedule found for one layout: cost in kg (null: none), pulses as channel, start, on-time.
"""

import json
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[1]))

from support import rivals


def row(seed: int) -> dict[str, Any]:
    """The row of one layout, of 30 random starts."""
    best = rivals.cheapest(*rivals.strong_layout(seed), starts=30, seed=seed)
    if best is None:
        return {"seed": seed, "cost_kg": None}
    return {
        "seed": seed,
        "cost_kg": best.cost,
        "pulses": [pulse for pulse in best.pulses if pulse[2] > 0.0],
    }


if __name__ == "__main__":
    with ProcessPoolExecutor() as pool:
        rows = ",\n".join(map(json.dumps, pool.map(row, range(300))))
    Path(__file__).with_name("rivals.json").write_text(f"[\n{rows}\n]\n", encoding="utf-8")
