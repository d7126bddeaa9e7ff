-- Note the troubles that somebody sees now, each for a target: "SCOPE TARGET TROUBLE". Those of this scope
-- that are not among them are over, and forgotten.
-- Returns those to tell now, which have lasted for `patience_ms` and were not told: for `lease_ms` nobody
-- else is asked to tell them.
function for_farm.note_troubles(it)
  local there, due = {}, {}
  for _, trouble in ipairs(it.found) do
    there[trouble] = true
    redis.call('HSETNX', TROUBLES, trouble, now() .. ' 0')
    local since, free_at = string.match(redis.call('HGET', TROUBLES, trouble), '^(%S+) (%S+)$')
    if free_at ~= 'told' and now() - since >= it.patience_ms and now() - free_at >= 0 then
      redis.call('HSET', TROUBLES, trouble, string.format('%s %.3f', since, now() + it.lease_ms))
      due[#due + 1] = trouble
    end
  end
  for _, had in ipairs(redis.call('HKEYS', TROUBLES)) do
    if string.sub(had, 1, #it.scope + 1) == it.scope .. ' ' and not there[had] then
      redis.call('HDEL', TROUBLES, had)
    end
  end
  return due
end

-- A trouble is told, and will not be told again until it is over.
function for_farm.note_told(it)
  local had = redis.call('HGET', TROUBLES, it.trouble)
  if had then redis.call('HSET', TROUBLES, it.trouble, string.match(had, '^%S+') .. ' told') end
end
