-- The owner has written the results of an ended job: nothing else of it is needed.
-- ARGV: job, token, spp of its image, results or '' where it has none, SHA-256 by blob (JSON) or ''
--       where they were shown before, notes (JSON)
-- Returns 'concluded' or 'fenced'.
local id, token, spp, results, digests, notes = ARGV[1], ARGV[2], ARGV[3], ARGV[4], ARGV[5], ARGV[6]
if not owned(id, token) then return 'fenced' end
if results ~= '' then
  show(id, results, spp, digests)
else
  redis.call('HSET', job_key(id), 'results', '')
end
redis.call('HSET', job_key(id), 'spp', spp, 'notes', notes, 'concluded', 1)
return 'concluded'
