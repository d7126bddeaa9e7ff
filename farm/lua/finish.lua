-- The owner has written the results of an ended job and cleared the rest.
-- ARGV: job, token
-- Returns 'finished' or 'fenced'.
local id = ARGV[1]
if not owned(id, ARGV[2]) then return 'fenced' end
redis.call('HSET', job_key(id), 'finished_at', now())
redis.call('HDEL', job_key(id), 'checkpoint')
redis.call('SREM', UNFINISHED, id)
redis.call('DEL', job_key(id, 'owner'), job_key(id, 'seeds'))
announce(id, 'finished', '{}')
return 'finished'
