-- Give a worker its next slice: highest priority first, then a job of the owner (an API key) with the
-- fewest leased spp, then the batch or single job with the fewest, then the older job. So a key gets no
-- more workers by sending more jobs, and a batch's jobs are rendered in their order, not all at once.
-- A worker keeps to the scene that it has loaded while its turn lasts.
-- ARGV: worker, its variants as JSON (best first), loaded job or '', '1' while its turn lasts,
--       lease in ms, most tries
-- Returns JSON {job, entry, index, tries, variant, spec, scene}, 'none', or 'again' (what it came
-- upon needed no rendering).
local worker, variants, loaded, in_turn = ARGV[1], cjson.decode(ARGV[2]), ARGV[3], ARGV[4] == '1'
local lease_ms, most_tries = tonumber(ARGV[5]), tonumber(ARGV[6])
-- So many leases that have run out are taken note of at once, so that nobody waits long for this.
local MOST_LOST = 100

if not is_silent(lease_ms) then
  local over = redis.call('ZRANGEBYSCORE', LEASES, '-inf', now() - lease_ms, 'LIMIT', 0, MOST_LOST)
  for _, lease in ipairs(over) do note_lost(string.match(lease, '^(%S+) (%S+)$')) end
  file_changed()
end
if redis.call('HEXISTS', worker_key(worker), 'drained') == 1 then return 'none' end

local function variant_for(wanted)
  if wanted == 'auto' then return variants[1] end
  for _, variant in ipairs(variants) do
    if variant == wanted then return variant end
  end
end

-- The next job, and the variant to render it with: of the first priority at which one waits that this
-- worker can render, the first entry of all its queues, or the job that is loaded.
local function next_job()
  local its_queue = in_turn and string.match(redis.call('HGET', job_key(loaded), 'filed') or '',
                                             '^%S* %d+ (.+)$')
  local entry, fewest, variant, at
  for _, queue in ipairs(redis.call('ZREVRANGE', WAITING, 0, -1)) do
    local priority, wanted = string.match(queue, '^(%S+) (.+)$')
    if at and priority ~= at then break end
    local suits = variant_for(wanted)
    if suits and queue == its_queue then return loaded, suits end
    if suits then
      local first = redis.call('ZRANGE', waiting_key(queue), 0, 0, 'WITHSCORES')
      local leased = tonumber(first[2])
      if not entry or leased < fewest or leased == fewest and first[1] < entry then
        entry, fewest, variant, at = first[1], leased, suits, priority
      end
    end
  end
  return entry and string.match(entry, '%S+$'), variant
end

local id, variant = next_job()
if not id then
  note_idle(worker, variants)
  return 'none'
end
redis.call('HDEL', IDLE, worker)
changed[id] = true
local slices, lost = job_key(id, 'slices'), redis.call('ZRANGE', job_key(id, 'lost'), 0, 0)[1]
local entry
if lost then
  local pending = redis.call('XPENDING', slices, GROUP, lost, lost, 1)[1]
  entry = redis.call('XCLAIM', slices, GROUP, worker, 0, lost)[1]
  if not entry then  -- it is pending and yet not in the stream any more, as Redis 6.2 can leave one
    drop_entry(id, lost)
    return 'again'
  end
  note_lease(id, lost)
  local holder = pending[2]
  -- One that lives and yet does not renew never heard of its lease: the answer was lost.
  local lives = now() - (redis.call('ZSCORE', WORKERS, holder) or 0) < lease_ms
  if holder ~= 'nobody' and not lives then
    local causes = note_death(id, entry[2][2], holder, 'worker ' .. holder .. ' was lost')
    if #causes >= most_tries then
      poison(id, entry[2][2], causes)
      return 'again'
    end
  end
else
  local planned, issued, ready = unpack(redis.call('HMGET', job_key(id), 'planned', 'issued', 'ready'))
  if ready - (planned - issued) == 0 then  -- else one is in the stream already that was rejected
    redis.call('XADD', slices, '*', 'index', issued)
    redis.call('HINCRBY', job_key(id), 'issued', 1)
  end
  entry = redis.call('XREADGROUP', 'GROUP', GROUP, worker, 'COUNT', 1, 'STREAMS', slices, '>')[1][2][1]
  redis.call('HINCRBY', job_key(id), 'ready', -1)
  redis.call('HINCRBY', job_key(id), 'leased', 1)
  note_lease(id, entry[1])
end
if redis.call('HEXISTS', job_key(id, 'ledger'), entry[2][2]) == 1 then  -- a late commit came first
  drop_entry(id, entry[1])
  return 'again'
end
if redis.call('HSETNX', job_key(id), 'variant', variant) == 1 then
  redis.call('HSET', job_key(id), 'started_at', now(), 'paused_ms', 0)
  has_more[id] = true  -- for workers that have this variant: those who were woken may have another
end
local job = redis.call('HMGET', job_key(id), 'state', 'spec', 'scene_sha256')
if job[1] == 'queued' then move(id, 'rendering', 'rendering with ' .. variant) end
local _, tries = holds(id, entry[1], worker)
return cjson.encode({job = id, entry = entry[1], index = tonumber(entry[2][2]), tries = tries,
                     variant = variant, spec = job[2], scene = job[3]})
