-- List an ended job, archive it, or delete it: each takes it out of where it was. A deleted job is in no batch.
-- Returns 'done' with where it was before, also where that is the same; or 'illegal' with the state (it has
-- not ended) or 'missing'.
function for_farm.set_visibility(it)
  local id, wanted = it.job, it.visibility
  local state, number = unpack(redis.call('HMGET', job_key(id), 'state', 'number'))
  if not state or Job.is_open(id) then return {outcome = 'illegal', state = state or 'missing'} end
  local lists = {archived = ARCHIVED, deleted = DELETED}
  local had = redis.call('HMGET', job_key(id, 'sealed'), 'archived_at', 'deleted_at')
  local before = had[2] and 'deleted' or had[1] and 'archived' or 'listed'
  if before == wanted then return {outcome = 'done', before = before} end
  if before == 'deleted' then Job.join_batch(id) end
  if wanted == 'deleted' then Job.leave_batch(id) end
  if lists[before] then
    redis.call('ZREM', lists[before], id)
    redis.call('HDEL', job_key(id, 'sealed'), before .. '_at')
  end
  if lists[wanted] then
    redis.call('ZADD', lists[wanted], number, id)
    redis.call('HSET', job_key(id, 'sealed'), wanted .. '_at', now())
  end
  return {outcome = 'done', before = before}
end
