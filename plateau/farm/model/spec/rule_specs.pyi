# Written by `make manual` from the rules.
from typing import Annotated, Final, Literal

from pydantic import Field

from plateau.farm.model.spec.rule_model import RuleModel

SPECS: Final[dict[str, type[RuleModel]]]

class FixedSpec(RuleModel):
    name: Literal["fixed"] = "fixed"
    spp: int = 10000

class SuccessiveSpec(RuleModel):
    name: Literal["successive"] = "successive"
    threshold: float = 1.0

class MultipleSpec(RuleModel):
    name: Literal["multiple"] = "multiple"
    window: int = 5
    threshold: float = 1.0

class ReverseSpec(RuleModel):
    name: Literal["reverse"] = "reverse"
    window: int = 5
    epsilon: float = 0.1

class MyszkowskiSpec(RuleModel):
    name: Literal["myszkowski"] = "myszkowski"
    alpha: float = 0.5
    threshold: float = 1.0

class VisibleSpec(RuleModel):
    name: Literal["visible"] = "visible"
    target: float = 0.0002
    min_spp: int = 200

class JodSpec(RuleModel):
    name: Literal["jod"] = "jod"
    target: float = 9.5
    min_spp: int = 200

class RelmseSpec(RuleModel):
    name: Literal["relmse"] = "relmse"
    target: float = 0.001
    min_spp: int = 200

class RmseSpec(RuleModel):
    name: Literal["rmse"] = "rmse"
    target: float = 0.01
    min_spp: int = 200

class PsnrSpec(RuleModel):
    name: Literal["psnr"] = "psnr"
    target: float = 40.0
    min_spp: int = 200

class NoiseSpec(RuleModel):
    name: Literal["noise"] = "noise"
    target: float = 0.03
    min_spp: int = 200
    share: float = 0.95

RuleSpec = Annotated[
    FixedSpec
    | SuccessiveSpec
    | MultipleSpec
    | ReverseSpec
    | MyszkowskiSpec
    | VisibleSpec
    | JodSpec
    | RelmseSpec
    | RmseSpec
    | PsnrSpec
    | NoiseSpec,
    Field(discriminator="name"),
]
