-- Count the farm's work: to do now, and done since its beginning.
-- Returns a `CensusRow`. Times (ms) and totals are text, since JSON from Lua has only 14 digits.
function for_farm.census(it)
  local jobs, demand, oldest = {queued = 0, rendering = 0, paused = 0}, {}, nil
  local least = it.least_priority
  local kinds, unserved = Waiting.at_work(it.alive_ms), {}

  -- Add a job's slices, up to the end that its monitor expects, and one worker's time for them: by the mean
  -- of its slices so far; `unmeasured` are the slices of jobs without any.
  local function add_work(slices, waiting, leased, committed, machine_ms, slice_spp, expected_spp, continued_spp)
    slices.waiting, slices.leased = slices.waiting + waiting, slices.leased + leased
    local left = leased  -- more workers would be of no use
    if waiting > 0 then left = math.max(waiting + leased, (expected_spp or 0) / slice_spp - committed) end
    slices.left = slices.left + left
    local measured = committed - (continued_spp or 0) / slice_spp
    if measured > 0 then
      slices.work_ms = slices.work_ms + left * machine_ms / measured
    else
      slices.unmeasured = slices.unmeasured + left
    end
  end

  for _, id in ipairs(redis.call('SMEMBERS', UNFINISHED)) do  -- those that have not ended, and a few more
    local job = redis.call('HMGET', job_key(id), 'state', 'ready', 'committed', 'created_at', 'held',
                           'variant', 'asked_variant', 'committed', 'machine_ms', 'slice_spp',
                           'expected_spp', 'continued_spp', 'need', 'awaits', 'number')
    local state = job[1]
    if state and jobs[state] then
      jobs[state] = jobs[state] + 1
      local waiting, leased, put_back = 0, 0, 0
      if state ~= 'queued' then  -- until the first lease
        local pending = redis.call('XPENDING', job_key(id, 'slices'), GROUP)
        for _, holder in ipairs(pending[4] or {}) do
          if holder[1] == 'nobody' then put_back = tonumber(holder[2]) end
        end
        leased = pending[1] - put_back
      end
      local may_be_rendered = state ~= 'paused' and not job[5] and not job[14]
      if may_be_rendered then
        waiting = job[2] + put_back
        if job[3] == '0' and (not oldest or tonumber(job[4]) < tonumber(oldest)) then oldest = job[4] end
      end
      local class = (job[6] or job[7] or 'auto') .. ' ' .. (job[13] or DEFAULT_POOL)
      if may_be_rendered and not Waiting.is_served(id, class, kinds) then
        table.insert(unserved, {id = id, number = tonumber(job[15])})
      end
      if not least or tonumber(redis.call('ZSCORE', OPEN, id) or least) >= least then
        demand[class] = demand[class] or {waiting = 0, leased = 0, left = 0, work_ms = 0, unmeasured = 0}
        add_work(demand[class], waiting, leased, unpack(job, 8, 12))
      end
    end
  end

  local workers = {idle = 0, rendering = 0, out_of_service = 0}
  for _, id in ipairs(redis.call('ZRANGEBYSCORE', WORKERS, now() - it.alive_ms, '+inf')) do
    local about = cjson.decode(redis.call('HGET', worker_key(id), 'about') or '{}')
    local state = given(about.trouble) and 'out_of_service' or given(about.job) and 'rendering' or 'idle'
    workers[state] = workers[state] + 1
  end

  -- Jobs without a suitable living worker that takes work, the oldest first.
  table.sort(unserved, function(one, other) return one.number < other.number end)
  for at, job in ipairs(unserved) do unserved[at] = job.id end

  local monitors, owned = 0, 0
  for _, id in ipairs(redis.call('ZRANGEBYSCORE', MONITORS, now(), '+inf')) do
    local about = cjson.decode(redis.call('HGET', monitor_key(id), 'about') or '{}')
    monitors, owned = monitors + 1, owned + (about.jobs or 0)
  end

  local notices = 0
  for _, receiver in ipairs(redis.call('ZRANGE', NOTICES, 0, -1)) do
    notices = notices + redis.call('ZCARD', Outbox.due_key(receiver))
  end

  return {
    now = now(), jobs = jobs, unserved = unserved, demand = demand, oldest = oldest, notices = notices,
    workers = workers, monitors = monitors, owned = owned, stored = redis.call('ZCARD', JOBS),
    created = redis.call('HGET', STORE, 'created') or '0', totals = table_of(TOTALS),
  }
end
