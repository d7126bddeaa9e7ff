-- Show a study whose pictures have been put.
-- ARGV: id, digest of the request and its owner, owner or '', what it is (JSON), how many there may be
-- Returns {'created', id}, {'repeated', id of the one that the same request made}, {'late'} (a sweep may
-- have taken its pictures) or {'too many'}.
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
