-- The slices of a job: their holders, and the ends of their tries.

-- The ledger's record of a slice; false without one.
function Slice.record(id, index)
  local entry = redis.call('HGET', job_key(id, 'ledger'), index)
  return entry and cjson.decode(cjson.decode(entry).record or '{}')
end

-- The seeds of a committed slice, as text.
function Slice.seeds(record) return string.format('%.0f-%.0f', record.first_seed, record.last_seed) end

-- The round of a slice as JSON, if an image has decided it; false for a slice of the whole film.
function Slice.round(id, index)
  return redis.call('ZREVRANGEBYSCORE', job_key(id, 'rounds'), index, '-inf', 'LIMIT', 0, 1)[1] or false
end

-- The samples of a slice.
function Slice.samples(id, index, spp, width, height)
  local round = Slice.round(id, index)
  if not round then return spp * width * height end
  round = cjson.decode(round)
  return round.spp * round.pixels
end

-- Add to the samples in the ledger, whose sum a job by zones has.
function Slice.count_samples(id, samples)
  if redis.call('HEXISTS', job_key(id), 'by_zones') == 1 then
    redis.call('HINCRBY', job_key(id), 'committed_samples', string.format('%.0f', samples))
  end
end

-- The entry of the job's stream among those that workers hold, or nil.
function Slice.pending(id, entry)
  return redis.call('XPENDING', job_key(id, 'slices'), GROUP, entry, entry, 1)[1]
end

-- The slice of this entry needs no worker any more.
function Slice.drop(id, entry)
  if redis.call('XACK', job_key(id, 'slices'), GROUP, entry) == 1 then
    redis.call('HINCRBY', job_key(id), 'leased', -1)
    changed[id] = true
  end
  redis.call('ZREM', LEASES, id .. ' ' .. entry)
  if redis.call('ZREM', job_key(id, 'lost'), entry) == 1 then changed[id] = true end
  redis.call('XDEL', job_key(id, 'slices'), entry)
end

-- A worker has this slice of the job from now on, by an entry of its stream. Noted are the time, how long
-- the worker had its last slice (0 without one), the entry, and that of a second try if there is one.
function Slice.note_holder(id, index, entry, worker)
  local noted = redis.call('HGET', job_key(id, 'leases'), index) or ''
  local first, second = string.match(noted, '^%S+ %S+ (%S+) ?(%S*)$')
  if entry == second then return end
  local pace = redis.call('HGET', job_key(id, 'paces'), worker) or '0'
  local other = entry == first and second ~= '' and ' ' .. second or ''
  redis.call('HSET', job_key(id, 'leases'), index, now() .. ' ' .. pace .. ' ' .. entry .. other)
end

-- No living worker has the slice by this entry. A second try continues.
local function forget_holder(id, index, entry)
  local noted = redis.call('HGET', job_key(id, 'leases'), index) or ''
  if string.match(noted, '^%S+ %S+ (%S+)$') == entry then redis.call('HDEL', job_key(id, 'leases'), index) end
end

-- A worker has an entry of the job's stream from now on, or renews it.
function Slice.note_lease(id, entry)
  redis.call('ZADD', LEASES, now(), id .. ' ' .. entry)
  if redis.call('ZREM', job_key(id, 'lost'), entry) == 1 then changed[id] = true end
end

-- No living worker has the entry any more: the next may take it, the job's lowest slice first.
function Slice.note_lost(id, entry)
  redis.call('ZREM', LEASES, id .. ' ' .. entry)
  local found = redis.call('XRANGE', job_key(id, 'slices'), entry, entry)[1]
  if found then
    redis.call('ZADD', job_key(id, 'lost'), found[2][2], entry)
    forget_holder(id, found[2][2], entry)
    -- A worker that has rendered nothing does not bind the others to its variant.
    local holders = redis.call('XPENDING', job_key(id, 'slices'), GROUP)[4]
    local done = redis.call('HMGET', job_key(id), 'committed', 'points')
    if #holders == 1 and done[1] == '0' and done[2] == '0' then redis.call('HDEL', job_key(id), 'variant') end
    changed[id], has_more[id] = true, true
  else  -- pending and yet not in the stream, as Redis 6.2 may leave one
    Slice.drop(id, entry)
  end
end

-- Does this worker hold the lease on this entry of the job's stream?
function Slice.holds(id, entry, worker)
  if redis.call('EXISTS', job_key(id, 'slices')) == 0 then return false end
  local pending = Slice.pending(id, entry)
  return pending ~= nil and pending[2] == worker, pending and pending[4]
end

-- Was the whole farm silent until a moment ago, since Redis was away or cut off? Leases ran out that nobody
-- could renew, so for the length of a lease none is taken from its worker.
function Slice.is_farm_silent(lease_ms)
  local heard, spared_till = unpack(redis.call('HMGET', HEARD, 'at', 'spared_till'))
  if spared_till and now() - spared_till < 0 then return true end
  if not heard or now() - heard <= lease_ms / 2 then return false end
  redis.call('HSET', HEARD, 'spared_till', string.format('%.3f', now() + lease_ms))
  return true
end

-- Put a leased slice back: nobody holds it, and the next worker may take it at once.
function Slice.put_back(id, entry, tries)
  redis.call('XCLAIM', job_key(id, 'slices'), GROUP, 'nobody', 0, entry,
             'IDLE', 86400000, 'RETRYCOUNT', tries, 'JUSTID')
  Slice.note_lost(id, entry)
end

-- Note in the job's log how a try of a slice ended. Commits without output are not noted: the ledger has
-- them, and `commit` counts them.
function Slice.note_try(id, index, worker, what, cause, ms, said)
  local lost = what == 'died' and ms == ''  -- with its worker, so that its time is unknown
  if what ~= 'committed' then count('tries ' .. (lost and 'lost' or what)) end
  redis.call('XADD', job_key(id, 'log'), 'MAXLEN', '~', 2000, '*', 'at', now(), 'slice', index,
             'worker', worker, 'what', what, 'cause', head(cause, 1024), 'ms', ms,
             'text', tail(said, 4096))
end

-- Note a try of a slice that came after the commit of another.
function Slice.note_outrun(it)
  redis.call('HDEL', job_key(it.job, 'outrun'), it.entry)
  Job.spend(it)
  redis.call('HINCRBY', job_key(it.job), 'wasted_ms', it.machine_ms)
  local cause = 'another try was committed before'
  Slice.note_try(it.job, it.index, it.worker, 'duplicate', cause, it.machine_ms, it.said)
end

-- The same, if this try is not noted yet.
function Slice.note_if_outrun(it)
  if redis.call('HEXISTS', job_key(it.job, 'outrun'), it.entry) == 1 then Slice.note_outrun(it) end
end

-- A slice is late that takes twice the usual time from its lease on: the median of the job's last commits.
-- Below half a second differences are chance.
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

-- A slice has entered the ledger by this entry: another worker that tries it is told to stop.
function Slice.settle(id, index, entry, worker)
  local noted = redis.call('HGET', job_key(id, 'leases'), index) or ''
  local since, first, second = string.match(noted, '^(%S+) %S+ (%S+) ?(%S*)$')
  redis.call('HDEL', job_key(id, 'leases'), index)
  if entry == first then note_pace(id, worker, now() - since) end
  if entry == second then note_pace(id, worker, now() - string.match(entry, '^%d+')) end
  for _, other in ipairs({first, second ~= '' and second or nil}) do
    if other ~= entry then
      if redis.call('ZSCORE', LEASES, id .. ' ' .. other) then
        local held = Slice.pending(id, other)
        local started = other == first and since or string.match(other, '^%d+')
        local pace = math.max(redis.call('HGET', job_key(id, 'paces'), held[2]) or 0, now() - started)
        redis.call('HSET', job_key(id, 'paces'), held[2], string.format('%.0f', pace))
        redis.call('HSET', job_key(id, 'outrun'), other, worker)
        redis.call('PUBLISH', WAKE_WORKERS, 'ended ' .. id .. ' ' .. other)
      end
      Slice.drop(id, other)
    end
  end
  Slice.drop(id, entry)
  local prefix = redis.call('HGET', job_key(id), 'prefix')
  local committed = redis.call('HLEN', job_key(id, 'ledger'))
  prefix = prefix and string.match(prefix, '^%d+$') and tonumber(prefix) or 0
  if prefix > committed then prefix = 0 end
  while prefix < committed and redis.call('HEXISTS', job_key(id, 'ledger'), prefix) == 1 do prefix = prefix + 1 end
  redis.call('HSET', job_key(id), 'prefix', prefix)
  changed[id] = true
end

-- Note why a worker died on a slice; returns all causes so far. For a lost worker, `ms` and `said` are nil.
function Slice.note_death(id, index, worker, cause, ms, said)
  local causes = cjson.decode(redis.call('HGET', job_key(id, 'deaths'), index) or '[]')
  causes[#causes + 1] = cause
  redis.call('HSET', job_key(id, 'deaths'), index, cjson.encode(causes))
  Outbox.announce(id, 'trouble', {index = tonumber(index), worker = worker, cause = cause})
  Slice.note_try(id, index, worker, 'died', cause, ms or '', said or '')
  return causes
end

-- A worker seems to be lost with a slice; it may only be cut off.
function Slice.note_lost_worker(id, index, worker)
  local cause = 'worker ' .. worker .. ' was lost'
  if redis.call('EXISTS', worker_key(worker)) == 1 then
    local blamed = redis.call('HGET', worker_key(worker), 'blamed') or ''
    redis.call('HSET', worker_key(worker), 'blamed', blamed .. id .. ' ' .. index .. ' ')
  end
  return Slice.note_death(id, index, worker, cause)
end

-- How often a slice is forgiven the loss of its worker: one that brings whole machines to a halt for a
-- while must not do so for ever.
local MOST_FORGIVEN = 10

-- A worker has sent a heartbeat again, so it has not died of the slices with which it was lost.
function Slice.forgive(worker)
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
      put(deaths, index, left[1] and cjson.encode(left))
    end
  end
end

function Slice.poison(id, index, causes)
  local why = 'slice %s failed %d times; each time the process that rendered it ended: %s'
  local known, different = {}, {}
  for _, cause in ipairs(causes) do
    if not known[cause] then different[#different + 1] = cause end
    known[cause] = true
  end
  Job.end_with(id, 'failed', 'deaths', string.format(why, index, #causes, table.concat(different, '; ')), index)
end
