-- Plan the slices up to, not including, `stop`; a repeated call plans nothing twice. They come into
-- the job's stream as they are leased, so to plan many costs no more than to plan one.
-- ARGV: job, token, stop, spp at which the job is expected to end or ''
-- Returns 'planned', 'fenced' or 'ended'.
local id, token, stop = ARGV[1], ARGV[2], tonumber(ARGV[3])
if not owned(id, token) then return 'fenced' end
if not is_open(id) then return 'ended' end
local planned = tonumber(redis.call('HGET', job_key(id), 'planned'))
if ARGV[4] and ARGV[4] ~= '' then redis.call('HSET', job_key(id), 'expected_spp', ARGV[4]) end
if stop > planned then
  redis.call('HSET', job_key(id), 'planned', stop)
  redis.call('HINCRBY', job_key(id), 'ready', stop - planned)
  changed[id], has_more[id] = true, true
end
return 'planned'
