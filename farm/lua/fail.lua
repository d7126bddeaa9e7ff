-- The scene itself is at fault, says the worker that holds the lease: the job fails, no retry.
-- ARGV: job, entry, worker, reason
-- Returns 'failed' or 'lost'.
if not holds(ARGV[1], ARGV[2], ARGV[3]) then return 'lost' end
end_job(ARGV[1], 'failed', ARGV[4])
return 'failed'
