-- The owner sets fields of a job.
-- ARGV: job, token, field, value, field, value, …
-- Returns 'saved' or 'fenced'.
if not owned(ARGV[1], ARGV[2]) then return 'fenced' end
redis.call('HSET', job_key(ARGV[1]), unpack(ARGV, 3))
return 'saved'
