-- Let the sums go that a job was left with when it was finished, so long ago.
-- ARGV: job, ms, '1' to change nothing
-- Returns 'dropped' or 'kept' (it has none, is not finished, or not for so long).
local job = redis.call('HMGET', job_key(ARGV[1]), 'finished_at', 'checkpoint')
if not job[1] or not job[2] or now() - job[1] < tonumber(ARGV[2]) then return 'kept' end
if ARGV[3] ~= '1' then redis.call('HDEL', job_key(ARGV[1]), 'checkpoint') end
return 'dropped'
