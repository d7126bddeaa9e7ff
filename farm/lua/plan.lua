-- Plan the slices from `first` up to, not including, `stop`; a repeated call plans nothing twice.
-- ARGV: job, token, first, stop
-- Returns 'planned', 'fenced' or 'ended'.
local id, token, first, stop = ARGV[1], ARGV[2], tonumber(ARGV[3]), tonumber(ARGV[4])
if not owned(id, token) then return 'fenced' end
if not is_open(id) then return 'ended' end
local planned = tonumber(redis.call('HGET', job_key(id), 'planned'))
for index = math.max(first, planned), stop - 1 do
  redis.call('XADD', job_key(id, 'slices'), '*', 'index', index)
  planned = index + 1
  redis.call('HINCRBY', job_key(id), 'ready', 1)
end
redis.call('HSET', job_key(id), 'planned', planned)
redis.call('PUBLISH', WAKE_WORKERS, 'planned')
return 'planned'
