"""Server-Sent Events as they come over the wire."""

import json
from collections.abc import Iterable, Iterator

from plateau.farm.model.job import Event


def parse_events(lines: Iterable[str]) -> Iterator[Event]:
    """The events in the lines of a stream, by the rules of the HTML standard that Plateau uses.

    An event that is cut short, by a connection that breaks, is left out.
    """
    fields: dict[str, str] = {}
    for line in lines:
        if line:
            name, _, value = line.partition(":")  # a comment has no name
            fields[name] = value.removeprefix(" ")
            continue
        if {"id", "event", "data"} <= fields.keys():
            data = json.loads(fields["data"])
            yield Event(id=fields["id"], type=fields["event"], data=data, at=data["at"])
        fields = {}
