-- Count the farm: what it has to do now, and what it has done since it began.
-- ARGV: ms after which a worker that was not heard of is gone
-- Returns JSON. Times (ms) and totals are text in it, for JSON from Lua has 14 digits only.
local jobs, waiting, leased, oldest = {queued = 0, rendering = 0, paused = 0}, 0, 0, nil
for _, id in ipairs(redis.call('SMEMBERS', UNFINISHED)) do  -- those that have not ended, and a few more
  local job = redis.call('HMGET', job_key(id), 'state', 'ready', 'committed', 'created_at', 'held')
  local state = job[1]
  if state and jobs[state] then
    jobs[state] = jobs[state] + 1
    local put_back = 0
    if state ~= 'queued' then  -- until the first lease
      local pending = redis.call('XPENDING', job_key(id, 'slices'), GROUP)
      for _, holder in ipairs(pending[4] or {}) do
        if holder[1] == 'nobody' then put_back = tonumber(holder[2]) end
      end
      leased = leased + pending[1] - put_back
    end
    if state ~= 'paused' and not job[5] then
      waiting = waiting + job[2] + put_back
      if job[3] == '0' and (not oldest or tonumber(job[4]) < tonumber(oldest)) then oldest = job[4] end
    end
  end
end

local function given(value) return value ~= nil and value ~= cjson.null end

local workers = {idle = 0, rendering = 0, out_of_service = 0}
for _, id in ipairs(redis.call('ZRANGEBYSCORE', WORKERS, now() - ARGV[1], '+inf')) do
  local about = cjson.decode(redis.call('HGET', worker_key(id), 'about') or '{}')
  local state = given(about.trouble) and 'out_of_service' or given(about.job) and 'rendering' or 'idle'
  workers[state] = workers[state] + 1
end

local monitors, owned = 0, 0
for _, id in ipairs(redis.call('ZRANGEBYSCORE', MONITORS, now(), '+inf')) do
  local about = cjson.decode(redis.call('HGET', monitor_key(id), 'about') or '{}')
  monitors, owned = monitors + 1, owned + (about.jobs or 0)
end

local webhooks = 0
for _, receiver in ipairs(redis.call('ZRANGE', RECEIVERS, 0, -1)) do
  webhooks = webhooks + redis.call('ZCARD', due_key(receiver))
end

return cjson.encode({
  now = now(), jobs = jobs, slices = {waiting = waiting, leased = leased}, oldest = oldest,
  webhooks = webhooks,
  workers = workers, monitors = monitors, owned = owned, stored = redis.call('ZCARD', JOBS),
  created = redis.call('GET', PREFIX .. 'created') or '0', totals = redis.call('HGETALL', TOTALS),
})
