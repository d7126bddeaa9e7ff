"""Whether the image that a job delivers is denoised: a part of its spec."""

from typing import Annotated, Literal

from pydantic import Field

from plateau.farm.model.spec.rule_model import Strict


class NoDenoising(Strict):
    """The merged image is delivered as it is."""

    name: Literal["none"] = "none"


class OidnDenoising(Strict):
    """It is blended with what Open Image Denoise makes of it, where that has the smaller error."""

    name: Literal["oidn"] = "oidn"
    guides: bool = Field(
        default=True,
        description="whether the first films have albedo and normal too, which keep texture from "
        "being taken for noise",
    )


DenoiseSpec = Annotated[NoDenoising | OidnDenoising, Field(discriminator="name")]
