-- Pause a job: none of its slices is leased any more; those that are may still be committed.
-- ARGV: job, reason, '1' where one that is queued is held back, or ''
-- Returns {'paused'} or {'held'}, also where it was, or {'illegal', state}.
local id, reason = ARGV[1], ARGV[2]
local moved, state = move(id, 'paused', reason)
if not moved and state == 'queued' and ARGV[3] == '1' then
  if redis.call('HSETNX', job_key(id), 'held', 1) == 1 then
    changed[id] = true
    redis.call('HSET', job_key(id), 'reason', reason)
    announce(id, 'state', cjson.encode({from = 'queued', to = 'queued', reason = reason}))
  end
  return {'held'}
end
if not moved and state ~= 'paused' then return {'illegal', state} end
if moved then redis.call('PUBLISH', WAKE_MONITORS, id) end
return {'paused'}
