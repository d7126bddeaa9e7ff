-- Let a paused job go on, or one that is held back begin.
-- ARGV: job, reason
-- Returns {'rendering'}, also where it was, {'queued'}, where it was held back, or {'illegal', state}: a
-- queued job starts by a lease.
local id, reason = ARGV[1], ARGV[2]
local state = redis.call('HGET', job_key(id), 'state') or 'missing'
if state == 'paused' then
  move(id, 'rendering', reason)
  has_more[id] = true
  redis.call('PUBLISH', WAKE_MONITORS, id)
elseif state == 'queued' and redis.call('HDEL', job_key(id), 'held') == 1 then
  changed[id], has_more[id] = true, true
  redis.call('HSET', job_key(id), 'reason', reason)
  announce(id, 'state', cjson.encode({from = 'queued', to = 'queued', reason = reason}))
  return {'queued'}
elseif state ~= 'rendering' then
  return {'illegal', state}
end
return {'rendering'}
