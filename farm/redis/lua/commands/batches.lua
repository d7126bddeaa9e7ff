-- List batches, by their newest jobs.
-- ARGV: the highest number of a newest job, as ZREVRANGEBYSCORE takes it, most batches
-- Returns for each its name, its newest job's number, how many jobs it has, when the newest was created,
-- and {state, how many of them, …}. Jobs whose state is lost or unknown do not count.
for_farm.batches = function(ARGV)
  local found = {}
  local rows = redis.call('ZREVRANGEBYSCORE', BATCHES, ARGV[1], '-inf', 'WITHSCORES', 'LIMIT', 0, ARGV[2])
  for i = 1, #rows, 2 do
    local jobs, newest_at, counts, states = 0, '', {}, {}
    for _, id in ipairs(redis.call('ZRANGE', batch_key(rows[i]), 0, -1)) do
      local job = redis.call('HMGET', job_key(id), 'state', 'created_at')
      if MOVES[job[1]] and job[2] then
        jobs, newest_at = jobs + 1, job[2]
        counts[job[1]] = (counts[job[1]] or 0) + 1
      end
    end
    for state, count in pairs(counts) do
      states[#states + 1] = state
      states[#states + 1] = count
    end
    found[#found + 1] = {rows[i], rows[i + 1], jobs, newest_at, states}
  end
  return found
end

-- Guard a batch against flicker: from now on it takes only jobs that stop as its others do.
-- ARGV: batch, number of its newest job when all of its jobs were found to stop alike
-- Returns 'guarded', 'changed' (another job has joined it since) or 'missing'.
for_farm.guard = function(ARGV)
  local batch, compared = ARGV[1], ARGV[2]
  local newest = redis.call('ZSCORE', BATCHES, batch)
  if not newest then return 'missing' end
  if newest ~= compared then return 'changed' end
  redis.call('SADD', GUARDED, batch)
  return 'guarded'
end
