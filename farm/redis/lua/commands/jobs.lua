-- Create a job, or many of one batch: all or none, and once for each idempotency key.
-- ARGV: idempotency key or '', request digest, priority, batch or '', '1' where all jobs of the batch
--       have to stop alike or '', number of the newest job of the batch with which these were compared
--       or '', how many jobs, then of each: id, field, value, … (as many fields for each)
-- Returns {'created', first id}, {'repeated', first id}, {'conflict', first id}, {'changed'} (the batch
-- is guarded, and these were not compared with its newest job), {'too varied', how many} (open jobs
-- need so many different things of workers already) or, where their owner would have too many open
-- jobs, {'too many', how many it has, how many it may have}.
for_farm.create = function(ARGV)
  local idempotency, digest, priority = ARGV[1], ARGV[2], ARGV[3]
  local batch, guarded, compared, jobs = ARGV[4], ARGV[5], ARGV[6], tonumber(ARGV[7])
  local first, width = 8, (#ARGV - 7) / jobs
  local made, by_then = New.made_before(idempotency, digest)
  if made then return {made, by_then} end
  if New.joins_unseen(batch, guarded, compared) then return {'changed'} end
  local open, most = New.too_many_jobs(jobs, unpack(ARGV, first + 1, first + width - 1))
  if open then return {'too many', open, most} end
  local needs = New.needs_too_much(unpack(ARGV, first + 1, first + width - 1))
  if needs then return {'too varied', needs} end
  New.remember_request(idempotency, digest, ARGV[first])
  for at = first, #ARGV, width do
    New.job(ARGV[at], priority, 'created', unpack(ARGV, at + 1, at + width - 1))
  end
  return {'created', ARGV[first]}
end

-- Go on with a finished job as a new one, which takes over its first slices and is rendering at once.
-- ARGV: new id, old id, idempotency key or '', request digest, slices, checkpoint of their sums
--       (JSON) or '' where the slices are kept, curve's last spp that it takes over, priority, batch,
--       '1' where it guards the batch, number of the batch's newest job with which it was compared,
--       then field, value, … of the new job
-- Returns {'created', id}, {'repeated', id}, {'conflict', id}, {'missing'} (there is no old job),
-- {'changed'} (it has not these slices, or these sums, any more, or the batch has changed),
-- {'too varied', how many} (open jobs need so many different things of workers already) or, where the
-- owner would have too many open jobs, {'too many', how many it has, how many it may have}.
for_farm.continue = function(ARGV)
  local id, old, idempotency, digest = ARGV[1], ARGV[2], ARGV[3], ARGV[4]
  local slices, checkpoint, judged_spp, priority = tonumber(ARGV[5]), ARGV[6], ARGV[7], ARGV[8]
  local batch, guarded, compared, first = ARGV[9], ARGV[10], ARGV[11], 12
  local made, by_then = New.made_before(idempotency, digest)
  if made then return {made, by_then} end
  local before = redis.call('HMGET', job_key(old), 'finished_at', 'checkpoint', 'variant', 'width',
                            'height', 'notes', 'results', 'spp')
  if redis.call('EXISTS', job_key(old)) == 0 then return {'missing'} end
  if not before[1] then return {'changed'} end
  if checkpoint ~= '' and before[2] ~= checkpoint then return {'changed'} end
  for index = 0, slices - 1 do
    if redis.call('HEXISTS', job_key(old, 'ledger'), index) == 0 then return {'changed'} end
  end
  if New.joins_unseen(batch, guarded, compared) then return {'changed'} end
  local open, most = New.too_many_jobs(1, unpack(ARGV, first))
  if open then return {'too many', open, most} end
  local needs = New.needs_too_much(unpack(ARGV, first))
  if needs then return {'too varied', needs} end

  New.remember_request(idempotency, digest, id)
  New.job(id, priority, 'goes on with job ' .. old, unpack(ARGV, first))
  redis.call('HINCRBY', job_key(old), 'continued', 1)
  redis.call('HSET', job_key(id), 'continues', old, 'continued_spp', judged_spp, 'variant', before[3],
             'width', before[4], 'height', before[5], 'notes', before[6] or '[]',
             'started_at', now(), 'paused_ms', 0, 'planned', slices, 'issued', slices, 'committed', slices,
             'taken_spp', slices * redis.call('HGET', job_key(id), 'slice_spp'))
  for index = 0, slices - 1 do
    local text = redis.call('HGET', job_key(old, 'ledger'), index)
    redis.call('HSET', job_key(id, 'ledger'), index, text)
    local record = cjson.decode(text)
    redis.call('ZADD', job_key(id, 'seeds'), string.format('%.0f', record.first_seed),
               string.format('%.0f-%.0f', record.first_seed, record.last_seed))
  end
  if checkpoint ~= '' then
    redis.call('HSET', job_key(id), 'checkpoint', checkpoint)
    for _, entry in ipairs(redis.call('XRANGE', job_key(old, 'curve'), '-', judged_spp)) do
      local spp, point = string.match(entry[1], '^%d+'), entry[2][2]
      redis.call('XADD', job_key(id, 'curve'), entry[1], 'point', point)
      redis.call('HSET', job_key(id), 'latest', point, 'spp', spp, 'latest_paused_ms', 0)
      redis.call('HINCRBY', job_key(id), 'points', 1)
      Outbox.announce(id, 'point', point)
    end
    if (before[7] or '') ~= '' then Job.show(id, before[7], before[8], '') end
  end
  -- Nobody is shown the secret of a webhook, so none can be sent again for the same receiver.
  local hook = redis.call('HMGET', job_key(id, 'webhook'), 'receiver', 'secret')
  local told = redis.call('HMGET', job_key(old, 'webhook'), 'receiver', 'secret')
  if hook[1] and hook[2] == '' and hook[1] == told[1] then
    redis.call('HSET', job_key(id, 'webhook'), 'secret', told[2])
  end
  Job.move(id, 'rendering', 'goes on after ' .. slices .. ' slices of job ' .. old)
  return {'created', id}
end

-- End a job: by its owner's token, or with '' by anyone who may.
-- ARGV: job, token or '', target state, reason, verdict (JSON) or '', results of all that the job has
--       merged or '' where they are not written yet, SHA-256 of these by blob (JSON) or ''
-- Returns {'ended'}, {'fenced'} or {'illegal', state}; ending it twice in the same way is harmless.
for_farm['end'] = function(ARGV)
  local id, token, target, reason = ARGV[1], ARGV[2], ARGV[3], ARGV[4]
  local verdict, results, digests = ARGV[5], ARGV[6], ARGV[7]
  if token ~= '' and not Job.is_owned(id, token) then return {'fenced'} end
  local moved, state = Job.end_with(id, target, reason)
  if not moved and state ~= target then return {'illegal', state} end
  if moved and verdict ~= '' then redis.call('HSET', job_key(id), 'verdict', verdict) end
  if moved and results ~= '' then
    Job.show(id, results, redis.call('HGET', job_key(id), 'spp'), digests)
    redis.call('HSET', job_key(id), 'concluded', 1)
  end
  return {'ended'}
end

-- Pause a job: none of its slices is leased any more; those that are may still be committed.
-- ARGV: job, reason, '1' where one that is queued is held back, or ''
-- Returns {'paused'} or {'held'}, also where it was, or {'illegal', state}.
for_farm.pause = function(ARGV)
  local id, reason = ARGV[1], ARGV[2]
  local moved, state = Job.move(id, 'paused', reason)
  if not moved and state == 'queued' and ARGV[3] == '1' then
    if redis.call('HSETNX', job_key(id), 'held', 1) == 1 then
      changed[id] = true
      redis.call('HSET', job_key(id), 'reason', reason)
      Outbox.announce(id, 'state', cjson.encode({from = 'queued', to = 'queued', reason = reason}))
    end
    return {'held'}
  end
  if not moved and state ~= 'paused' then return {'illegal', state} end
  if moved then redis.call('PUBLISH', WAKE_MONITORS, id) end
  return {'paused'}
end

-- Let a paused job go on, or one that is held back begin.
-- ARGV: job, reason
-- Returns {'rendering'}, also where it was, {'queued'}, where it was held back, or {'illegal', state}: a
-- queued job starts by a lease.
for_farm.resume = function(ARGV)
  local id, reason = ARGV[1], ARGV[2]
  local state = redis.call('HGET', job_key(id), 'state') or 'missing'
  if state == 'paused' then
    Job.move(id, 'rendering', reason)
    has_more[id] = true
    redis.call('PUBLISH', WAKE_MONITORS, id)
  elseif state == 'queued' and redis.call('HDEL', job_key(id), 'held') == 1 then
    changed[id], has_more[id] = true, true
    redis.call('HSET', job_key(id), 'reason', reason)
    Outbox.announce(id, 'state', cjson.encode({from = 'queued', to = 'queued', reason = reason}))
    return {'queued'}
  elseif state ~= 'rendering' then
    return {'illegal', state}
  end
  return {'rendering'}
end

-- Change the priority of a job that has not ended; the next lease goes by it.
-- ARGV: job, priority
-- Returns {'changed'}, also where it has this priority already, or {'illegal', state}.
for_farm.reprioritise = function(ARGV)
  local id, priority = ARGV[1], ARGV[2]
  if not Job.is_open(id) then
    return {'illegal', redis.call('HGET', job_key(id), 'state') or 'missing'}
  end
  redis.call('ZADD', OPEN, priority, id)
  changed[id] = true
  redis.call('HSET', job_key(id), 'priority', priority)
  return {'changed'}
end
