"""The specification of each installed rule; type checkers read the stub beside this file.

`make manual` writes the stub, and a test compares it with the rules.
"""

from functools import reduce
from operator import or_
from typing import Annotated

from pydantic import Field

from plateau.farm.model.spec.rule_model import rule_model
from plateau.rules import rules

SPECS = {name: rule_model(rule, __name__) for name, rule in rules().items()}

FixedSpec = SPECS["fixed"]
JodSpec = SPECS["jod"]
MultipleSpec = SPECS["multiple"]
MyszkowskiSpec = SPECS["myszkowski"]
NoiseSpec = SPECS["noise"]
PsnrSpec = SPECS["psnr"]
RelmseSpec = SPECS["relmse"]
ReverseSpec = SPECS["reverse"]
RmseSpec = SPECS["rmse"]
SuccessiveSpec = SPECS["successive"]
VisibleSpec = SPECS["visible"]

RuleSpec = Annotated[reduce(or_, SPECS.values()), Field(discriminator="name")]
