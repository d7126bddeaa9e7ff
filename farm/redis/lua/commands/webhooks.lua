-- Lease the delivery that is due first, of a receiver that is not busy, to one who tries it. Of a job
-- one is tried at a time, in the order in which they are due.
-- ARGV: token, lease (ms), then receivers that are busy
-- Returns JSON {job, number, tries, receiver, url, secret, spec, sealed, now, delivery (JSON)}, or nil
-- where nothing is due.
for_farm.take_delivery = function(ARGV)
  local token, lease_ms, busy = ARGV[1], ARGV[2], {}
  for i = 3, #ARGV do busy[ARGV[i]] = true end

  local function lease(id, number, receiver)
    local deliveries, ends = job_key(id, 'deliveries'), string.format('%.3f', now() + lease_ms)
    if redis.call('HEXISTS', deliveries, number .. ' token') == 1 then
      Outbox.note_delivery(id, number, '', 'the monitor that tried it was lost, or was cut off from Redis', '')
    end
    redis.call('HSET', deliveries, 'trying until', ends, number .. ' token', token)
    Outbox.deliver_at(id, number, ends)
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
      local due = redis.call('ZRANGEBYSCORE', Outbox.due_key(receiver), '-inf', now(), 'LIMIT', 0, 50)
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
end

-- Say how a try of a delivery ended. Whoever has delivered it is believed, though his lease may have
-- run out; of the other ends only that of the lease's holder counts.
-- ARGV: job, number, token, 'delivered', 'failed' (another try follows) or 'given-up', ms until the
--       next try, status or '', error or '', ms that it took
-- Returns 'settled', or 'lost': another holds the lease or has settled it, or it is forgotten.
for_farm.settle_delivery = function(ARGV)
  local id, number, token, outcome = ARGV[1], ARGV[2], ARGV[3], ARGV[4]
  local deliveries = job_key(id, 'deliveries')
  if redis.call('HEXISTS', deliveries, number) == 0 then return 'lost' end
  local holder = redis.call('HGET', deliveries, number .. ' token')
  if holder ~= token then
    if outcome ~= 'delivered' then return 'lost' end
    if redis.call('HGET', deliveries, number .. ' state') == 'delivered' then return 'settled' end
  end
  count('webhook tries ' .. outcome)
  Outbox.note_delivery(id, number, ARGV[6], ARGV[7], ARGV[8])
  redis.call('HDEL', deliveries, 'trying until', number .. ' token')
  if outcome == 'failed' then
    Outbox.deliver_at(id, number, string.format('%.3f', now() + ARGV[5]))
  else
    redis.call('HSET', deliveries, number .. ' state', outcome)
    Outbox.deliver_no_more(id, number)
  end
  return 'settled'
end

-- Have a delivery tried now, with all tries before it; one that is being tried is left alone.
-- ARGV: job, number
-- Returns 'queued' or 'unknown'.
for_farm.redeliver = function(ARGV)
  local id, number = ARGV[1], ARGV[2]
  local deliveries = job_key(id, 'deliveries')
  if redis.call('HEXISTS', deliveries, number) == 0 then return 'unknown' end
  if redis.call('HEXISTS', deliveries, number .. ' token') == 1 then return 'queued' end
  redis.call('HSET', deliveries, number .. ' state', 'waiting', number .. ' tries', 0)
  Outbox.deliver_at(id, number, now())
  redis.call('PUBLISH', WAKE_WEBHOOKS, id)
  return 'queued'
end

-- Give the farm a secret to sign webhooks with, unless it has one.
-- ARGV: a secret
-- Returns {the farm's secret, those before it that sign still, with blanks between}.
for_farm.farm_secrets = function(ARGV)
  redis.call('SET', WEBHOOK_SECRET, ARGV[1], 'NX')
  return {redis.call('GET', WEBHOOK_SECRET), redis.call('GET', OLD_WEBHOOK_SECRET) or ''}
end

-- Give the farm another secret to sign webhooks with; the newest of those before it go on signing.
-- ARGV: the secret, ms for which the others sign, how many of them
for_farm.renew_farm_secret = function(ARGV)
  local former = (redis.call('GET', WEBHOOK_SECRET) or '') .. ' ' .. (redis.call('GET', OLD_WEBHOOK_SECRET) or '')
  local kept = {}
  for secret in string.gmatch(former, '%S+') do
    if #kept < tonumber(ARGV[3]) then kept[#kept + 1] = secret end
  end
  redis.call('SET', OLD_WEBHOOK_SECRET, table.concat(kept, ' '), 'PX', ARGV[2])
  redis.call('SET', WEBHOOK_SECRET, ARGV[1])
end
