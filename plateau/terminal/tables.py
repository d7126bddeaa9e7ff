"""Tables for people on a terminal, and lines for grep and cut elsewhere."""

import sys
from collections.abc import Sequence
from typing import Final

from rich.cells import cell_len, set_cell_size
from rich.console import Console
from rich.text import Text

from plateau.farm.process.letters import on_one_line

_GAP: Final = 2  #: between two columns
#: The last column is not cut below this width; the terminal wraps lines that are still too long.
_LEAST: Final = 8


def print_rows(
    columns: Sequence[str], rows: Sequence[Sequence[str]], *, none: str, spare: Sequence[str] = ()
) -> None:
    """Print a table on a terminal, and lines with tabs and without headings in a pipe.

    Parameters
    ----------
    columns
        The headings. Only the last column is cut, since a cut id is useless.
    none
        Printed on standard error if there are no rows.
    spare
        Columns that a narrow terminal does not show; the first is left out first.
    """
    rows = [list(map(on_one_line, row)) for row in rows]
    console = Console()
    if not rows:
        print(none, file=sys.stderr)
    elif console.is_terminal:
        _print_table(console, columns, rows, spare)
    else:
        for row in rows:
            print("\t".join(row))


def _print_table(
    console: Console, columns: Sequence[str], rows: Sequence[Sequence[str]], spare: Sequence[str]
) -> None:
    table = [columns, *rows]
    widths = [max(map(cell_len, cells)) for cells in zip(*table, strict=True)]
    shown = list(range(len(columns)))
    for name in spare:
        if _width(widths, shown) <= console.width:
            break
        shown.remove(columns.index(name))
    over = _width(widths, shown) - console.width
    if over > 0:
        widths[shown[-1]] = max(min(_LEAST, widths[shown[-1]]), widths[shown[-1]] - over)
    for number, row in enumerate(table):
        cells = (_fitted(row[index], widths[index]) for index in shown)
        line = Text((" " * _GAP).join(cells).rstrip(), style="" if number else "bold")
        console.print(line, soft_wrap=True)


def _width(widths: Sequence[int], shown: Sequence[int]) -> int:
    return sum(widths[index] for index in shown) + _GAP * (len(shown) - 1)


def _fitted(cell: str, width: int) -> str:
    """The cell, cut or padded to this width."""
    if cell_len(cell) > width:
        return f"{set_cell_size(cell, width - 1)}…"
    return set_cell_size(cell, width)
