-- A worker that drains, or whose job was cancelled, gives its slice back unharmed.
-- ARGV: job, entry, worker, machine ms
-- Returns 'put back' or 'lost'.
local id, entry, worker = ARGV[1], ARGV[2], ARGV[3]
if redis.call('EXISTS', job_key(id)) == 0 then return 'lost' end
redis.call('HINCRBY', job_key(id), 'machine_ms', ARGV[4])
local held, tries = holds(id, entry, worker)
if not held then return 'lost' end
put_back(id, entry, tries - 1)
return 'put back'
