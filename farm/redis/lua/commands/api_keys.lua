-- Put what is known of an API key, where it is still what it was.
-- ARGV: key's id, what was known of it (JSON) or '' for a new key, what is known now (JSON)
-- Returns 1, or nil where it is another by now, or there is one already.
for_farm.put_key = function(ARGV)
  local id, was, is = ARGV[1], ARGV[2], ARGV[3]
  if (redis.call('HGET', API_KEYS, id) or '') ~= was then return nil end
  redis.call('HSET', API_KEYS, id, is)
  return 1
end

-- Take up to so many requests out of a key's bucket, and note that the key is used.
-- ARGV: key's id, requests wanted, ms in which the bucket gains one, requests that it holds
-- Returns {taken, ms until there is one}; nothing is written where none is taken.
for_farm.take = function(ARGV)
  local id, wanted, interval, burst = ARGV[1], tonumber(ARGV[2]), tonumber(ARGV[3]), tonumber(ARGV[4])
  local rate, at = api_key_key(id, 'rate'), tonumber(now())
  local full_at = math.max(at, tonumber(redis.call('GET', rate) or 0))
  local there = math.floor(burst - (full_at - at) / interval + 1e-6)
  if there < 1 then
    local wait = (1 - burst) * interval + full_at - at
    return {0, string.format('%.0f', math.ceil(wait))}
  end
  local taken = math.min(wanted, there)
  full_at = full_at + taken * interval
  redis.call('SET', rate, string.format('%.3f', full_at), 'PX', math.ceil(full_at - at))
  redis.call('HSET', API_KEYS_USED, id, string.format('%.0f', at))
  return {taken, '0'}
end
