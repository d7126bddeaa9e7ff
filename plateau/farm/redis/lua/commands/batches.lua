-- List batches, by their newest jobs.
-- Returns a `BatchRow` for each. Jobs whose state is lost or unknown do not count.
function for_farm.batches(it)
  local found = {}
  local highest = it.before and '(' .. it.before or '+inf'
  local rows = redis.call('ZREVRANGEBYSCORE', BATCHES, highest, '-inf', 'WITHSCORES', 'LIMIT', 0, it.limit)
  for i = 1, #rows, 2 do
    local jobs, newest_at, states = 0, nil, {}
    for _, id in ipairs(redis.call('ZRANGE', batch_key(rows[i]), 0, -1)) do
      local job = redis.call('HMGET', job_key(id), 'state', 'created_at')
      if MOVES[job[1]] and job[2] then
        jobs, newest_at = jobs + 1, job[2]
        states[job[1]] = (states[job[1]] or 0) + 1
      end
    end
    found[#found + 1] = {
      name = rows[i], number = tonumber(rows[i + 1]), jobs = jobs, newest_at = newest_at, states = states,
    }
  end
  return found
end
