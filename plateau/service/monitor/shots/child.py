"""The process that looks at a shot: its frames come on the standard input, its answer goes out.

The input is a JSON document and then the sums of the frames, as checkpoints have them, in the order
in which the eye sees them: first those that come before the first one.
"""

import json
from collections.abc import Sequence
from typing import IO, Any

import numpy as np

from plateau.farm.model.spec import JobSpec, stored_spec
from plateau.farm.process.child import read_part, serve
from plateau.metric import View
from plateau.metric.blend import BlendError
from plateau.metric.compiled import CompiledVisibleDifferences
from plateau.metric.cvvdp import ColorVideoVDP
from plateau.metric.noise_model import NoiseModel, noise_model
from plateau.metric.quality import display_of
from plateau.metric.shots import frame_weights, samples_needed, shot_quality
from plateau.picture.checkpoints import unpacked_sums
from plateau.picture.denoised import DenoisingTask, packed
from plateau.picture.denoising.child import denoised


def main() -> None:
    """Look at the shots on the standard input."""
    serve(looked)


def looked(stream: IO[bytes]) -> memoryview:
    """Return what is seen of a shot."""
    about = json.loads(read_part(stream))
    spec, spp = stored_spec(json.dumps(about["spec"])), about["spp"]
    shot = spec.shot
    assert shot is not None
    view = View(**spec.view.of_display())
    quality = shot_quality(
        ColorVideoVDP(display_of(view, about["width"])),
        shot.fps,
        _Frames(stream, spec, view, about["slices"]),
        view=view,
        heat=True,
    )
    worst = int(np.argmin(quality.low_frames))
    answer = {
        "jod": quality.jod,
        "low_jod": quality.low_jod,
        "frames": quality.frames,
        "low_frames": quality.low_frames,
        "worst_frame": int(frame_weights(shot.fps, len(spp))[worst].argmax()),
        "needed": spp,
    }
    if shot.target is not None:
        answer["needed"] = samples_needed(quality, shot.fps, shot.target, spp)
    assert quality.heat is not None
    return packed({"about": np.array(json.dumps(answer)), "heat": quality.heat})


class _Frames(Sequence["NoiseModel | BlendError"]):
    """The errors of the frames as they are delivered, each read when its turn comes."""

    def __init__(self, stream: IO[bytes], spec: JobSpec, view: View, slices: list[int]) -> None:
        self._stream, self._spec, self._slices = stream, spec, slices
        self._metric = CompiledVisibleDifferences(view)

    def __len__(self) -> int:
        return len(self._slices)

    def __getitem__(self, place: Any) -> Any:
        merge, _ = unpacked_sums(read_part(self._stream), self._slices[place], self._spec)
        if self._spec.is_denoised:
            task = DenoisingTask.of(merge, self._spec, is_point=False)
            return denoised(task).error
        halves = merge.halves()
        assert halves is not None  # a frame of one slice is not looked at
        return noise_model(self._metric, merge.image(), halves)


if __name__ == "__main__":
    main()
