"""Reading a stream of Server-Sent Events."""

from plateau.client.watching import parse_events

AT = '"at": "2026-01-01T00:00:00Z"'


def test_events_are_read_and_comments_skipped() -> None:
    stream = [
        "retry: 1000",
        "",
        ": still here",
        "",
        "id: 1-0",
        "event: state",
        f'data: {{{AT}, "to": "queued"}}',
        "",
        "id: 2-0",
        "event: finished",
        f"data:{{{AT}}}",  # the space may be missing
        "",
    ]
    first, second = parse_events(stream)
    assert (first.id, first.type, first.data["to"]) == ("1-0", "state", "queued")
    assert (second.id, second.type) == ("2-0", "finished")


def test_an_event_that_is_cut_short_is_left_out() -> None:
    whole = ["id: 1-0", "event: slice", f"data: {{{AT}}}", ""]
    assert [event.id for event in parse_events([*whole, *whole[:-1]])] == ["1-0"]
