"""Rows for people on a terminal, and for grep and cut elsewhere."""

import sys
from collections.abc import Sequence

from rich.console import Console
from rich.table import Table
from rich.text import Text

from farm.log import printable


def print_rows(columns: Sequence[str], rows: Sequence[Sequence[str]], *, none: str) -> None:
    """Print a table on a terminal, and lines with tabs in a pipe; `none` where there are no rows.

    In a pipe there is no line of headings, and where there is nothing, no line at all: `none` goes
    to standard error.
    """
    rows = [[printable(cell).replace("\t", " ").replace("\n", " ") for cell in row] for row in rows]
    console = Console()
    if not rows:
        print(none, file=sys.stderr)
    elif console.is_terminal:
        table = Table(box=None, padding=(0, 2, 0, 0), header_style="bold")
        for column in columns:
            table.add_column(column, no_wrap=True)
        for row in rows:
            table.add_row(*map(Text, row))
        console.print(table)
    else:
        for row in rows:
            print("\t".join(row))
