"""Removes scenes that no job has.

The danger: a scene is submitted again while a sweep removes it. If the API sees the blob, does not
put it again, and the sweep then removes it, the job has no scene. Therefore

1. the API notes the use (`SceneIndex.use`), then checks that the scene is not going, then looks for
   the blob;
2. a sweep chooses a moment at least an hour ago, reads the scenes of all jobs, and runs
   ``forget_scene`` for each other scene that was last used before that moment: in one step the
   script checks the use again, forgets the scene and marks it. The sweep removes blob and mark.

If the note comes first, the script finds it and keeps the scene. If the script comes first, the API
finds the mark, waits, and puts the blob again. A job that is created after the sweep has read the
jobs has a note later than the moment, unless its API took an hour between note and job. A sweep
that dies in between leaves the mark for five minutes, in which the API answers 503 for this scene.
One gap remains: a sweep that is suspended for these minutes exactly between its look at the clock
and its call to the blob store.

The first sweep that sees a scene without a note, which a dead sweep may leave, notes a use then.
"""

import time
from collections.abc import Collection
from typing import Final

from plateau.farm.blobs import names as blobs
from plateau.farm.redis import keys
from plateau.farm.redis.client import RedisClient
from plateau.farm.redis.commands.scenes import ForgetScene, NoteScenes, SceneGone
from plateau.farm.redis.link import now_ms
from plateau.farm.redis.scripts import Scripts
from plateau.farm.sweep.finished_jobs import field_of_all
from plateau.farm.sweep.removal import Removal

#: A scene used within this time, which is longer than any request, is kept.
_IN_USE_S: Final = 3600.0
#: The lifetime of the mark that a scene is going, should the sweep die.
_GOING_S: Final = 300.0
#: The removal must begin by then: the rest of the time is for the blob store's retries.
_BEGINS_WITHIN_S: Final = 60.0
_AT_ONCE: Final = 1000  #: scenes in one command


def remove_scenes(
    client: RedisClient, removal: Removal, unused_for_s: float, forgotten: Collection[str]
) -> int:
    """Remove unused scenes of no job; returns how many.

    They are unused for `unused_for_s`, and at least for an hour. `forgotten` jobs need no scene any
    more, though in a dry run Redis still has them.
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
            continue  # the sweep was suspended, and by now the API may rely on the blob
        removed += removal.remove([stored[sha256]] if sha256 in stored else [])
        if not removal.dry_run:
            scripts.run(SceneGone(sha256=sha256))
    return removed
