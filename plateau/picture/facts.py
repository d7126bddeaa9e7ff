"""The metadata of image files: attributes of an EXR's header, and text chunks of a PNG."""

from collections.abc import Mapping
from typing import Any, Final

from plateau.farm.model import versions
from plateau.farm.model.job import Job, utc_now
from plateau.picture.denoised import Denoised
from plateau.picture.merged_image import MergedImage

#: By name, without ``plateau:``.
Facts = Mapping[str, str | int]

#: Rec. 709: x and y of red, green, blue and white.
_CHROMATICITIES: Final = (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329)


def facts_of(
    job: Job, merge: MergedImage, state: str, reason: str, denoised: Denoised | None = None
) -> Facts:
    """Return what is known of a merged image at this time.

    Parameters
    ----------
    job
        The job of the image.
    merge
        The image.
    state, reason
        The job's state with this image, and the reason for it.
    denoised
        The image denoised, if it is.
    """
    known: dict[str, str | int] = {
        "job": job.id,
        "spp": merge.spp,
        "scene": job.name,
        "scene_sha256": job.scene_sha256,
        **merge.origin,
        "rule": job.spec.rule.model_dump_json(),
        "state": state,
        "reason": reason,
        "non_finite": merge.non_finite(),
        "denoiser": "" if denoised is None else denoised.denoiser,
        "time": utc_now().isoformat(timespec="seconds"),
        "plateau": versions.plateau(),
    }
    return {name: value for name, value in known.items() if value != ""}


def exr_header(facts: Facts) -> dict[str, Any]:
    """Return the attributes of an EXR file."""
    attributes = {f"plateau:{name}": value for name, value in facts.items()}
    return {**attributes, "chromaticities": _CHROMATICITIES}


def png_texts(facts: Facts) -> dict[str, str]:
    """Return the text chunks of a PNG file: what never changes for the image of this spp."""
    named = ("job", "spp", "scene", "scene_sha256")
    return {f"plateau:{name}": str(facts[name]) for name in named if facts.get(name)}
