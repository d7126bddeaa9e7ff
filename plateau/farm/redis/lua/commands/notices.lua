local function lease(id, receiver, it)
  local notice = Outbox.notice(id, receiver) or {}
  if notice.token then notice.error = 'the monitor that tried it was lost, or was cut off from Redis' end
  notice.tries, notice.token = (notice.tries or 0) + 1, it.token
  Outbox.note(id, receiver, notice)
  Outbox.schedule(id, receiver, string.format('%.3f', now() + it.lease_ms))
  return {
    job = id, receiver = receiver, tries = notice.tries, now = now(),
    fields = redis.call('HGETALL', job_key(id)), sealed = redis.call('HGETALL', job_key(id, 'sealed')),
  }
end

-- Lease the first due notice to a receiver that is not busy.
-- Returns the notice, or nothing where none is due.
function for_farm.take_notice(it)
  local busy = {}
  for _, receiver in ipairs(it.busy) do busy[receiver] = true end
  for _, receiver in ipairs(redis.call('ZRANGEBYSCORE', NOTICES, '-inf', now())) do
    local id = not busy[receiver] and redis.call('ZRANGE', Outbox.due_key(receiver), 0, 0)[1]
    if id then return lease(id, receiver, it) end
  end
end

-- Report how a try of a notice ended. 'delivered' counts even after the lease ran out; other ends count
-- only from the lease's holder. After 'failed' another try follows.
-- Returns 'settled', or 'lost': another holds the lease or has settled it, or it is forgotten.
function for_farm.settle_notice(it)
  local notice = Outbox.notice(it.job, it.receiver)
  if not notice then return 'lost' end
  if notice.token ~= it.token then
    if it['end'] ~= 'delivered' then return 'lost' end
    if notice.state == 'delivered' then return 'settled' end
  end
  count('notice tries ' .. it['end'])
  local again, error = it['end'] == 'failed', it.error ~= '' and head(it.error, 300) or nil
  local state = again and 'waiting' or it['end']
  Outbox.note(it.job, it.receiver, {state = state, at = now(), error = error, tries = notice.tries})
  Outbox.schedule(it.job, it.receiver, again and string.format('%.3f', now() + it.delay_ms) or nil)
  return 'settled'
end
