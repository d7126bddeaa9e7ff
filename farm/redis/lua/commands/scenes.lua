-- Note that a scene is wanted now.
-- ARGV: SHA-256
-- Returns 1 while its blob is being removed, else 0.
for_farm.use_scene = function(ARGV)
  redis.call('ZADD', SCENES_USED, now(), ARGV[1])
  return redis.call('EXISTS', scene_going_key(ARGV[1]))
end

-- Take the note of use_scene.lua back: there is no such scene.
-- ARGV: SHA-256
for_farm.disuse_scene = function(ARGV)
  redis.call('ZREM', SCENES_USED, ARGV[1])
end

-- The blob store holds a scene; what is known of it already stays.
-- ARGV: SHA-256, summary (JSON)
for_farm.remember_scene = function(ARGV)
  redis.call('HSETNX', SCENES, ARGV[1], ARGV[2])
end

-- From now on runs the time of scenes of which nobody knows when they were used.
-- ARGV: SHA-256, SHA-256, …
for_farm.note_scenes = function(ARGV)
  for _, sha256 in ipairs(ARGV) do redis.call('ZADD', SCENES_USED, 'NX', now(), sha256) end
end

-- Forget a scene that was last used before a moment, so that its blob may be removed: until that is
-- done, or for so long at most, nobody may take it to be there.
-- ARGV: SHA-256, the moment (ms), the longest that the removal may take (ms)
-- Returns 'forgotten' or 'kept' (it was used since, or nobody knows when).
for_farm.forget_scene = function(ARGV)
  local sha256 = ARGV[1]
  local used = redis.call('ZSCORE', SCENES_USED, sha256)
  if not used or tonumber(used) >= tonumber(ARGV[2]) then return 'kept' end
  redis.call('ZREM', SCENES_USED, sha256)
  redis.call('HDEL', SCENES, sha256)
  redis.call('SET', scene_going_key(sha256), '1', 'PX', ARGV[3])
  return 'forgotten'
end

-- The blob of a forgotten scene is removed: who sends the scene again may put it.
-- ARGV: SHA-256
for_farm.scene_gone = function(ARGV)
  redis.call('DEL', scene_going_key(ARGV[1]))
end
