-- Note that a scene is wanted now.
-- ARGV: SHA-256
-- Returns 1 while its blob is being removed, else 0.
redis.call('ZADD', SCENES_USED, now(), ARGV[1])
return redis.call('EXISTS', scene_going_key(ARGV[1]))
