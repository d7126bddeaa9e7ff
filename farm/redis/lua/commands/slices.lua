-- Record a rendered slice: it enters the ledger once, its stream entry is acknowledged, and the
-- monitor is told. Slices are pure, so the first commit wins, whoever holds the lease by now.
-- ARGV: job, entry, worker, index, record (JSON object), first seed, last seed, machine ms,
--       width, height, notes (JSON), variant, what the render child printed
-- Returns 'committed' (also where this very record is in the ledger), 'duplicate' (where another
-- is), 'ended', 'overlap' or 'stale' (the job is rendered with another variant by now).
for_workers.commit = function(ARGV)
  local id, entry, worker, index, record = ARGV[1], ARGV[2], ARGV[3], ARGV[4], ARGV[5]
  local first, last, machine_ms, said = ARGV[6], ARGV[7], ARGV[8], ARGV[13]
  local job, blob = job_key(id), cjson.decode(record).blob
  -- A commit that does not count, and is repeated since the answer was lost, took its time once.
  local function is_repeated() return not redis.call('SET', told_key(blob), '1', 'PX', 3600000, 'NX') end
  if redis.call('EXISTS', job) == 0 then return 'ended' end
  local known = redis.call('HGET', job_key(id, 'ledger'), index)
  if known then
    Slice.drop(id, entry)
    if cjson.decode(known).blob == blob then return 'committed' end
    if not is_repeated() then Slice.note_outrun(id, entry, index, worker, machine_ms, said) end
    return 'duplicate'
  end
  if not Job.is_open(id) then
    if not is_repeated() then
      Job.spend(id, machine_ms)
      count('tries late')
    end
    return 'ended'
  end
  if redis.call('HGET', job, 'variant') ~= ARGV[12] then
    if not is_repeated() then
      Job.spend(id, machine_ms)
      Slice.note_try(id, index, worker, 'stale', 'others render with another variant by now', machine_ms, said)
    end
    return 'stale'
  end
  local seeds = job_key(id, 'seeds')
  local below = redis.call('ZREVRANGEBYSCORE', seeds, last, '-inf', 'LIMIT', 0, 1)[1]
  if below and tonumber(string.match(below, '-(%d+)$')) >= tonumber(first) then
    if not is_repeated() then Job.spend(id, machine_ms) end
    return 'overlap'
  end

  Job.spend(id, machine_ms)
  redis.call('ZADD', seeds, first, first .. '-' .. last)
  redis.call('HSET', job_key(id, 'ledger'), index, '{"at":' .. now() .. ',' .. string.sub(record, 2))
  Slice.settle(id, index, entry, worker)
  redis.call('HDEL', job_key(id, 'deaths'), index, index .. ' forgiven')
  redis.call('HSETNX', job, 'width', ARGV[9])
  redis.call('HSETNX', job, 'height', ARGV[10])
  redis.call('HSETNX', job, 'notes', ARGV[11])
  redis.call('HINCRBY', job, 'committed', 1)
  count('tries committed')
  count('samples', cjson.decode(record).spp * ARGV[9] * ARGV[10])
  if said ~= '' then Slice.note_try(id, index, worker, 'committed', '', machine_ms, said) end
  Outbox.announce(id, 'slice', cjson.encode({index = tonumber(index), worker = worker}))
  redis.call('PUBLISH', WAKE_MONITORS, id)
  return 'committed'
end

-- A worker has the first pass of a job's first slice: something to see, long before the slice.
-- ARGV: job, entry, worker, blob
-- Returns 'noted', 'lost' (the slice is another's) or 'late' (there is an image, or none is wanted).
for_workers.glimpse = function(ARGV)
  local id, entry, worker, blob = ARGV[1], ARGV[2], ARGV[3], ARGV[4]
  if not Slice.holds(id, entry, worker) then return 'lost' end
  if not Job.is_open(id) or Job.has_image(id) then return 'late' end
  redis.call('HSET', job_key(id), 'glimpse', blob)
  redis.call('PUBLISH', WAKE_MONITORS, id)
  return 'noted'
end

-- A render child died on a slice. The slice goes back, or the job is poisoned.
-- ARGV: job, entry, worker, index, cause, most tries, machine ms, what it printed
-- Returns 'put back', 'poisoned' or 'lost'.
for_workers.died = function(ARGV)
  local id, entry, worker, index, cause = ARGV[1], ARGV[2], ARGV[3], ARGV[4], ARGV[5]
  local held, tries = Slice.holds(id, entry, worker)
  if not held then
    Slice.note_if_outrun(id, entry, index, worker, ARGV[7], ARGV[8])
    return 'lost'
  end
  Job.spend(id, ARGV[7])
  local causes = Slice.note_death(id, index, worker, cause, ARGV[7], ARGV[8])
  if #causes >= tonumber(ARGV[6]) then
    Slice.poison(id, index, causes)
    return 'poisoned'
  end
  Slice.put_back(id, entry, tries)
  return 'put back'
end

-- A worker that drains, is cut off from what it needs, or cannot render, gives its slice back
-- unharmed.
-- ARGV: job, entry, worker, machine ms, index, 'handed-back' or 'unfit', cause, what the render
--       child printed
-- Returns 'put back' or 'lost'.
for_workers.hand_back = function(ARGV)
  local id, entry, worker = ARGV[1], ARGV[2], ARGV[3]
  local held, tries = Slice.holds(id, entry, worker)
  if not held then
    Slice.note_if_outrun(id, entry, ARGV[5], worker, ARGV[4], ARGV[8])
    return 'lost'
  end
  Job.spend(id, ARGV[4])
  Slice.put_back(id, entry, tries - 1)
  Slice.note_try(id, ARGV[5], worker, ARGV[6], ARGV[7], ARGV[4], ARGV[8])
  -- A worker that could render nothing does not bind the others to its variant.
  local holders = redis.call('XPENDING', job_key(id, 'slices'), GROUP)[4]
  local done = redis.call('HMGET', job_key(id), 'committed', 'points')
  if #holders == 1 and done[1] == '0' and done[2] == '0' then
    redis.call('HDEL', job_key(id), 'variant')
  end
  return 'put back'
end

-- The scene itself is at fault, says the worker that holds the lease: the job fails, no retry.
-- ARGV: job, entry, worker, reason, index, machine ms, what the render child printed
-- Returns 'failed' or 'lost'.
for_workers.fail = function(ARGV)
  if not Slice.holds(ARGV[1], ARGV[2], ARGV[3]) then return 'lost' end
  Slice.note_try(ARGV[1], ARGV[5], ARGV[3], 'failed', ARGV[4], ARGV[6], ARGV[7])
  Job.end_with(ARGV[1], 'failed', ARGV[4])
  return 'failed'
end
