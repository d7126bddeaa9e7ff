"""What may go wrong with a command: said in one line, without a traceback."""

from typing import Final

from farm.bundle import BundleError
from farm.errors import FarmError
from plateau.client import ClientError
from plateau.data_folder import InUse
from plateau.judge import CannotJudge
from plateau.read_settings import BadSetting
from plateau.study import CannotFit
from plateau.tree import TreeFailed


class CommandFailed(Exception):
    """A command cannot do what was asked; the message says why and what to do."""


#: Errors whose message is all that a user needs.
EXPECTED: Final = (
    BadSetting,
    BundleError,
    CannotFit,
    CannotJudge,
    ClientError,
    CommandFailed,
    FarmError,
    InUse,
    OSError,
    TreeFailed,
)
