-- Forget a scene that was last used before a moment, so that its blob may be removed: until that is
-- done, or for so long at most, nobody may take it to be there.
-- ARGV: SHA-256, the moment (ms), the longest that the removal may take (ms)
-- Returns 'forgotten' or 'kept' (it was used since, or nobody knows when).
local sha256 = ARGV[1]
local used = redis.call('ZSCORE', SCENES_USED, sha256)
if not used or tonumber(used) >= tonumber(ARGV[2]) then return 'kept' end
redis.call('ZREM', SCENES_USED, sha256)
redis.call('HDEL', SCENES, sha256)
redis.call('SET', scene_going_key(sha256), '1', 'PX', ARGV[3])
return 'forgotten'
