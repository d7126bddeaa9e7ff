-- The index of the jobs that wait for a worker, so that a lease looks at no others. At the end of a command
-- its changed jobs are filed, and idle workers are woken for them.
--
-- A queue is a priority and a class: a variant, 'auto' until a job is pinned to one, and the pool and tags
-- that the job needs. A party is an owner (an API key, or '' for jobs without one), or a batch of it. In a
-- queue each owner has one entry, and in each owner's part of it each batch, and each job without one. An
-- entry is a party's next job. Its score is the spp that the party has leased at this priority and above;
-- among equal scores the member decides, whose text sorts by age.
--
--   need   "POOL", or "POOL TAG,TAG"
--   class  "VARIANT NEED"
--   queue  "PRIORITY CLASS"                    kind   "POOL VARIANT,VARIANT TAG,TAG" of a worker

function Waiting.key(queue, owner, batch)
  return WAITING .. ':' .. queue .. (owner and ':' .. owner or '') .. (batch and ':' .. batch or '')
end

local function share_key(owner, batch)
  return PREFIX .. 'share:' .. owner .. (batch and ':' .. batch or '')
end

local function priority_of(queue) return tonumber(string.match(queue, '^%S+')) end

-- A number that sorts as text, and what it belongs to.
local function sortable(number, member) return string.format('%016.0f %s', number, member) end

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

-- The first job of a party becomes its entry among the parties that it competes with.
local function put_first_forward(own, among, party, share, queue)
  local first, was = redis.call('ZRANGE', own, 0, 0, 'WITHSCORES'), share[queue]
  local entry = first[1] and sortable(first[2], first[1])
  if was and was ~= entry then redis.call('ZREM', among, was) end
  if entry then redis.call('ZADD', among, leased_from(share, priority_of(queue)), entry) end
  if was ~= entry then put(party, queue, entry) end
end

-- Do so in each queue in which the party has an entry, and in these, where '' means none.
local function put_forward(party, keys_of, ...)
  local share, queues = table_of(party), {}  -- its leased spp by priority, and its entries by queue
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

-- Is it one of these, separated by commas?
local function is_among(one, these)
  return string.find(',' .. these .. ',', ',' .. one .. ',', 1, true) ~= nil
end

-- The jobs that a worker leaves to others for a while, by its field `left_out`, each with the time until
-- which it does (ms).
local LEFT_OUT_MS, MOST_READ = 120000, 65536
-- An id has twelve digits: a pattern of this length takes no longer for a hostile text.
local LEFT_OUT = '(' .. string.rep('%x', 12) .. ') (%d+)'

function Waiting.left_out_of(worker)
  local jobs, text = {}, redis.call('HGET', worker_key(worker), 'left_out') or ''
  for id, till in lua_string.gmatch(lua_string.sub(text, 1, MOST_READ), LEFT_OUT) do
    if till - now() > 0 then jobs[id] = till end
  end
  return jobs
end

-- A worker is left out of a job from now on: slices of it died there, or it cannot read its spec or files.
function Waiting.leave_out(worker, id)
  local jobs, text = Waiting.left_out_of(worker), {}
  jobs[id] = string.format('%.0f', now() + LEFT_OUT_MS)
  for job, till in pairs(jobs) do text[#text + 1] = job .. ' ' .. till end
  redis.call('HSET', worker_key(worker), 'left_out', table.concat(text, ' '))
  redis.call('EXPIRE', worker_key(worker), 3600)
end

-- The kind of a worker, by its description.
function Waiting.kind_of(about)
  return string.format('%s %s %s', about.pool or DEFAULT_POOL, table.concat(about.variants or {}, ','),
                       table.concat(about.tags or {}, ','))
end

-- The class of a job.
function Waiting.class_of(id)
  local pinned, asked, need = unpack(redis.call('HMGET', job_key(id), 'variant', 'asked_variant', 'need'))
  return (pinned or asked or 'auto') .. ' ' .. (need or DEFAULT_POOL)
end

-- May another living worker that takes work render the job?
function Waiting.is_served_by_another(worker, id, alive_ms)
  local class = Waiting.class_of(id)
  for _, other in ipairs(redis.call('ZRANGEBYSCORE', WORKERS, now() - alive_ms, '+inf')) do
    local about, drained = unpack(redis.call('HMGET', worker_key(other), 'about', 'drained'))
    local read, it = pcall(cjson.decode, about)
    about = read and type(it) == 'table' and it or {}
    local takes_work = other ~= worker and not drained and not given(about.trouble)
    if takes_work and Waiting.variant_of(Waiting.kind_of(about), class)
       and not Waiting.left_out_of(other)[id] then return true end
  end
  return false
end

-- The first job of a queue, or of the part of it of an owner or a batch, that is not among `left_out`, which
-- are so many; with the entry that it comes from, and the entry's score.
function Waiting.first(queue, left_out, most, owner, batch)
  local entries = redis.call('ZRANGE', Waiting.key(queue, owner, batch), 0, most, 'WITHSCORES')
  for i = 1, #entries, 2 do
    local id = string.match(entries[i], '%S+$')
    if left_out[id] and not batch then
      local party, its_batch = unpack(redis.call('HMGET', job_key(id), 'party', 'batch'))
      if not owner then
        id = Waiting.first(queue, left_out, most, party or '')
      else
        id = (its_batch or '') ~= '' and Waiting.first(queue, left_out, most, owner, its_batch)
      end
    end
    if id and not left_out[id] then return id, entries[i], tonumber(entries[i + 1]) end
  end
end

-- The variant with which workers of this kind render jobs of this class, or nil.
function Waiting.variant_of(kind, class)
  local pool, variants, tags = string.match(kind, '^(%S+) (%S*) (%S*)$')
  local wanted, in_pool, required = string.match(class, '^(%S+) (%S+) ?(.*)')
  if pool ~= in_pool then return nil end
  for tag in string.gmatch(required, '[^, ]+') do
    if not is_among(tag, tags) then return nil end
  end
  if wanted == 'auto' then return string.match(variants, '^[^,]+') end
  return is_among(wanted, variants) and wanted or nil
end

-- An idle worker is woken when a slice that it can render waits.
function Waiting.note_idle(worker, kind)
  if redis.call('HSETNX', IDLE, worker, 1) == 0 then return end
  redis.call('SADD', IDLE .. ':' .. kind, worker)
  redis.call('SADD', IDLE_KINDS, kind)
end

-- Wake idle workers of a kind for this many slices of a job; returns the slices without a worker. Workers
-- in the set that found other work or died are not counted, and those left out of the job stay in it.
local function wake_kind(kind, id, slices)
  local idle, left_out = IDLE .. ':' .. kind, {}
  while slices > 0 do
    local worker = redis.call('SPOP', idle)
    if not worker then break end
    if Waiting.left_out_of(worker)[id] then
      left_out[#left_out + 1] = worker
    elseif redis.call('HDEL', IDLE, worker) == 1 then
      slices = slices - redis.call('PUBLISH', wake_worker_key(worker), 'planned')
    end
  end
  for _, worker in ipairs(left_out) do redis.call('SADD', idle, worker) end
  if redis.call('EXISTS', idle) == 0 then redis.call('SREM', IDLE_KINDS, kind) end
  return math.max(0, slices)
end

-- Wake as many idle workers as there are slices for them.
local function wake_workers(id, class, slices)
  for _, kind in ipairs(redis.call('SMEMBERS', IDLE_KINDS)) do
    if slices > 0 and Waiting.variant_of(kind, class) then slices = wake_kind(kind, id, slices) end
  end
end

-- File when the slice that holds up the job's image is late: the first that is not in the ledger, if only
-- one worker has it. The slice of a slow worker is late at once.
local function file_late(id, state, class, late_ms, prefix, was)
  local lease = state == 'rendering' and late_ms
                and redis.call('HGET', job_key(id, 'leases'), prefix or 0)
  local since, pace_ms = string.match(lease or '', '^(%S+) (%S+) %S+$')
  local slow = since and tonumber(pace_ms) > tonumber(late_ms)
  local late = since and string.format('%.3f %s', since + (slow and 0 or late_ms), class) or false
  if late == was then return end
  if was then redis.call('ZREM', LATE, id .. ' ' .. string.match(was, ' (.+)$')) end
  put(job_key(id), 'late', late)
  if late then redis.call('ZADD', LATE, string.match(late, '^%S+'), id .. ' ' .. class) end
end

-- The queue in which a job waits; '' without slices to lease, or while they must not be leased.
local function queue_for(id, priority, state, waits, ready, class)
  if not priority or waits or state ~= 'queued' and state ~= 'rendering' then return '' end
  if tonumber(ready) == 0 and redis.call('EXISTS', job_key(id, 'lost')) == 0 then return '' end
  return priority .. ' ' .. class
end

local NOT_FILED = ' 0 '

-- Bring a job's entries in the index up to date: its priority, its leased spp and its queue.
local function file(id)
  local state, held, ready, leased, slice_spp, number, owner, batch, was = unpack(
    redis.call('HMGET', job_key(id), 'state', 'held', 'ready', 'leased', 'slice_spp', 'number',
               'party', 'batch', 'filed'))
  if not state then return end
  local late_ms, prefix, late, awaits = unpack(
    redis.call('HMGET', job_key(id), 'late_ms', 'prefix', 'late', 'awaits'))
  local class = Waiting.class_of(id)
  file_late(id, state, class, late_ms, prefix, late)
  local priority = redis.call('ZSCORE', OPEN, id)  -- none once it has ended
  local queue = queue_for(id, priority, state, held or awaits, ready, class)
  local spp = priority and (leased or 0) * slice_spp or 0
  local counts = spp > 0 or queue ~= ''
  local filed = counts and string.format('%s %.0f %s', priority, spp, queue) or NOT_FILED
  if queue ~= '' and has_more[id] then
    wake_workers(id, class, ready + redis.call('ZCARD', job_key(id, 'lost')))
  end
  was = was or NOT_FILED
  if filed == was then return end
  put(job_key(id), 'filed', filed ~= NOT_FILED and filed)
  local old_priority, old_spp, old_queue = string.match(was, '^(%S*) (%d+) (.*)$')
  owner, batch = owner or '', batch and batch ~= '' and batch or nil
  for _, party in ipairs({share_key(owner), batch and share_key(owner, batch)}) do
    add_leased(party, old_priority, -old_spp)
    if priority then add_leased(party, priority, spp) end
  end
  local member = batch and id or sortable(number, id)
  if old_queue ~= '' and old_queue ~= queue then
    redis.call('ZREM', Waiting.key(old_queue, owner, batch), member)
  end
  if queue ~= '' then
    redis.call('ZADD', Waiting.key(queue, owner, batch), batch and number or spp, member)
  end
  if batch then
    put_forward(share_key(owner, batch), function(of)
      return Waiting.key(of, owner, batch), Waiting.key(of, owner)
    end, old_queue, queue)
  end
  put_forward(share_key(owner), function(of)
    return Waiting.key(of, owner), Waiting.key(of)
  end, old_queue, queue)
  for _, of in ipairs({old_queue, queue}) do
    if of ~= '' then rank(WAITING, of, redis.call('EXISTS', Waiting.key(of)) == 1 and priority_of(of)) end
  end
end

function Waiting.file_changed()
  for id in pairs(changed) do file(id) end
  changed, has_more = {}, {}
end

-- Rebuild the index after damage, which no script causes.
function Waiting.file_all_anew()
  for _, pattern in ipairs({WAITING .. '*', PREFIX .. 'share:*'}) do
    local cursor = '0'
    repeat
      local found = redis.call('SCAN', cursor, 'MATCH', pattern, 'COUNT', 1000)
      cursor = found[1]
      for _, key in ipairs(found[2]) do redis.call('DEL', key) end
    until cursor == '0'
  end
  redis.call('DEL', LATE)
  for _, id in ipairs(redis.call('ZRANGE', OPEN, 0, -1)) do
    redis.call('HDEL', job_key(id), 'filed', 'late')
    changed[id] = true
  end
end
