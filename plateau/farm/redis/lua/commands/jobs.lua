-- Create a job, or many of one batch: all or none, and once for each idempotency key.
-- Returns 'created', 'repeated' or 'conflict', each with the first job; 'too varied' with the number of
-- different needs of open jobs; 'too many' with the owner's open jobs, and the most that it may have; or
-- 'cannot follow' with one that they were to wait for, and how it stands.
function for_farm.create(it)
  local first = it.jobs[1]
  local made = New.made_before(it.idempotency, it.digest)
  if made then return made end
  local refused = New.too_many_jobs(#it.jobs, first.fields) or New.needs_too_much(first.fields)
  if refused then return refused end
  local gates, unmet = After.gates(it.after)
  if unmet then return unmet end
  New.remember_request(it.idempotency, it.digest, first.id)
  for _, job in ipairs(it.jobs) do
    New.job(job, it.priority, 'created')
    After.wait(job.id, gates)
  end
  if first.fields.shot then
    local frames = {}
    for place, job in ipairs(it.jobs) do frames[place] = job.id end
    redis.call('HSET', job_key(first.id, 'shot'), 'frames', cjson.encode(frames), 'looks', 0)
  end
  return {outcome = 'created', job = first.id}
end

-- Continue a finished job as a new one, which takes over its first slices and is rendering at once.
-- Returns as `create` does, 'missing' (there is no old job), or 'changed' where the old one has lost these
-- slices, or these sums.
for_farm['continue'] = function(it)
  local id, old, slices, checkpoint = it.job.id, it.old, it.slices, it.checkpoint
  local made = New.made_before(it.idempotency, it.digest)
  if made then return made end
  local before = redis.call('HMGET', job_key(old), 'finished_at', 'checkpoint', 'variant', 'width',
                            'height', 'notes', 'results', 'spp')
  if redis.call('EXISTS', job_key(old)) == 0 then return {outcome = 'missing'} end
  if not before[1] or checkpoint ~= '' and before[2] ~= checkpoint then return {outcome = 'changed'} end
  for index = 0, slices - 1 do
    if redis.call('HEXISTS', job_key(old, 'ledger'), index) == 0 then return {outcome = 'changed'} end
  end
  local refused = New.too_many_jobs(1, it.job.fields) or New.needs_too_much(it.job.fields)
  if refused then return refused end

  New.remember_request(it.idempotency, it.digest, id)
  New.job(it.job, it.priority, 'goes on with job ' .. old)
  redis.call('HINCRBY', job_key(old), 'continued', 1)
  redis.call('HSET', job_key(id), 'continues', old, 'continued_spp', it.judged_spp, 'variant', before[3],
             'width', before[4], 'height', before[5], 'notes', before[6] or '[]',
             'started_at', now(), 'paused_ms', 0, 'planned', slices, 'issued', slices, 'committed', slices,
             'taken_samples', it.samples)
  Slice.count_samples(id, it.samples)
  for _, one in ipairs(it.rounds) do redis.call('ZADD', job_key(id, 'rounds'), one.first, one.json) end
  for index = 0, slices - 1 do
    redis.call('HSET', job_key(id, 'ledger'), index, redis.call('HGET', job_key(old, 'ledger'), index))
    local record = Slice.record(id, index)
    redis.call('ZADD', job_key(id, 'seeds'), record.first_seed, Slice.seeds(record))
  end
  if checkpoint ~= '' then
    redis.call('HSET', job_key(id), 'checkpoint', checkpoint)
    for _, entry in ipairs(redis.call('XRANGE', job_key(old, 'curve'), '-', it.judged_spp)) do
      local spp, at, point = string.match(entry[1], '^%d+'), entry[2][2], entry[2][4]
      Job.append_point(id, spp, at, point)
    end
    if (before[7] or '') ~= '' then Job.show(id, before[7], before[8]) end
  end
  Job.move(id, 'rendering', 'goes on after ' .. slices .. ' slices of job ' .. old)
  return {outcome = 'created', job = id}
end

-- End a job: by its owner's token, or without one by a user.
-- Returns 'ended', 'fenced' or 'illegal' with the state; ending it twice in the same way is harmless.
for_farm['end'] = function(it)
  local id = it.job
  if it.token and not Job.is_owned(id, it.token) then return {outcome = 'fenced'} end
  local moved, state = Job.end_with(id, it.target, it.ended_by, it.reason)
  if not moved and state ~= it.target then return {outcome = 'illegal', state = state} end
  if moved and it.verdict then redis.call('HSET', job_key(id), 'verdict', it.verdict) end
  if moved and it.results ~= '' then
    Job.show(id, it.results, redis.call('HGET', job_key(id), 'spp'), it.digests)
    redis.call('HSET', job_key(id), 'concluded', 1)
    if it.notes then redis.call('HSET', job_key(id), 'notes', it.notes) end
  end
  return {outcome = 'ended'}
end

-- Pause a job: none of its slices is leased any more; leased ones may still be committed.
-- Returns 'paused' or 'held', also where it was before, or 'illegal' with the state.
function for_farm.pause(it)
  local id, reason = it.job, it.reason
  local moved, state = Job.move(id, 'paused', reason)
  if not moved and state == 'queued' and it.holds_back then
    if redis.call('HSETNX', job_key(id), 'held', 1) == 1 then Job.note_queued(id, reason) end
    return {outcome = 'held'}
  end
  if not moved and state ~= 'paused' then return {outcome = 'illegal', state = state} end
  if moved then redis.call('PUBLISH', WAKE_MONITORS, id) end
  return {outcome = 'paused'}
end

-- Resume a paused job, or release one that is held back.
-- Returns 'rendering', also where it was before; 'queued' where it was held back; or 'illegal' with the
-- state: a queued job starts by a lease.
function for_farm.resume(it)
  local id, reason = it.job, it.reason
  local state = redis.call('HGET', job_key(id), 'state') or 'missing'
  if state == 'paused' then
    Job.move(id, 'rendering', reason)
    has_more[id] = true
    redis.call('PUBLISH', WAKE_MONITORS, id)
  elseif state == 'queued' and redis.call('HDEL', job_key(id), 'held') == 1 then
    has_more[id] = true
    Job.note_queued(id, reason)
    return {outcome = 'queued'}
  elseif state ~= 'rendering' then
    return {outcome = 'illegal', state = state}
  end
  return {outcome = 'rendering'}
end

-- Change the priority of a job that has not ended; the next lease respects it.
-- Returns 'changed', also where it had this priority before, or 'illegal' with the state.
function for_farm.reprioritise(it)
  local id = it.job
  if not Job.is_open(id) then
    return {outcome = 'illegal', state = redis.call('HGET', job_key(id), 'state') or 'missing'}
  end
  redis.call('ZADD', OPEN, it.priority, id)
  changed[id] = true
  redis.call('HSET', job_key(id), 'priority', it.priority)
  return {outcome = 'changed'}
end
