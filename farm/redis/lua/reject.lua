-- The partial of a committed slice is lost or spoiled: it is taken out of the ledger and planned
-- again.
-- ARGV: job, token, index, blob, cause
-- Returns how often that has happened to the slice, 0 where the ledger has another blob (or none)
-- by now, or 'fenced'.
local id, index = ARGV[1], ARGV[3]
if not owned(id, ARGV[2]) then return 'fenced' end
local job, ledger = job_key(id), job_key(id, 'ledger')
local record = redis.call('HGET', ledger, index)
if not record or not is_open(id) then return 0 end
record = cjson.decode(record)
if record.blob ~= ARGV[4] then return 0 end
redis.call('HDEL', ledger, index)
redis.call('ZREM', job_key(id, 'seeds'), string.format('%.0f-%.0f', record.first_seed, record.last_seed))
redis.call('HINCRBY', job, 'committed', -1)
redis.call('XADD', job_key(id, 'slices'), '*', 'index', index)
redis.call('HINCRBY', job, 'ready', 1)
local prefix = redis.call('HGET', job, 'prefix')
if prefix and tonumber(index) < tonumber(prefix) then redis.call('HSET', job, 'prefix', index) end
changed[id], has_more[id] = true, true
announce(id, 'trouble', cjson.encode({index = tonumber(index), worker = record.worker, cause = ARGV[5]}))
note_try(id, index, record.worker, 'rejected', ARGV[5], '', '')
return redis.call('HINCRBY', job_key(id, 'spoiled'), index, 1)
