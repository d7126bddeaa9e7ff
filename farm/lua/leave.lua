-- A worker signs off.
-- ARGV: worker
redis.call('ZREM', WORKERS, ARGV[1])
redis.call('DEL', worker_key(ARGV[1]))
redis.call('HDEL', IDLE, ARGV[1])
