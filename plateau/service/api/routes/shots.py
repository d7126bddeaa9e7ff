"""Routes of shots: batches whose frames are judged as a video."""

import hashlib
import itertools
import math
from collections.abc import Iterator
from contextlib import suppress
from typing import Any, Final

from fastapi import APIRouter, Response
from fastapi.responses import StreamingResponse

from plateau.farm.blobs import names as blobs
from plateau.farm.ledger.shots import ShotRecord, by_frame
from plateau.farm.wire.shot_views import ShotView, shot_view
from plateau.service.api.http.etags import (
    NOT_MODIFIED,
    REVALIDATE,
    IfNoneMatch,
    not_modified,
    strong,
)
from plateau.service.api.http.parameters import BatchName
from plateau.service.api.http.served_blobs import PNG, blob_response, file_of
from plateau.service.api.parts import Farm, Parts
from plateau.service.api.problems import catalogue as problems
from plateau.service.api.problems.catalogue import documented
from plateau.service.api.problems.problem import Problem
from plateau.service.api.stored_files import SpoiledBlob

router = APIRouter(prefix="/v1/batches/{name}/shot", tags=["batches"])

#: The most pixels of the longer side of a film's frames, and of all of them together.
_LONGEST: Final = 512
_MOST_PIXELS: Final = 64_000_000

_PROBLEMS: Final = (problems.UNKNOWN_BATCH, problems.NO_SHOT)
_PICTURE: Final[dict[int | str, dict[str, Any]]] = {
    **file_of(PNG, "ETag", "Cache-Control"),
    **NOT_MODIFIED,
    **documented(*_PROBLEMS, problems.NO_IMAGE_YET, problems.SPOILED_FILE),
}


@router.get("", responses=documented(*_PROBLEMS))
def get_shot(name: BatchName, farm: Farm) -> ShotView:
    """Show the newest shot of a batch: its frames, and how it was judged as a video.

    A frame waits once its own rule is satisfied. When all frames wait, the shot is judged, by the
    noise that is seen in motion. Frames that are seen at moments which are not good enough then
    have more samples, until no moment is below the target, or all of these have reached their cap.
    """
    record = _shot(name, farm)
    shot = by_frame(record, farm.batches.shots.looks(record.id))
    if shot is None:
        raise Problem(problems.NO_SHOT, batch=name)
    return shot_view(name, shot)


@router.get("/flicker.png", response_class=StreamingResponse, responses=_PICTURE)
def get_flicker_png(name: BatchName, farm: Farm, has: IfNoneMatch) -> Response:
    """Show where the last judgement has seen noise in motion, from dark blue to yellow.

    It is the mean over all frames; yellow is where it is seen most.
    """
    while True:
        record = _shot(name, farm)
        last = record.last
        if last is None or last.flicker_sha256 is None:
            raise Problem(problems.SHOT_NOT_JUDGED, batch=name)
        sha256, blob = last.flicker_sha256, blobs.flicker_map(record.id, record.looks - 1)
        headers = {"ETag": strong(sha256), "Cache-Control": REVALIDATE}
        try:
            return blob_response(blob, sha256, PNG, headers, farm, has)
        except FileNotFoundError as error:
            if _shot(name, farm).looks == record.looks:  # and no newer look has replaced it
                raise SpoiledBlob(blob) from error


@router.get("/film.png", response_class=Response, responses=_PICTURE)
def get_film_png(name: BatchName, farm: Farm, has: IfNoneMatch) -> Response:
    """Play the newest image of each frame as an animated PNG of at most 512 pixels a side.

    The frame before stands in for one without an image, and the first image for those before it.
    """
    # Imported at the first use: Pillow and numpy take a part of the API's start.
    from plateau.farm.images.png import encode_film

    record = _shot(name, farm)
    assert record.spec is not None
    assert record.spec.shot is not None
    shown = [farm.jobs.results(frame.job_id) for frame in record.frames]
    tag = strong(hashlib.sha256("\n".join(shown).encode()).hexdigest())
    headers = {"ETag": tag, "Cache-Control": REVALIDATE}
    if has.has(tag):
        return not_modified(headers)
    pictures = _pictures(shown, farm)
    first = next(pictures, None)
    if first is None:
        raise Problem(problems.NO_FRAME_YET, batch=name)
    longest = min(_LONGEST, math.isqrt(_MOST_PIXELS // len(shown)))
    film = encode_film(itertools.chain((first,), pictures), record.spec.shot.fps, longest)
    return Response(film, media_type=PNG, headers=headers)


def _pictures(shown: list[str], farm: Parts) -> Iterator[bytes]:
    """The pictures of these sets of results; the last one again for a set that is not there."""
    picture, waiting = b"", 0
    for results in shown:
        blob = f"{results}/image.png"
        waiting += 1
        with suppress(FileNotFoundError):  # a newer set has just replaced it
            picture = farm.files.content(blob, farm.jobs.sha256(blob)) if results else picture
        if picture:
            yield from itertools.repeat(picture, waiting)
            waiting = 0


def _shot(name: str, farm: Parts) -> ShotRecord:
    record = farm.batches.shot(name)
    if record is None or record.spec is None:
        raise Problem(problems.NO_SHOT, batch=name)
    return record
