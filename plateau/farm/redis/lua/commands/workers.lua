-- A worker lives: its description is stored, and its leases are renewed.
-- Returns the leases that are lost, or whose job has ended.
function for_workers.heartbeat(it)
  local worker, gone = it.worker, {}
  Slice.is_farm_silent(it.lease_ms)
  redis.call('HSET', HEARD, 'at', now())
  redis.call('ZADD', WORKERS, now(), worker)
  Slice.forgive(worker)
  redis.call('HSET', worker_key(worker), 'about', it.about, 'seen_at', now())
  redis.call('EXPIRE', worker_key(worker), 3600)
  redis.call('ZREMRANGEBYSCORE', WORKERS, '-inf', now() - 3600000)
  for _, lease in ipairs(it.leases) do
    if Slice.holds(lease.job, lease.entry, worker) then
      redis.call('XCLAIM', job_key(lease.job, 'slices'), GROUP, worker, 0, lease.entry, 'JUSTID')
      Slice.note_lease(lease.job, lease.entry)
    else
      gone[#gone + 1] = lease
    end
  end
  return gone
end

-- A worker signs off.
function for_workers.leave(it)
  redis.call('ZREM', WORKERS, it.worker)
  redis.call('HDEL', IDLE, it.worker)
  local about = redis.call('HGET', worker_key(it.worker), 'about')
  if about then redis.call('SREM', IDLE .. ':' .. Waiting.kind_of(cjson.decode(about)), it.worker) end
  redis.call('DEL', worker_key(it.worker))
end
