"""What a user asks for: the specification of a job or of a batch, checked field by field."""

from plateau.farm.model.spec.job import (
    MAX_ENTRIES,
    BatchSpec,
    JobSpec,
    parameter_strings,
    stored_spec,
)
from plateau.farm.model.spec.parts import ExrSpec
from plateau.farm.model.spec.rule_specs import (
    FixedSpec,
    JodSpec,
    MultipleSpec,
    MyszkowskiSpec,
    NoiseSpec,
    PsnrSpec,
    RelmseSpec,
    ReverseSpec,
    RmseSpec,
    RuleSpec,
    SuccessiveSpec,
    VisibleSpec,
)
from plateau.farm.model.spec.shared import Priority, RenderVariant, SharedSpec
from plateau.farm.model.spec.view import PLACES, ViewSpec

__all__ = [
    "MAX_ENTRIES",
    "PLACES",
    "BatchSpec",
    "ExrSpec",
    "FixedSpec",
    "JobSpec",
    "JodSpec",
    "MultipleSpec",
    "MyszkowskiSpec",
    "NoiseSpec",
    "Priority",
    "PsnrSpec",
    "RelmseSpec",
    "RenderVariant",
    "ReverseSpec",
    "RmseSpec",
    "RuleSpec",
    "SharedSpec",
    "SuccessiveSpec",
    "ViewSpec",
    "VisibleSpec",
    "parameter_strings",
    "stored_spec",
]
