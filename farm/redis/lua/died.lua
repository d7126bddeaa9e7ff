-- A render child died on a slice. The slice goes back, or the job is poisoned.
-- ARGV: job, entry, worker, index, cause, most tries, machine ms, what it printed
-- Returns 'put back', 'poisoned' or 'lost'.
local id, entry, worker, index, cause = ARGV[1], ARGV[2], ARGV[3], ARGV[4], ARGV[5]
local held, tries = holds(id, entry, worker)
if not held then
  note_if_outrun(id, entry, index, worker, ARGV[7], ARGV[8])
  return 'lost'
end
spend(id, ARGV[7])
local causes = note_death(id, index, worker, cause, ARGV[7], ARGV[8])
if #causes >= tonumber(ARGV[6]) then
  poison(id, index, causes)
  return 'poisoned'
end
put_back(id, entry, tries)
return 'put back'
