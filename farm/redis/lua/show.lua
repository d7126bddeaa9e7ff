-- The owner shows a set of results; who follows the job is told of the first.
-- ARGV: job, token, where it is in the blob store, its spp, SHA-256 by blob (JSON) or ''
-- Returns 'shown' or 'fenced'.
local id, token, results, spp, digests = ARGV[1], ARGV[2], ARGV[3], ARGV[4], ARGV[5]
if not owned(id, token) then return 'fenced' end
show(id, results, spp, digests)
return 'shown'
