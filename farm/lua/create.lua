-- Create a job, once for each idempotency key.
-- ARGV: id, idempotency key or '', request digest, priority, then field, value, …
-- Returns {'created', id}, {'repeated', id} or {'conflict', id}.
local id, idempotency, digest, priority = ARGV[1], ARGV[2], ARGV[3], ARGV[4]
if idempotency ~= '' then
  local known = redis.call('GET', PREFIX .. 'idempotency:' .. idempotency)
  if known then
    known = cjson.decode(known)
    return {known.digest == digest and 'repeated' or 'conflict', known.id}
  end
  redis.call('SET', PREFIX .. 'idempotency:' .. idempotency,
             cjson.encode({id = id, digest = digest}), 'EX', 86400)
end
local number = redis.call('INCR', PREFIX .. 'created')
redis.call('HSET', job_key(id), 'id', id, 'state', 'queued', 'reason', 'waiting for a worker',
           'created_at', now(), 'number', number, unpack(ARGV, 5))
redis.call('ZADD', JOBS, number, id)
redis.call('ZADD', OPEN, priority, id)
redis.call('SADD', UNFINISHED, id)
redis.call('XGROUP', 'CREATE', job_key(id, 'slices'), GROUP, '0', 'MKSTREAM')
announce(id, 'state', cjson.encode({to = 'queued', reason = 'created'}))
redis.call('PUBLISH', WAKE_MONITORS, id)
return {'created', id}
