"""What a user asks for: the specification of a job or of a batch, checked field by field."""

from plateau.farm.model.spec.job import (
    MAX_ENTRIES,
    BatchSpec,
    JobSpec,
    Parameters,
    parameter_strings,
    stored_spec,
)
from plateau.farm.model.spec.parts import ExrSpec, ShotSpec
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
from plateau.farm.model.spec.shared import MOST_S, Priority, RenderVariant, SharedSpec, Variant
from plateau.farm.model.spec.view import PLACES, ViewSpec

__all__ = [
    "MAX_ENTRIES",
    "MOST_S",
    "PLACES",
    "BatchSpec",
    "ExrSpec",
    "FixedSpec",
    "JobSpec",
    "JodSpec",
    "MultipleSpec",
    "MyszkowskiSpec",
    "NoiseSpec",
    "Parameters",
    "Priority",
    "PsnrSpec",
    "RelmseSpec",
    "RenderVariant",
    "ReverseSpec",
    "RmseSpec",
    "RuleSpec",
    "SharedSpec",
    "ShotSpec",
    "SuccessiveSpec",
    "Variant",
    "ViewSpec",
    "VisibleSpec",
    "parameter_strings",
    "stored_spec",
]
