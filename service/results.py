"""The pictures of a job: what the merged image looks like, and where it differs from the first."""

import logging
import time
from typing import Final

import numpy as np

from farm import blobs
from farm.blobs import Blobs
from farm.errors import CorruptPartial
from farm.exr import decode_partial, encode_image
from farm.ownership import Ownership, Ownerships
from farm.png import encode_png
from farm.spec import JobSpec
from metric import MAP_PALETTE, difference_map, encode_srgb
from service.broken_image import non_finite_png
from service.judge import Judge
from service.merge import Merge
from service.previews import Previews
from service.thumbnails import thumbnail

_LOG = logging.getLogger(__name__)

_INTERVAL_S: Final = 2.0  #: at least so long between two previews


class Results:
    """The job's last set of pictures.

    A set is written under a name of its own and shown by one fenced write to Redis: who fetches
    images sees whole sets only, and a monitor that has lost the job cannot replace a newer one.
    """

    def __init__(self, owned: Ownership, owners: Ownerships, store: Blobs, spec: JobSpec) -> None:
        self._owned = owned
        self._owners = owners
        self._blobs = store
        self._spec = spec
        self._previews = Previews(store, owned.job_id)
        self._glimpsed = False
        self._shown: str | None = None
        self._shown_spp = 0
        self._shown_at = float("-inf")

    def show_glimpse(self, judge: Judge) -> None:
        """Show the first pass of the first slice, once it is there: a slice may take minutes."""
        blob = None if self._glimpsed else self._owners.glimpse(self._owned.job_id)
        if blob is None:
            return
        self._glimpsed = True
        try:
            if not blobs.is_partial(blob):
                raise CorruptPartial(f"{blob!r} is no partial's name")
            partial = decode_partial(self._blobs.get(blob))
            if not 0 < partial.spp < self._spec.slice_spp:
                raise CorruptPartial(f"a first pass of {partial.spp} spp")
        except (FileNotFoundError, CorruptPartial) as error:
            _LOG.warning("the first pass cannot be shown: %s", error)
            return
        glimpse = Merge(slice_spp=partial.spp)
        glimpse.add(partial.pixels)
        self.show(glimpse, judge)
        self._blobs.delete(blob)

    def preview(self, merge: Merge, judge: Judge) -> None:
        """Show the merged image, unless it is shown, or another was a moment ago."""
        if merge.spp == self._shown_spp or time.monotonic() < self._shown_at + _INTERVAL_S:
            return
        self.show(merge, judge)
        self._shown_at = time.monotonic()

    def show(self, merge: Merge, judge: Judge) -> None:
        """Show the merged image."""
        pictures = self._pictures(merge, judge, compressed=False)  # another comes in a moment
        written, before = self._put(merge.spp, pictures, str(self._owned.token)), self._shown
        self._owners.show_results(self._owned, written, merge.spp)
        if self._spec.evaluates_at(merge.spp):
            self._previews.keep(merge.spp, pictures["image.png"])
        self._shown, self._shown_spp = written, merge.spp
        if before not in {None, written}:
            self._blobs.delete(*self._blobs.names(f"{before}/"))

    def write(self, merge: Merge, judge: Judge) -> str:
        """Write the pictures of the merged image; returns the set's name, which nobody sees yet."""
        return self._put(
            merge.spp, self._pictures(merge, judge, compressed=True), f"{self._owned.token}-final"
        )

    def _pictures(self, merge: Merge, judge: Judge, *, compressed: bool) -> dict[str, bytes]:
        image, exposure_ev = merge.image(), self._spec.view.exposure_ev
        about: dict[str, str | int] = {"plateau:job": self._owned.job_id, "plateau:spp": merge.spp}
        picture = encode_srgb(image, exposure_ev)
        pictures = {
            "image.exr": encode_image(image, about, compressed=compressed),
            "image.png": encode_png(picture),
            "thumbnail.png": encode_png(thumbnail(image, exposure_ev)),
        }
        if not np.isfinite(image).all():
            pictures["non-finite.png"] = non_finite_png(image, exposure_ev)
        visible = judge.visible_map(merge)
        if visible is not None:
            difference = difference_map(picture, visible)
            pictures["difference.png"] = encode_png(difference, MAP_PALETTE)
        return pictures

    def _put(self, spp: int, pictures: dict[str, bytes], token: str) -> str:
        name = blobs.result_set(self._owned.job_id, spp, token)
        for picture, content in pictures.items():
            self._blobs.put(f"{name}/{picture}", content)
        return name
