-- Guard a batch against flicker: from now on it takes only jobs that stop as its others do.
-- ARGV: batch, number of its newest job when all of its jobs were found to stop alike
-- Returns 'guarded', 'changed' (another job has joined it since) or 'missing'.
local batch, compared = ARGV[1], ARGV[2]
local newest = redis.call('ZSCORE', BATCHES, batch)
if not newest then return 'missing' end
if newest ~= compared then return 'changed' end
redis.call('SADD', GUARDED, batch)
return 'guarded'
