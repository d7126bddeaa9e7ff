-- Let a paused job go on.
-- ARGV: job, reason
-- Returns {'rendering'}, also where it was, or {'illegal', state}: a queued job starts by a lease.
local id = ARGV[1]
local state = redis.call('HGET', job_key(id), 'state') or 'missing'
if state == 'paused' then
  move(id, 'rendering', ARGV[2])
  redis.call('PUBLISH', WAKE_WORKERS, 'planned')
  redis.call('PUBLISH', WAKE_MONITORS, id)
elseif state ~= 'rendering' then
  return {'illegal', state}
end
return {'rendering'}
