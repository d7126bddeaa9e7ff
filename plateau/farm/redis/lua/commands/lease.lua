-- Give a worker its next slice: highest priority first, then a job of the owner (an API key) with the
-- fewest leased spp, then the batch or single job with the fewest, then the older job. So a key gets no
-- more workers by sending more jobs, and a batch's jobs are rendered in their order, not all at once.
-- A worker keeps to the scene that it has loaded while its turn lasts. If another worker is late with the
-- slice that holds up the job's image, this one is given that slice; without other work, such a slice of
-- any job.
-- Returns the slice; `again` where the slice that it found needs no rendering; otherwise, if known, the ms
-- until a slice of another worker may be late.
function for_workers.lease(it)
  local worker, kind, loaded, in_turn = it.worker, it.kind, it.loaded, it.in_turn
  local lease_ms, most_tries = it.lease_ms, it.most_tries
  local MOST_LOST = 100  -- expired leases that are noted at once, to keep the command short
  local MOST_LATE = 50  -- late jobs that a worker without other work looks at

  if not Slice.is_farm_silent(lease_ms) then
    local over = redis.call('ZRANGEBYSCORE', LEASES, '-inf', now() - lease_ms, 'LIMIT', 0, MOST_LOST)
    for _, lease in ipairs(over) do Slice.note_lost(string.match(lease, '^(%S+) (%S+)$')) end
    Waiting.file_changed()
  end
  if redis.call('HEXISTS', worker_key(worker), 'drained') == 1 then return {} end

  local left_out, most = Waiting.left_out_of(worker), 0
  for _ in pairs(left_out) do most = most + 1 end

  -- The next job, and the variant to render it with: at the highest priority with a job that this worker
  -- can render, the first entry of all queues, or the job that is loaded.
  local function next_job()
    local its_queue = in_turn and not left_out[loaded]
                      and string.match(redis.call('HGET', job_key(loaded), 'filed') or '', '^%S* %d+ (.+)$')
    local id, entry, fewest, variant, at
    for _, queue in ipairs(redis.call('ZREVRANGE', WAITING, 0, -1)) do
      local priority, class = string.match(queue, '^(%S+) (.+)$')
      if at and priority ~= at then break end
      local suits = Waiting.variant_of(kind, class)
      if suits and queue == its_queue then return loaded, suits end
      if suits then
        local its_first, first, leased = Waiting.first(queue, left_out, most)
        if its_first and (not id or leased < fewest or leased == fewest and first < entry) then
          id, entry, fewest, variant, at = its_first, first, leased, suits, priority
        end
      end
    end
    return id, variant
  end

  -- The slice that holds up the job's image, if this worker may try it, too: its index, its note and the
  -- number of its leases; otherwise nil, and the ms until it may. The slice must be late, and out for so
  -- long that this worker would have rendered it since. A worker that has not rendered the job yet would
  -- have to load it, and is taken to need twice the time that makes a slice late. A slow worker is helped
  -- at once by one that is not slow and would finish first; otherwise when it is late by its own pace.
  local function late_slice(id)
    local job = redis.call('HMGET', job_key(id), 'prefix', 'late_ms', 'ready', 'planned', 'issued')
    local index, late_ms = job[1] or '0', job[2]
    local noted = redis.call('HGET', job_key(id, 'leases'), index) or ''
    local since, its_pace, entry = string.match(noted, '^(%S+) (%S+) (%S+)$')
    if not since or job[3] - (job[4] - job[5]) ~= 0 then return nil end  -- a rejected slice waits
    local pace = tonumber(redis.call('HGET', job_key(id, 'paces'), worker) or 2 * late_ms)
    local wait_ms = since + math.max(pace, late_ms) - now()
    if its_pace - late_ms > 0 then
      local is_first = now() + pace - since - its_pace < 0
      if not is_first then wait_ms = since + its_pace + late_ms - now() end
      if is_first and pace - late_ms < 0 then wait_ms = 0 end
    end
    local lease = Slice.pending(id, entry)
    if not lease or lease[2] == worker then return nil end
    if wait_ms > 0 then return nil, wait_ms end
    return {index = index, noted = noted, tries = lease[4]}
  end

  -- For a worker without other work: a job, its variant and such a slice of it; otherwise three times nil,
  -- and the ms until there may be one.
  local function late_job()
    local soonest, at, variants = nil, now(), {}
    local jobs = redis.call('ZRANGE', LATE, 0, MOST_LATE - 1, 'WITHSCORES')
    for i = 1, #jobs, 2 do
      local id, class = string.match(jobs[i], '^(%S+) (.+)$')
      if variants[class] == nil then variants[class] = Waiting.variant_of(kind, class) or false end
      local suits, wait_ms, slice = not left_out[id] and variants[class], jobs[i + 1] - at
      if suits and wait_ms > 0 then return nil, nil, nil, math.min(soonest or wait_ms, wait_ms) end
      if suits then
        slice, wait_ms = late_slice(id)
        if slice then return id, suits, slice end
        if wait_ms then soonest = math.min(soonest or wait_ms, wait_ms) end
      end
    end
    return nil, nil, nil, soonest
  end

  local id, variant = next_job()
  local late
  if id then
    local state, late_at = unpack(redis.call('HMGET', job_key(id), 'state', 'late'))
    if not state or not MOVES[state]['cancelled'] then
      Waiting.file_all_anew()
      return {again = true}
    end
    if late_at and now() - string.match(late_at, '^%S+') > 0 then late = late_slice(id) end
  else
    local wait_ms
    id, variant, late, wait_ms = late_job()
    if not id then
      Waiting.note_idle(worker, kind)
      return {wait_ms = wait_ms}
    end
  end
  redis.call('HDEL', IDLE, worker)
  changed[id] = true
  local slices, lost = job_key(id, 'slices'), redis.call('ZRANGE', job_key(id, 'lost'), 0, 0)[1]
  local entry

  -- Lease the newest slice of the stream.
  local function read()
    entry = redis.call('XREADGROUP', 'GROUP', GROUP, worker, 'COUNT', 1, 'STREAMS', slices, '>')[1][2][1]
    redis.call('HINCRBY', job_key(id), 'leased', 1)
    Slice.note_lease(id, entry[1])
  end

  if late then
    redis.call('XADD', slices, '*', 'index', late.index)
    read()
    redis.call('HSET', job_key(id, 'leases'), late.index, late.noted .. ' ' .. entry[1])
    redis.call('HINCRBY', job_key(id), 'second_tries', 1)
  elseif lost then
    local pending = Slice.pending(id, lost)
    entry = redis.call('XCLAIM', slices, GROUP, worker, 0, lost)[1]
    if not entry then  -- pending and yet not in the stream any more, as Redis 6.2 may leave one
      Slice.drop(id, lost)
      return {again = true}
    end
    Slice.note_lease(id, lost)
    local holder = pending[2]
    -- A living holder that does not renew never got the answer with its lease.
    local lives = now() - (redis.call('ZSCORE', WORKERS, holder) or 0) < lease_ms
    if holder ~= 'nobody' and not lives then
      local causes = Slice.note_lost_worker(id, entry[2][2], holder)
      if #causes >= most_tries then
        Slice.poison(id, entry[2][2], causes)
        return {again = true}
      end
    end
  else
    local planned, issued, ready = unpack(redis.call('HMGET', job_key(id), 'planned', 'issued', 'ready'))
    if ready - (planned - issued) == 0 then  -- otherwise a rejected one is in the stream already
      redis.call('XADD', slices, '*', 'index', issued)
      redis.call('HINCRBY', job_key(id), 'issued', 1)
    end
    read()
    redis.call('HINCRBY', job_key(id), 'ready', -1)
  end
  if redis.call('HEXISTS', job_key(id, 'ledger'), entry[2][2]) == 1 then  -- a late commit came first
    Slice.drop(id, entry[1])
    return {again = true}
  end
  if redis.call('HSETNX', job_key(id), 'variant', variant) == 1 then
    redis.call('HSET', job_key(id), 'started_at', now(), 'paused_ms', 0)
    has_more[id] = true  -- for workers of this variant: those that were woken may have another
  end
  local job = redis.call('HMGET', job_key(id), 'state', 'spec', 'scene_sha256')
  if job[1] == 'queued' then Job.move(id, 'rendering', 'rendering with ' .. variant) end
  Slice.note_holder(id, entry[2][2], entry[1], worker)
  local _, tries = Slice.holds(id, entry[1], worker)
  if late then tries = late.tries + 1 end
  return {slice = {job = id, entry = entry[1], index = tonumber(entry[2][2]), tries = tries,
                   variant = variant, spec = job[2], scene = job[3],
                   round = Slice.round(id, entry[2][2]) or nil}}
end
