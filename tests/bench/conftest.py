"""The experiment in small, for the benchmarks that work on it."""

from pathlib import Path

import pytest

from bench.experiment.renders import Size

SIZE = Size(pixels=24, cap=600)


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("data")


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("results")
