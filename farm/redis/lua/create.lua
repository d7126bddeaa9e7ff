-- Create a job, or many of one batch: all or none, and once for each idempotency key.
-- ARGV: idempotency key or '', request digest, priority, batch or '', '1' where all jobs of the batch
--       have to stop alike or '', number of the newest job of the batch with which these were compared
--       or '', how many jobs, then of each: id, field, value, … (as many fields for each)
-- Returns {'created', first id}, {'repeated', first id}, {'conflict', first id}, {'changed'} (the batch
-- is guarded, and these were not compared with its newest job), {'too varied', how many} (open jobs
-- need so many different things of workers already) or, where their owner would have too many open
-- jobs, {'too many', how many it has, how many it may have}.
local idempotency, digest, priority = ARGV[1], ARGV[2], ARGV[3]
local batch, guarded, compared, jobs = ARGV[4], ARGV[5], ARGV[6], tonumber(ARGV[7])
local first, width = 8, (#ARGV - 7) / jobs
local made, by_then = made_before(idempotency, digest)
if made then return {made, by_then} end
if joins_unseen(batch, guarded, compared) then return {'changed'} end
local open, most = too_many_jobs(jobs, unpack(ARGV, first + 1, first + width - 1))
if open then return {'too many', open, most} end
local needs = needs_too_much(unpack(ARGV, first + 1, first + width - 1))
if needs then return {'too varied', needs} end
remember_request(idempotency, digest, ARGV[first])
for at = first, #ARGV, width do
  new_job(ARGV[at], priority, 'created', unpack(ARGV, at + 1, at + width - 1))
end
return {'created', ARGV[first]}
