"""The scenes in the blob store, and when each was last used."""

import json
import time
from collections.abc import Iterator
from typing import Any, Final

from plateau.farm.model.errors import StoreUnavailable
from plateau.farm.redis import keys
from plateau.farm.redis.commands.scenes import DisuseScene, RememberScene, UseScene
from plateau.farm.redis.scripts import OnRedis

#: Far longer than removing a scene's blob usually takes.
_SCENE_GOES_S: Final = 5.0


class SceneIndex(OnRedis):
    """The stored scenes, by SHA-256. Every method raises `StoreUnavailable` when Redis is away."""

    def use(self, sha256: str) -> None:
        """Note the use of a scene, before anyone asks the blob store for it.

        From now on no sweep removes it for at least an hour; see `plateau.farm.sweep.scenes`. If a
        sweep is just removing it, this waits for the end of that.

        Raises
        ------
        StoreUnavailable
            The removal takes too long: call again later.
        """
        patience = time.monotonic() + _SCENE_GOES_S
        is_going = self._scripts.run(UseScene(sha256=sha256))
        while is_going:
            if time.monotonic() > patience:
                raise StoreUnavailable(f"scene {sha256} is being removed; send it again soon")
            time.sleep(0.05)
            is_going = bool(self._redis.exists(keys.scene_going(sha256)))

    def disuse(self, sha256: str) -> None:
        """Take the note of `use` back: the blob store has no such scene."""
        self._scripts.run(DisuseScene(sha256=sha256))

    def remember(self, sha256: str, summary: dict[str, Any]) -> None:
        """Note that the blob store holds this scene."""
        self._scripts.run(RememberScene(sha256=sha256, summary=json.dumps(summary)))

    def bytes_of(self, owner: str) -> int:
        """Bytes of the stored scenes that this key, by its id, was the first to send."""
        return sum(scene["bytes"] for scene in self.all() if scene.get("owner") == owner)

    def has(self, sha256: str) -> bool:
        """Whether the blob store holds this scene."""
        return bool(self._redis.hexists(keys.SCENES, sha256))

    def all(self) -> Iterator[dict[str, Any]]:
        """The stored scenes with their summaries."""
        scenes = self._redis.hgetall(keys.SCENES)
        for sha256, summary in scenes.items():
            yield {"sha256": sha256, **json.loads(summary)}
