-- Record a rendered slice: it enters the ledger once, its stream entry is acknowledged, and the monitor is
-- told. Slices are pure, so the first commit wins, whoever holds the lease by now.
-- Returns 'committed' (also where this record is in the ledger already), 'duplicate' (where another is),
-- 'ended', 'overlap' or 'stale' (the job is rendered with another variant by now).
function for_workers.commit(it)
  local id, entry, worker, index, machine_ms, said = it.job, it.entry, it.worker, it.index, it.machine_ms, it.said
  local job, record = job_key(id), cjson.decode(it.record)
  -- A commit that does not count adds its time only once, even if it is repeated after a lost answer.
  local function is_repeated()
    return not redis.call('SET', told_key(record.blob), '1', 'PX', 3600000, 'NX')
  end
  if redis.call('EXISTS', job) == 0 then return 'ended' end
  local known = Slice.record(id, index)
  if known then
    Slice.drop(id, entry)
    if known.blob == record.blob then return 'committed' end
    if not is_repeated() then Slice.note_outrun(it) end
    return 'duplicate'
  end
  if not Job.is_open(id) then
    if not is_repeated() then
      Job.spend(it)
      count('tries late')
    end
    return 'ended'
  end
  redis.call('HSETNX', job, 'variant', it.variant)  -- one that seemed lost before anybody had committed
  if redis.call('HGET', job, 'variant') ~= it.variant then
    if not is_repeated() then
      Job.spend(it)
      Slice.note_try(id, index, worker, 'stale', 'others render with another variant by now', machine_ms, said)
    end
    return 'stale'
  end
  local seeds = job_key(id, 'seeds')
  local below = redis.call('ZREVRANGEBYSCORE', seeds, record.last_seed, '-inf', 'LIMIT', 0, 1)[1]
  if below and tonumber(string.match(below, '-(%d+)$')) >= record.first_seed then
    if not is_repeated() then Job.spend(it) end
    return 'overlap'
  end

  Job.spend(it)
  redis.call('ZADD', seeds, record.first_seed, Slice.seeds(record))
  redis.call('HSET', job_key(id, 'ledger'), index, cjson.encode({at = now(), record = it.record}))
  Slice.settle(id, index, entry, worker)
  redis.call('HDEL', job_key(id, 'deaths'), index, index .. ' forgiven')
  redis.call('HSETNX', job, 'width', it.width)
  redis.call('HSETNX', job, 'height', it.height)
  redis.call('HSETNX', job, 'notes', it.notes)
  redis.call('HINCRBY', job, 'committed', 1)
  count('tries committed')
  local samples = Slice.samples(id, index, record.spp, it.width, it.height)
  count('samples', samples)
  Slice.count_samples(id, samples)
  if said ~= '' then Slice.note_try(id, index, worker, 'committed', '', machine_ms, said) end
  Outbox.announce(id, 'slice', {index = index, worker = worker, samples = samples})
  redis.call('PUBLISH', WAKE_MONITORS, id)
  return 'committed'
end

-- A worker has the first pass of a job's first slice: an image long before the slice.
-- Returns 'noted', 'lost' (the slice is another's) or 'late' (the job has an image, or has ended).
function for_workers.glimpse(it)
  if not Slice.holds(it.job, it.entry, it.worker) then return 'lost' end
  if not Job.is_open(it.job) or Job.has_image(it.job) then return 'late' end
  redis.call('HSET', job_key(it.job), 'glimpse', it.blob)
  redis.call('PUBLISH', WAKE_MONITORS, it.job)
  return 'noted'
end

-- A render child died on a slice. The slice goes back, or the job is poisoned. The worker is left out of the
-- job for a while, if another one that lives can render it.
-- Returns 'put back', 'poisoned' or 'lost'.
function for_workers.died(it)
  local held, tries = Slice.holds(it.job, it.entry, it.worker)
  if not held then
    Slice.note_if_outrun(it)
    return 'lost'
  end
  Job.spend(it)
  local causes = Slice.note_death(it.job, it.index, it.worker, it.cause, it.machine_ms, it.said)
  if #causes >= it.most_tries then
    Slice.poison(it.job, it.index, causes)
    return 'poisoned'
  end
  Slice.put_back(it.job, it.entry, tries)
  if Waiting.is_served_by_another(it.worker, it.job, it.alive_ms) then Waiting.leave_out(it.worker, it.job) end
  return 'put back'
end

-- A worker that drains, cannot reach a store, or cannot render, gives its slice back. Where it cannot render
-- this job, it is left out of it for a while.
-- Returns 'put back' or 'lost'.
function for_workers.hand_back(it)
  local id = it.job
  local held, tries = Slice.holds(id, it.entry, it.worker)
  if not held then
    Slice.note_if_outrun(it)
    return 'lost'
  end
  if it.leaves_out then Waiting.leave_out(it.worker, id) end
  Job.spend(it)
  Slice.put_back(id, it.entry, tries - 1)
  Slice.note_try(id, it.index, it.worker, it.what, it.cause, it.machine_ms, it.said)
  return 'put back'
end

-- The worker that holds the lease finds the scene at fault: the job fails without another try.
-- Returns 'failed' or 'lost'.
function for_workers.fail(it)
  if not Slice.holds(it.job, it.entry, it.worker) then return 'lost' end
  Job.spend(it)
  Slice.note_try(it.job, it.index, it.worker, 'failed', it.reason, it.machine_ms, it.said)
  Job.end_with(it.job, 'failed', 'scene', it.reason, it.index)
  return 'failed'
end
