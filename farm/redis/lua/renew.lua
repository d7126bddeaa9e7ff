-- A monitor renews its ownership of jobs.
-- ARGV: lease in ms, then job, token, job, token, …
-- Returns the jobs that it has lost.
local lost = {}
for i = 2, #ARGV, 2 do
  if owned(ARGV[i], ARGV[i + 1]) then
    redis.call('PEXPIRE', job_key(ARGV[i], 'owner'), ARGV[1])
  else
    lost[#lost + 1] = ARGV[i]
  end
end
return lost
