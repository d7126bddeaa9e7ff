"""Time ColorVideoVDP in a process of its own, on the cores that it is given.

`python cvvdp_child.py WAY WHAT REFERENCE.npy TEST.npy`, with `ours` or `authors` as the way and
`still` or `video` as what is compared, prints the JOD; then for each line that it reads the seconds
that another comparison took, and at the end of its input its peak memory in MiB. In a video both
images move. The authors' may be another environment's Python.
"""

from __future__ import annotations

import os
import resource
import sys
import time
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

#: Frames of a video, one more than the temporal filter has, and how many are shown in a second.
FRAMES, FPS = 8, 24
#: Pixels by which it moves from one frame to the next.
_SPEED = 3


def main() -> None:
    way, what, *files = sys.argv[1:]
    reference, test = (np.load(file) for file in files)
    ways = {
        "ours": {"still": _our_still, "video": _our_video},
        "authors": {"still": _authors_still, "video": _authors_video},
    }
    compare = ways[way][what](reference, test)
    print(compare(), flush=True)
    for _ in sys.stdin:
        started = time.perf_counter()
        compare()
        print(time.perf_counter() - started, flush=True)
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024, flush=True)


def _moved(image: Any, frame: int) -> Any:
    return np.roll(image, _SPEED * frame, axis=1)


def _our_model() -> Any:
    from plateau.metric.cvvdp import DISPLAYS, ColorVideoVDP

    return ColorVideoVDP(DISPLAYS["standard_4k"], threads=len(os.sched_getaffinity(0)))


def _our_still(reference: Any, test: Any) -> Callable[[], float]:
    model = _our_model()
    return lambda: model.compare(model.percept(reference), model.percept(test)).jod


def _our_video(reference: Any, test: Any) -> Callable[[], float]:
    from plateau.metric.cvvdp import video_jod

    model = _our_model()

    def compare() -> float:
        ours, theirs = model.video(FPS), model.video(FPS)
        return video_jod(
            model.compare(
                ours.percept(_moved(reference, frame)), theirs.percept(_moved(test, frame))
            )
            for frame in range(FRAMES)
        )

    return compare


def _authors_model() -> Any:
    import pycvvdp
    import torch

    torch.set_num_threads(len(os.sched_getaffinity(0)))
    torch.set_grad_enabled(False)
    return pycvvdp.cvvdp(display_name="standard_4k", device=torch.device("cpu"), quiet=True)


def _authors_still(reference: Any, test: Any) -> Callable[[], float]:
    model = _authors_model()
    return lambda: float(model.predict(test, reference, dim_order="HWC")[0])


def _authors_video(reference: Any, test: Any) -> Callable[[], float]:
    import torch
    from pycvvdp.video_source import video_source_dm

    class Source(video_source_dm):  # type: ignore[misc]
        """The videos frame by frame, so that neither way holds them."""

        def get_video_size(self) -> tuple[int, int, int]:
            height, width, _ = reference.shape
            return height, width, FRAMES

        def get_frames_per_second(self) -> float:
            return FPS

        def get_batch_size(self) -> int:
            return 1

        def get_reference_frame(self, frame: int, device: Any, colorspace: str) -> Any:
            return self._shown(reference, frame, device, colorspace)

        def get_test_frame(self, frame: int, device: Any, colorspace: str) -> Any:
            return self._shown(test, frame, device, colorspace)

        def _shown(self, image: Any, frame: int, device: Any, colorspace: str) -> Any:
            pixels = torch.from_numpy(_moved(image, frame)).to(device).permute(2, 0, 1)
            return self.apply_dm_and_color_transform(pixels[None, :, None], colorspace)

    model = _authors_model()
    return lambda: float(model.predict_video_source(Source("standard_4k"))[0])


if __name__ == "__main__":
    main()
