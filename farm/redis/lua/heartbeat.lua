-- A worker is alive: its description, and its leases renewed.
-- ARGV: worker, description (JSON), lease in ms, then job, entry, job, entry, …
-- Returns the entries among them whose job has ended or whose lease is lost, each after its job.
local worker, gone = ARGV[1], {}
is_silent(ARGV[3])
redis.call('SET', HEARD, now())
redis.call('ZADD', WORKERS, now(), worker)
forgive_worker(worker)
redis.call('HSET', worker_key(worker), 'about', ARGV[2], 'seen_at', now())
redis.call('EXPIRE', worker_key(worker), 3600)
redis.call('ZREMRANGEBYSCORE', WORKERS, '-inf', now() - 3600000)
local about = cjson.decode(ARGV[2])
if not given(about.trouble) and redis.call('HEXISTS', worker_key(worker), 'drained') == 0 then
  redis.call('ZADD', KINDS, now(), kind_of(about))
end
redis.call('ZREMRANGEBYSCORE', KINDS, '-inf', now() - 3600000)
redis.call('EXPIRE', KINDS, 3600)
for i = 4, #ARGV, 2 do
  local id, entry = ARGV[i], ARGV[i + 1]
  if holds(id, entry, worker) then
    redis.call('XCLAIM', job_key(id, 'slices'), GROUP, worker, 0, entry, 'JUSTID')
    note_lease(id, entry)
  else
    gone[#gone + 1] = id
    gone[#gone + 1] = entry
  end
end
return gone
