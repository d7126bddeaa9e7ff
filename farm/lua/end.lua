-- End a job: by its owner's token, or with '' by anyone who may.
-- ARGV: job, token or '', target state, reason, verdict (JSON) or ''
-- Returns {'ended'}, {'fenced'} or {'illegal', state}; ending it twice in the same way is harmless.
local id, token, target, reason, verdict = ARGV[1], ARGV[2], ARGV[3], ARGV[4], ARGV[5]
if token ~= '' and not owned(id, token) then return {'fenced'} end
local moved, state = end_job(id, target, reason)
if not moved and state ~= target then return {'illegal', state} end
if moved and verdict ~= '' then redis.call('HSET', job_key(id), 'verdict', verdict) end
return {'ended'}
