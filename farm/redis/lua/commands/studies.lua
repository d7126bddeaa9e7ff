-- From now on the pictures of a study may be put, for so long.
-- ARGV: study, ms
for_farm.begin_study = function(ARGV)
  redis.call('SET', study_key(ARGV[1], 'making'), '1', 'PX', ARGV[2])
end

-- Show a study whose pictures have been put.
-- ARGV: id, digest of the request and its owner, owner or '', what it is (JSON), how many there may be
-- Returns {'created', id}, {'repeated', id of the one that the same request made}, {'late'} (a sweep may
-- have taken its pictures) or {'too many'}.
for_farm.create_study = function(ARGV)
  local id, digest = ARGV[1], ARGV[2]
  local made = redis.call('HGET', STUDIES_ASKED, digest)
  if made then return {'repeated', made} end
  if redis.call('EXISTS', study_key(id, 'making')) == 0 then return {'late'} end
  if redis.call('ZCARD', STUDIES) >= tonumber(ARGV[5]) then return {'too many'} end
  local at = now()
  redis.call('HSET', study_key(id), 'id', id, 'digest', digest, 'owner', ARGV[3], 'about', ARGV[4],
             'created_at', at)
  redis.call('HSET', STUDIES_ASKED, digest, id)
  redis.call('ZADD', STUDIES, at, id)
  redis.call('DEL', study_key(id, 'making'))
  return {'created', id}
end

-- Take part in a study; who takes part already keeps number and screen.
-- ARGV: study, pseudonym, screen (JSON), how many may take part
-- Returns 'joined', 'known', 'full' or 'missing'.
for_farm.join_study = function(ARGV)
  local id, name = ARGV[1], ARGV[2]
  if redis.call('EXISTS', study_key(id)) == 0 then return 'missing' end
  local observers = study_key(id, 'observers')
  if redis.call('HEXISTS', observers, name) == 1 then return 'known' end
  local number = redis.call('HLEN', observers)
  if number >= tonumber(ARGV[4]) then return 'full' end
  redis.call('HSET', observers, name, cjson.encode({number = number, screen = ARGV[3], joined_at = now()}))
  return 'joined'
end

-- Note an observer's answer to a pair; the first one stays.
-- ARGV: study, pseudonym, the pair's number, answer (JSON)
-- Returns the answer that counts, as JSON, or 'missing'.
for_farm.answer_study = function(ARGV)
  local id = ARGV[1]
  if redis.call('EXISTS', study_key(id)) == 0 then return 'missing' end
  local answers, place = study_key(id, 'answers'), ARGV[2] .. ':' .. ARGV[3]
  redis.call('HSETNX', answers, place, cjson.encode({given = ARGV[4], at = now()}))
  return redis.call('HGET', answers, place)
end

-- Forget a study, its observers and their answers.
-- ARGV: study
-- Returns 'forgotten'.
for_farm.forget_study = function(ARGV)
  local id = ARGV[1]
  local digest = redis.call('HGET', study_key(id), 'digest')
  if digest then redis.call('HDEL', STUDIES_ASKED, digest) end
  redis.call('ZREM', STUDIES, id)
  redis.call('UNLINK', study_key(id), study_key(id, 'observers'), study_key(id, 'answers'))
  return 'forgotten'
end
