"""The real renderer, in each variant that this machine can test."""

from collections.abc import Iterator

import pytest

from tests.support.processes.mitsuba_process import MitsubaProcess
from tests.support.variants import VARIANTS, library_for


@pytest.fixture(scope="module", params=VARIANTS)
def mitsuba(request: pytest.FixtureRequest) -> Iterator[MitsubaProcess]:
    variant: str = request.param
    with MitsubaProcess(variant, library_for(variant)) as process:
        yield process


@pytest.fixture(scope="module")
def scalar() -> Iterator[MitsubaProcess]:
    with MitsubaProcess("scalar_rgb") as process:
        yield process
