-- Forget a job that has been finished for so long: all that Redis has of it.
-- ARGV: job, ms
-- Returns 'forgotten', 'kept' (it is not finished, or not for so long yet, or another job goes on
-- with its slices) or 'missing'.
local id = ARGV[1]
if redis.call('EXISTS', job_key(id)) == 0 then return 'missing' end
local job = redis.call('HMGET', job_key(id), 'finished_at', 'continued', 'continues')
if not job[1] or now() - job[1] < tonumber(ARGV[2]) then return 'kept' end
if tonumber(job[2] or 0) > 0 then return 'kept' end
if job[3] then redis.call('HINCRBY', job_key(job[3]), 'continued', -1) end
redis.call('ZREM', JOBS, id)
redis.call('ZREM', in_state_key(redis.call('HGET', job_key(id), 'state')), id)
local batch = redis.call('HGET', job_key(id), 'batch')
if batch and batch ~= '' then
  redis.call('ZREM', batch_key(batch), id)
  local newest = redis.call('ZREVRANGE', batch_key(batch), 0, 0, 'WITHSCORES')
  if newest[1] then
    redis.call('ZADD', BATCHES, newest[2], batch)
  else
    redis.call('ZREM', BATCHES, batch)
    redis.call('SREM', GUARDED, batch)
  end
end
local owner = redis.call('HGET', job_key(id, 'sealed'), 'owner')
if owner then redis.call('ZREM', api_key_key(owner, 'jobs'), id) end
drop_deliveries(id)
redis.call('UNLINK', job_key(id))
for _, part in ipairs(JOB_PARTS) do redis.call('UNLINK', job_key(id, part)) end
return 'forgotten'
