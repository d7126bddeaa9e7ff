"""What a test needs and a newcomer's machine may lack."""

import os
from typing import NoReturn

import pytest

#: Of a test that looks into a process which has shut its memory.
of_root = pytest.mark.skipif(os.geteuid() != 0, reason="root alone may look into the process")


def missing(message: str) -> NoReturn:
    """Skip the test, which says what to install; in CI, where nothing may be skipped, fail it."""
    if os.environ.get("CI") == "true":
        pytest.fail(message)
    pytest.skip(message)
