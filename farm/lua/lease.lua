-- Give a worker its next slice: highest priority first, then a job of the owner (an API key) with the
-- fewest leased spp, then the batch or single job with the fewest, then the older job. So a key gets no
-- more workers by sending more jobs, and a batch's jobs are rendered in their order, not all at once.
-- A worker keeps to the scene that it has loaded while its turn lasts.
-- ARGV: worker, its variants as JSON (best first), loaded job or '', '1' while its turn lasts,
--       lease in ms, most tries
-- Returns JSON {job, entry, index, tries, variant, spec, scene}, 'none', or 'again' (what it came
-- upon needed no rendering).
local worker, variants, loaded, in_turn = ARGV[1], cjson.decode(ARGV[2]), ARGV[3], ARGV[4] == '1'
local lease_ms, most_tries = ARGV[5], tonumber(ARGV[6])
local silent = is_silent(lease_ms)
if redis.call('HEXISTS', worker_key(worker), 'drained') == 1 then return 'none' end

local function variant_for(asked, pinned)
  local wanted = pinned or asked
  if wanted == 'auto' then return variants[1] end
  for _, variant in ipairs(variants) do
    if variant == wanted then return variant end
  end
end

local function stale_lease(slices)
  if silent then return redis.call('XPENDING', slices, GROUP, '-', '+', 1, 'nobody')[1] end
  return redis.call('XPENDING', slices, GROUP, 'IDLE', lease_ms, '-', '+', 1)[1]
end

-- What each owner has leased in the jobs that were looked at, so at this priority and above.
local leased_of = {}
-- The same for each batch, and each job without one.
local leased_in = {}

local function candidate(id)
  local job = redis.call('HMGET', job_key(id), 'state', 'ready', 'asked_variant', 'variant',
                         'slice_spp', 'number', 'owner', 'batch', 'held')
  local slices, owner = job_key(id, 'slices'), job[7] or ''
  local group = (job[8] or '') ~= '' and owner .. ' batch ' .. job[8] or id
  -- A job is queued till its first lease; of a long batch most are, and need not be asked.
  local leased = job[1] == 'queued' and 0 or redis.call('XPENDING', slices, GROUP)[1]
  -- What runs on while its job is paused, or what only others can render, keeps workers busy too.
  leased_of[owner] = (leased_of[owner] or 0) + leased * job[5]
  leased_in[group] = (leased_in[group] or 0) + leased * job[5]
  local variant = variant_for(job[3], job[4] or nil)
  if job[1] == 'paused' or job[9] or not variant then return nil end
  local stale = leased > 0 and stale_lease(slices)
  if tonumber(job[2]) == 0 and not stale then return nil end
  return {id = id, variant = variant, stale = stale, state = job[1], owner = owner,
          group = group, number = tonumber(job[6])}
end

local function before(a, b)
  local a_owner, b_owner = leased_of[a.owner], leased_of[b.owner]
  if a_owner ~= b_owner then return a_owner < b_owner end
  local a_group, b_group = leased_in[a.group], leased_in[b.group]
  if a_group ~= b_group then return a_group < b_group end
  return a.number < b.number
end

local waiting, priority = {}, nil
local open = redis.call('ZREVRANGE', OPEN, 0, -1, 'WITHSCORES')
for i = 1, #open, 2 do
  if priority and open[i + 1] ~= priority then break end
  local job = candidate(open[i])
  if job then
    waiting[#waiting + 1] = job
    priority = open[i + 1]
  end
end
local chosen = waiting[1]
if not chosen then return 'none' end
for _, job in ipairs(waiting) do
  if job.id == loaded and in_turn then
    chosen = job
    break
  end
  if before(job, chosen) then chosen = job end
end

local id, slices = chosen.id, job_key(chosen.id, 'slices')
local entry
if chosen.stale then
  entry = redis.call('XCLAIM', slices, GROUP, worker, lease_ms, chosen.stale[1])[1]
  if not entry then  -- it is pending and yet not in the stream any more, as Redis 6.2 can leave one
    redis.call('XACK', slices, GROUP, chosen.stale[1])
    return 'again'
  end
  local holder = chosen.stale[2]
  -- One that lives and yet does not renew never heard of its lease: the answer was lost.
  local lives = now() - (redis.call('ZSCORE', WORKERS, holder) or 0) < tonumber(lease_ms)
  if holder ~= 'nobody' and not lives then
    local causes = note_death(id, entry[2][2], holder, 'worker ' .. holder .. ' was lost')
    if #causes >= most_tries then
      poison(id, entry[2][2], causes)
      return 'again'
    end
  end
else
  entry = redis.call('XREADGROUP', 'GROUP', GROUP, worker, 'COUNT', 1, 'STREAMS', slices, '>')[1][2][1]
  redis.call('HINCRBY', job_key(id), 'ready', -1)
end
if redis.call('HEXISTS', job_key(id, 'ledger'), entry[2][2]) == 1 then  -- a late commit came first
  drop_entry(id, entry[1])
  return 'again'
end
if redis.call('HSETNX', job_key(id), 'variant', chosen.variant) == 1 then
  redis.call('HSET', job_key(id), 'started_at', now(), 'paused_ms', 0)
end
if chosen.state == 'queued' then move(id, 'rendering', 'rendering with ' .. chosen.variant) end
local job = redis.call('HMGET', job_key(id), 'spec', 'scene_sha256')
local _, tries = holds(id, entry[1], worker)
return cjson.encode({job = id, entry = entry[1], index = tonumber(entry[2][2]), tries = tries,
                     variant = chosen.variant, spec = job[1], scene = job[2]})
