"""Tests of Cycles that need no Blender; `tests/blender` has the others."""

from tests.service.conftest import api_store, http, session_api

__all__ = ["api_store", "http", "session_api"]
