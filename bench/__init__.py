"""Every performance figure of Plateau, reproducible: `make bench-NAME` runs ``bench/NAME.py``."""

from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parents[1]
