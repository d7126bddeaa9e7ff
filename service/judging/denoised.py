"""A merged image that is denoised: what a denoiser is asked, and what it answers."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from plateau.farm.model.aovs import AOVS
from plateau.farm.model.denoise import GUIDES, OidnDenoising
from plateau.metric import Blend, BlendError, Half, NoiseModel, View

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from plateau.farm.images.exr import Pixels
    from plateau.farm.model.spec import JobSpec
    from plateau.service.judging.merge import Merge

#: Arrays by name, as they go to the process that denoises and come back.
Arrays = dict[str, "NDArray[Any]"]
_MODEL: Final = ("clean", "noise", "non_finite")


@dataclass(frozen=True, eq=False)
class DenoisingTask:
    """A merged image and its parts: four quarters, or else two halves, which cannot be judged."""

    image: Pixels  #: (height, width, 3) float32 linear radiance, over the background
    parts: tuple[Half, ...]
    guides: tuple[Pixels, ...]  #: albedo and normal, (height, width, 3) float32 each; or none
    view: View

    @classmethod
    def of(cls, merge: Merge, spec: JobSpec) -> DenoisingTask:
        """Return the task for a merged image of two slices or more."""
        parts = merge.quarters() or merge.halves()
        assert parts is not None
        guides: tuple[Pixels, ...] = ()
        if isinstance(spec.denoise, OidnDenoising) and spec.denoise.guides:
            layers = merge.layers()
            guides = tuple(
                np.nan_to_num(np.stack([layers[name] for name in AOVS[aov].channels], axis=-1))
                for aov in GUIDES
            )
        return cls(
            merge.image(),
            tuple(Half(*part) for part in parts),
            guides,
            View(**spec.view.of_display()),
        )

    def arrays(self) -> Arrays:
        """Return what `restored` takes."""
        return {
            "image": self.image,
            "parts": np.stack([part.mean for part in self.parts]),
            "spp": np.array([part.spp for part in self.parts]),
            "guides": np.stack(self.guides) if self.guides else np.zeros(0, np.float32),
            "view": np.array(json.dumps(asdict(self.view))),
        }

    @classmethod
    def restored(cls, arrays: Arrays) -> DenoisingTask:
        """Return the task with these arrays."""
        parts = zip(arrays["parts"], arrays["spp"].tolist(), strict=True)
        return cls(
            arrays["image"],
            tuple(Half(mean, spp) for mean, spp in parts),
            tuple(arrays["guides"]),
            View(**json.loads(str(arrays["view"]))),
        )


@dataclass(frozen=True, eq=False)
class Denoised:
    """A merged image, denoised."""

    blend: Blend
    error: BlendError | None  #: None of an image of two halves
    denoiser: str  #: its name, version and settings

    def arrays(self) -> Arrays:
        """Return what `restored` takes."""
        arrays: Arrays = {
            "image": self.blend.image,
            "denoised": self.blend.denoised,
            "weight": self.blend.weight,
            "denoiser": np.array(self.denoiser),
        }
        for name, model in {} if self.error is None else vars(self.error).items():
            arrays |= {f"{name}.{part}": getattr(model, part) for part in _MODEL}
        return arrays

    @classmethod
    def restored(cls, arrays: Arrays) -> Denoised:
        """Return the answer with these arrays."""
        models = [
            NoiseModel(*(arrays[f"{name}.{part}"] for part in _MODEL))
            for name in ("likely", "greatest")
            if f"{name}.clean" in arrays
        ]
        return cls(
            Blend(arrays["image"], arrays["denoised"], arrays["weight"]),
            BlendError(*models) if models else None,
            str(arrays["denoiser"]),
        )
