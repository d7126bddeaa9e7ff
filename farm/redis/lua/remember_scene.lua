-- The blob store holds a scene; what is known of it already stays.
-- ARGV: SHA-256, summary (JSON)
redis.call('HSETNX', SCENES, ARGV[1], ARGV[2])
