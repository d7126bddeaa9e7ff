-- The functions that all other files use.

-- A hostile worker may write anything, and must not keep a script busy for ever: no loop starts or ends at
-- a worker's number, and a pattern is matched against the start of a text only, since matching may take
-- time at each character.
local MOST_MATCHED = 4096
local lua_string = string
local string = setmetatable({
  match = function(text, ...) return lua_string.match(lua_string.sub(text, 1, MOST_MATCHED), ...) end,
  gmatch = function(text, ...) return lua_string.gmatch(lua_string.sub(text, 1, MOST_MATCHED), ...) end,
}, {__index = lua_string})

-- Milliseconds by Redis's clock, to the microsecond, so that no two steps have the same time; as
-- text, since Lua would print 1.7e+12.
local function now()
  local time = redis.call('TIME')
  return string.format('%.3f', time[1] * 1000 + time[2] / 1000)
end

-- Does a field of decoded JSON have a value?
local function given(value) return value ~= nil and value ~= cjson.null end

-- A hash as a table.
local function table_of(key)
  local found, flat = {}, redis.call('HGETALL', key)
  for i = 1, #flat, 2 do found[flat[i]] = flat[i + 1] end
  return found
end

-- Set a field of a hash, or a member's score, or remove it where there is no value.
local function put(key, field, value)
  if value then redis.call('HSET', key, field, value) else redis.call('HDEL', key, field) end
end
local function rank(key, member, score)
  if score then redis.call('ZADD', key, score, member) else redis.call('ZREM', key, member) end
end

-- Add to a total of the whole farm; see plateau/farm/ledger/totals.py.
local function count(total, more) redis.call('HINCRBY', TOTALS, total, string.format('%.0f', more or 1)) end

-- The start or the end of a text, up to `most` bytes, without half a character of UTF-8.
local function head(text, most)
  if #text <= most then return text end
  return (string.gsub(string.sub(text, 1, most), '[\192-\255][\128-\191]*$', ''))
end
local function tail(text, most)
  if #text <= most then return text end
  return (string.gsub(string.sub(text, -most), '^[\128-\191]+', ''))
end

-- Jobs that the script has changed, and among them those with more slices to lease than before.
local changed, has_more = {}, {}
