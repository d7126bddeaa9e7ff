-- Store an API key, if the stored one is still `instead_of`.
-- Returns whether it is stored.
function for_farm.put_key(it)
  if (redis.call('HGET', API_KEYS, it.key) or '') ~= it.instead_of then return false end
  redis.call('HSET', API_KEYS, it.key, it.known)
  return true
end

-- Take up to `wanted` requests out of a key's bucket, and note the key's use.
-- Returns how many were taken. If none was, returns the ms until the next, and writes nothing.
function for_farm.take(it)
  local interval = it.interval_ms
  local rate, at = api_key_key(it.key, 'rate'), tonumber(now())
  local full_at = math.max(at, tonumber(redis.call('GET', rate) or 0))
  local there = math.floor(it.burst - (full_at - at) / interval + 1e-6)
  if there < 1 then return {taken = 0, wait_ms = math.ceil((1 - it.burst) * interval + full_at - at)} end
  local taken = math.min(it.wanted, there)
  full_at = full_at + taken * interval
  redis.call('SET', rate, string.format('%.3f', full_at), 'PX', math.ceil(full_at - at))
  redis.call('HSET', API_KEYS_USED, it.key, string.format('%.0f', at))
  return {taken = taken, wait_ms = 0}
end
