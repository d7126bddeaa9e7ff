"""A merged image that is denoised: what a denoiser is asked, and what it answers."""

from __future__ import annotations

import io
import json
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from plateau.farm.images.view_transform import ViewTransform
from plateau.farm.model.aovs import AOVS, GUIDES
from plateau.metric import Half, NoiseModel, View
from plateau.metric.blend import Blend, BlendError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from plateau.farm.images.exr import Pixels
    from plateau.farm.model.spec import JobSpec
    from plateau.picture.merged_image import MergedImage


#: Arrays by name, as they go to another process or into a blob.
Arrays = dict[str, "NDArray[Any]"]


@dataclass(frozen=True, eq=False)
class DenoisingTask:
    """A merged image and two halves of its samples."""

    image: Pixels  #: (height, width, 3) float32 linear radiance, over the background
    halves: tuple[Half, Half]
    guides: tuple[Pixels, ...]  #: albedo and normal, (height, width, 3) float32 each; or none
    view: View
    others: tuple[Half, Half] | None = None  #: two other halves, by which zones are chosen
    transform: ViewTransform | None = None  #: through which the image is seen

    @classmethod
    def of(cls, merge: MergedImage, spec: JobSpec, *, is_point: bool) -> DenoisingTask:
        """Return the task for a merged image of two slices or more.

        `is_point` says whether it is a point of the curve, by zones the end of a round.
        """
        halves = merge.halves(as_seen=False)
        assert halves is not None
        return cls(
            merge.image(as_seen=False),
            halves,
            guides_in(merge.layers()) if spec.is_guided else (),
            View(**spec.view.of_display()),
            merge.other_halves(as_seen=False) if spec.by_zones and is_point else None,
            merge.transform,
        )

    def arrays(self) -> Arrays:
        """Return what `restored` takes."""
        halves = (*self.halves, *(self.others or ()))
        return {
            "image": self.image,
            "halves": np.stack([half.mean for half in halves]),
            "spp": np.array([half.spp for half in halves]),
            "guides": np.stack(self.guides) if self.guides else np.zeros(0, np.float32),
            "view": np.array(json.dumps(asdict(self.view))),
            "look": np.array("" if self.transform is None else self.transform.as_text()),
        }

    def seen(self, image: Pixels) -> Pixels:
        """Return the light that an image makes of the display."""
        transform = self.transform
        return image if transform is None else transform.seen(image, self.view.exposure_ev)

    @property
    def gain(self) -> float:
        """By what the image is brighter on the display than its radiance, its exposure aside."""
        return 1.0 if self.transform is None else self.transform.gain

    @classmethod
    def restored(cls, arrays: Arrays) -> DenoisingTask:
        """Return the task with these arrays."""
        one, other, *others = map(Half, arrays["halves"], arrays["spp"].tolist())
        return cls(
            arrays["image"],
            (one, other),
            tuple(arrays["guides"]),
            View(**json.loads(str(arrays["view"]))),
            (others[0], others[1]) if others else None,
            ViewTransform.from_text(text) if (text := str(arrays["look"])) else None,
        )


@dataclass(frozen=True, eq=False)
class Denoised:
    """A merged image, denoised."""

    blend: Blend
    error: BlendError
    denoiser: str  #: its name, version and settings
    others: BlendError | None = None  #: the error by other halves, by which zones are chosen

    def arrays(self) -> Arrays:
        """Return what `restored` takes."""
        errors = (self.error, *((self.others,) if self.others else ()))
        models = [model for error in errors for model in (error.likely, error.greatest)]
        return {
            "image": self.blend.image,
            "seen": self.blend.seen,
            "denoised": self.blend.denoised,
            "weight": self.blend.weight,
            "denoiser": np.array(self.denoiser),
            "clean": models[0].clean,  # of all: only the noise differs
            "non_finite": models[0].non_finite,
            "noises": np.stack([model.noise for model in models]),
        }

    @classmethod
    def restored(cls, arrays: Arrays) -> Denoised:
        """Return the answer with these arrays."""
        likely, greatest, *others = (
            NoiseModel(arrays["clean"], noise, arrays["non_finite"]) for noise in arrays["noises"]
        )
        return cls(
            Blend(*(arrays[name] for name in ("image", "denoised", "weight", "seen"))),
            BlendError(likely, greatest),
            str(arrays["denoiser"]),
            BlendError(*others) if others else None,
        )


def guides_in(layers: Mapping[str, Pixels]) -> tuple[Pixels, ...]:
    """Return albedo and normal of an image's channels, (height, width, 3) each; or none."""
    names = [AOVS[guide].channels for guide in GUIDES]
    if not all(name in layers for channels in names for name in channels):
        return ()
    return tuple(np.stack([layers[name] for name in channels], axis=-1) for channels in names)


def layers_of(blend: Blend, raw: Pixels, behind: Pixels) -> dict[str, Pixels]:
    """Return the channels of a blended image, with those of which it was made.

    `raw` is the merged image without what is `behind` it, (height, width, 3) each.
    """
    made = {"": blend.image - behind, "raw.": raw, "denoised.": blend.denoised - behind}
    return {
        f"{layer}{name}": colour[..., plane]
        for layer, colour in made.items()
        for plane, name in enumerate("RGB")
    } | {"denoised.weight": blend.weight}


def packed(arrays: Arrays) -> memoryview:
    """Return arrays as one ``.npz`` file."""
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, **arrays)
    return file.getbuffer()


def unpacked(content: bytes) -> Arrays:
    """Return what was `packed`."""
    with np.load(io.BytesIO(content), allow_pickle=False) as file:
        return {name: file[name] for name in file.files}
