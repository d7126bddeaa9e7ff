-- The members of the farm and the versions that they speak. `OLDEST`, `NEWEST` and `PLATEAU` are those of
-- the process that runs the script; see farm/model/versions.py.

-- The monitors and APIs that live.
local function living_members()
  local found = {}
  for _, kind in ipairs({{MONITORS, monitor_key}, {APIS, api_member_key}}) do
    for _, id in ipairs(redis.call('ZRANGEBYSCORE', kind[1], now(), '+inf')) do
      found[#found + 1] = kind[2](id)
    end
  end
  return found
end

-- The versions that all living monitors and APIs speak, without the member of the key `without`; nil
-- without any.
local function spoken_by_all(without)
  local oldest, newest, plateau
  for _, member in ipairs(living_members()) do
    local says = redis.call('HMGET', member, 'oldest', 'newest', 'plateau')
    if says[1] and member ~= without then
      oldest = math.max(oldest or 0, says[1])
      if not newest or tonumber(says[2]) < newest then newest, plateau = tonumber(says[2]), says[3] end
    end
  end
  return oldest, newest, plateau
end

-- An error where this process speaks none of these versions, for a command to return after its answer;
-- nil where it does.
local function refusal(oldest, newest, plateau)
  if not oldest or OLDEST <= tonumber(newest) and tonumber(oldest) <= NEWEST then return nil end
  return redis.error_reply('REFUSED ' .. oldest .. ' ' .. newest .. ' ' .. plateau)
end

-- The same of the farm and a worker.
function Member.refusal_of_worker()
  return refusal(unpack(redis.call('HMGET', PROTOCOL, 'oldest', 'newest', 'plateau')))
end

-- A monitor or an API lives, or signs off without `about`; the farm then speaks what the others speak.
-- Returns a refusal where it speaks no version of all others: it is then no member.
function Member.note(members, key, id, about, life_ms)
  local refused = about and refusal(spoken_by_all(key))
  if refused then return refused end
  if not about then
    redis.call('ZREM', members, id)
  else
    redis.call('HSET', key, 'about', about, 'seen_at', now(), 'oldest', OLDEST, 'newest', NEWEST,
               'plateau', PLATEAU)
    redis.call('ZADD', members, now() + life_ms, id)
  end
  redis.call('EXPIRE', key, 86400)
  redis.call('ZREMRANGEBYSCORE', members, '-inf', now() - 3600000)
  local oldest, newest, plateau = spoken_by_all()
  if oldest then redis.call('HSET', PROTOCOL, 'oldest', oldest, 'newest', newest, 'plateau', plateau) end
end
