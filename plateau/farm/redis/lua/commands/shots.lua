-- Note a look at a shot, and what it said to frames; the same look is noted once.
-- Returns 'answered' or 'known' (there was this look before).
function for_farm.answer_frames(it)
  local shot = job_key(it.shot, 'shot')
  local looks = redis.call('HGET', shot, 'looks')
  if looks then  -- and the first frame is not forgotten
    if tonumber(looks) ~= it.number then return 'known' end
    redis.call('HSET', shot, 'why', it.why)
    if it.over then redis.call('HSET', shot, 'over', it.over) end
    if it.look then redis.call('HSET', shot, 'looks', it.number + 1, 'look:' .. it.number, it.look) end
  end
  for _, one in ipairs(it.answers) do
    if Job.is_open(one.job) then
      if one.answer ~= '' then
        redis.call('HSET', job_key(one.job), 'shot_answer', one.answer)
      else
        redis.call('HDEL', job_key(one.job), 'shot_waits')
      end
      redis.call('PUBLISH', WAKE_MONITORS, one.job)
    end
  end
  return 'answered'
end
