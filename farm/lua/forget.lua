-- Forget a job that has been finished for so long: all that Redis has of it.
-- ARGV: job, ms
-- Returns 'forgotten', 'kept' (it is not finished, or not for so long yet) or 'missing'.
local id = ARGV[1]
if redis.call('EXISTS', job_key(id)) == 0 then return 'missing' end
local finished_at = redis.call('HGET', job_key(id), 'finished_at')
if not finished_at or now() - finished_at < tonumber(ARGV[2]) then return 'kept' end
redis.call('ZREM', JOBS, id)
redis.call('UNLINK', job_key(id))
for _, part in ipairs(JOB_PARTS) do redis.call('UNLINK', job_key(id, part)) end
return 'forgotten'
