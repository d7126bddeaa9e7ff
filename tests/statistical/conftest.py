"""The real renderer, as the tests of workers have it."""

from tests.worker.conftest import mitsuba, scalar

__all__ = ["mitsuba", "scalar"]
