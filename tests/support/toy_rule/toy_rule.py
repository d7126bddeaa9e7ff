"""A stopping rule from outside Plateau; this folder is what its installation would leave."""

from dataclasses import dataclass, field
from typing import ClassVar

from plateau.metric.rules.base import Memory, Rule, Verdict
from plateau.rules import parameter


@dataclass(kw_only=True)
class Toy(Rule):
    """Stops when the image has been looked at often enough."""

    name: ClassVar[str] = "toy"
    title: ClassVar[str] = "A number of looks"
    help: ClassVar[str] = "Stops when the image was looked at often enough."

    #: How often it looks.
    looks: int = parameter(
        5,
        1,
        1000,
        description="evaluations after which to stop",
        label="Looks",
        help="How often the image is judged.",
        option=True,
    )
    _seen: int = field(default=0, init=False, repr=False, compare=False)

    def judge(self, evidence):
        self._seen += 1
        return Verdict(
            stop=self._seen >= self.looks,
            value=float(self._seen),
            numbers={"looks": float(self._seen)},
            reason=f"looked {self._seen} times, at {evidence.spp} spp",
        )

    def memory(self):
        return Memory({"seen": self._seen}) if self._seen else Memory()

    def recall(self, memory):
        self._seen = memory.numbers.get("seen", 0)
