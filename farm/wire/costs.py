"""What machine time costs: core hours times their price."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from pydantic import BaseModel, ConfigDict, Field

if TYPE_CHECKING:
    from plateau.farm.process.settings import Settings

#: Digits after the point of an amount: more than any currency has, for jobs of seconds.
_DIGITS = 6


@dataclass(frozen=True)
class Price:
    """The price of a core hour, in a currency ("" where none is named)."""

    per_core_hour: float
    currency: str = ""

    @classmethod
    def if_set(cls, settings: "Settings") -> "Price | None":
        """The price that the settings name, if they do."""
        price = settings.core_hour_price
        return None if price is None else cls(price, settings.currency)

    def of(self, core_hours: float) -> float:
        """The price of these core hours."""
        return round(core_hours * self.per_core_hour, _DIGITS)


class Cost(BaseModel):
    """What a job or a worker cost, by the service's present price of a core hour."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    amount: float = Field(description="of the `core_hours`")
    saved: float = Field(description="of the `saved_core_hours`")
    currency: str = Field(description="as the service's settings name it")


class Spender(Protocol):
    """What has cost core hours: a job, or a worker."""

    @property
    def core_hours(self) -> float | None:
        """Those that it has cost; None where that is not known."""

    @property
    def saved_core_hours(self) -> float:
        """Those that were saved."""


def cost_of(spender: Spender, price: Price | None) -> Cost | None:
    """What it cost, and what was saved; None without a price, or where that is not known."""
    if price is None or spender.core_hours is None:
        return None
    return Cost(
        amount=price.of(spender.core_hours),
        saved=price.of(spender.saved_core_hours),
        currency=price.currency,
    )
