"""Reading a stream of Server-Sent Events."""

from plateau.client.watching import parse_events


def test_an_event_that_is_cut_short_is_left_out() -> None:
    whole = ["id: 1-0", "event: slice", 'data: {"at": "2026-01-01T00:00:00Z"}', ""]
    assert [event.id for event in parse_events([*whole, *whole[:-1]])] == ["1-0"]
