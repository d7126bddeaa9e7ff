-- Record a rendered slice: the lease is checked, the slice enters the ledger once, its stream
-- entry is acknowledged, and the monitor is told.
-- ARGV: job, entry, worker, index, record (JSON object), first seed, last seed, machine ms,
--       width, height, notes (JSON)
-- Returns 'committed', 'duplicate', 'lost', 'ended' or 'overlap'.
local id, entry, worker, index, record = ARGV[1], ARGV[2], ARGV[3], ARGV[4], ARGV[5]
local first, last, machine_ms = ARGV[6], ARGV[7], ARGV[8]
local job, slices = job_key(id), job_key(id, 'slices')
local state = redis.call('HGET', job, 'state')
if not state then return 'ended' end
if redis.call('HEXISTS', job_key(id, 'ledger'), index) == 1 then
  if holds(id, entry, worker) then
    redis.call('XACK', slices, GROUP, entry)
    redis.call('XDEL', slices, entry)
  end
  return 'duplicate'
end
redis.call('HINCRBY', job, 'machine_ms', machine_ms)
if not MOVES[state]['cancelled'] then return 'ended' end
if not holds(id, entry, worker) then return 'lost' end
local seeds = job_key(id, 'seeds')
local below = redis.call('ZREVRANGEBYSCORE', seeds, last, '-inf', 'LIMIT', 0, 1)[1]
if below and tonumber(string.match(below, '-(%d+)$')) >= tonumber(first) then return 'overlap' end

redis.call('ZADD', seeds, first, first .. '-' .. last)
redis.call('HSET', job_key(id, 'ledger'), index, '{"at":' .. now() .. ',' .. string.sub(record, 2))
redis.call('XACK', slices, GROUP, entry)
redis.call('XDEL', slices, entry)
redis.call('HDEL', job_key(id, 'deaths'), index)
redis.call('HSETNX', job, 'width', ARGV[9])
redis.call('HSETNX', job, 'height', ARGV[10])
redis.call('HSETNX', job, 'notes', ARGV[11])
redis.call('HINCRBY', job, 'committed', 1)
announce(id, 'slice', cjson.encode({index = tonumber(index), worker = worker}))
redis.call('PUBLISH', WAKE_MONITORS, id)
return 'committed'
