-- A monitor is alive, and what it has done is added to the totals. It says how much that was since it
-- started, so that a repeated or a lost heartbeat counts nothing twice and loses nothing.
-- ARGV: monitor, description (JSON) or '' where it signs off, ms after which it is taken for dead,
--       then total, number, total, number, …
local id, about = ARGV[1], ARGV[2]
local monitor = monitor_key(id)
for i = 4, #ARGV, 2 do
  local more = ARGV[i + 1] - (redis.call('HGET', monitor, 'did ' .. ARGV[i]) or 0)
  if more > 0 then
    count(ARGV[i], more)
    redis.call('HSET', monitor, 'did ' .. ARGV[i], ARGV[i + 1])
  end
end
if about == '' then
  redis.call('ZREM', MONITORS, id)
else
  redis.call('HSET', monitor, 'about', about, 'seen_at', now())
  redis.call('ZADD', MONITORS, now() + ARGV[3], id)
end
redis.call('EXPIRE', monitor, 86400)
redis.call('ZREMRANGEBYSCORE', MONITORS, '-inf', now() - 3600000)
