"""The merged image of a job: the sum of its partials."""

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

    So the image depends neither on which workers rendered it nor on the order of their commits.

    Notes
    -----
    The merge keeps two sums: of all slices, (height, width, channels) float64, and of those with
    an even index, which has the judged channels alone: R, G, B, W and, if the film has it, A. The
    slices with an odd index are the difference.
    """

    slice_spp: int
    background: Colour = BLACK  #: behind an image with alpha
    slices: int = 0  #: in the sums: the slices 0 … slices − 1
    channels: Channels = field(default_factory=Channels)
    #: How the slices were made: first_seed, last_seed, variant, renderer. Empty if not known.
    origin: dict[str, str] = field(default_factory=dict)
    _total: NDArray[np.float64] | None = field(default=None, repr=False)
    _even: NDArray[np.float64] | None = field(default=None, repr=False)

    @classmethod
    def of(cls, spec: SharedSpec) -> "Merge":
        """Return empty sums for a job of this spec."""
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
            The film's channels; by default R, G, B and W.

        Raises
        ------
        ValueError
            The slices before have another size or other channels.
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
        is_known = bool(self.origin) or not self.slices
        self.add(partial.pixels, partial.channels)
        if is_known:
            before = self.origin.get("renderer", "")
            names = filter(None, (*before.split(", "), partial.renderer))
            self.origin = {
                "first_seed": self.origin.get("first_seed", str(partial.first_seed)),
                "last_seed": str(partial.last_seed),
                "variant": partial.variant,
                "renderer": ", ".join(dict.fromkeys(names)),  # each version once
            }

    def image(self) -> Pixels:
        """Return the image that is judged: (height, width, 3) float32 linear radiance.

        An image with alpha is over the background.
        """
        assert self._total is not None
        return self._seen(self._total)

    def layers(self) -> dict[str, Pixels]:
        """Return the image by channel: (height, width) float32, with premultiplied colour."""
        assert self._total is not None
        return self.channels.normalised(self._total)

    def halves(self) -> tuple[tuple[Pixels, int], tuple[Pixels, int]] | None:
        """Return the images of the even and of the odd slices, each with its spp."""
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
        """Return which alpha and AOV channels have NaN or infinite pixels, in words; "" if none.

        They stay so in image.exr. Colour is judged by `result_files.flaw_of`.
        """
        assert self._total is not None
        counts = {
            name: int(np.count_nonzero(~np.isfinite(self._total[..., plane])))
            for plane, name in enumerate(self.channels.names)
            if name not in {"R", "G", "B", "W"}
        }
        return ", ".join(f"{name} in {count} pixels" for name, count in counts.items() if count)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the arrays of a checkpoint."""
        assert self._total is not None
        assert self._even is not None
        return {"total": self._total, "even": self._even}

    def about(self) -> dict[str, Any]:
        """Return what a checkpoint says of its arrays, for JSON."""
        return {
            "channels": self.channels.names,
            "ids": self.channels.ids,
            "origin": self.origin,
        }

    def restore(
        self, slices: int, arrays: Mapping[str, NDArray[Any]], about: Mapping[str, Any]
    ) -> None:
        """Take over the sums of a checkpoint; an older one does not name R, G, B and W."""
        if "channels" in about:
            self.channels = Channels(about["channels"], about["ids"])
            self.origin = about["origin"]
        self.slices = slices
        self._total, self._even = arrays["total"], arrays["even"]

    def _seen(self, total: NDArray[np.float64]) -> Pixels:
        return self.channels.seen_in(total, self.background)
