-- A monitor is alive, and what it has done is added to the totals. It says how much that was since it
-- started, so that a repeated or a lost heartbeat counts nothing twice and loses nothing.
-- ARGV: monitor, description (JSON) or '' where it signs off, ms after which it is taken for dead,
--       then total, number, total, number, …
-- Returns an error where it does not speak what the farm does.
for_farm.monitor_heartbeat = function(ARGV)
  local id, about = ARGV[1], ARGV[2]
  local monitor = monitor_key(id)
  for i = 4, #ARGV, 2 do
    local more = ARGV[i + 1] - (redis.call('HGET', monitor, 'did ' .. ARGV[i]) or 0)
    if more > 0 then
      count(ARGV[i], more)
      redis.call('HSET', monitor, 'did ' .. ARGV[i], ARGV[i + 1])
    end
  end
  return Member.note(MONITORS, monitor, id, about, ARGV[3])
end

-- An API is alive.
-- ARGV: API, description (JSON) or '' where it signs off, ms after which it is taken for dead
-- Returns an error where it does not speak what the farm does.
for_farm.api_heartbeat = function(ARGV)
  return Member.note(APIS, api_member_key(ARGV[1]), ARGV[1], ARGV[2], ARGV[3])
end

-- Tell a worker to take no more slices, or to take some again. What it has in hand it finishes.
-- ARGV: worker, '1' to drain it, '0' to take that back; its life within so many ms
-- Returns 'drained', 'working', or 'missing' (no such worker lives).
for_farm.drain = function(ARGV)
  local worker, drains, within_ms = ARGV[1], ARGV[2] == '1', ARGV[3]
  local seen = redis.call('ZSCORE', WORKERS, worker)
  if not seen or now() - seen > tonumber(within_ms) then return 'missing' end
  if drains then
    redis.call('HSET', worker_key(worker), 'drained', '1')
    redis.call('HDEL', IDLE, worker)
    return 'drained'
  end
  redis.call('HDEL', worker_key(worker), 'drained')
  redis.call('PUBLISH', wake_worker_key(worker), 'planned')
  return 'working'
end

-- Give Redis the id that it shares with its blob store, unless it has one.
-- ARGV: an id, '1' where the blob store is marked with it, or ''
-- Returns the id that Redis has now.
for_farm.pair = function(ARGV)
  redis.call('HSETNX', STORE, 'id', ARGV[1])
  if ARGV[2] == '1' then redis.call('HSET', STORE, 'paired', 1) end
  return redis.call('HGET', STORE, 'id')
end
