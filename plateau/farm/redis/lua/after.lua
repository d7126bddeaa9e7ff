-- Jobs that wait until others have ended well: converged or exhausted, with their results written.
--
-- A gate is what a job waits for: "job ID", or "batch NUMBER NAME", the jobs of a batch up to the one of this
-- number, its newest when the waiting job was made. So a job waits only for older ones, and no two for each other.

local WELL = {converged = true, exhausted = true}

local function gate_key(gate) return PREFIX .. 'gate:' .. gate end

-- How a job stands: 'well'; 'open', until its results are written; 'lost' where Redis has no state of it; or
-- the state at which it ended without an image to go by.
local function standing(id)
  local state, finished = unpack(redis.call('HMGET', job_key(id), 'state', 'finished_at'))
  if not state then return 'lost' end
  if not MOVES[state].cancelled and not WELL[state] then return state end
  return finished and 'well' or 'open'
end

-- The number and the name of the batch of a gate; nil for that of a job.
local function batch_of(gate) return string.match(gate, '^batch (%d+) (.+)$') end

-- Is one of the first jobs of a batch not done? The newest come first, as they are often done last.
local function is_under_way(name, number)
  for _, id in ipairs(redis.call('ZREVRANGEBYSCORE', batch_key(name), number, '-inf')) do
    if redis.call('SISMEMBER', UNFINISHED, id) == 1 then return true end
  end
  return false
end

local function job_in_words(id)
  return string.format('job %s (%s)', redis.call('HGET', job_key(id), 'name') or '?', id)
end

-- Note how many gates a job still waits for, and for which.
local function note_wait(id)
  local gates, words = redis.call('ZRANGE', job_key(id, 'after'), 0, -1), {}
  for i, gate in ipairs(gates) do
    local _, name = batch_of(gate)
    words[i] = name and 'batch ' .. name or job_in_words(string.match(gate, '%S+$'))
  end
  redis.call('HSET', job_key(id), 'awaits', #gates, 'reason', 'waits for ' .. table.concat(words, ', '))
end

-- The gates of these names, of jobs or batches, that are not open yet; or nil, and a refusal with the name
-- that is unknown, or the job that has not ended well.
function After.gates(names)
  local gates = {}
  for _, name in ipairs(names) do
    local is_job = #name == 12 and not string.find(name, '%X') and redis.call('EXISTS', job_key(name)) == 1
    local jobs, gate = {name}, 'job ' .. name
    if not is_job then
      local newest = redis.call('ZSCORE', BATCHES, name)
      if not newest then return nil, {outcome = 'cannot follow', after = name, state = 'missing'} end
      jobs, gate = redis.call('ZRANGE', batch_key(name), 0, -1), string.format('batch %s %s', newest, name)
    elseif redis.call('HEXISTS', job_key(name, 'sealed'), 'deleted_at') == 1 then
      return nil, {outcome = 'cannot follow', after = name, state = 'deleted'}
    end
    local is_open = true
    for _, id in ipairs(jobs) do
      local how = standing(id)
      if how ~= 'well' and how ~= 'open' then
        return nil, {outcome = 'cannot follow', after = job_in_words(id), state = how}
      end
      is_open = is_open and how == 'well'
    end
    if not is_open then gates[#gates + 1] = gate end
  end
  return gates
end

-- A new job waits for these gates.
function After.wait(id, gates)
  if #gates == 0 then return end
  for i, gate in ipairs(gates) do
    redis.call('ZADD', job_key(id, 'after'), i, gate)
    redis.call('SADD', gate_key(gate), id)
    local number = batch_of(gate)
    if number then redis.call('ZADD', GATES, number, gate) end
  end
  note_wait(id)
end

-- The open jobs that wait for a gate, which is no more.
local function take_waiting(gate)
  local waiting = {}
  for _, id in ipairs(redis.call('SMEMBERS', gate_key(gate))) do
    if Job.is_open(id) then waiting[#waiting + 1] = id end
  end
  redis.call('DEL', gate_key(gate))
  redis.call('ZREM', GATES, gate)
  return waiting
end

-- What a gate stands for has ended well: jobs that wait for nothing else may be rendered.
local function open(gate)
  for _, id in ipairs(take_waiting(gate)) do
    redis.call('ZREM', job_key(id, 'after'), gate)
    if redis.call('EXISTS', job_key(id, 'after')) == 1 then
      note_wait(id)
    else
      redis.call('HDEL', job_key(id), 'awaits')
      Job.may_begin(id, 'all that it waited for has ended well')
    end
  end
end

-- A job that ends while it waits is in front of no gate any more.
local function wait_no_more(id)
  for _, gate in ipairs(redis.call('ZRANGE', job_key(id, 'after'), 0, -1)) do
    redis.call('SREM', gate_key(gate), id)
    if redis.call('EXISTS', gate_key(gate)) == 0 then redis.call('ZREM', GATES, gate) end
  end
  redis.call('DEL', job_key(id, 'after'))
  redis.call('HDEL', job_key(id), 'awaits')
end

local BADLY = {failed = 'failed', cancelled = 'was cancelled', lost = 'is lost'}

-- A job of what a gate stands for has not ended well: those that wait for it never can be rendered.
local function shut(gate, id, how)
  local words = string.format('%s, for which it waited, %s', job_in_words(id), BADLY[how])
  for _, waiting in ipairs(take_waiting(gate)) do
    wait_no_more(waiting)
    Job.end_with(waiting, 'cancelled', 'predecessor', words)
  end
end

-- A job is done, or lost: what waited for it, or for its batch, goes on or is cancelled.
function After.settle(id)
  wait_no_more(id)
  local how = standing(id)
  if how == 'well' then open('job ' .. id) else shut('job ' .. id, id, how) end
  local batch, place = unpack(redis.call('HMGET', job_key(id), 'batch', 'number'))
  for _, gate in ipairs(redis.call('ZRANGE', GATES, 0, -1)) do
    local number, name = batch_of(gate)
    local at = name == batch and place or redis.call('ZSCORE', batch_key(name), id)
    if at and number - at >= 0 then
      if how ~= 'well' then
        shut(gate, id, how)
      elseif not is_under_way(name, number) then
        open(gate)
      end
    end
  end
end
