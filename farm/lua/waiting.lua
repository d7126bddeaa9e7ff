-- The index of the jobs that wait for a worker, so that a lease looks at no others. Shared by every
-- script, as prelude.lua is: what a script has changed of a job is filed when the script is done, and
-- workers that have nothing to do are woken for it.
--
-- A queue is a priority and a variant, 'auto' until a job is pinned to one. In a queue each owner (an
-- API key, or '' for nobody's jobs) has one entry, and in each owner's part of it each batch, and each
-- job without one. An entry is a party's next job. It is scored by what the party has leased, in spp,
-- at this priority and above; of equal ones the members decide, which are made to sort as they should.

-- Jobs that the script has changed, and among them those that have more to give than before.
local changed, has_more = {}, {}

local function waiting_key(queue, owner, batch)
  return WAITING .. ':' .. queue .. (owner and ':' .. owner or '') .. (batch and ':' .. batch or '')
end

local function share_key(owner, batch)
  return PREFIX .. 'share:' .. owner .. (batch and ':' .. batch or '')
end

local function priority_of(queue) return tonumber(string.match(queue, '^%S+')) end

-- A number that sorts as text, and what it belongs to.
local function sortable(number, member) return string.format('%016.0f %s', number, member) end

-- Of a party, what it has leased by priority, and its entries by queue.
local function share_of(party)
  local share, flat = {}, redis.call('HGETALL', party)
  for i = 1, #flat, 2 do share[flat[i]] = flat[i + 1] end
  return share
end

local function add_leased(party, priority, spp)
  if priority == '' or spp == 0 then return end
  if redis.call('HINCRBY', party, priority, spp) == 0 then redis.call('HDEL', party, priority) end
end

local function leased_from(share, priority)
  local leased = 0
  for at, spp in pairs(share) do
    if (tonumber(at) or -math.huge) >= priority then leased = leased + spp end
  end
  return leased
end

-- The first of a party's own becomes its entry among the parties that it competes with.
local function put_first_forward(own, among, party, share, queue)
  local first, was = redis.call('ZRANGE', own, 0, 0, 'WITHSCORES'), share[queue]
  local entry = first[1] and sortable(first[2], first[1])
  if was and was ~= entry then redis.call('ZREM', among, was) end
  if entry then
    redis.call('ZADD', among, leased_from(share, priority_of(queue)), entry)
    if was ~= entry then redis.call('HSET', party, queue, entry) end
  elseif was then
    redis.call('HDEL', party, queue)
  end
end

-- Do so in each queue in which the party has an entry, and in these, of which '' is none.
local function put_forward(party, keys_of, ...)
  local share, queues = share_of(party), {}
  for field in pairs(share) do
    if string.find(field, ' ') then queues[field] = true end
  end
  for _, queue in ipairs({...}) do
    if queue ~= '' then queues[queue] = true end
  end
  for queue in pairs(queues) do
    local own, among = keys_of(queue)
    put_first_forward(own, among, party, share, queue)
  end
end

-- A worker has nothing to do, and is woken when there is something that it can render.
local function note_idle(worker, variants)
  if redis.call('HSETNX', IDLE, worker, 1) == 0 then return end
  redis.call('SADD', IDLE .. ':auto', worker)
  for _, variant in ipairs(variants) do redis.call('SADD', IDLE .. ':' .. variant, worker) end
end

-- Wake as many idle workers as there are slices for them. A set may name some that found other work
-- meanwhile, and some that died: neither is counted.
local function wake_workers(variant, slices)
  while slices > 0 do
    local worker = redis.call('SPOP', IDLE .. ':' .. variant)
    if not worker then return end
    if redis.call('HDEL', IDLE, worker) == 1 then
      slices = slices - redis.call('PUBLISH', wake_worker_key(worker), 'planned')
    end
  end
end

-- The queue in which a job waits; '' where it has nothing to give, or must not.
local function queue_for(id, priority, state, held, ready, variant)
  if not priority or state == 'paused' or held then return '' end
  if tonumber(ready) == 0 and redis.call('EXISTS', job_key(id, 'lost')) == 0 then return '' end
  return priority .. ' ' .. variant
end

local NOT_FILED = ' 0 '

-- Bring what is filed of a job, its priority, the spp leased of it and its queue, up to what it is.
local function file(id)
  local state, held, ready, leased, slice_spp, number, owner, batch, pinned, asked, was = unpack(
    redis.call('HMGET', job_key(id), 'state', 'held', 'ready', 'leased', 'slice_spp', 'number',
               'owner', 'batch', 'variant', 'asked_variant', 'filed'))
  if not state then return end
  local priority = redis.call('ZSCORE', OPEN, id)  -- none once it has ended
  local queue = queue_for(id, priority, state, held, ready, pinned or asked)
  local spp = priority and (leased or 0) * slice_spp or 0
  local counts = spp > 0 or queue ~= ''
  local filed = counts and string.format('%s %.0f %s', priority, spp, queue) or NOT_FILED
  if queue ~= '' and has_more[id] then
    wake_workers(pinned or asked, ready + redis.call('ZCARD', job_key(id, 'lost')))
  end
  was = was or NOT_FILED
  if filed == was then return end
  if filed == NOT_FILED then
    redis.call('HDEL', job_key(id), 'filed')
  else
    redis.call('HSET', job_key(id), 'filed', filed)
  end
  local old_priority, old_spp, old_queue = string.match(was, '^(%S*) (%d+) (.*)$')
  owner, batch = owner or '', batch and batch ~= '' and batch or nil
  for _, party in ipairs({share_key(owner), batch and share_key(owner, batch)}) do
    add_leased(party, old_priority, -old_spp)
    if priority then add_leased(party, priority, spp) end
  end
  local member = batch and id or sortable(number, id)
  if old_queue ~= '' and old_queue ~= queue then
    redis.call('ZREM', waiting_key(old_queue, owner, batch), member)
  end
  if queue ~= '' then
    redis.call('ZADD', waiting_key(queue, owner, batch), batch and number or spp, member)
  end
  if batch then
    put_forward(share_key(owner, batch), function(of)
      return waiting_key(of, owner, batch), waiting_key(of, owner)
    end, old_queue, queue)
  end
  put_forward(share_key(owner), function(of)
    return waiting_key(of, owner), waiting_key(of)
  end, old_queue, queue)
  for _, of in ipairs({old_queue, queue}) do
    if of ~= '' and redis.call('EXISTS', waiting_key(of)) == 0 then
      redis.call('ZREM', WAITING, of)
    elseif of ~= '' then
      redis.call('ZADD', WAITING, priority_of(of), of)
    end
  end
end

local function file_changed()
  for id in pairs(changed) do file(id) end
  changed, has_more = {}, {}
end
