-- A worker is alive: its description, and its leases renewed.
-- ARGV: worker, description (JSON), lease in ms, then job, entry, job, entry, …
-- Returns the entries among them whose job has ended or whose lease is lost, each after its job.
for_workers.heartbeat = function(ARGV)
  local worker, gone = ARGV[1], {}
  Slice.is_farm_silent(ARGV[3])
  redis.call('SET', HEARD, now())
  redis.call('ZADD', WORKERS, now(), worker)
  Slice.forgive(worker)
  redis.call('HSET', worker_key(worker), 'about', ARGV[2], 'seen_at', now())
  redis.call('EXPIRE', worker_key(worker), 3600)
  redis.call('ZREMRANGEBYSCORE', WORKERS, '-inf', now() - 3600000)
  local about = cjson.decode(ARGV[2])
  if not given(about.trouble) and redis.call('HEXISTS', worker_key(worker), 'drained') == 0 then
    redis.call('ZADD', KINDS, now(), Waiting.kind_of(about))
  end
  redis.call('ZREMRANGEBYSCORE', KINDS, '-inf', now() - 3600000)
  redis.call('EXPIRE', KINDS, 3600)
  for i = 4, #ARGV, 2 do
    local id, entry = ARGV[i], ARGV[i + 1]
    if Slice.holds(id, entry, worker) then
      redis.call('XCLAIM', job_key(id, 'slices'), GROUP, worker, 0, entry, 'JUSTID')
      Slice.note_lease(id, entry)
    else
      gone[#gone + 1] = id
      gone[#gone + 1] = entry
    end
  end
  return gone
end

-- A worker signs off.
-- ARGV: worker
for_workers.leave = function(ARGV)
  redis.call('ZREM', WORKERS, ARGV[1])
  redis.call('HDEL', IDLE, ARGV[1])
  local about = redis.call('HGET', worker_key(ARGV[1]), 'about')
  if about then redis.call('SREM', IDLE .. ':' .. Waiting.kind_of(cjson.decode(about)), ARGV[1]) end
  redis.call('DEL', worker_key(ARGV[1]))
end

-- Note that a process was refused, for those who look why it is not there: the last one of a machine
-- and role, for an hour.
-- ARGV: machine and role, what is known of it (JSON, without its time)
for_workers.refused = function(ARGV)
  redis.call('HSET', REFUSED, ARGV[1], '{"at":' .. now() .. ',' .. string.sub(ARGV[2], 2))
  redis.call('EXPIRE', REFUSED, 3600)
end
