"""Calls that fetch what a job has come to: its curve, its images, its slices."""

import base64
import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from plateau.client.errors import ClientError, Damaged
from plateau.client.transport import Calls, Patience
from plateau.errors import needs
from plateau.farm.model.job import CurvePoint
from plateau.farm.model.scene_roots import at_home
from plateau.farm.wire.views import Curve
from plateau.files.job_folder import whole

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

#: The whole file is on its way: between two parts of it there is little to wait for.
_READ_S: Final = 45.0
#: RFC 9530, section 3: ``sha-256=:BASE64:``, perhaps among others.
_HEADER: Final = "Repr-Digest"
_SHA256: Final = "sha-256"


class ResultCalls(Calls):
    """The curve, the images and the slices of a job, while it runs as well as afterwards.

    A call that takes a job's id raises `ApiError` ``unknown-job`` if there is none; one for an
    image also ``no-image-yet``, before anything of it can be seen.
    """

    def curve(self, job_id: str) -> list[CurvePoint]:
        """The points of the job's curve, by rising spp; none before the first evaluation."""
        return self._transport.read(Curve, f"/v1/jobs/{job_id}/curve").points

    def curve_csv(self, job_id: str) -> str:
        """The job's curve as CSV."""
        return self._transport.send("GET", f"/v1/jobs/{job_id}/curve.csv").text

    def curve_columns(self, job_id: str) -> "dict[str, NDArray[Any]]":
        """The job's curve as one array for each column of its CSV, all of the same length.

        Returns
        -------
        dict
            ``spp``, ``visible_pixels`` and ``non_finite_pixels`` are int64; ``at`` is datetime64,
            in UTC; each rule's ``NAME_stop`` is bool; all others, among them ``visible_fraction``,
            ``slope``, ``estimate_pixels``, ``expected_spp`` and each rule's ``NAME_value``, are
            float64, with NaN where nothing is known.
        """
        from plateau.client.columns import columns

        return columns(self.curve(job_id))

    def image(self, job_id: str, name: str = "image.png") -> bytes:
        """One of the job's images, such as ``image.png``, ``image.exr`` or ``noise.png``."""
        path = f"/v1/jobs/{job_id}/{name}"
        answer = self._transport.send("GET", path)
        _check(hashlib.sha256(answer.content).digest(), path, answer.headers)
        return answer.content

    def array(self, job_id: str) -> "NDArray[np.float32]":
        """The job's merged image: the newest while it runs, in the end the final one.

        Returns
        -------
        NDArray
            (height, width, 3) float32: linear Rec. 709 radiance, as Mitsuba has it.
        """
        with needs("images"):
            from plateau.farm.images.exr import decode_image

        return decode_image(self.image(job_id, "image.exr"))

    def channels(self, job_id: str) -> "dict[str, NDArray[np.float32]]":
        """The job's merged image by channel: the newest while it runs, in the end the final one.

        Returns
        -------
        dict
            (height, width) float32 by the names of image.exr: ``R``, ``G``, ``B``, then ``A`` where
            the scene has alpha, and the channels of the job's AOVs (``albedo.R``, ``Z``), and
            ``spp``, the samples of each pixel, where the job is allocated by zones. Colour is
            linear Rec. 709 radiance, premultiplied.
        """
        with needs("images"):
            from plateau.farm.images.exr import decode_layers

        return decode_layers(self.image(job_id, "image.exr"))

    def film(self, job_id: str, index: int) -> "NDArray[np.float32]":
        """The film of one slice of a job that keeps its slices, before normalisation.

        So films can be added: with ``total`` the sum of some, their image is
        ``total[..., :3] / total[..., 3:4]``.

        Returns
        -------
        NDArray
            (height, width, channels) float32: the sums of filter-weighted linear R, G and B, and of
            the filter weights; then those of alpha, where the scene has it, and of the job's AOVs.
            Ids are no sums: a pixel has that of its first sample.

            Where a job is allocated by zones, a slice of some of them has (pixels, channels): one
            zone after the other, each with its border and row by row. The attributes
            ``plateau:zones`` (x, y, width, height of each, in pixels) and ``plateau:border`` of
            ``slices/INDEX.exr`` name them, and films of several slices cannot be added as they are.

        Raises
        ------
        ApiError
            ``unknown-job``; ``unknown-slice`` where the job's spec does not say `keep_slices`, or
            the slice is not committed yet.
        """
        with needs("images"):
            from plateau.farm.images.exr import decode_partial

        return decode_partial(self.image(job_id, f"slices/{index}.exr")).pixels

    def download(self, job_id: str, name: str, path: Path) -> None:
        """Write one of the job's files (``image.exr``, ``slices/3.exr``) whole or not at all.

        Where it breaks off it is begun again, as long as the client is patient; it is patient anew
        with an attempt that has come further than those before.

        Raises
        ------
        ApiError
            ``unknown-job``, ``no-image-yet``, ``unknown-slice``, ``spoiled-file``.
        Damaged
            What came is not what the service sent.
        OSError
            The file cannot be written.
        """
        with whole(at_home(path)) as unfinished:
            self._receive(f"/v1/jobs/{job_id}/{name}", unfinished)

    def _receive(self, address: str, path: Path) -> None:
        patience, furthest = Patience(self._transport), 0
        while True:
            try:
                with (
                    self._transport.stream(address, read_s=_READ_S) as answer,
                    path.open("wb") as file,
                ):
                    sha256 = hashlib.sha256()
                    for chunk in answer.iter_bytes():
                        sha256.update(chunk)
                        file.write(chunk)
                        if file.tell() > furthest:
                            furthest = file.tell()
                            patience.renew()
                    _check(sha256.digest(), address, answer.headers)
            except ClientError as error:
                patience.wait_after(error)
            else:
                return


def _check(sha256: bytes, path: str, headers: Mapping[str, str]) -> None:
    """Raise `Damaged` where the headers name another SHA-256 than that of all that came."""
    digests = (one.strip().partition("=") for one in headers.get(_HEADER, "").split(","))
    named = next((value for name, _, value in digests if name == _SHA256), None)
    if named is not None and named != f":{base64.b64encode(sha256).decode()}:":
        raise Damaged(path)
