-- The scene itself is at fault, says the worker that holds the lease: the job fails, no retry.
-- ARGV: job, entry, worker, reason, index, machine ms, what the render child printed
-- Returns 'failed' or 'lost'.
if not holds(ARGV[1], ARGV[2], ARGV[3]) then return 'lost' end
note_try(ARGV[1], ARGV[5], ARGV[3], 'failed', ARGV[4], ARGV[6], ARGV[7])
end_job(ARGV[1], 'failed', ARGV[4])
return 'failed'
