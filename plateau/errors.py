"""What may go wrong with a command: said in one line, without a traceback."""

from typing import Final

from plateau.farm.bundle import BundleError
from plateau.farm.model.errors import FarmError


class PlateauError(Exception):
    """What went wrong is not the program's fault; the message is all that a user needs."""


class CommandFailed(PlateauError):
    """A command cannot do what was asked; the message says why and what to do."""


# No module of weight is imported for this: every process of the farm looks here.
#: Errors whose message is all that a user needs.
EXPECTED: Final = (BundleError, FarmError, OSError, PlateauError)
