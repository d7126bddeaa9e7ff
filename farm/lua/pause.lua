-- Pause a job: none of its slices is leased any more; those that are may still be committed.
-- ARGV: job, reason
-- Returns {'paused'}, also where it was, or {'illegal', state}.
local id = ARGV[1]
local moved, state = move(id, 'paused', ARGV[2])
if not moved and state ~= 'paused' then return {'illegal', state} end
if moved then redis.call('PUBLISH', WAKE_MONITORS, id) end
return {'paused'}
