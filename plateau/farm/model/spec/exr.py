"""How a job's EXR file is to be written."""

from typing import Literal

from pydantic import Field

from plateau.farm.model.spec.rule_model import Strict

#: Those without loss: the ids and the depth of an image are to be exact, and so is its remake.
Compression = Literal["none", "rle", "zips", "zip", "piz"]


class ExrSpec(Strict):
    """How image.exr is written."""

    precision: Literal["float", "half"] = Field(
        default="float",
        description="of its values; ids and Z are float in either, and half ends at 65504",
    )
    compression: Compression = Field(
        default="zip", description="of the final file, without loss; zips and none read fastest"
    )
