"""What the tests of pictures have in common with those of the service."""

from tests.service.conftest import farm

__all__ = ["farm"]
