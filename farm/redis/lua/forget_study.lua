-- Forget a study, its observers and their answers.
-- ARGV: study
-- Returns 'forgotten'.
local id = ARGV[1]
local digest = redis.call('HGET', study_key(id), 'digest')
if digest then redis.call('HDEL', STUDIES_ASKED, digest) end
redis.call('ZREM', STUDIES, id)
redis.call('UNLINK', study_key(id), study_key(id, 'observers'), study_key(id, 'answers'))
return 'forgotten'
