-- Tell a worker to take no more slices, or to take some again. What it has in hand it finishes.
-- ARGV: worker, '1' to drain it, '0' to take that back; its life within so many ms
-- Returns 'drained', 'working', or 'missing' (no such worker lives).
local worker, drains, within_ms = ARGV[1], ARGV[2] == '1', ARGV[3]
local seen = redis.call('ZSCORE', WORKERS, worker)
if not seen or now() - seen > tonumber(within_ms) then return 'missing' end
if drains then
  redis.call('HSET', worker_key(worker), 'drained', '1')
  redis.call('HDEL', IDLE, worker)
  return 'drained'
end
redis.call('HDEL', worker_key(worker), 'drained')
redis.call('PUBLISH', wake_worker_key(worker), 'planned')
return 'working'
