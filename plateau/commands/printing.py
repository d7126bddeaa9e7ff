"""What commands print: JSON for scripts, and lines or tables for people."""

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from pydantic import BaseModel

_Model = TypeVar("_Model", bound="BaseModel")


def print_one(found: "BaseModel", words: str, *, as_json: bool) -> None:
    """Print a model as JSON, or what the words say of it."""
    print(found.model_dump_json(indent=2) if as_json else words)


def print_json(found: "Iterable[BaseModel | dict[str, Any]] | dict[str, Any]") -> None:
    """Print a document, or a list of documents or models."""
    import json

    shown = found
    if not isinstance(found, dict):
        shown = [one if isinstance(one, dict) else one.model_dump(mode="json") for one in found]
    print(json.dumps(shown, indent=2))


def print_table(
    found: Sequence[_Model],
    columns: Sequence[str],
    row: Callable[[_Model], Sequence[str]],
    *,
    none: str,
    spare: Sequence[str] = (),
    as_json: bool = False,
) -> None:
    """Print models as JSON, or each as a row; see `plateau.terminal.tables.print_rows`."""
    if as_json:
        print_json(found)
    else:
        from plateau.terminal.tables import print_rows

        print_rows(columns, list(map(row, found)), none=none, spare=spare)
