-- A worker has the first pass of a job's first slice: something to see, long before the slice.
-- ARGV: job, entry, worker, blob
-- Returns 'noted', 'lost' (the slice is another's) or 'late' (there is an image, or none is wanted).
local id, entry, worker, blob = ARGV[1], ARGV[2], ARGV[3], ARGV[4]
if not holds(id, entry, worker) then return 'lost' end
if not is_open(id) or has_image(id) then return 'late' end
redis.call('HSET', job_key(id), 'glimpse', blob)
redis.call('PUBLISH', WAKE_MONITORS, id)
return 'noted'
