-- A monitor lives, and owns so many jobs; without their number it signs off.
function for_farm.monitor_heartbeat(it)
  local monitor = monitor_key(it.monitor)
  rank(MONITORS, it.monitor, it.jobs and now() + it.life_ms)
  redis.call('ZREMRANGEBYSCORE', MONITORS, '-inf', now() - 3600000)
  redis.call('HSET', monitor, 'jobs', it.jobs or 0)
  redis.call('EXPIRE', monitor, 3600)
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
