-- Take part in a study; who takes part already keeps number and screen.
-- ARGV: study, pseudonym, screen (JSON), how many may take part
-- Returns 'joined', 'known', 'full' or 'missing'.
local id, name = ARGV[1], ARGV[2]
if redis.call('EXISTS', study_key(id)) == 0 then return 'missing' end
local observers = study_key(id, 'observers')
if redis.call('HEXISTS', observers, name) == 1 then return 'known' end
local number = redis.call('HLEN', observers)
if number >= tonumber(ARGV[4]) then return 'full' end
redis.call('HSET', observers, name, cjson.encode({number = number, screen = ARGV[3], joined_at = now()}))
return 'joined'
