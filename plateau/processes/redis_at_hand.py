"""A farm's Redis for commands that use it directly, whether `plateau up` runs or not."""

from contextlib import ExitStack
from urllib.parse import quote

from plateau.errors import CommandFailed
from plateau.farm.process.settings import Settings
from plateau.farm.redis.embedded import EmbeddedRedis, socket_in
from plateau.processes.data_folder import DataFolder, InUse
from plateau.processes.ground import check_ground


def redis_at_hand(
    settings: Settings, data: DataFolder, stack: ExitStack, *, may_begin: bool = False
) -> str:
    """URL of the settings' Redis, or of the data folder's, which is started if it does not run.

    `stack` stops that Redis again. Without `may_begin`, a missing data folder is `CommandFailed`.
    """
    if settings.redis_url:
        return settings.redis_url
    if not may_begin and not data.redis.is_dir():
        raise CommandFailed(
            f"there is no data of Plateau in {data.path}: set PLATEAU_DATA to the folder that "
            "`plateau up` prints, or PLATEAU_REDIS_URL and PLATEAU_BLOBS"
        )
    try:
        stack.enter_context(data)
    except InUse as held:
        socket = socket_in(data.redis)
        if socket is None or not socket.exists():
            raise CommandFailed(
                f"{held}; its Redis is not in that folder: set PLATEAU_REDIS_URL and PLATEAU_BLOBS "
                "to the values that it printed"
            ) from held
        return f"unix://{quote(str(socket))}"
    check_ground(settings, caches=False, has_redis=True, data=data.path)
    server = EmbeddedRedis(data.redis)
    stack.callback(server.stop)
    return server.url
