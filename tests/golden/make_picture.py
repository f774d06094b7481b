"""Makes two-pulse.png, the picture in the README: the built-in example with its scheme two-pulse.

python tests/golden/make_picture.py
"""

import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

if __name__ == "__main__":
    drawing = ("--plot", str(Path(__file__).with_name("two-pulse.png")), "--figure", "motion")
    with TemporaryDirectory() as empty:  # where no spacecraft.yaml is found
        subprocess.run(
            [
                sys.executable,
                "-m",
                "nutdamp",
                "simulate",
                "--scheme",
                "two-pulse",
                "--flown",
                *drawing,
            ],
            cwd=empty,
            check=True,
        )
