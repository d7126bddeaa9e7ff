-- Jobs that wait until others have ended well: converged or exhausted, with their results written.
--
-- A gate is what a job waits for: "job ID", or "batch NUMBER NAME", the jobs of a batch up to the one of this
-- number, its newest when the waiting job was made. So a job waits only for older ones, and no two for each other.

local WELL = {converged = true, exhausted = true}

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
function After.is_under_way(name, number)
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
  for i, gate in ipairs(gates) do redis.call('ZADD', job_key(id, 'after'), i, gate) end
  redis.call('SADD', AWAITING, id)
  note_wait(id)
end

-- A job that ends while it waits is in front of no gate any more.
local function wait_no_more(id)
  redis.call('SREM', AWAITING, id)
  redis.call('DEL', job_key(id, 'after'))
  redis.call('HDEL', job_key(id), 'awaits')
end

-- What a gate stands for has ended well: a job that waits for nothing else may be rendered.
local function open(id, gate)
  redis.call('ZREM', job_key(id, 'after'), gate)
  if redis.call('EXISTS', job_key(id, 'after')) == 1 then return note_wait(id) end
  wait_no_more(id)
  has_more[id] = true
  Job.note_queued(id, 'all that it waited for has ended well', 'waiting for a worker')
end

local BADLY = {failed = 'failed', cancelled = 'was cancelled', lost = 'is lost'}

-- A job is done, or lost: those that waited for it, or for its batch, go on or are cancelled.
function After.settle(id)
  wait_no_more(id)
  local how = standing(id)
  local batch, place = unpack(redis.call('HMGET', job_key(id), 'batch', 'number'))
  local known = {}  -- what each gate is by now: shut, open or as before

  local function becomes(gate)
    local number, name = batch_of(gate)
    local at = name == batch and place or name and redis.call('ZSCORE', batch_key(name), id)
    if gate ~= 'job ' .. id and not (at and number - at >= 0) then return 'as before' end
    if how ~= 'well' then return 'shut' end
    return name and After.is_under_way(name, number) and 'as before' or 'open'
  end

  for _, waiting in ipairs(redis.call('SMEMBERS', AWAITING)) do
    for _, gate in ipairs(redis.call('ZRANGE', job_key(waiting, 'after'), 0, -1)) do
      known[gate] = known[gate] or becomes(gate)
      if not Job.is_open(waiting) then break end
      if known[gate] == 'open' then open(waiting, gate) end
      if known[gate] == 'shut' then
        wait_no_more(waiting)
        local words = string.format('%s, for which it waited, %s', job_in_words(id), BADLY[how])
        Job.end_with(waiting, 'cancelled', 'predecessor', words)
      end
    end
  end
end
