-- Allow the pictures of a study to be put, for `making_ms`.
function for_farm.begin_study(it)
  redis.call('SET', study_key(it.study, 'making'), '1', 'PX', it.making_ms)
end

-- Show a study whose pictures have been put.
-- Returns 'created', 'repeated' with the study of the same request, 'late' (a sweep may have removed the
-- pictures) or 'too many'.
function for_farm.create_study(it)
  local id = it.study
  local made = redis.call('HGET', STUDIES_ASKED, it.digest)
  if made then return {outcome = 'repeated', study = made} end
  if redis.call('EXISTS', study_key(id, 'making')) == 0 then return {outcome = 'late'} end
  if redis.call('ZCARD', STUDIES) >= it.most then return {outcome = 'too many'} end
  local at = now()
  redis.call('HSET', study_key(id), 'id', id, 'digest', it.digest, 'owner', it.owner, 'about', it.about,
             'created_at', at)
  redis.call('HSET', STUDIES_ASKED, it.digest, id)
  redis.call('ZADD', STUDIES, at, id)
  redis.call('DEL', study_key(id, 'making'))
  return {outcome = 'created', study = id}
end

-- Take part in a study; an observer who takes part already keeps number and screen.
-- Returns 'joined', 'known', 'full' or 'missing'.
function for_farm.join_study(it)
  if redis.call('EXISTS', study_key(it.study)) == 0 then return 'missing' end
  local observers = study_key(it.study, 'observers')
  if redis.call('HEXISTS', observers, it.name) == 1 then return 'known' end
  local number = redis.call('HLEN', observers)
  if number >= it.most then return 'full' end
  redis.call('HSET', observers, it.name,
             cjson.encode({number = number, screen = it.screen, joined_at = now()}))
  return 'joined'
end

-- Note an observer's answer to a pair; the first one stays.
-- Returns the stored answer, which counts; nothing where there is no such study.
function for_farm.answer_study(it)
  if redis.call('EXISTS', study_key(it.study)) == 0 then return nil end
  local answers, place = study_key(it.study, 'answers'), it.name .. ':' .. it.trial
  redis.call('HSETNX', answers, place, cjson.encode({given = it.given, at = now()}))
  return redis.call('HGET', answers, place)
end

-- Forget a study, its observers and their answers.
function for_farm.forget_study(it)
  local id = it.study
  local digest = redis.call('HGET', study_key(id), 'digest')
  if digest then redis.call('HDEL', STUDIES_ASKED, digest) end
  redis.call('ZREM', STUDIES, id)
  redis.call('UNLINK', study_key(id), study_key(id, 'observers'), study_key(id, 'answers'))
end
