"""The Redis of a farm, for commands that work on it directly, whether `plateau up` runs or not."""

from contextlib import ExitStack

from plateau.errors import CommandFailed
from plateau.farm.process.settings import Settings
from plateau.farm.redis.embedded import EmbeddedRedis
from plateau.processes.data_folder import DataFolder, InUse


def redis_at_hand(
    settings: Settings, data: DataFolder, stack: ExitStack, *, may_begin: bool = False
) -> str:
    """URL of the Redis that the settings mean; an embedded one is started where none runs.

    Parameters
    ----------
    settings
        With the URL of a Redis, or with none, for the embedded one.
    data
        The data folder, whose Redis it is then.
    stack
        What is started here is stopped with it.
    may_begin
        Whether a data folder that is not there yet is made.

    Raises
    ------
    CommandFailed
        There is no data folder, or its Redis runs and cannot be found.
    """
    if settings.redis_url:
        return settings.redis_url
    if not may_begin and not data.redis.is_dir():
        raise CommandFailed(
            f"there is no data of Plateau in {data.path}: set PLATEAU_DATA to the folder that "
            "`plateau up` says it uses, or PLATEAU_REDIS_URL and PLATEAU_BLOBS"
        )
    try:
        stack.enter_context(data)
    except InUse as held:
        socket = data.redis.absolute() / "redis.sock"
        if not socket.exists():
            raise CommandFailed(
                f"{held}; its Redis is not in that folder: set PLATEAU_REDIS_URL and PLATEAU_BLOBS "
                "as it printed them at its start"
            ) from held
        return f"unix://{socket}"
    server = EmbeddedRedis(data.redis)
    stack.callback(server.stop)
    return server.url
