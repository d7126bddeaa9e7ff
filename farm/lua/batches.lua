-- List batches, by their newest jobs.
-- ARGV: the highest number of a newest job, as ZREVRANGEBYSCORE takes it, most batches
-- Returns for each its name, its newest job's number, how many jobs it has, when the newest was created,
-- and {state, how many of them, …}.
local found = {}
local rows = redis.call('ZREVRANGEBYSCORE', BATCHES, ARGV[1], '-inf', 'WITHSCORES', 'LIMIT', 0, ARGV[2])
for i = 1, #rows, 2 do
  local jobs = redis.call('ZRANGE', batch_key(rows[i]), 0, -1)
  local counts, states = {}, {}
  for _, id in ipairs(jobs) do
    local state = redis.call('HGET', job_key(id), 'state')
    counts[state] = (counts[state] or 0) + 1
  end
  for state, count in pairs(counts) do
    states[#states + 1] = state
    states[#states + 1] = count
  end
  local newest_at = redis.call('HGET', job_key(jobs[#jobs]), 'created_at')
  found[#found + 1] = {rows[i], rows[i + 1], #jobs, newest_at, states}
end
return found
