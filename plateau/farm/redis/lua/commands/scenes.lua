-- Note a use of a scene now.
-- Returns whether its blob is being removed.
function for_farm.use_scene(it)
  redis.call('ZADD', SCENES_USED, now(), it.sha256)
  return redis.call('EXISTS', scene_going_key(it.sha256)) == 1
end

-- Take the note of `use_scene` back: there is no such scene.
function for_farm.disuse_scene(it) redis.call('ZREM', SCENES_USED, it.sha256) end

-- The blob store holds a scene; an earlier summary stays.
function for_farm.remember_scene(it) redis.call('HSETNX', SCENES, it.sha256, it.summary) end

-- Note a use now for scenes without one.
function for_farm.note_scenes(it)
  for _, sha256 in ipairs(it.scenes) do redis.call('ZADD', SCENES_USED, 'NX', now(), sha256) end
end

-- Forget a scene that was last used before a moment, so that its blob may be removed: until that is done,
-- or for `going_ms`, nobody may rely on the blob.
-- Returns 'forgotten' or 'kept' (it was used since, or its use is unknown).
function for_farm.forget_scene(it)
  local used = redis.call('ZSCORE', SCENES_USED, it.sha256)
  if not used or tonumber(used) >= it.before_ms then return 'kept' end
  redis.call('ZREM', SCENES_USED, it.sha256)
  redis.call('HDEL', SCENES, it.sha256)
  redis.call('SET', scene_going_key(it.sha256), '1', 'PX', it.going_ms)
  return 'forgotten'
end

-- The blob of a forgotten scene is removed: an API may put it again.
function for_farm.scene_gone(it) redis.call('DEL', scene_going_key(it.sha256)) end
