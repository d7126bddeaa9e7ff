-- A worker that drains, is cut off from what it needs, or cannot render, gives its slice back
-- unharmed.
-- ARGV: job, entry, worker, machine ms, index, 'handed-back' or 'unfit', cause, what the render
--       child printed
-- Returns 'put back' or 'lost'.
local id, entry, worker = ARGV[1], ARGV[2], ARGV[3]
local held, tries = holds(id, entry, worker)
if not held then
  note_if_outrun(id, entry, ARGV[5], worker, ARGV[4], ARGV[8])
  return 'lost'
end
spend(id, ARGV[4])
put_back(id, entry, tries - 1)
note_try(id, ARGV[5], worker, ARGV[6], ARGV[7], ARGV[4], ARGV[8])
-- A worker that could render nothing does not bind the others to its variant.
local holders = redis.call('XPENDING', job_key(id, 'slices'), GROUP)[4]
local done = redis.call('HMGET', job_key(id), 'committed', 'points')
if #holders == 1 and done[1] == '0' and done[2] == '0' then
  redis.call('HDEL', job_key(id), 'variant')
end
return 'put back'
