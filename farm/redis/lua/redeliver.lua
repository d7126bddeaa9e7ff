-- Have a delivery tried now, with all tries before it; one that is being tried is left alone.
-- ARGV: job, number
-- Returns 'queued' or 'unknown'.
local id, number = ARGV[1], ARGV[2]
local deliveries = job_key(id, 'deliveries')
if redis.call('HEXISTS', deliveries, number) == 0 then return 'unknown' end
if redis.call('HEXISTS', deliveries, number .. ' token') == 1 then return 'queued' end
redis.call('HSET', deliveries, number .. ' state', 'waiting', number .. ' tries', 0)
deliver_at(id, number, now())
redis.call('PUBLISH', WAKE_WEBHOOKS, id)
return 'queued'
