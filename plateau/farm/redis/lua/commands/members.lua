-- A monitor lives, or signs off without `about`, and its work is added to the totals. It reports its work
-- since its start, so that a repeated or a lost heartbeat counts nothing twice and loses nothing.
function for_farm.monitor_heartbeat(it)
  local monitor = monitor_key(it.monitor)
  for total, number in pairs(it.done) do
    local more = number - (redis.call('HGET', monitor, 'did ' .. total) or 0)
    if more > 0 then
      count(total, more)
      redis.call('HSET', monitor, 'did ' .. total, number)
    end
  end
  if given(it.about) then redis.call('HSET', monitor, 'about', it.about, 'seen_at', now()) end
  rank(MONITORS, it.monitor, given(it.about) and now() + it.life_ms)
  redis.call('EXPIRE', monitor, 86400)
  redis.call('ZREMRANGEBYSCORE', MONITORS, '-inf', now() - 3600000)
end

-- Tell a worker to take no more slices, or to take some again. It finishes those that it has.
-- Returns 'drained', 'working', or 'missing' (no such worker lives).
function for_farm.drain(it)
  local worker = it.worker
  local seen = redis.call('ZSCORE', WORKERS, worker)
  if not seen or now() - seen > it.alive_ms then return 'missing' end
  if it.drains then
    redis.call('HSET', worker_key(worker), 'drained', '1')
    redis.call('HDEL', IDLE, worker)
    return 'drained'
  end
  redis.call('HDEL', worker_key(worker), 'drained')
  redis.call('PUBLISH', wake_worker_key(worker), 'planned')
  return 'working'
end

-- Give Redis the id that it shares with its blob store, unless it has one.
-- Returns the id that Redis has now.
function for_farm.pair(it)
  redis.call('HSETNX', STORE, 'id', it.id)
  if it.is_marked then redis.call('HSET', STORE, 'paired', 1) end
  return redis.call('HGET', STORE, 'id')
end
