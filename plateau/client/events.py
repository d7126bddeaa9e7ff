"""The events of a job, each kind with a type of its own.

>>> for event in client.events(job_id):  # doctest: +SKIP
...     match event:
...         case PointEvent():
...             print(event.point.spp, event.point.visible_pixels)
...         case StateEvent():
...             print(event.state.value, event.reason)
"""

from typing import Final

from plateau.farm.model.job import CurvePoint, Event
from plateau.farm.model.states import JobState


class StateEvent(Event):
    """The job has moved to another state."""

    @property
    def state(self) -> JobState:
        """The state that it moved to."""
        return JobState(self.data["to"])

    @property
    def reason(self) -> str:
        """Why it moved."""
        return str(self.data["reason"])


class ImageEvent(Event):
    """The job has a first image that can be fetched."""

    @property
    def spp(self) -> int:
        """Its samples per pixel."""
        return int(str(self.data["spp"]))


class PointEvent(Event):
    """The merged image was judged: the curve has another point."""

    @property
    def point(self) -> CurvePoint:
        """The new point."""
        return CurvePoint.model_validate({"at": self.at, **self.data})


class RenderedEvent(Event):
    """The job needs no more samples: only its last pictures are still to be made."""


class _OfASlice(Event):
    @property
    def index(self) -> int:
        """The slice's index."""
        return int(str(self.data["index"]))

    @property
    def worker(self) -> str:
        """The worker that rendered it."""
        return str(self.data["worker"])


class SliceEvent(_OfASlice):
    """A slice was committed."""


class TroubleEvent(_OfASlice):
    """A worker died on a slice, or the partial of a slice was lost; it is rendered again."""

    @property
    def cause(self) -> str:
        """What went wrong."""
        return str(self.data["cause"])


class FinishedEvent(Event):
    """The final images are written. This is the last event of a stream."""


_KINDS: Final[dict[str, type[Event]]] = {
    "state": StateEvent,
    "image": ImageEvent,
    "point": PointEvent,
    "rendered": RenderedEvent,
    "slice": SliceEvent,
    "trouble": TroubleEvent,
    "finished": FinishedEvent,
}


def typed(event: Event) -> Event:
    """The event as an instance of the class for its type."""
    kind = _KINDS.get(event.type, Event)
    return kind(id=event.id, type=event.type, data=event.data, at=event.at)


def is_rendered(event: Event) -> bool:
    """Whether its job needs no more samples."""
    ended = isinstance(event, StateEvent) and event.state.ended
    return ended or isinstance(event, RenderedEvent)
