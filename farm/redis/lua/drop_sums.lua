-- Let the sums go that a job was left with when it was finished, so long ago.
-- ARGV: job, ms, then the jobs that go on with it, as far as they are known
-- Returns 'dropped' or 'kept' (it has none, is not finished, or not for so long, or a job that goes on
-- with it still stands on the same sums, or is not known).
local id = ARGV[1]
local job = redis.call('HMGET', job_key(id), 'finished_at', 'checkpoint', 'continued')
if not job[1] or not job[2] or now() - job[1] < tonumber(ARGV[2]) then return 'kept' end
local stand_on_it = tonumber(job[3] or 0)
for i = 3, #ARGV do
  local other = redis.call('HMGET', job_key(ARGV[i]), 'continues', 'checkpoint')
  if other[1] == id and other[2] ~= job[2] then stand_on_it = stand_on_it - 1 end
end
if stand_on_it > 0 then return 'kept' end
redis.call('HDEL', job_key(id), 'checkpoint')
return 'dropped'
