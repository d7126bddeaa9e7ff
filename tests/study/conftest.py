"""A live API over the session's Redis, and a client of it: the fixtures of both ends."""

from tests.plateau.conftest import api, plateau, store
from tests.service.conftest import api_store, http, session_api

__all__ = ["api", "api_store", "http", "plateau", "session_api", "store"]
