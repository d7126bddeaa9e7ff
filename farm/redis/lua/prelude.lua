-- Shared by every script; farm/redis/scripts.py puts the key names and the table of moves before it.

-- Milliseconds by Redis's clock, to the microsecond, so that no two steps have the same time; as
-- text, since Lua would print 1.7e+12.
local function now()
  local time = redis.call('TIME')
  return string.format('%.3f', time[1] * 1000 + time[2] / 1000)
end

-- Is there something in a field of decoded JSON?
local function given(value) return value ~= nil and value ~= cjson.null end

-- The kind of a worker that describes itself so; see waiting.lua.
local function kind_of(about)
  return string.format('%s %s %s', about.pool or DEFAULT_POOL, table.concat(about.variants or {}, ','),
                       table.concat(about.tags or {}, ','))
end

-- Count something of the whole farm; see farm/ledger/totals.py.
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

-- Is there an image of the job to be looked at?
local function has_image(id) return (redis.call('HGET', job_key(id), 'results') or '') ~= '' end

-- The job has a set of results, of so many spp: there is an image to be looked at, from the first on.
-- What its bytes are is noted by blob (JSON); with '' the set is one that is shown already, or another
-- job's.
local function show(id, results, spp, digests)
  if not has_image(id) then announce(id, 'image', cjson.encode({spp = tonumber(spp)})) end
  redis.call('HSET', job_key(id), 'results', results)
  if digests == '' then return end
  for _, blob in ipairs(redis.call('HKEYS', job_key(id, 'digests'))) do
    if string.sub(blob, 1, 8) == 'results/' then redis.call('HDEL', job_key(id, 'digests'), blob) end
  end
  for blob, sha256 in pairs(cjson.decode(digests)) do
    redis.call('HSET', job_key(id, 'digests'), blob, sha256)
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

-- Of a new job with these fields and values: how many different needs open jobs have, where there is no
-- room for another. A lease may look at each.
local function needs_too_much(...)
  local fields = {...}
  for i = 1, #fields, 2 do
    if fields[i] == 'need' and redis.call('HEXISTS', NEEDS, fields[i + 1]) == 0 then
      local needs = redis.call('HLEN', NEEDS)
      return needs >= MOST_NEEDS and needs or nil
    end
  end
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
-- 'conflict', and the id that it was answered with. '' is no key, and one whose job was forgotten since
-- is a new one.
local function made_before(idempotency, digest)
  local known = idempotency ~= '' and redis.call('GET', PREFIX .. 'idempotency:' .. idempotency)
  if not known then return nil end
  known = cjson.decode(known)
  if redis.call('EXISTS', job_key(known.id)) == 0 then return nil end
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

-- Where a job's messages go, and what signs them, are no part of the job's hash, which workers may write.
local function seal_webhook(id)
  local hook = redis.call('HMGET', job_key(id), 'webhook_receiver', 'webhook_url', 'webhook_secret')
  if not hook[1] then return end
  redis.call('HSET', job_key(id, 'webhook'), 'receiver', hook[1], 'url', hook[2], 'secret', hook[3])
  redis.call('HDEL', job_key(id), 'webhook_url', 'webhook_secret')
end

-- Whose a job is, is no part of it either. What stays there is in whose share of the workers it counts.
local function seal_owner(id, owner, key)
  redis.call('HDEL', job_key(id), 'owner')
  if not owner then return end
  redis.call('HSET', job_key(id, 'sealed'), 'owner', owner, 'owner_name', key.name or '')
  redis.call('HSET', job_key(id), 'party', owner)
end

-- A new job, queued; what follows `reason` are fields and values of its hash.
local function new_job(id, priority, reason, ...)
  local number = redis.call('INCR', PREFIX .. 'created')
  redis.call('HSET', job_key(id), 'id', id, 'state', 'queued', 'reason', 'waiting for a worker',
             'created_at', now(), 'number', number, ...)
  seal_webhook(id)
  local owner, key = owner_among(...)
  seal_owner(id, owner, key)
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
  redis.call('HINCRBY', NEEDS, redis.call('HGET', job_key(id), 'need') or DEFAULT_POOL, 1)
  if owner then
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

-- Note what a job that converged would have cost otherwise: the samples of its cap, without those that
-- it has or took over. One that was to stop at so many would have cost no more. It is noted here alone:
-- jobs, batches and the whole farm show what this has written.
local function note_saved(id)
  local job = redis.call('HMGET', job_key(id), 'spec', 'spp', 'taken_spp', 'width', 'height')
  local spec = cjson.decode(job[1])
  if spec.rule.name == 'fixed' or not job[4] then return end
  local spp = math.max(0, spec.max_spp - math.max(job[2], job[3] or 0))
  local samples = string.format('%.0f', spp * job[4] * job[5])
  redis.call('HSET', job_key(id), 'samples_saved', samples)
  count('samples saved', samples)
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

-- A worker has this slice of the job from now on, by an entry of its stream. What is noted of it is
-- since when, how long the worker had its last one (0 where it had none), the entry, and that of a
-- second try where there is one.
local function note_holder(id, index, entry, worker)
  local noted = redis.call('HGET', job_key(id, 'leases'), index) or ''
  local first, second = string.match(noted, '^%S+ %S+ (%S+) ?(%S*)$')
  if entry == second then return end
  local pace = redis.call('HGET', job_key(id, 'paces'), worker) or '0'
  local other = entry == first and second ~= '' and ' ' .. second or ''
  redis.call('HSET', job_key(id, 'leases'), index, now() .. ' ' .. pace .. ' ' .. entry .. other)
end

-- Nobody has it now who lives. A second try goes on.
local function forget_holder(id, index, entry)
  local noted = redis.call('HGET', job_key(id, 'leases'), index) or ''
  if string.match(noted, '^%S+ %S+ (%S+)$') == entry then
    redis.call('HDEL', job_key(id, 'leases'), index)
  end
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
    forget_holder(id, found[2][2], entry)
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
  for _, part in ipairs({'slices', 'lost', 'leases', 'paces', 'outrun'}) do
    redis.call('DEL', job_key(id, part))
  end
  redis.call('HSET', job_key(id), 'ready', 0, 'leased', 0)
end

-- Move a job to an end: what is not committed is withdrawn, and everyone is told.
local function end_job(id, target, reason)
  local moved, state = move(id, target, reason)
  if not moved then return false, state end
  count('ended ' .. target)
  if target == 'converged' then note_saved(id) end
  redis.call('HSET', job_key(id), 'ended_at', now())
  withdraw(id)
  redis.call('DEL', job_key(id, 'deaths'), job_key(id, 'spoiled'))
  redis.call('ZREM', OPEN, id)
  local need = redis.call('HGET', job_key(id), 'need') or DEFAULT_POOL
  if redis.call('HINCRBY', NEEDS, need, -1) < 1 then redis.call('HDEL', NEEDS, need) end
  local party = redis.call('HGET', job_key(id), 'party')
  if party then redis.call('SREM', api_key_key(party, 'open'), id) end
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

-- A try of a slice came to nothing, since another was committed before.
local function note_outrun(id, entry, index, worker, ms, said)
  redis.call('HDEL', job_key(id, 'outrun'), entry)
  spend(id, ms)
  redis.call('HINCRBY', job_key(id), 'wasted_ms', ms)
  count('wasted ms', ms)
  note_try(id, index, worker, 'duplicate', 'another try was committed before', ms, said)
end

-- The same, where nobody has said it of this try yet.
local function note_if_outrun(id, entry, ...)
  if redis.call('HEXISTS', job_key(id, 'outrun'), entry) == 1 then note_outrun(id, entry, ...) end
end

-- A slice is late that takes twice as long as is usual: the median of the job's last commits, from the
-- lease on. Below half a second it is chance what takes long.
local LATE_FACTOR, LATE_LEAST_MS, USUAL_OF = 2, 500, 9

-- Note how long a worker had a slice that it has committed.
local function note_pace(id, worker, took_ms)
  redis.call('HSET', job_key(id, 'paces'), worker, string.format('%.0f', took_ms))
  local took = {string.format('%.0f', took_ms)}
  for one in string.gmatch(redis.call('HGET', job_key(id), 'took') or '', '%S+') do
    if #took < USUAL_OF then took[#took + 1] = one end
  end
  local last = table.concat(took, ' ')
  table.sort(took, function(one, other) return tonumber(one) < tonumber(other) end)
  local late_ms = math.max(LATE_LEAST_MS, LATE_FACTOR * took[math.ceil(#took / 2)])
  redis.call('HSET', job_key(id), 'took', last, 'late_ms', string.format('%.0f', late_ms))
end

-- A slice has entered the ledger by this entry: whoever else tries it is told to stop.
local function settle_tries(id, index, entry, worker)
  local noted = redis.call('HGET', job_key(id, 'leases'), index) or ''
  local since, first, second = string.match(noted, '^(%S+) %S+ (%S+) ?(%S*)$')
  redis.call('HDEL', job_key(id, 'leases'), index)
  if entry == first then note_pace(id, worker, now() - since) end
  if entry == second then note_pace(id, worker, now() - string.match(entry, '^%d+')) end
  for _, other in ipairs({first, second ~= '' and second or nil}) do
    if other ~= entry then
      if redis.call('ZSCORE', LEASES, id .. ' ' .. other) then
        local held = redis.call('XPENDING', job_key(id, 'slices'), GROUP, other, other, 1)[1]
        local started = other == first and since or string.match(other, '^%d+')
        local pace = math.max(redis.call('HGET', job_key(id, 'paces'), held[2]) or 0, now() - started)
        redis.call('HSET', job_key(id, 'paces'), held[2], string.format('%.0f', pace))
        redis.call('HSET', job_key(id, 'outrun'), other, worker)
        redis.call('PUBLISH', WAKE_WORKERS, 'ended ' .. id .. ' ' .. other)
      end
      drop_entry(id, other)
    end
  end
  drop_entry(id, entry)
  local prefix, committed = redis.call('HGET', job_key(id), 'prefix'), redis.call('HLEN', job_key(id, 'ledger'))
  prefix = prefix and string.match(prefix, '^%d+$') and tonumber(prefix) or 0
  if prefix > committed then prefix = 0 end
  for index = prefix, committed - 1 do
    if redis.call('HEXISTS', job_key(id, 'ledger'), index) == 0 then break end
    prefix = index + 1
  end
  redis.call('HSET', job_key(id), 'prefix', prefix)
  changed[id] = true
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

-- A worker was lost with a slice, as far as one can tell: it may only be cut off.
local function note_lost_worker(id, index, worker)
  local cause = 'worker ' .. worker .. ' was lost'
  if redis.call('EXISTS', worker_key(worker)) == 1 then
    local blamed = redis.call('HGET', worker_key(worker), 'blamed') or ''
    redis.call('HSET', worker_key(worker), 'blamed', blamed .. id .. ' ' .. index .. ' ')
  end
  return note_death(id, index, worker, cause)
end

-- So often a slice is forgiven that the worker was lost which had it: one that brings its whole
-- machine to a halt, so that nothing is heard of it for a while, shall not do so for ever.
local MOST_FORGIVEN = 10

-- A worker is heard of again, so it has not died of the slices with which it was lost.
local function forgive_worker(worker)
  local blamed = redis.call('HGET', worker_key(worker), 'blamed')
  if not blamed then return end
  redis.call('HDEL', worker_key(worker), 'blamed')
  for id, index in string.gmatch(blamed, '(%S+) (%S+) ') do
    local deaths, forgiven = job_key(id, 'deaths'), index .. ' forgiven'
    local causes, left = cjson.decode(redis.call('HGET', deaths, index) or '[]'), {}
    for _, cause in ipairs(causes) do
      if cause ~= 'worker ' .. worker .. ' was lost' then left[#left + 1] = cause end
    end
    if #left < #causes and redis.call('HINCRBY', deaths, forgiven, 1) <= MOST_FORGIVEN then
      if left[1] then
        redis.call('HSET', deaths, index, cjson.encode(left))
      else
        redis.call('HDEL', deaths, index)
      end
    end
  end
end

local function poison(id, index, causes)
  end_job(id, 'failed', string.format('slice %s failed %d times; each time the process that rendered it ended: %s',
                                      index, #causes, table.concat(causes, '; ')))
end

-- Is this the token of the monitor that owns the job?
local function owned(id, token)
  return redis.call('GET', job_key(id, 'owner')) == token
end
