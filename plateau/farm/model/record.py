"""The base of plain values that nobody changes."""

from pydantic import BaseModel, ConfigDict


class Record(BaseModel):
    """A value that nobody changes."""

    model_config = ConfigDict(frozen=True)
