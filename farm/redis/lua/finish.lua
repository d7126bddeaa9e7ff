-- The owner has written the results of an ended job and cleared the rest.
-- ARGV: job, token, '1' where its last checkpoint stays, for another job to go on from
-- Returns 'finished' or 'fenced'.
local id = ARGV[1]
if not owned(id, ARGV[2]) then return 'fenced' end
redis.call('HSET', job_key(id), 'finished_at', now())
if ARGV[3] ~= '1' then redis.call('HDEL', job_key(id), 'checkpoint') end
redis.call('SREM', UNFINISHED, id)
redis.call('DEL', job_key(id, 'owner'), job_key(id, 'seeds'))
announce(id, 'finished', '{}')
return 'finished'
