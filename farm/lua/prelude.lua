-- Shared by every script; farm/scripts.py puts the key names and the table of moves before it.

-- Milliseconds by Redis's clock, to the microsecond, so that no two steps have the same time; as
-- text, since Lua would print 1.7e+12.
local function now()
  local time = redis.call('TIME')
  return string.format('%.3f', time[1] * 1000 + time[2] / 1000)
end

-- Count something of the whole farm; see farm/totals.py.
local function count(total, more)
  redis.call('HINCRBY', TOTALS, total, string.format('%.0f', more or 1))
end

-- A render child has spent so long on the job.
local function spend(id, ms)
  redis.call('HINCRBY', job_key(id), 'machine_ms', ms)
  count('machine ms', ms)
end

-- What webhooks may want to be told when the script is done: job, event, job, event, …
local happened = {}

local function announce(id, type, data)
  redis.call('XADD', job_key(id, 'events'), '*', 'type', type, 'at', now(), 'data', data)
  local event = type == 'state' and cjson.decode(data).to or type == 'finished' and type
  if event then
    happened[#happened + 1] = id
    happened[#happened + 1] = event
  end
end

-- For how long the job's clock has stood still (ms), the pause that lasts included.
local function paused_ms(id)
  local paused = redis.call('HMGET', job_key(id), 'paused_ms', 'paused_at')
  local lasts = paused[2] and math.max(0, now() - paused[2]) or 0
  return string.format('%.0f', (paused[1] or 0) + lasts)
end

-- Move a job along the table. Returns true, or false and the state that forbids it.
local function move(id, target, reason)
  local state = redis.call('HGET', job_key(id), 'state')
  if not state then return false, 'missing' end
  if not MOVES[state][target] then return false, state end
  if state == 'paused' then
    redis.call('HSET', job_key(id), 'paused_ms', paused_ms(id))
    redis.call('HDEL', job_key(id), 'paused_at')
  elseif target == 'paused' then
    redis.call('HSET', job_key(id), 'paused_at', now())
  end
  redis.call('HSET', job_key(id), 'state', target, 'reason', reason)
  redis.call('ZREM', in_state_key(state), id)
  redis.call('ZADD', in_state_key(target), redis.call('HGET', job_key(id), 'number'), id)
  changed[id] = true
  announce(id, 'state', cjson.encode({from = state, to = target, reason = reason}))
  return true, state
end

-- The API key that a new job with these fields and values belongs to: its id and what is known of it.
local function owner_among(...)
  local fields = {...}
  for i = 1, #fields, 2 do
    if fields[i] == 'owner' and fields[i + 1] ~= '' then
      return fields[i + 1], cjson.decode(redis.call('HGET', API_KEYS, fields[i + 1]) or '{}')
    end
  end
end

-- How many open jobs the owner has and how many it may have, where so many more would be too many.
local function too_many_jobs(more, ...)
  local owner, key = owner_among(...)
  local most = owner and key.limits and tonumber(key.limits.open_jobs)  -- null is no number
  if not most then return nil end
  local open = redis.call('SCARD', api_key_key(owner, 'open'))
  if open + more > most then return open, most end
end

-- Whether a request with this idempotency key was there before: 'repeated' or, where it was another,
-- 'conflict', and the id that it was answered with. '' is no key.
local function made_before(idempotency, digest)
  local known = idempotency ~= '' and redis.call('GET', PREFIX .. 'idempotency:' .. idempotency)
  if not known then return nil end
  known = cjson.decode(known)
  return known.digest == digest and 'repeated' or 'conflict', known.id
end

local function remember_request(idempotency, digest, id)
  if idempotency == '' then return end
  redis.call('SET', PREFIX .. 'idempotency:' .. idempotency,
             cjson.encode({id = id, digest = digest}), 'EX', 86400)
end

-- Would a job join a guarded batch with whose newest job it was not compared? `guarded` is '1' where
-- the job itself guards the batch, `compared` the number of the newest job that it was compared with.
local function joins_unseen(batch, guarded, compared)
  if batch == '' then return false end
  if guarded ~= '1' and redis.call('SISMEMBER', GUARDED, batch) == 0 then return false end
  return (redis.call('ZSCORE', BATCHES, batch) or '') ~= compared
end

-- A new job, queued; what follows `reason` are fields and values of its hash.
local function new_job(id, priority, reason, ...)
  local number = redis.call('INCR', PREFIX .. 'created')
  redis.call('HSET', job_key(id), 'id', id, 'state', 'queued', 'reason', 'waiting for a worker',
             'created_at', now(), 'number', number, ...)
  redis.call('ZADD', JOBS, number, id)
  redis.call('ZADD', in_state_key('queued'), number, id)
  local batch = redis.call('HMGET', job_key(id), 'batch', 'guards')
  if batch[1] and batch[1] ~= '' then
    redis.call('ZADD', batch_key(batch[1]), number, id)
    redis.call('ZADD', BATCHES, number, batch[1])
    if batch[2] == '1' then redis.call('SADD', GUARDED, batch[1]) end
  end
  redis.call('ZADD', OPEN, priority, id)
  redis.call('SADD', UNFINISHED, id)
  local owner, key = owner_among(...)
  if owner then
    redis.call('HSET', job_key(id), 'owner_name', key.name or '')
    redis.call('SADD', api_key_key(owner, 'open'), id)
    redis.call('ZADD', api_key_key(owner, 'jobs'), number, id)
  end
  redis.call('XGROUP', 'CREATE', job_key(id, 'slices'), GROUP, '0', 'MKSTREAM')
  announce(id, 'state', cjson.encode({to = 'queued', reason = reason}))
  redis.call('PUBLISH', WAKE_MONITORS, id)
end

-- Can anything still happen to the job?
local function is_open(id)
  local state = redis.call('HGET', job_key(id), 'state')
  return state and MOVES[state]['cancelled'] or false
end

-- Count the samples that a job which has converged did not need of its cap. One that goes on with
-- another's adds nothing: that one was counted.
local function count_saved(id)
  local job = redis.call('HMGET', job_key(id), 'spec', 'spp', 'width', 'height', 'continues')
  if not job[3] or not job[4] or job[5] then return end
  count('samples saved', (cjson.decode(job[1]).max_spp - job[2]) * job[3] * job[4])
end

-- The slice of this entry needs nobody any more.
local function drop_entry(id, entry)
  if redis.call('XACK', job_key(id, 'slices'), GROUP, entry) == 1 then
    redis.call('HINCRBY', job_key(id), 'leased', -1)
    changed[id] = true
  end
  redis.call('ZREM', LEASES, id .. ' ' .. entry)
  if redis.call('ZREM', job_key(id, 'lost'), entry) == 1 then changed[id] = true end
  redis.call('XDEL', job_key(id, 'slices'), entry)
end

-- A worker has an entry of the job's stream from now on, or renews it.
local function note_lease(id, entry)
  redis.call('ZADD', LEASES, now(), id .. ' ' .. entry)
  if redis.call('ZREM', job_key(id, 'lost'), entry) == 1 then changed[id] = true end
end

-- Nobody has it any more who lives: the next worker may take it, the job's lowest slice first.
local function note_lost(id, entry)
  redis.call('ZREM', LEASES, id .. ' ' .. entry)
  local found = redis.call('XRANGE', job_key(id, 'slices'), entry, entry)[1]
  if found then
    redis.call('ZADD', job_key(id, 'lost'), found[2][2], entry)
    changed[id], has_more[id] = true, true
  else  -- it is pending and yet not in the stream, as Redis 6.2 can leave one
    drop_entry(id, entry)
  end
end

-- Nothing of the job is leased any more, nor will be.
local function withdraw(id)
  if redis.call('EXISTS', job_key(id, 'slices')) == 1 then
    for _, lease in ipairs(redis.call('XPENDING', job_key(id, 'slices'), GROUP, '-', '+', 1e6)) do
      redis.call('ZREM', LEASES, id .. ' ' .. lease[1])
    end
  end
  redis.call('DEL', job_key(id, 'slices'), job_key(id, 'lost'))
  redis.call('HSET', job_key(id), 'ready', 0, 'leased', 0)
end

-- Move a job to an end: what is not committed is withdrawn, and everyone is told.
local function end_job(id, target, reason)
  local moved, state = move(id, target, reason)
  if not moved then return false, state end
  count('ended ' .. target)
  if target == 'converged' then count_saved(id) end
  redis.call('HSET', job_key(id), 'ended_at', now())
  withdraw(id)
  redis.call('DEL', job_key(id, 'deaths'), job_key(id, 'spoiled'))
  redis.call('ZREM', OPEN, id)
  local owner = redis.call('HGET', job_key(id), 'owner')
  if owner and owner ~= '' then redis.call('SREM', api_key_key(owner, 'open'), id) end
  redis.call('PUBLISH', WAKE_WORKERS, 'ended ' .. id)
  redis.call('PUBLISH', WAKE_MONITORS, id)
  return true, state
end

-- Does this worker hold the lease on this entry of the job's stream?
local function holds(id, entry, worker)
  if redis.call('EXISTS', job_key(id, 'slices')) == 0 then return false end
  local pending = redis.call('XPENDING', job_key(id, 'slices'), GROUP, entry, entry, 1)
  return pending[1] ~= nil and pending[1][2] == worker, pending[1] and pending[1][4]
end

-- Has the farm as a whole fallen silent a moment ago: was Redis away, or cut off? Leases ran out
-- meanwhile that nobody could renew, so for the length of a lease none is taken from its worker.
local function is_silent(lease_ms)
  if redis.call('EXISTS', GRACE) == 1 then return true end
  local heard = redis.call('GET', HEARD)
  if not heard or now() - heard <= lease_ms / 2 then return false end
  redis.call('SET', GRACE, '1', 'PX', lease_ms)
  return true
end

-- Put a leased slice back: nobody holds it, and the next worker may take it at once.
local function put_back(id, entry, tries)
  redis.call('XCLAIM', job_key(id, 'slices'), GROUP, 'nobody', 0, entry,
             'IDLE', 86400000, 'RETRYCOUNT', tries, 'JUSTID')
  note_lost(id, entry)
end

-- The start or the end of a text in so many bytes, without half a character of UTF-8.
local function head(text, most)
  if #text <= most then return text end
  return (string.gsub(string.sub(text, 1, most), '[\192-\255][\128-\191]*$', ''))
end
local function tail(text, most)
  if #text <= most then return text end
  return (string.gsub(string.sub(text, -most), '^[\128-\191]+', ''))
end

-- Note in the job's log how a try of a slice ended. The silent ones that were committed are not
-- noted: the ledger has them, and their commit counts them.
local function note_try(id, index, worker, what, cause, ms, said)
  local lost = what == 'died' and ms == ''  -- with its worker, so that nobody knows how long it took
  if what ~= 'committed' then count('tries ' .. (lost and 'lost' or what)) end
  redis.call('XADD', job_key(id, 'log'), 'MAXLEN', '~', 2000, '*', 'at', now(), 'slice', index,
             'worker', worker, 'what', what, 'cause', head(cause, 1024), 'ms', ms,
             'text', tail(said, 4096))
end

-- Note why a worker died on a slice; returns all causes so far. Of one that was lost nothing else is
-- known.
local function note_death(id, index, worker, cause, ms, said)
  local causes = cjson.decode(redis.call('HGET', job_key(id, 'deaths'), index) or '[]')
  causes[#causes + 1] = cause
  redis.call('HSET', job_key(id, 'deaths'), index, cjson.encode(causes))
  announce(id, 'trouble', cjson.encode({index = tonumber(index), worker = worker, cause = cause}))
  note_try(id, index, worker, 'died', cause, ms or '', said or '')
  return causes
end

local function poison(id, index, causes)
  end_job(id, 'failed', string.format('slice %s was given to %d workers and none survived it: %s',
                                      index, #causes, table.concat(causes, '; ')))
end

-- Is this the token of the monitor that owns the job?
local function owned(id, token)
  return redis.call('GET', job_key(id, 'owner')) == token
end
