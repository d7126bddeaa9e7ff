-- Change the priority of a job that has not ended; the next lease goes by it.
-- ARGV: job, priority
-- Returns {'changed'}, also where it has this priority already, or {'illegal', state}.
local id, priority = ARGV[1], ARGV[2]
if not is_open(id) then
  return {'illegal', redis.call('HGET', job_key(id), 'state') or 'missing'}
end
redis.call('ZADD', OPEN, priority, id)
changed[id] = true
redis.call('HSET', job_key(id), 'priority', priority)
return {'changed'}
