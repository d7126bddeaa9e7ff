-- Redis has lost the job's hash, or its state in it, as by an eviction: no monitor has work with the job
-- any more, and nothing of it is leased. What else there is of it stays.
-- ARGV: job, token
-- Returns 'abandoned', 'kept' (its state is there) or 'fenced'.
local id = ARGV[1]
if not owned(id, ARGV[2]) then return 'fenced' end
if redis.call('HEXISTS', job_key(id), 'state') == 1 then return 'kept' end
withdraw(id)
redis.call('UNLINK', job_key(id))  -- counters that were written since, which would be taken for a job
redis.call('ZREM', OPEN, id)
redis.call('SREM', UNFINISHED, id)
redis.call('DEL', job_key(id, 'owner'))
redis.call('PUBLISH', WAKE_WORKERS, 'ended ' .. id)
file_all_anew()  -- where it waited is not known any more
return 'abandoned'
