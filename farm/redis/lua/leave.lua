-- A worker signs off.
-- ARGV: worker
redis.call('ZREM', WORKERS, ARGV[1])
redis.call('HDEL', IDLE, ARGV[1])
local about = redis.call('HGET', worker_key(ARGV[1]), 'about')
if about then redis.call('SREM', IDLE .. ':' .. kind_of(cjson.decode(about)), ARGV[1]) end
redis.call('DEL', worker_key(ARGV[1]))
