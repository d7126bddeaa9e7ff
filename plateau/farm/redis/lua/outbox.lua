-- The events of jobs, and the outbox: notices of ended jobs that wait for their receivers.

-- Note an event of a job, with its data as a table or as JSON.
function Outbox.announce(id, event, data, at)
  local text = type(data) == 'string' and data or cjson.encode(data)
  redis.call('XADD', job_key(id, 'events'), '*', 'type', event, 'at', at or now(), 'data', text)
end

function Outbox.due_key(receiver) return NOTICES .. ':' .. receiver end

-- Schedule a try of a job's notice (ms), perhaps for the end of a lease on it; none without a time. A
-- receiver is due when the first of its notices is.
function Outbox.schedule(id, receiver, at)
  local due = Outbox.due_key(receiver)
  rank(due, id, at)
  rank(NOTICES, receiver, redis.call('ZRANGE', due, 0, 0, 'WITHSCORES')[2])
end

-- A job's notice to a receiver, and how it stands; nil where there is none.
function Outbox.notice(id, receiver)
  local text = redis.call('HGET', job_key(id, 'sealed'), 'notice ' .. receiver)
  return text and cjson.decode(text) or nil
end

function Outbox.note(id, receiver, notice)
  redis.call('HSET', job_key(id, 'sealed'), 'notice ' .. receiver, cjson.encode(notice))
end

local function receivers_of(id)
  return string.gmatch(redis.call('HGET', job_key(id, 'sealed'), 'receivers') or '', '%S+')
end

-- Forget the notices of a job that is about to be forgotten itself.
function Outbox.drop(id)
  for receiver in receivers_of(id) do Outbox.schedule(id, receiver) end
end

-- The jobs of a batch by state; nothing while one of them is not done.
local function whole_batch(name)
  if After.is_under_way(name, '+inf') then return nil end
  local states = {}
  for _, id in ipairs(redis.call('ZRANGE', batch_key(name), 0, -1)) do
    local state = redis.call('HGET', job_key(id), 'state')
    if state then states[state] = (states[state] or 0) + 1 end
  end
  return states
end

-- Put the notices of a job that is done into the outbox, in the step that makes it so: none is lost, and none
-- is made up. A URL hears of each job. Targets hear of a batch when all of it is done, and of each of its jobs
-- that failed.
function Outbox.fill(id)
  local sealed, job = job_key(id, 'sealed'), redis.call('HMGET', job_key(id), 'batch', 'state')
  if redis.call('HEXISTS', sealed, 'receivers') == 0 then return end
  local in_batch = (job[1] or '') ~= ''
  local batch = in_batch and whole_batch(job[1]) or nil
  if batch then redis.call('HSET', sealed, 'whole_batch', cjson.encode(batch)) end
  for receiver in receivers_of(id) do
    if string.find(receiver, '://', 1, true) or not in_batch or batch or job[2] == 'failed' then
      Outbox.note(id, receiver, {state = 'waiting', at = now()})
      Outbox.schedule(id, receiver, now())
    end
  end
  redis.call('PUBLISH', WAKE_NOTIFIER, id)
end
