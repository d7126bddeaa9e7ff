-- A worker signs off.
-- ARGV: worker
redis.call('ZREM', WORKERS, ARGV[1])
redis.call('HDEL', IDLE, ARGV[1])
local about = redis.call('HGET', worker_key(ARGV[1]), 'about')
if about then
  redis.call('SREM', IDLE .. ':auto', ARGV[1])
  for _, variant in ipairs(cjson.decode(about).variants or {}) do
    redis.call('SREM', IDLE .. ':' .. variant, ARGV[1])
  end
end
redis.call('DEL', worker_key(ARGV[1]))
