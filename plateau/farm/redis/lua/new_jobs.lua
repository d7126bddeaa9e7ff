-- New jobs: their limits, and their records.

-- A refusal where a new job with these fields has one more need than open jobs may have. A lease may look
-- at each need.
function New.needs_too_much(fields)
  if redis.call('HEXISTS', NEEDS, fields.need or DEFAULT_POOL) == 1 then return nil end
  local needs = redis.call('HLEN', NEEDS)
  if needs >= MOST_NEEDS then return {outcome = 'too varied', has = needs} end
end

-- The API key that owns a new job with these fields: its id and its record.
local function owner_among(fields)
  if (fields.owner or '') == '' then return nil end
  return fields.owner, cjson.decode(redis.call('HGET', API_KEYS, fields.owner) or '{}')
end

-- A refusal where `more` jobs would be too many for the owner.
function New.too_many_jobs(more, fields)
  local owner, key = owner_among(fields)
  local most = owner and key.limits and tonumber(key.limits.open_jobs)  -- null is no number
  if not most then return nil end
  local open = redis.call('SCARD', api_key_key(owner, 'open'))
  if open + more > most then return {outcome = 'too many', has = open, most = most} end
end

-- The answer to an earlier request with this idempotency key: 'repeated', or 'conflict' where that was a
-- different request, and its job. '' is no key, and a key whose job was forgotten is new.
function New.made_before(idempotency, digest)
  local known = idempotency ~= '' and redis.call('GET', PREFIX .. 'idempotency:' .. idempotency)
  if not known then return nil end
  known = cjson.decode(known)
  if redis.call('EXISTS', job_key(known.id)) == 0 then return nil end
  return {outcome = known.digest == digest and 'repeated' or 'conflict', job = known.id}
end

function New.remember_request(idempotency, digest, id)
  if idempotency == '' then return end
  redis.call('SET', PREFIX .. 'idempotency:' .. idempotency,
             cjson.encode({id = id, digest = digest}), 'EX', 86400)
end

-- A new job, queued, with its id and the fields of its two hashes.
function New.job(job, priority, reason)
  local id, number = job.id, redis.call('HINCRBY', STORE, 'created', 1)
  redis.call('HSET', job_key(id), 'id', id, 'state', 'queued', 'reason', 'waiting for a worker',
             'created_at', now(), 'number', number)
  for field, value in pairs(job.fields) do redis.call('HSET', job_key(id), field, value) end
  for field, value in pairs(job.sealed) do redis.call('HSET', job_key(id, 'sealed'), field, value) end
  redis.call('HDEL', job_key(id), 'owner')  -- it is sealed, since workers may write this hash
  redis.call('ZADD', JOBS, number, id)
  redis.call('ZADD', in_state_key('queued'), number, id)
  Job.join_batch(id)
  redis.call('ZADD', OPEN, priority, id)
  redis.call('SADD', UNFINISHED, id)
  redis.call('HINCRBY', NEEDS, redis.call('HGET', job_key(id), 'need') or DEFAULT_POOL, 1)
  local owner, key = owner_among(job.fields)
  if owner then
    redis.call('HSET', job_key(id, 'sealed'), 'owner', owner, 'owner_name', key.name or '')
    redis.call('HSET', job_key(id), 'party', owner)  -- in whose share of the workers the job counts
    redis.call('SADD', api_key_key(owner, 'open'), id)
    redis.call('ZADD', api_key_key(owner, 'jobs'), number, id)
  end
  redis.call('XGROUP', 'CREATE', job_key(id, 'slices'), GROUP, '0', 'MKSTREAM')
  Outbox.announce(id, 'state', {to = 'queued', reason = reason})
  redis.call('PUBLISH', WAKE_MONITORS, id)
end
