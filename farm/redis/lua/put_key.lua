-- Put what is known of an API key, where it is still what it was.
-- ARGV: key's id, what was known of it (JSON) or '' for a new key, what is known now (JSON)
-- Returns 1, or nil where it is another by now, or there is one already.
local id, was, is = ARGV[1], ARGV[2], ARGV[3]
if (redis.call('HGET', API_KEYS, id) or '') ~= was then return nil end
redis.call('HSET', API_KEYS, id, is)
return 1
