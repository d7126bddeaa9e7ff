"""Calls about the farm itself."""

from plateau.client.calls import Calls
from plateau.farm.model.job import RefusedProcess, Worker
from plateau.farm.wire.views import Scenes, SceneView, Workers


class FarmCalls(Calls):
    """Who works, and what is stored."""

    def workers(self) -> list[Worker]:
        """The workers that live, and what each renders."""
        return self._transport.read(Workers, "/v1/workers").workers

    def refused(self) -> list[RefusedProcess]:
        """The processes whose version does not fit the farm's: of each machine the last one."""
        return self._transport.read(Workers, "/v1/workers").refused

    def scenes(self) -> list[SceneView]:
        """The stored scenes; `Client.submit` takes one by its SHA-256."""
        return self._transport.read(Scenes, "/v1/scenes").scenes
