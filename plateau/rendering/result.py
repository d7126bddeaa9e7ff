"""What `plateau.render` returns: a job's image and curve, independent of its farm."""

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from plateau.client import ApiError, Client
from plateau.client.columns import columns
from plateau.errors import CommandFailed, needs
from plateau.farm.model.job import CurvePoint
from plateau.farm.model.scene_roots import at_home
from plateau.farm.model.states import JobState
from plateau.farm.wire.views import JobView, SliceView
from plateau.files.job_folder import IMAGES, whole
from plateau.files.out_folder import ready
from plateau.rendering.html import card

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

#: The file that has all of an image.
IMAGE: Final = "image.exr"
_NO_IMAGE: Final = "no-image-yet"


@dataclass(eq=False, repr=False)
class Result:
    """A job that has ended, with its image and its curve; it can be pickled.

    A notebook shows it as its image, its curve and its reason.
    """

    job: JobView  #: all that is known of the job
    points: list[CurvePoint]  #: the points of its curve, by rising spp
    files: dict[str, bytes]  #: its images as files, by their names, such as ``image.exr``

    @classmethod
    def fetched(
        cls,
        client: Client,
        job: JobView,
        names: Collection[str] = IMAGES,
        *,
        with_curve: bool = True,
    ) -> "Result":
        """The result of an ended job of a service, with those of these images that it has."""
        files = {}
        for name in names:
            try:
                files[name] = client.image(job.id, name)
            except ApiError as error:
                if error.slug != _NO_IMAGE:
                    raise
        return cls(job, client.curve(job.id) if with_curve else [], files)

    @property
    def state(self) -> JobState:
        """``converged``, ``exhausted`` or ``cancelled``."""
        return self.job.state

    @property
    def reason(self) -> str:
        """Why it ended, in words."""
        return self.job.reason

    @property
    def spp(self) -> int:
        """Samples per pixel of the image; by zones their mean, rounded down."""
        return self.job.spp

    @property
    def has_image(self) -> bool:
        """Whether anything was rendered before it ended."""
        return IMAGE in self.files

    @cached_property
    def image(self) -> "NDArray[np.float32]":
        """The image: (height, width, 3) float32, linear Rec. 709 radiance, as Mitsuba has it."""
        with needs("images"):
            from plateau.farm.images.exr import decode_image

        return decode_image(self._file(IMAGE))

    @cached_property
    def channels(self) -> "dict[str, NDArray[np.float32]]":
        """The image by channel, as `Client.channels` has it: (height, width) float32 each."""
        with needs("images"):
            from plateau.farm.images.exr import decode_layers

        return decode_layers(self._file(IMAGE))

    @property
    def curve(self) -> "dict[str, NDArray[Any]]":
        """The curve as one array for each column; ``pandas.DataFrame(result.curve)`` takes it.

        `Client.curve_columns` documents the columns.
        """
        return columns(self.points)

    def save(self, path: Path | str) -> Path:
        """Write the image or all results; returns the path.

        Parameters
        ----------
        path
            A file ``.exr`` (linear, all channels) or ``.png`` (as the job's display shows it);
            otherwise a folder for the files that ``plateau render -o`` writes.

        Raises
        ------
        CommandFailed
            There is no image, or the folder has files that are not a job's.
        OSError
            It cannot be written.
        """
        path = at_home(path)
        name = {".exr": IMAGE, ".png": "image.png"}.get(path.suffix.lower())
        if name is not None:
            content = self._file(name)
            with whole(path) as unfinished:
                unfinished.write_bytes(content)
        else:
            from plateau.rendering.outputs import write_results

            with ready(path):
                write_results(_Kept(self), self.job, path)
        return path

    def _file(self, name: str) -> bytes:
        if name not in self.files:
            raise CommandFailed(f"the job has no {name}: {self.job.outcome}, {self.reason}")
        return self.files[name]

    def __repr__(self) -> str:
        return f"<plateau.Result: {self.job.outcome} at {self.spp:,} spp: {self.reason}>"

    def _repr_html_(self) -> str:
        return card(self.job, self.points, self.files.get("image.png"))

    def _repr_png_(self) -> bytes | None:
        return self.files.get("image.png")


class _Kept:
    """The files of a result, as a client has those of its job."""

    def __init__(self, result: Result) -> None:
        self._result = result

    def curve(self, _: str) -> list[CurvePoint]:
        return self._result.points

    def slices(self, _: str) -> list[SliceView]:
        return []

    def download(self, _: str, name: str, path: Path) -> None:
        if name not in self._result.files:
            raise ApiError(404, {"type": _NO_IMAGE})
        path.write_bytes(self._result.files[name])
