local function lease(id, number, receiver, it)
  local deliveries, ends = job_key(id, 'deliveries'), string.format('%.3f', now() + it.lease_ms)
  if redis.call('HEXISTS', deliveries, number .. ' token') == 1 then
    local why = 'the monitor that tried it was lost, or was cut off from Redis'
    Outbox.note_delivery(id, number, '', why, '')
  end
  redis.call('HSET', deliveries, number .. ' token', it.token, 'trying until', ends)
  Outbox.deliver_at(id, number, ends)
  local hook = redis.call('HMGET', job_key(id, 'webhook'), 'url', 'secret')
  local sealed = redis.call('HMGET', job_key(id, 'sealed'), 'owner', 'owner_name')
  return {
    job = id, number = tonumber(number), receiver = receiver, url = hook[1] or '', secret = hook[2] or '',
    spec = redis.call('HGET', job_key(id), 'spec') or '',  -- as where Redis has lost the job
    sealed = {owner = sealed[1] or nil, owner_name = sealed[2] or nil},
    tries = redis.call('HINCRBY', deliveries, number .. ' tries', 1), now = now(),
    delivery = redis.call('HGET', deliveries, number),
  }
end

-- Lease the first due delivery to a receiver that is not busy. Deliveries of a job are tried one at a time,
-- in the order in which they are due.
-- Returns the delivery, or nothing where none is due.
function for_farm.take_delivery(it)
  local busy = {}
  for _, receiver in ipairs(it.busy) do busy[receiver] = true end
  for _, receiver in ipairs(redis.call('ZRANGEBYSCORE', RECEIVERS, '-inf', now())) do
    if not busy[receiver] then
      local due = redis.call('ZRANGEBYSCORE', Outbox.due_key(receiver), '-inf', now(), 'LIMIT', 0, 50)
      for _, member in ipairs(due) do
        local id, number = string.match(member, '^(.+):(%d+)$')
        local until_ms = redis.call('HGET', job_key(id, 'deliveries'), 'trying until')
        if not until_ms or tonumber(until_ms) <= tonumber(now()) then
          return lease(id, number, receiver, it)
        end
      end
    end
  end
end

-- Report how a try of a delivery ended. 'delivered' counts even after the lease ran out; other ends count
-- only from the lease's holder. After 'failed' another try follows.
-- Returns 'settled', or 'lost': another holds the lease or has settled it, or it is forgotten.
function for_farm.settle_delivery(it)
  local id, number = it.job, it.number
  local deliveries = job_key(id, 'deliveries')
  if redis.call('HEXISTS', deliveries, number) == 0 then return 'lost' end
  if redis.call('HGET', deliveries, number .. ' token') ~= it.token then
    if it['end'] ~= 'delivered' then return 'lost' end
    if redis.call('HGET', deliveries, number .. ' state') == 'delivered' then return 'settled' end
  end
  count('webhook tries ' .. it['end'])
  Outbox.note_delivery(id, number, it.status or '', it.error, it.ms)
  redis.call('HDEL', deliveries, number .. ' token', 'trying until')
  if it['end'] == 'failed' then
    Outbox.deliver_at(id, number, string.format('%.3f', now() + it.delay_ms))
  else
    redis.call('HSET', deliveries, number .. ' state', it['end'])
    Outbox.deliver_no_more(id, number)
  end
  return 'settled'
end

-- Have a delivery tried now, with a fresh count of tries; one that is being tried is left alone.
-- Returns 'queued' or 'unknown'.
function for_farm.redeliver(it)
  local id, number = it.job, it.number
  local deliveries = job_key(id, 'deliveries')
  if redis.call('HEXISTS', deliveries, number) == 0 then return 'unknown' end
  if redis.call('HEXISTS', deliveries, number .. ' token') == 1 then return 'queued' end
  redis.call('HSET', deliveries, number .. ' state', 'waiting', number .. ' tries', 0)
  Outbox.deliver_at(id, number, now())
  redis.call('PUBLISH', WAKE_WEBHOOKS, id)
  return 'queued'
end

-- Give the farm a secret to sign webhooks with, unless it has one.
-- Returns the farm's secret, and the earlier ones that still sign, with blanks between.
function for_farm.farm_secrets(it)
  redis.call('SET', WEBHOOK_SECRET, it.secret, 'NX')
  return redis.call('GET', WEBHOOK_SECRET) .. ' ' .. (redis.call('GET', OLD_WEBHOOK_SECRET) or '')
end

-- Give the farm another secret to sign webhooks with; the newest earlier ones still sign.
function for_farm.renew_farm_secret(it)
  local now_signs, before = redis.call('GET', WEBHOOK_SECRET), redis.call('GET', OLD_WEBHOOK_SECRET)
  local kept = {}
  for secret in string.gmatch((now_signs or '') .. ' ' .. (before or ''), '%S+') do
    if #kept < it.most then kept[#kept + 1] = secret end
  end
  redis.call('SET', OLD_WEBHOOK_SECRET, table.concat(kept, ' '), 'PX', it.signs_for_ms)
  redis.call('SET', WEBHOOK_SECRET, it.secret)
end
