"""The real renderer, in each variant that this machine can test."""

from collections.abc import Iterator

import pytest

from tests.support.processes.mitsuba_process import MitsubaProcess
from tests.worker.conftest import mitsuba

__all__ = ["mitsuba"]


@pytest.fixture(scope="module")
def scalar() -> Iterator[MitsubaProcess]:
    with MitsubaProcess("scalar_rgb") as process:
        yield process
