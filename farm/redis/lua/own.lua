-- A monitor takes a job that nobody owns.
-- ARGV: job, lease in ms
-- Returns the fencing token, or nil.
local id = ARGV[1]
if redis.call('EXISTS', job_key(id, 'owner')) == 1 then return nil end
if redis.call('SISMEMBER', UNFINISHED, id) == 0 then return nil end
local token = tostring(redis.call('INCR', job_key(id, 'fence')))
redis.call('SET', job_key(id, 'owner'), token, 'PX', ARGV[2])
return token
