"""The command line: what each command takes and says; what it does is in `plateau.commands`.

No module of weight is imported here, so that --help and a mistyped option answer at once.
"""

from plateau.cli import serving, jobs, images  # isort: skip  # in the order in which help lists them
from plateau.cli.app import app

__all__ = ["app", "images", "jobs", "main", "serving"]


def main() -> None:
    """Run the command line."""
    app(prog_name="plateau")
