-- A monitor is alive, and what it has done is added to the totals. It says how much that was since it
-- started, so that a repeated or a lost heartbeat counts nothing twice and loses nothing.
-- ARGV: monitor, description (JSON) or '' where it signs off, ms after which it is taken for dead,
--       then total, number, total, number, …
-- Returns an error where it does not speak what the farm does.
local id, about = ARGV[1], ARGV[2]
local monitor = monitor_key(id)
for i = 4, #ARGV, 2 do
  local more = ARGV[i + 1] - (redis.call('HGET', monitor, 'did ' .. ARGV[i]) or 0)
  if more > 0 then
    count(ARGV[i], more)
    redis.call('HSET', monitor, 'did ' .. ARGV[i], ARGV[i + 1])
  end
end
return note_member(MONITORS, monitor, id, about, ARGV[3])
