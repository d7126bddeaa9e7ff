-- Take the note of use_scene.lua back: there is no such scene.
-- ARGV: SHA-256
redis.call('ZREM', SCENES_USED, ARGV[1])
