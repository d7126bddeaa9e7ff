-- Note an observer's answer to a pair; the first one stays.
-- ARGV: study, pseudonym, the pair's number, answer (JSON)
-- Returns the answer that counts, as JSON, or 'missing'.
local id = ARGV[1]
if redis.call('EXISTS', study_key(id)) == 0 then return 'missing' end
local answers, place = study_key(id, 'answers'), ARGV[2] .. ':' .. ARGV[3]
redis.call('HSETNX', answers, place, cjson.encode({given = ARGV[4], at = now()}))
return redis.call('HGET', answers, place)
