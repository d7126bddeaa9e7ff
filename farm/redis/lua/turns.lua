-- Turns: of the jobs of an API key, or of a batch, no more may be rendered at once than their limit says. A
-- job has its turn from when it may be rendered until its results are written, in each of its groups:
-- "key ID" and "batch NAME". A frame has none while it waits for a look at its shot.

local function had_key(group) return PREFIX .. 'turns:had:' .. group end
local function held_key(group) return PREFIX .. 'turns:held:' .. group end

-- How many waiting jobs are looked at when one gives its turn back. Those of one key may be in many
-- batches, each with a limit of its own.
local MOST_LOOKED_AT = 100

-- The groups of a job in which there is a limit: their names, limits and words.
local function groups_of(id)
  local party, key_most, batch, batch_most = unpack(
    redis.call('HMGET', job_key(id), 'party', 'key_at_once', 'batch', 'at_once'))
  local found = {}
  key_most, batch_most = tonumber(key_most or ""), tonumber(batch_most or "")
  if party and key_most then
    found[1] = {name = 'key ' .. party, most = key_most, words = 'key'}
  end
  if batch and batch_most then
    found[#found + 1] = {name = 'batch ' .. batch, most = batch_most, words = 'batch'}
  end
  return found
end

-- The first group that is full, if one is.
local function full(groups)
  for _, group in ipairs(groups) do
    if redis.call('SCARD', had_key(group.name)) >= group.most then return group end
  end
end

local function take(id, groups)
  for _, group in ipairs(groups) do
    redis.call('ZREM', held_key(group.name), id)
    redis.call('SADD', had_key(group.name), id)
    redis.call('SADD', job_key(id, 'turns'), group.name)
  end
end

-- Let a job take its turn, even beyond a limit.
function Turn.take(id) take(id, groups_of(id)) end

-- A job asks for its turn, and waits for it where it cannot have it yet.
-- Returns whether it has it.
function Turn.ask(id)
  local groups = groups_of(id)
  local over = full(groups)
  if not over then
    take(id, groups)
    return true
  end
  for _, group in ipairs(groups) do redis.call('SADD', job_key(id, 'turns'), group.name) end
  local words = 'waits for its turn: of its %s, at most %d may be rendered at once'
  redis.call('HSET', job_key(id), 'turn', 1, 'reason', string.format(words, over.words, over.most))
  Turn.place(id)
  return false
end

-- Put a waiting job into its place: higher priorities come first, then older jobs.
function Turn.place(id)
  if redis.call('HEXISTS', job_key(id), 'turn') == 0 then return end
  local place = string.format('%.0f', redis.call('HGET', job_key(id), 'number')
                                      - 1e12 * redis.call('ZSCORE', OPEN, id))
  for _, group in ipairs(groups_of(id)) do redis.call('ZADD', held_key(group.name), place, id) end
end

-- A job is done, or lost: it gives its turn back, or stops waiting for it, and others may have theirs.
function Turn.give_back(id)
  local names = redis.call('SMEMBERS', job_key(id, 'turns'))
  redis.call('DEL', job_key(id, 'turns'))
  redis.call('HDEL', job_key(id), 'turn')
  for _, name in ipairs(names) do
    redis.call('SREM', had_key(name), id)
    redis.call('ZREM', held_key(name), id)
  end
  for _, name in ipairs(names) do
    for _, waiting in ipairs(redis.call('ZRANGE', held_key(name), 0, MOST_LOOKED_AT - 1)) do
      local groups = groups_of(waiting)
      if Job.is_open(waiting) and not full(groups) then
        take(waiting, groups)
        redis.call('HDEL', job_key(waiting), 'turn')
        Job.may_begin(waiting, 'it is its turn')
      end
    end
  end
end
