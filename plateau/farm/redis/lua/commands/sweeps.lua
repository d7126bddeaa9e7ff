-- Begin a sweep of the farm, unless one was begun within `every_ms`.
-- Returns whether it is begun.
function for_farm.begin_sweep(it)
  if now() - (redis.call('HGET', STORE, 'next_sweep_at') or 0) < 0 then return false end
  redis.call('HSET', STORE, 'next_sweep_at', string.format('%.0f', now() + it.every_ms))
  return true
end

-- Note that a sweep has just ended.
function for_farm.note_sweep() redis.call('HSET', TOTALS, 'swept at', string.format('%.0f', now())) end

-- Forget a finished job, with all its records: one that finished `finished_for_ms` ago, or was deleted
-- `deleted_for_ms` ago, where these are given.
-- Returns 'forgotten', 'kept' (it has not finished, or both were later, or another job has taken over its
-- slices) or 'missing'.
function for_farm.forget(it)
  local id = it.job
  if redis.call('EXISTS', job_key(id)) == 0 then return 'missing' end
  local job = redis.call('HMGET', job_key(id), 'finished_at', 'continued', 'continues')
  local deleted_at = redis.call('HGET', job_key(id, 'sealed'), 'deleted_at')
  local is_old = it.finished_for_ms and job[1] and now() - job[1] >= it.finished_for_ms
  local is_gone = it.deleted_for_ms and deleted_at and now() - deleted_at >= it.deleted_for_ms
  if not job[1] or not (is_old or is_gone) then return 'kept' end
  if tonumber(job[2] or 0) > 0 then return 'kept' end
  if job[3] then redis.call('HINCRBY', job_key(job[3]), 'continued', -1) end
  redis.call('ZREM', JOBS, id)
  redis.call('ZREM', in_state_key(redis.call('HGET', job_key(id), 'state')), id)
  redis.call('ZREM', DELETED, id)
  Job.leave_batch(id)
  local owner = redis.call('HGET', job_key(id, 'sealed'), 'owner')
  if owner then redis.call('ZREM', api_key_key(owner, 'jobs'), id) end
  Outbox.drop(id)
  redis.call('UNLINK', job_key(id))
  for _, part in ipairs(JOB_PARTS) do redis.call('UNLINK', job_key(id, part)) end
  return 'forgotten'
end

-- Drop the sums of a job that finished `finished_for_ms` ago.
-- Returns 'dropped' or 'kept' (it has none, has not finished, or later, or a job that continues it still
-- depends on these sums, or is unknown).
function for_farm.drop_sums(it)
  local id = it.job
  local job = redis.call('HMGET', job_key(id), 'finished_at', 'checkpoint', 'continued')
  if not job[1] or not job[2] or now() - job[1] < it.finished_for_ms then return 'kept' end
  local stand_on_it = tonumber(job[3] or 0)
  for _, continuing in ipairs(it.continued_by) do
    local other = redis.call('HMGET', job_key(continuing), 'continues', 'checkpoint')
    if other[1] == id and other[2] ~= job[2] then stand_on_it = stand_on_it - 1 end
  end
  if stand_on_it > 0 then return 'kept' end
  redis.call('HDEL', job_key(id), 'checkpoint')
  return 'dropped'
end
