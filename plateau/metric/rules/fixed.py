"""Algorithm 4.1 of the paper: stop at a fixed number of samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from plateau.metric.rules.base import Rule, Verdict
from plateau.rules import MOST_SPP, ParameterRole, parameter

if TYPE_CHECKING:
    from plateau.metric.rules.evidence import Evidence


@dataclass(kw_only=True)
class Fixed(Rule):
    """Stops when the image has the requested samples per pixel, and remembers nothing.

    References
    ----------
    N. Takouachet, S. Delepoulle and C. Renaud, A perceptual stopping condition for global
    illumination computations, SCCG 2007, algorithm 4.1 (cap 10000).
    """

    name: ClassVar[str] = "fixed"
    title: ClassVar[str] = "A number of samples"
    help: ClassVar[str] = "Stops at a number of samples, whatever the image looks like."
    order: ClassVar[int] = 1
    continues: ClassVar[bool] = True

    #: The cap, in samples per pixel.
    spp: int = parameter(
        10_000,
        1,
        MOST_SPP,
        description="samples per pixel at which to stop",
        label="Stop at",
        unit="spp",
        help="Samples per pixel.",
        role=ParameterRole.END_SPP,
        option=True,
    )

    def judge(self, evidence: Evidence) -> Verdict:
        """Return whether the cap is reached; the value is the spp."""
        stop = evidence.spp >= self.spp
        words = "reached" if stop else "not yet reached"
        return Verdict(
            stop=stop,
            value=float(evidence.spp),
            numbers={"spp": float(evidence.spp), "cap": float(self.spp)},
            reason=f"the fixed {self.spp} spp are {words}: {evidence.spp} spp",
        )
