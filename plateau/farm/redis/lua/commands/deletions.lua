-- Delete an ended job, which leaves its batch, or restore it.
-- Returns 'changed', also where it was so before, or 'illegal' with the state (it has not ended) or 'missing'.
function for_farm.set_deleted(it)
  local id = it.job
  local state, number = unpack(redis.call('HMGET', job_key(id), 'state', 'number'))
  if not state or Job.is_open(id) then return {outcome = 'illegal', state = state or 'missing'} end
  local was_deleted = redis.call('HEXISTS', job_key(id, 'sealed'), 'deleted_at') == 1
  if was_deleted == it.deleted then return {outcome = 'changed'} end
  if it.deleted then
    Job.leave_batch(id)
    redis.call('ZADD', DELETED, number, id)
    redis.call('HSET', job_key(id, 'sealed'), 'deleted_at', now())
  else
    Job.join_batch(id)
    redis.call('ZREM', DELETED, id)
    redis.call('HDEL', job_key(id, 'sealed'), 'deleted_at')
  end
  return {outcome = 'changed'}
end
