-- Append a point to the curve, once for each spp.
-- ARGV: job, token, spp, point (JSON object)
-- Returns 'appended', 'known' or 'fenced'.
local id, token, spp, point = ARGV[1], ARGV[2], ARGV[3], ARGV[4]
if not owned(id, token) then return 'fenced' end
local last = redis.call('XREVRANGE', job_key(id, 'curve'), '+', '-', 'COUNT', 1)[1]
if last and tonumber(string.match(last[1], '^%d+')) >= tonumber(spp) then return 'known' end
point = '{"at":' .. now() .. ',' .. string.sub(point, 2)
redis.call('XADD', job_key(id, 'curve'), spp .. '-0', 'point', point)
redis.call('HSET', job_key(id), 'latest', point, 'spp', spp, 'latest_paused_ms', paused_ms(id))
redis.call('HINCRBY', job_key(id), 'points', 1)
announce(id, 'point', point)
return 'appended'
