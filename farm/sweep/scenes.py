"""Removes scenes that no job has.

The danger is one that is submitted again just as it goes: the API sees its blob and does not put it
again, the sweep removes it, and the job has no scene. Therefore

1. the API notes the use (`SceneIndex.use`), then looks whether the scene is going, then at the
   blob;
2. a sweep fixes a moment, an hour in the past or more, then reads which scenes the jobs have, and
   asks ``forget_scene`` for each other scene that was last used before that moment: the
   script looks once more, forgets the scene and says that it is going, in one step; the sweep
   removes the blob; then it says that the scene is gone.

Where the note is first, the script finds it and keeps the scene. Where the script is first, the
API finds the scene going, waits, and then puts the blob again. A job that is created after the
sweep has read the jobs has a note that is younger than the moment, unless its API took an hour
between note and job. A sweep that dies in between leaves the scene going for five minutes, in
which the API answers 503 for this scene. What is left open: a sweep that is suspended for these
minutes exactly between its look at the clock and its call to the blob store.

A scene without a note, from before there were notes or from a sweep that died, gets one by the
first sweep that sees it; its time runs from then.
"""

import time
from collections.abc import Collection
from typing import Final

from plateau.farm.blobs import store as blobs
from plateau.farm.redis import keys
from plateau.farm.redis.client import RedisClient
from plateau.farm.redis.commands.scenes import ForgetScene, NoteScenes, SceneGone
from plateau.farm.redis.link import now_ms
from plateau.farm.redis.scripts import Scripts
from plateau.farm.sweep.finished_jobs import field_of_all
from plateau.farm.sweep.removal import Removal

#: A scene that was used within this time is kept. No request takes so long.
_IN_USE_S: Final = 3600.0
#: So long the API takes a scene's blob not to be there, should a sweep die while it removes it.
_GOING_S: Final = 300.0
#: By then the removal must have begun: the rest of the time is for the blob store's own retries.
_BEGINS_WITHIN_S: Final = 60.0
_AT_ONCE: Final = 1000  #: scenes that a script is given


def remove_scenes(
    client: RedisClient, removal: Removal, unused_for_s: float, forgotten: Collection[str]
) -> int:
    """Remove scenes of no job that were not used for so long; returns how many.

    Parameters
    ----------
    client, removal
        Redis, and what removes from the blob store that belongs to it.
    unused_for_s
        An hour at least; less is taken for that.
    forgotten
        Jobs that need no scene any more, though Redis may know them.
    """
    before = now_ms(client) - round(max(unused_for_s, _IN_USE_S) * 1000)
    stored = {
        blob.name.removeprefix(blobs.SCENES): blob for blob in removal.store.listing(blobs.SCENES)
    }
    used = dict(client.zrange(keys.SCENES_USED, 0, -1, withscores=True))
    unnoted = sorted((stored.keys() | client.hkeys(keys.SCENES)) - used.keys())
    scripts, removed = Scripts(client), 0
    if not removal.dry_run:
        for start in range(0, len(unnoted), _AT_ONCE):
            scripts.run(NoteScenes(scenes=tuple(unnoted[start : start + _AT_ONCE])))
    wanted = {
        scene for job_id, scene in field_of_all(client, "scene_sha256") if job_id not in forgotten
    }
    unused = sorted(one for one in used.keys() - wanted if used[one] < before)
    for sha256 in unused:
        asked = time.monotonic()
        if not removal.dry_run:
            going_ms = round(_GOING_S * 1000)
            forget = ForgetScene(sha256=sha256, before_ms=before, going_ms=going_ms)
            if scripts.run(forget) != "forgotten":
                continue
        if time.monotonic() - asked > _BEGINS_WITHIN_S:
            continue  # we were suspended, and by now the API may count on the blob
        removed += removal.remove([stored[sha256]] if sha256 in stored else [])
        if not removal.dry_run:
            scripts.run(SceneGone(sha256=sha256))
    return removed
