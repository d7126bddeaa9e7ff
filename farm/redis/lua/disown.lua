-- A monitor gives jobs back, so that another need not wait for its lease to run out.
-- ARGV: job, token, job, token, …
for i = 1, #ARGV, 2 do
  if owned(ARGV[i], ARGV[i + 1]) then
    redis.call('DEL', job_key(ARGV[i], 'owner'))
    redis.call('PUBLISH', WAKE_MONITORS, FREE .. ARGV[i])
  end
end
