-- Record a rendered slice: it enters the ledger once, its stream entry is acknowledged, and the
-- monitor is told. Slices are pure, so the first commit wins, whoever holds the lease by now.
-- ARGV: job, entry, worker, index, record (JSON object), first seed, last seed, machine ms,
--       width, height, notes (JSON), variant, what the render child printed
-- Returns 'committed' (also where this very record is in the ledger), 'duplicate' (where another
-- is), 'ended', 'overlap' or 'stale' (the job is rendered with another variant by now).
local id, entry, worker, index, record = ARGV[1], ARGV[2], ARGV[3], ARGV[4], ARGV[5]
local first, last, machine_ms, said = ARGV[6], ARGV[7], ARGV[8], ARGV[13]
local job, blob = job_key(id), cjson.decode(record).blob
-- A commit that does not count, and is repeated since the answer was lost, took its time once.
local function is_repeated() return not redis.call('SET', told_key(blob), '1', 'PX', 3600000, 'NX') end
if redis.call('EXISTS', job) == 0 then return 'ended' end
local known = redis.call('HGET', job_key(id, 'ledger'), index)
if known then
  drop_entry(id, entry)
  if cjson.decode(known).blob == blob then return 'committed' end
  if not is_repeated() then note_outrun(id, entry, index, worker, machine_ms, said) end
  return 'duplicate'
end
if not is_open(id) then
  if not is_repeated() then
    spend(id, machine_ms)
    count('tries late')
  end
  return 'ended'
end
if redis.call('HGET', job, 'variant') ~= ARGV[12] then
  if not is_repeated() then
    spend(id, machine_ms)
    note_try(id, index, worker, 'stale', 'others render with another variant by now', machine_ms, said)
  end
  return 'stale'
end
local seeds = job_key(id, 'seeds')
local below = redis.call('ZREVRANGEBYSCORE', seeds, last, '-inf', 'LIMIT', 0, 1)[1]
if below and tonumber(string.match(below, '-(%d+)$')) >= tonumber(first) then
  if not is_repeated() then spend(id, machine_ms) end
  return 'overlap'
end

spend(id, machine_ms)
redis.call('ZADD', seeds, first, first .. '-' .. last)
redis.call('HSET', job_key(id, 'ledger'), index, '{"at":' .. now() .. ',' .. string.sub(record, 2))
settle_tries(id, index, entry, worker)
redis.call('HDEL', job_key(id, 'deaths'), index, index .. ' forgiven')
redis.call('HSETNX', job, 'width', ARGV[9])
redis.call('HSETNX', job, 'height', ARGV[10])
redis.call('HSETNX', job, 'notes', ARGV[11])
redis.call('HINCRBY', job, 'committed', 1)
count('tries committed')
count('samples', cjson.decode(record).spp * ARGV[9] * ARGV[10])
if said ~= '' then note_try(id, index, worker, 'committed', '', machine_ms, said) end
announce(id, 'slice', cjson.encode({index = tonumber(index), worker = worker}))
redis.call('PUBLISH', WAKE_MONITORS, id)
return 'committed'
