"""What machine time costs: core hours times their price."""

from dataclasses import dataclass

from pydantic import BaseModel, ConfigDict, Field

from plateau.farm.model.job import Job
from plateau.farm.process.settings import Settings

#: Digits after the point of an amount: more than any currency has, for jobs of seconds.
_DIGITS = 6


@dataclass(frozen=True)
class Price:
    """The price of a core hour, in a currency ("" where none is named)."""

    per_core_hour: float
    currency: str = ""

    @classmethod
    def if_set(cls, settings: Settings) -> "Price | None":
        """The price that the settings name, if they do."""
        price = settings.core_hour_price
        return None if price is None else cls(price, settings.currency)

    def of(self, core_hours: float) -> float:
        """The price of these core hours."""
        return round(core_hours * self.per_core_hour, _DIGITS)


class Cost(BaseModel):
    """What a job cost, by the service's present price of a core hour."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    amount: float = Field(description="of the job's `core_hours`")
    saved: float = Field(description="of its `saved_core_hours`")
    currency: str = Field(description="as the service's settings name it")


def cost_of(job: Job, price: Price) -> Cost:
    """What the job cost, and what its stop saved."""
    return Cost(
        amount=price.of(job.core_hours),
        saved=price.of(job.saved_core_hours),
        currency=price.currency,
    )
