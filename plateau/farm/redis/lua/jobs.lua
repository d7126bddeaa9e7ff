-- A job: its state, its image, its end.

-- Add the time of a try's render child, which ran on so many threads, to the job.
function Job.spend(it)
  local id, ms = it.job, it.machine_ms
  redis.call('HINCRBY', job_key(id), 'machine_ms', ms)
  redis.call('HINCRBY', job_key(id), 'further_core_ms', string.format('%.0f', ms * (it.threads - 1)))
  count('machine ms', ms)
end

-- Does the job have an image?
function Job.has_image(id) return (redis.call('HGET', job_key(id), 'results') or '') ~= '' end

-- Show a set of results of this spp; the first is announced. `digests` has the SHA-256 of each blob; none
-- for a set that is shown already, or another job's.
function Job.show(id, results, spp, digests)
  if not Job.has_image(id) then Outbox.announce(id, 'image', {spp = tonumber(spp)}) end
  redis.call('HSET', job_key(id), 'results', results)
  if not digests then return end
  for _, blob in ipairs(redis.call('HKEYS', job_key(id, 'digests'))) do
    if string.sub(blob, 1, 8) == 'results/' then redis.call('HDEL', job_key(id, 'digests'), blob) end
  end
  for blob, sha256 in pairs(digests) do redis.call('HSET', job_key(id, 'digests'), blob, sha256) end
end

-- The total of the job's pauses (ms), a present one included.
function Job.paused_ms(id)
  local paused = redis.call('HMGET', job_key(id), 'paused_ms', 'paused_at')
  local lasts = paused[2] and math.max(0, now() - paused[2]) or 0
  return string.format('%.0f', (paused[1] or 0) + lasts)
end

-- Append a point (JSON) to the job's curve. Older points do not say their samples.
function Job.append_point(id, spp, at, point)
  local film = redis.call('HMGET', job_key(id), 'width', 'height')
  local samples = cjson.decode(point).samples or spp * (film[1] or 0) * (film[2] or 0)
  redis.call('XADD', job_key(id, 'curve'), spp .. '-0', 'at', at, 'point', point)
  redis.call('HSET', job_key(id), 'latest', point, 'latest_at', at, 'spp', spp, 'samples',
             string.format('%.0f', samples),
             'latest_paused_ms', Job.paused_ms(id))
  redis.call('HINCRBY', job_key(id), 'points', 1)
  Outbox.announce(id, 'point', point, at)
end

-- Move a job along the table. Returns true, or false and the state that forbids it. An end says what ended
-- the job, and which slice could not be rendered, if one could not.
function Job.move(id, target, reason, ended_by, failed_slice)
  local state = redis.call('HGET', job_key(id), 'state')
  if not state then return false, 'missing' end
  if not MOVES[state][target] then return false, state end
  if state == 'paused' then
    redis.call('HSET', job_key(id), 'paused_ms', Job.paused_ms(id))
    redis.call('HDEL', job_key(id), 'paused_at')
  elseif target == 'paused' then
    redis.call('HSET', job_key(id), 'paused_at', now())
  end
  redis.call('HSET', job_key(id), 'state', target, 'reason', reason)
  if ended_by then redis.call('HSET', job_key(id), 'ended_by', ended_by) end
  if failed_slice then redis.call('HSET', job_key(id), 'failed_slice', failed_slice) end
  redis.call('ZREM', in_state_key(state), id)
  redis.call('ZADD', in_state_key(target), redis.call('HGET', job_key(id), 'number'), id)
  changed[id] = true
  Outbox.announce(id, 'state', {from = state, to = target, reason = reason, ended_by = ended_by})
  return true, state
end

-- Put a job into its batch, if it has one. It keeps its place among the batch's jobs.
function Job.join_batch(id)
  local batch, number = unpack(redis.call('HMGET', job_key(id), 'batch', 'number'))
  if not batch or batch == '' then return end
  redis.call('ZADD', batch_key(batch), number, id)
  redis.call('ZADD', BATCHES, 'GT', number, batch)
end

-- Take a job out of its batch, if it is in one. A batch ends with its last job.
function Job.leave_batch(id)
  local batch = redis.call('HGET', job_key(id), 'batch')
  if not batch or batch == '' or redis.call('ZREM', batch_key(batch), id) == 0 then return end
  rank(BATCHES, batch, redis.call('ZREVRANGE', batch_key(batch), 0, 0, 'WITHSCORES')[2])
end

-- Has the job not ended?
function Job.is_open(id)
  local state = redis.call('HGET', job_key(id), 'state')
  return state and MOVES[state]['cancelled'] or false
end

-- Note the samples that a converged job has saved: those of its cap, without those that it has or took
-- over. The rule fixed saves none. Jobs, batches and the whole farm show this number.
local function note_saved(id)
  local spec, spp, samples, taken, width, height = unpack(
    redis.call('HMGET', job_key(id), 'spec', 'spp', 'samples', 'taken_samples', 'width', 'height'))
  spec = cjson.decode(spec)
  if spec.rule.name == 'fixed' or not width then return end
  local pixels = width * height
  local had = math.max(samples or spp * pixels, taken or 0)
  samples = string.format('%.0f', math.max(0, spec.max_spp * pixels - had))
  redis.call('HSET', job_key(id), 'samples_saved', samples)
  count('samples saved', samples)
end

-- End all leases of the job, for good.
function Job.withdraw(id)
  if redis.call('EXISTS', job_key(id, 'slices')) == 1 then
    for _, lease in ipairs(redis.call('XPENDING', job_key(id, 'slices'), GROUP, '-', '+', 1e6)) do
      redis.call('ZREM', LEASES, id .. ' ' .. lease[1])
    end
  end
  for _, part in ipairs({'slices', 'lost', 'leases', 'paces', 'outrun'}) do redis.call('DEL', job_key(id, part)) end
  redis.call('HSET', job_key(id), 'ready', 0, 'leased', 0)
end

-- Move a job to an end: slices that are not committed are withdrawn, and workers and monitors are told.
function Job.end_with(id, target, ended_by, reason, failed_slice)
  local moved, state = Job.move(id, target, reason, ended_by, failed_slice)
  if not moved then return false, state end
  count('ended ' .. target)
  if target == 'converged' then note_saved(id) end
  redis.call('HSET', job_key(id), 'ended_at', now())
  Job.withdraw(id)
  redis.call('DEL', job_key(id, 'deaths'))
  redis.call('ZREM', OPEN, id)
  local need = redis.call('HGET', job_key(id), 'need') or DEFAULT_POOL
  if redis.call('HINCRBY', NEEDS, need, -1) < 1 then redis.call('HDEL', NEEDS, need) end
  local party = redis.call('HGET', job_key(id), 'party')
  if party then redis.call('SREM', api_key_key(party, 'open'), id) end
  redis.call('PUBLISH', WAKE_WORKERS, 'ended ' .. id)
  redis.call('PUBLISH', WAKE_MONITORS, id)
  return true, state
end

-- Is this the token of the monitor that owns the job?
function Job.is_owned(id, token) return redis.call('GET', job_key(id, 'owner')) == token end

-- Note why a queued job waits, or waits no more.
function Job.note_queued(id, reason, words)
  redis.call('HSET', job_key(id), 'reason', words or reason)
  changed[id] = true
  Outbox.announce(id, 'state', {from = 'queued', to = 'queued', reason = reason})
end
