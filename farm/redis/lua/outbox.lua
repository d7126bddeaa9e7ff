-- The outbox: messages about jobs that wait for their receivers, webhooks and targets of notifications. The command that changes a job
-- fills it in the same step, so no change is lost and none is made up.

-- The command's events that webhooks may want: job, event, job, event, …
local happened = {}

-- Note an event of a job, with its data as a table or as JSON.
function Outbox.announce(id, event, data, at)
  local text = type(data) == 'string' and data or cjson.encode(data)
  redis.call('XADD', job_key(id, 'events'), '*', 'type', event, 'at', at or now(), 'data', text)
  local told = event == 'state' and data.to or event == 'finished' and event
  if told then
    happened[#happened + 1] = id
    happened[#happened + 1] = told
  end
end

-- Deliveries that a job remembers; older ones are dropped, delivered or not.
local MOST_DELIVERIES = 100

function Outbox.due_key(receiver) return RECEIVERS .. ':due:' .. receiver end

-- The receiver of a delivery; an older Plateau noted none, since all went to the job's webhook.
local function receiver_of(id, number)
  return redis.call('HGET', job_key(id, 'deliveries'), number .. ' receiver')
      or redis.call('HGET', job_key(id), 'webhook_receiver')
end

-- A receiver is due when the first of its deliveries is.
local function reschedule(receiver)
  local first = redis.call('ZRANGE', Outbox.due_key(receiver), 0, 0, 'WITHSCORES')
  if first[1] then
    redis.call('ZADD', RECEIVERS, first[2], receiver)
  else
    redis.call('ZREM', RECEIVERS, receiver)
  end
end

-- Schedule a try of a delivery (ms), perhaps for the end of a lease on it.
function Outbox.deliver_at(id, number, at)
  local receiver = receiver_of(id, number)
  redis.call('ZADD', Outbox.due_key(receiver), at, id .. ':' .. number)
  reschedule(receiver)
end

-- End the tries of a delivery.
function Outbox.deliver_no_more(id, number)
  local receiver = receiver_of(id, number)
  redis.call('ZREM', Outbox.due_key(receiver), id .. ':' .. number)
  reschedule(receiver)
end

-- Note how a try of a delivery ended.
function Outbox.note_delivery(id, number, status, error, ms)
  redis.call('XADD', job_key(id, 'tries'), 'MAXLEN', '~', 1000, '*', 'delivery', number, 'at', now(),
             'status', status, 'error', head(error, 300), 'ms', ms)
end

-- Forget a delivery of a job, if it has it.
local function drop_delivery(id, number)
  local deliveries = job_key(id, 'deliveries')
  local state = redis.call('HGET', deliveries, number .. ' state')
  if not state then return end
  if state == 'waiting' then count('webhooks dropped') end
  Outbox.deliver_no_more(id, number)
  redis.call('HDEL', deliveries, number, number .. ' state', number .. ' tries', number .. ' token',
             number .. ' receiver')
end

-- Forget all deliveries of a job that is about to be forgotten itself.
function Outbox.drop_deliveries(id)
  for _, number in ipairs(redis.call('HKEYS', job_key(id, 'deliveries'))) do
    if string.match(number, '^%d+$') then drop_delivery(id, number) end
  end
end

-- Put a message into the outbox, with the job as it is now. The spec is left out: it may be large, and does
-- not change. `batch` counts the jobs of the whole batch by state, where the message is about that.
local function put_into_outbox(id, receiver, event, batch)
  local number = redis.call('HINCRBY', job_key(id), 'webhook_count', 1)
  local fields, job = redis.call('HGETALL', job_key(id)), {}
  for i = 1, #fields, 2 do
    if fields[i] ~= 'spec' and string.sub(fields[i], 1, 8) ~= 'webhook_' then
      job[fields[i]] = fields[i + 1]
    end
  end
  redis.call('HSET', job_key(id, 'deliveries'), number .. ' state', 'waiting', number .. ' tries', 0,
             number .. ' receiver', receiver,
             number, cjson.encode({event = event, at = now(), job = job, batch = batch}))
  drop_delivery(id, number - MOST_DELIVERIES)
  Outbox.deliver_at(id, number, now())
  redis.call('PUBLISH', WAKE_WEBHOOKS, id)
end

-- The jobs of a batch by state; nothing while one of them is not done. The newest come first, as they are
-- often done last.
local function whole_batch(name)
  local jobs, states = redis.call('ZREVRANGE', batch_key(name), 0, -1), {}
  for _, id in ipairs(jobs) do
    if redis.call('SISMEMBER', UNFINISHED, id) == 1 then return nil end
  end
  for _, id in ipairs(jobs) do
    local state = redis.call('HGET', job_key(id), 'state')
    if state then states[state] = (states[state] or 0) + 1 end
  end
  return states
end

-- The targets of notifications hear of a job whose results are written. Of a batch they hear when all of it
-- is done, and of each job that failed.
local function tell_targets(id)
  local job = redis.call('HMGET', job_key(id), 'notify', 'batch', 'state')
  if not job[1] then return end
  local in_batch = (job[2] or '') ~= ''
  local batch = in_batch and whole_batch(job[2]) or nil
  if in_batch and not batch and job[3] ~= 'failed' then return end
  for target in string.gmatch(job[1], '%S+') do
    put_into_outbox(id, NOTIFIED .. target, 'finished', batch)
  end
end

local function tell_webhook(id, event)
  local hook = redis.call('HMGET', job_key(id), 'webhook_receiver', 'webhook_events')
  if not hook[1] or not string.find(hook[2], ' ' .. event .. ' ', 1, true) then return end
  put_into_outbox(id, hook[1], event)
end

-- Called at the end of a command, so that a message shows the job as the command left it.
function Outbox.fill()
  for i = 1, #happened, 2 do
    tell_webhook(happened[i], happened[i + 1])
    if happened[i + 1] == 'finished' then tell_targets(happened[i]) end
  end
end
