"""The command line: what each command takes and says; what it does is in `plateau.commands`.

No module of weight is imported here, so that --help and a mistyped option answer at once.
"""

from plateau.cli import serving, jobs, continuing, batches, results, webhooks, images, studies, keys  # isort: skip  # in the order in which help lists them
from plateau.cli.app import app
from plateau.cli.bash_words import completing_in_bash, with_whole_words

__all__ = [
    "app",
    "batches",
    "continuing",
    "images",
    "jobs",
    "keys",
    "main",
    "results",
    "serving",
    "studies",
    "webhooks",
]


def main() -> None:
    """Run the command line."""
    if completing_in_bash("_PLATEAU_COMPLETE"):
        with_whole_words(lambda: app(prog_name="plateau"))
    else:
        app(prog_name="plateau")
