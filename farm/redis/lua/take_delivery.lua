-- Lease the delivery that is due first, of a receiver that is not busy, to one who tries it. Of a job
-- one is tried at a time, in the order in which they are due.
-- ARGV: token, lease (ms), then receivers that are busy
-- Returns JSON {job, number, tries, receiver, url, secret, spec, sealed, now, delivery (JSON)}, or nil
-- where nothing is due.
local token, lease_ms, busy = ARGV[1], ARGV[2], {}
for i = 3, #ARGV do busy[ARGV[i]] = true end

local function lease(id, number, receiver)
  local deliveries, ends = job_key(id, 'deliveries'), string.format('%.3f', now() + lease_ms)
  if redis.call('HEXISTS', deliveries, number .. ' token') == 1 then
    note_delivery(id, number, '', 'the monitor that tried it was lost, or was cut off from Redis', '')
  end
  redis.call('HSET', deliveries, 'trying until', ends, number .. ' token', token)
  deliver_at(id, number, ends)
  local hook = redis.call('HMGET', job_key(id, 'webhook'), 'url', 'secret')
  local sealed = redis.call('HMGET', job_key(id, 'sealed'), 'owner', 'owner_name')
  return cjson.encode({
    job = id, number = tonumber(number), receiver = receiver, url = hook[1], secret = hook[2],
    spec = redis.call('HGET', job_key(id), 'spec'),
    sealed = {owner = sealed[1] or nil, owner_name = sealed[2] or nil},
    tries = redis.call('HINCRBY', deliveries, number .. ' tries', 1), now = now(),
    delivery = redis.call('HGET', deliveries, number),
  })
end

for _, receiver in ipairs(redis.call('ZRANGEBYSCORE', RECEIVERS, '-inf', now())) do
  if not busy[receiver] then
    local due = redis.call('ZRANGEBYSCORE', due_key(receiver), '-inf', now(), 'LIMIT', 0, 50)
    for _, member in ipairs(due) do
      local id, number = string.match(member, '^(.+):(%d+)$')
      local until_ms = redis.call('HGET', job_key(id, 'deliveries'), 'trying until')
      if not until_ms or tonumber(until_ms) <= tonumber(now()) then
        return lease(id, number, receiver)
      end
    end
  end
end
return nil
