-- End a job: by its owner's token, or with '' by anyone who may.
-- ARGV: job, token or '', target state, reason, verdict (JSON) or '', results of all that the job has
--       merged or '' where they are not written yet, SHA-256 of these by blob (JSON) or ''
-- Returns {'ended'}, {'fenced'} or {'illegal', state}; ending it twice in the same way is harmless.
local id, token, target, reason = ARGV[1], ARGV[2], ARGV[3], ARGV[4]
local verdict, results, digests = ARGV[5], ARGV[6], ARGV[7]
if token ~= '' and not owned(id, token) then return {'fenced'} end
local moved, state = end_job(id, target, reason)
if not moved and state ~= target then return {'illegal', state} end
if moved and verdict ~= '' then redis.call('HSET', job_key(id), 'verdict', verdict) end
if moved and results ~= '' then
  show(id, results, redis.call('HGET', job_key(id), 'spp'), digests)
  redis.call('HSET', job_key(id), 'concluded', 1)
end
return {'ended'}
