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
new_job(id, priority, 'created', unpack(ARGV, 5))
return {'created', id}
