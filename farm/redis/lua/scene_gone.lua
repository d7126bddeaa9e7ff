-- The blob of a forgotten scene is removed: who sends the scene again may put it.
-- ARGV: SHA-256
redis.call('DEL', scene_going_key(ARGV[1]))
