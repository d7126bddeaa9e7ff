"""What is seen of the sums of a job's slices: its image, layers, halves and quarters."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plateau.farm.images.channels import BLACK, Channels, Colour
from plateau.farm.images.exr import Pixels, input_layer
from plateau.farm.images.view_transform import ViewTransform
from plateau.metric import Half
from plateau.metric.standard_error import Quarters
from plateau.picture.canvas import Sampled

BETWEEN: Final = ", "  #: the kinds of workers in `MergedImage.origin`


@dataclass(kw_only=True)
class MergedImage:
    """The image of a contiguous prefix of slices, by their sums; `Merge` makes them.

    Notes
    -----
    There are two sums: of all slices, (height, width, channels) float64, and of those with an even
    index, which has the judged channels alone: R, G, B, W and, if the film has it, A. The slices
    with an odd index are the difference. By zones there is a third, see `other_halves`; for
    `quarters` that and a fourth.
    """

    slice_spp: int
    zone_size: int | None = None  #: in pixels; None where all slices have the whole film
    background: Colour = BLACK  #: behind an image with alpha
    has_quarters: bool = False  #: for rules that need them; only of whole films
    exposure_ev: float = 0.0  #: under which the image will be seen; only a transform needs it
    slices: int = 0  #: in the sums: the slices 0 … slices − 1
    channels: Channels = field(default_factory=Channels)
    #: How the slices were made: first_seed, last_seed, variant, renderer. Empty if not known.
    origin: dict[str, str] = field(default_factory=dict)
    transform: ViewTransform | None = None  #: the view transform of the scene
    header: Mapping[str, str] = field(default_factory=dict)  #: what that of the image is to say
    #: The sums of the first passes, (height, width, channels) float32, by their spp.
    inputs: Mapping[int, Pixels] = field(default_factory=dict)
    _total: NDArray[np.float64] | None = field(default=None, repr=False)
    _even: NDArray[np.float64] | None = field(default=None, repr=False)
    _other: NDArray[np.float64] | None = field(default=None, repr=False)
    _first: NDArray[np.float64] | None = field(default=None, repr=False)
    _sampled: Sampled | None = field(default=None, repr=False)  #: where slices have zones

    @property
    def spp(self) -> int:
        """Samples per pixel in the merged image: by zones their mean, rounded down."""
        if self._sampled is None:
            return self.slices * self.slice_spp
        grid = self._sampled.canvas.grid
        return self.samples // (grid.width * grid.height)

    @property
    def samples(self) -> int:
        """Samples in the merged image, over all pixels."""
        if self._sampled is not None:
            return self._sampled.samples(self._sampled.spp)
        height, width = (0, 0) if self._total is None else self._total.shape[:2]
        return int(self.spp * width * height)

    @property
    def zone_spp(self) -> NDArray[np.int64] | None:
        """Samples per pixel of each zone, (rows, columns); None where all pixels have the same."""
        return None if self._sampled is None else self._sampled.spp

    @property
    def spp_range(self) -> tuple[int, int] | None:
        """The least and the most samples per pixel of a zone; None where all have the same."""
        spp = self.zone_spp
        return None if spp is None else (int(spp.min()), int(spp.max()))

    @property
    def kinds(self) -> tuple[str, ...]:
        """The kinds of the workers that rendered it, in the order of their first slices."""
        return tuple(filter(None, self.origin.get("renderer", "").split(BETWEEN)))

    @property
    def is_lit(self) -> bool:
        """Whether any pixel has light, as rendered; one that is NaN or infinite tells nothing."""
        assert self._total is not None
        colours = self._total[..., :3]
        return bool(((colours > 0) & (colours < np.inf)).any())

    def image(self, *, as_seen: bool = True) -> Pixels:
        """Return the image that is judged: (height, width, 3) float32 linear radiance.

        An image with alpha is over the background. An image with a view transform is the light of
        the display, unless it is wanted as rendered (`as_seen` is false).
        """
        assert self._total is not None
        return self._image(self._film(self._total), as_seen)

    def layers(self) -> dict[str, Pixels]:
        """Return the image by channel: (height, width) float32, with premultiplied colour."""
        assert self._total is not None
        return self.channels.normalised(self._film(self._total))

    def input_layers(self) -> dict[str, Pixels]:
        """Return the images of the first passes by channel: (height, width) float32."""
        return {
            f"{input_layer(spp)}.{name}": plane
            for spp, film in self.inputs.items()
            for name, plane in self.channels.normalised(film.astype(np.float64)).items()
        }

    def variance_layers(self) -> dict[str, Pixels]:
        """Return the variance of the image's R, G and B: (height, width) float32 by channel.

        It is without bias, by the parts that `quarters` has; empty with fewer than four slices.

        Notes
        -----
        The mean of nᵢ of the n slices has the variance σ²/nᵢ, if σ² is that of a slice. So the sum
        of nᵢ (meanᵢ - mean)² has the expectation 3 σ², and the image has the variance σ²/n.
        """
        found = self._quarters()
        if found is None:
            return {}
        (sums, counts), total = found, self.slices
        with np.errstate(invalid="ignore", over="ignore"):
            # As image.exr has them: without what the job wants to see behind the image
            parts = [self.channels.seen_in(one).astype(np.float64) for one in sums]
            mean = sum(n * one for n, one in zip(counts, parts, strict=True)) / total
            apart = sum(n * np.square(one - mean) for n, one in zip(counts, parts, strict=True))
            variance = np.asarray(apart / ((len(parts) - 1) * total), np.float32)
        return {f"variance.{name}": variance[..., plane] for plane, name in enumerate("RGB")}

    def halves(self, *, as_seen: bool = True) -> tuple[Half, Half] | None:
        """Return the images of the even and of the odd slices, each with its spp.

        By zones, all of them have as many even samples as odd ones at the end of a round, which is
        when an image is judged, and the spp is the mean.
        """
        if self.slices < 2 or self._even is None:
            return None
        if self._sampled is not None:
            return self._zoned_halves(self._even, self._sampled.even_spp, as_seen)
        odd = self.slices // 2
        even = self.slices - odd
        return (
            Half(self._image(self._even, as_seen), even * self.slice_spp),
            Half(self._image(self._without(self._even), as_seen), odd * self.slice_spp),
        )

    def other_halves(self, *, as_seen: bool = True) -> tuple[Half, Half] | None:
        """Return two other halves, by zones at the end of a round: two slices in turn for each.

        Zones are chosen by these, since an estimate by halves that choose would flatter them. Where
        a cap ends the first rounds between them, there are none.
        """
        if self.slices % 4:
            return None
        assert self._other is not None
        assert self._sampled is not None
        return self._zoned_halves(self._other, self._sampled.spp // 2, as_seen)

    def quarters(self) -> Quarters | None:
        """Return the images of the slices 0, 4, …, of 1, 5, … and so on; None with fewer than 4."""
        found = self._quarters()
        if found is None:
            return None
        sums, slices = found
        return Quarters([self._image(one, as_seen=False) for one in sums], slices, self._seen)

    def _quarters(self) -> tuple[list[NDArray[np.float64]], list[int]] | None:
        """Return the sums of the quarters, and how many slices each has."""
        if not self.has_quarters or self.slices < 4:
            return None
        assert self._even is not None
        assert self._other is not None
        assert self._first is not None
        with np.errstate(invalid="ignore", over="ignore"):
            second, third = self._other - self._first, self._even - self._first
            sums = [self._first, second, third, self._without(self._even) - second]
        return sums, [len(range(part, self.slices, 4)) for part in range(4)]

    def _zoned_halves(
        self, half: NDArray[np.float64], half_spp: NDArray[np.int64], as_seen: bool
    ) -> tuple[Half, Half]:
        assert self._sampled is not None
        grid, rest_spp = self._sampled.canvas.grid, self._sampled.spp - half_spp
        pixels = grid.width * grid.height
        sums = (half, half_spp), (self._without(half), rest_spp)
        one, other = (
            Half(self._image(self._film(total, spp), as_seen), self._sampled.samples(spp) / pixels)
            for total, spp in sums
        )
        return one, other

    def _without(self, half: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the sum of the slices that are not in this half."""
        assert self._total is not None
        with np.errstate(invalid="ignore", over="ignore"):  # a scene may have infinite pixels
            rest: NDArray[np.float64] = self._total[..., : self.channels.judged] - half
        return rest

    def spp_map(self) -> Pixels | None:
        """Return the samples of each pixel, (height, width) float32; None where all are alike."""
        if self._sampled is None:
            return None
        grid = self._sampled.canvas.grid
        spp = self._sampled.spp.astype(np.float32)
        tall = spp.repeat(grid.size, axis=0).repeat(grid.size, axis=1)
        return tall[: grid.height, : grid.width]

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

    def _film(
        self, total: NDArray[np.float64], spp: NDArray[np.int64] | None = None
    ) -> NDArray[np.float64]:
        """Return the sums of the film: those of its zones, with these spp, put together."""
        if self._sampled is None:
            return total
        canvas, all_spp = self._sampled.canvas, self._sampled.spp
        return canvas.assembled(total, all_spp if spp is None else spp, self.channels)

    def _image(self, total: NDArray[np.float64], as_seen: bool) -> Pixels:
        image = self.channels.seen_in(total, self.background)
        return self._seen(image) if as_seen else image

    def _seen(self, image: Pixels) -> Pixels:
        """Return an image as its scene wants it to be shown."""
        return image if self.transform is None else self.transform.seen(image, self.exposure_ev)
