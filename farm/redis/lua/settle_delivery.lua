-- Say how a try of a delivery ended. Whoever has delivered it is believed, though his lease may have
-- run out; of the other ends only that of the lease's holder counts.
-- ARGV: job, number, token, 'delivered', 'failed' (another try follows) or 'given-up', ms until the
--       next try, status or '', error or '', ms that it took
-- Returns 'settled', or 'lost': another holds the lease or has settled it, or it is forgotten.
local id, number, token, outcome = ARGV[1], ARGV[2], ARGV[3], ARGV[4]
local deliveries = job_key(id, 'deliveries')
if redis.call('HEXISTS', deliveries, number) == 0 then return 'lost' end
local holder = redis.call('HGET', deliveries, number .. ' token')
if holder ~= token then
  if outcome ~= 'delivered' then return 'lost' end
  if redis.call('HGET', deliveries, number .. ' state') == 'delivered' then return 'settled' end
end
count('webhook tries ' .. outcome)
note_delivery(id, number, ARGV[6], ARGV[7], ARGV[8])
redis.call('HDEL', deliveries, 'trying until', number .. ' token')
if outcome == 'failed' then
  deliver_at(id, number, string.format('%.3f', now() + ARGV[5]))
else
  redis.call('HSET', deliveries, number .. ' state', outcome)
  deliver_no_more(id, number)
end
return 'settled'
