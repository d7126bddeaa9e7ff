-- Store an API key, if the stored one is still `instead_of`.
-- Returns whether it is stored.
function for_farm.put_key(it)
  if (redis.call('HGET', API_KEYS, it.key) or '') ~= it.instead_of then return false end
  redis.call('HSET', API_KEYS, it.key, it.known)
  return true
end

-- Note that a key is used now.
function for_farm.note_use(it) redis.call('HSET', API_KEYS_USED, it.key, string.format('%.0f', now())) end
