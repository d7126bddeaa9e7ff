-- Go on with a finished job as a new one, which takes over its first slices and is rendering at once.
-- ARGV: new id, old id, idempotency key or '', request digest, slices, checkpoint of their sums
--       (JSON) or '' where the slices are kept, curve's last spp that it takes over, priority, batch,
--       '1' where it guards the batch, number of the batch's newest job with which it was compared,
--       then field, value, … of the new job
-- Returns {'created', id}, {'repeated', id}, {'conflict', id}, {'missing'} (there is no old job),
-- {'changed'} (it has not these slices, or these sums, any more, or the batch has changed),
-- {'too varied', how many} (open jobs need so many different things of workers already) or, where the
-- owner would have too many open jobs, {'too many', how many it has, how many it may have}.
local id, old, idempotency, digest = ARGV[1], ARGV[2], ARGV[3], ARGV[4]
local slices, checkpoint, judged_spp, priority = tonumber(ARGV[5]), ARGV[6], ARGV[7], ARGV[8]
local batch, guarded, compared, first = ARGV[9], ARGV[10], ARGV[11], 12
local made, by_then = made_before(idempotency, digest)
if made then return {made, by_then} end
local before = redis.call('HMGET', job_key(old), 'finished_at', 'checkpoint', 'variant', 'width',
                          'height', 'notes', 'results', 'spp')
if redis.call('EXISTS', job_key(old)) == 0 then return {'missing'} end
if not before[1] then return {'changed'} end
if checkpoint ~= '' and before[2] ~= checkpoint then return {'changed'} end
for index = 0, slices - 1 do
  if redis.call('HEXISTS', job_key(old, 'ledger'), index) == 0 then return {'changed'} end
end
if joins_unseen(batch, guarded, compared) then return {'changed'} end
local open, most = too_many_jobs(1, unpack(ARGV, first))
if open then return {'too many', open, most} end
local needs = needs_too_much(unpack(ARGV, first))
if needs then return {'too varied', needs} end

remember_request(idempotency, digest, id)
new_job(id, priority, 'goes on with job ' .. old, unpack(ARGV, first))
redis.call('HINCRBY', job_key(old), 'continued', 1)
redis.call('HSET', job_key(id), 'continues', old, 'continued_spp', judged_spp, 'variant', before[3],
           'width', before[4], 'height', before[5], 'notes', before[6] or '[]',
           'started_at', now(), 'paused_ms', 0, 'planned', slices, 'issued', slices, 'committed', slices,
           'taken_spp', slices * redis.call('HGET', job_key(id), 'slice_spp'))
for index = 0, slices - 1 do
  local text = redis.call('HGET', job_key(old, 'ledger'), index)
  redis.call('HSET', job_key(id, 'ledger'), index, text)
  local record = cjson.decode(text)
  redis.call('ZADD', job_key(id, 'seeds'), string.format('%.0f', record.first_seed),
             string.format('%.0f-%.0f', record.first_seed, record.last_seed))
end
if checkpoint ~= '' then
  redis.call('HSET', job_key(id), 'checkpoint', checkpoint)
  for _, entry in ipairs(redis.call('XRANGE', job_key(old, 'curve'), '-', judged_spp)) do
    local spp, point = string.match(entry[1], '^%d+'), entry[2][2]
    redis.call('XADD', job_key(id, 'curve'), entry[1], 'point', point)
    redis.call('HSET', job_key(id), 'latest', point, 'spp', spp, 'latest_paused_ms', 0)
    redis.call('HINCRBY', job_key(id), 'points', 1)
    announce(id, 'point', point)
  end
  if (before[7] or '') ~= '' then show(id, before[7], before[8], '') end
end
-- Nobody is shown the secret of a webhook, so none can be sent again for the same receiver.
local hook = redis.call('HMGET', job_key(id, 'webhook'), 'receiver', 'secret')
local told = redis.call('HMGET', job_key(old, 'webhook'), 'receiver', 'secret')
if hook[1] and hook[2] == '' and hook[1] == told[1] then
  redis.call('HSET', job_key(id, 'webhook'), 'secret', told[2])
end
move(id, 'rendering', 'goes on after ' .. slices .. ' slices of job ' .. old)
return {'created', id}
