"""The merged image of a job: partials added up, and what a restart needs to continue."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from plateau.farm.images.channels import BLACK, Channels, Colour
from plateau.farm.images.exr import Partial, Pixels
from plateau.farm.model.spec import SharedSpec


@dataclass(kw_only=True)
class Merge:
    """The sum of a contiguous prefix of slices, added in index order in float64.

    So the image does not depend on which workers rendered it, nor in which order they finished.

    Notes
    -----
    Two sums are kept: of all slices and of the even-indexed ones; the odd-indexed ones are the
    difference. The first is (height, width, channels) float64, of `channels`; the second has what
    is seen alone: R, G, B, W and, if any, A.
    """

    slice_spp: int
    background: Colour = BLACK  #: what is seen behind an image with alpha
    slices: int = 0  #: how many are in the sums: the prefix 0 … slices − 1
    channels: Channels = field(default_factory=Channels)
    #: What is known of how the slices were made: first_seed, last_seed, variant and renderer.
    origin: dict[str, str] = field(default_factory=dict)
    _total: NDArray[np.float64] | None = field(default=None, repr=False)
    _even: NDArray[np.float64] | None = field(default=None, repr=False)

    @classmethod
    def of(cls, spec: SharedSpec) -> "Merge":
        """The sums of nothing, for a job of this spec."""
        return cls(slice_spp=spec.slice_spp, background=spec.view.background)

    @property
    def spp(self) -> int:
        """Samples per pixel in the merged image."""
        return self.slices * self.slice_spp

    def add(self, film: Pixels, channels: Channels | None = None) -> None:
        """Add the next slice.

        Parameters
        ----------
        film
            Its film before normalisation, (height, width, channels) float32.
        channels
            Of the film; R, G, B and W where they are not given.

        Raises
        ------
        ValueError
            Its size or its channels are not those of the slices before.
        """
        channels = channels or Channels()
        if self._total is None:
            self.channels = channels
        elif film.shape[:2] != self._total.shape[:2]:
            raise ValueError(
                f"slice {self.slices} is {film.shape[1]}×{film.shape[0]} pixels, those before it "
                f"{self._total.shape[1]}×{self._total.shape[0]}"
            )
        elif channels != self.channels:
            raise ValueError(
                f"slice {self.slices} has the channels {', '.join(channels.names)}, those before "
                f"it {', '.join(self.channels.names)}: submit the scene as a new job"
            )
        self._total = channels.add(self._total, film)
        if self.slices % 2 == 0:
            seen = channels.seen()
            self._even = seen.add(self._even, film[..., : channels.judged])
        self.slices += 1

    def add_partial(self, partial: Partial) -> None:
        """Add the next slice as its worker uploaded it; raises as `add`."""
        is_known = bool(self.origin) or not self.slices  # of all slices before it
        self.add(partial.pixels, partial.channels)
        if is_known:
            before = self.origin.get("renderer", "")
            names = filter(None, (*before.split(", "), partial.renderer))
            self.origin = {
                "first_seed": self.origin.get("first_seed", str(partial.first_seed)),
                "last_seed": str(partial.last_seed),
                "variant": partial.variant,
                "renderer": ", ".join(dict.fromkeys(names)),  # workers may have several versions
            }

    def image(self) -> Pixels:
        """The merged image as it is seen: (height, width, 3) float32 linear radiance.

        Where it has alpha, it is over the background.
        """
        assert self._total is not None
        return self._seen(self._total)

    def layers(self) -> dict[str, Pixels]:
        """The merged image by channel: (height, width) float32; colour is premultiplied."""
        assert self._total is not None
        return self.channels.normalised(self._total)

    def halves(self) -> tuple[tuple[Pixels, int], tuple[Pixels, int]] | None:
        """The images of the even- and of the odd-indexed slices, each with its spp."""
        if self.slices < 2 or self._total is None or self._even is None:
            return None
        odd = self.slices // 2
        even = self.slices - odd
        with np.errstate(invalid="ignore", over="ignore"):  # a scene may have infinite pixels
            rest = self._total[..., : self.channels.judged] - self._even
        return (
            (self._seen(self._even), even * self.slice_spp),
            (self._seen(rest), odd * self.slice_spp),
        )

    def non_finite(self) -> str:
        """Which of alpha and the AOVs are NaN or infinite, and in how many pixels; "" where none.

        They are left so in image.exr. Colour has a limit of its own, see `flaw_of`.
        """
        assert self._total is not None
        counts = {
            name: int(np.count_nonzero(~np.isfinite(self._total[..., plane])))
            for plane, name in enumerate(self.channels.names)
            if name not in {"R", "G", "B", "W"}
        }
        return ", ".join(f"{name} in {count} pixels" for name, count in counts.items() if count)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """What a checkpoint keeps of the sums."""
        assert self._total is not None
        assert self._even is not None
        return {"total": self._total, "even": self._even}

    def about(self) -> dict[str, Any]:
        """What a checkpoint keeps beside the sums, as JSON has it."""
        return {
            "channels": self.channels.names,
            "ids": self.channels.ids,
            "origin": self.origin,
        }

    def restore(
        self, slices: int, arrays: Mapping[str, NDArray[Any]], about: Mapping[str, Any]
    ) -> None:
        """Take up the sums of a checkpoint, in the place of none.

        One from before films had other channels than R, G, B and W does not name them.
        """
        if "channels" in about:
            self.channels = Channels(about["channels"], about["ids"])
            self.origin = about["origin"]
        self.slices = slices
        self._total, self._even = arrays["total"], arrays["even"]

    def _seen(self, total: NDArray[np.float64]) -> Pixels:
        return self.channels.seen_in(total, self.background)
