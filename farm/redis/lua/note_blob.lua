-- The owner notes the SHA-256 of a blob of the job that it is about to put, or forgets one.
-- ARGV: job, token, blob without jobs/ID/, SHA-256 or '' where the blob has gone
-- Returns 'noted' or 'fenced'.
local id, token, blob, sha256 = ARGV[1], ARGV[2], ARGV[3], ARGV[4]
if not owned(id, token) then return 'fenced' end
if sha256 == '' then
  redis.call('HDEL', job_key(id, 'digests'), blob)
else
  redis.call('HSET', job_key(id, 'digests'), blob, sha256)
end
return 'noted'
