-- A monitor takes a job that nobody owns.
-- ARGV: job, lease in ms
-- Returns the fencing token, or nil.
for_farm.own = function(ARGV)
  local id = ARGV[1]
  if redis.call('EXISTS', job_key(id, 'owner')) == 1 then return nil end
  if redis.call('SISMEMBER', UNFINISHED, id) == 0 then return nil end
  local token = tostring(redis.call('INCR', job_key(id, 'fence')))
  redis.call('SET', job_key(id, 'owner'), token, 'PX', ARGV[2])
  return token
end

-- A monitor renews its ownership of jobs.
-- ARGV: lease in ms, then job, token, job, token, …
-- Returns the jobs that it has lost.
for_farm.renew = function(ARGV)
  local lost = {}
  for i = 2, #ARGV, 2 do
    if Job.is_owned(ARGV[i], ARGV[i + 1]) then
      redis.call('PEXPIRE', job_key(ARGV[i], 'owner'), ARGV[1])
    else
      lost[#lost + 1] = ARGV[i]
    end
  end
  return lost
end

-- A monitor gives jobs back, so that another need not wait for its lease to run out.
-- ARGV: job, token, job, token, …
for_farm.disown = function(ARGV)
  for i = 1, #ARGV, 2 do
    if Job.is_owned(ARGV[i], ARGV[i + 1]) then
      redis.call('DEL', job_key(ARGV[i], 'owner'))
      redis.call('PUBLISH', WAKE_MONITORS, FREE .. ARGV[i])
    end
  end
end

-- Plan the slices up to, not including, `stop`; a repeated call plans nothing twice. They come into
-- the job's stream as they are leased, so to plan many costs no more than to plan one.
-- ARGV: job, token, stop, spp at which the job is expected to end or ''
-- Returns 'planned', 'fenced' or 'ended'.
for_farm.plan = function(ARGV)
  local id, token, stop = ARGV[1], ARGV[2], tonumber(ARGV[3])
  if not Job.is_owned(id, token) then return 'fenced' end
  if not Job.is_open(id) then return 'ended' end
  local planned = tonumber(redis.call('HGET', job_key(id), 'planned'))
  if ARGV[4] and ARGV[4] ~= '' then redis.call('HSET', job_key(id), 'expected_spp', ARGV[4]) end
  if stop > planned then
    redis.call('HSET', job_key(id), 'planned', stop)
    redis.call('HINCRBY', job_key(id), 'ready', stop - planned)
    changed[id], has_more[id] = true, true
  end
  return 'planned'
end

-- Append a point to the curve, once for each spp.
-- ARGV: job, token, spp, point (JSON object)
-- Returns 'appended', 'known' or 'fenced'.
for_farm.append_point = function(ARGV)
  local id, token, spp, point = ARGV[1], ARGV[2], ARGV[3], ARGV[4]
  if not Job.is_owned(id, token) then return 'fenced' end
  local last = redis.call('XREVRANGE', job_key(id, 'curve'), '+', '-', 'COUNT', 1)[1]
  if last and tonumber(string.match(last[1], '^%d+')) >= tonumber(spp) then return 'known' end
  point = '{"at":' .. now() .. ',' .. string.sub(point, 2)
  redis.call('XADD', job_key(id, 'curve'), spp .. '-0', 'point', point)
  redis.call('HSET', job_key(id), 'latest', point, 'spp', spp, 'latest_paused_ms', Job.paused_ms(id))
  redis.call('HINCRBY', job_key(id), 'points', 1)
  Outbox.announce(id, 'point', point)
  return 'appended'
end

-- The partial of a committed slice is lost or spoiled: it is taken out of the ledger and planned
-- again.
-- ARGV: job, token, index, blob, cause
-- Returns how often that has happened to the slice, 0 where the ledger has another blob (or none)
-- by now, or 'fenced'.
for_farm.reject = function(ARGV)
  local id, index = ARGV[1], ARGV[3]
  if not Job.is_owned(id, ARGV[2]) then return 'fenced' end
  local job, ledger = job_key(id), job_key(id, 'ledger')
  local record = redis.call('HGET', ledger, index)
  if not record or not Job.is_open(id) then return 0 end
  record = cjson.decode(record)
  if record.blob ~= ARGV[4] then return 0 end
  redis.call('HDEL', ledger, index)
  redis.call('ZREM', job_key(id, 'seeds'), string.format('%.0f-%.0f', record.first_seed, record.last_seed))
  redis.call('HINCRBY', job, 'committed', -1)
  redis.call('XADD', job_key(id, 'slices'), '*', 'index', index)
  redis.call('HINCRBY', job, 'ready', 1)
  local prefix = redis.call('HGET', job, 'prefix')
  if prefix and tonumber(index) < tonumber(prefix) then redis.call('HSET', job, 'prefix', index) end
  changed[id], has_more[id] = true, true
  Outbox.announce(id, 'trouble', cjson.encode({index = tonumber(index), worker = record.worker, cause = ARGV[5]}))
  Slice.note_try(id, index, record.worker, 'rejected', ARGV[5], '', '')
  return redis.call('HINCRBY', job_key(id, 'spoiled'), index, 1)
end

-- The owner shows a set of results; who follows the job is told of the first.
-- ARGV: job, token, where it is in the blob store, its spp, SHA-256 by blob (JSON) or ''
-- Returns 'shown' or 'fenced'.
for_farm.show = function(ARGV)
  local id, token, results, spp, digests = ARGV[1], ARGV[2], ARGV[3], ARGV[4], ARGV[5]
  if not Job.is_owned(id, token) then return 'fenced' end
  Job.show(id, results, spp, digests)
  return 'shown'
end

-- The owner notes the SHA-256 of a blob of the job that it is about to put, or forgets one.
-- ARGV: job, token, blob without jobs/ID/, SHA-256 or '' where the blob has gone
-- Returns 'noted' or 'fenced'.
for_farm.note_blob = function(ARGV)
  local id, token, blob, sha256 = ARGV[1], ARGV[2], ARGV[3], ARGV[4]
  if not Job.is_owned(id, token) then return 'fenced' end
  if sha256 == '' then
    redis.call('HDEL', job_key(id, 'digests'), blob)
  else
    redis.call('HSET', job_key(id, 'digests'), blob, sha256)
  end
  return 'noted'
end

-- The owner sets fields of a job.
-- ARGV: job, token, field, value, field, value, …
-- Returns 'saved' or 'fenced'.
for_farm.save = function(ARGV)
  if not Job.is_owned(ARGV[1], ARGV[2]) then return 'fenced' end
  redis.call('HSET', job_key(ARGV[1]), unpack(ARGV, 3))
  return 'saved'
end

-- The owner has written the results of an ended job: nothing else of it is needed.
-- ARGV: job, token, spp of its image, results or '' where it has none, SHA-256 by blob (JSON) or ''
--       where they were shown before, notes (JSON)
-- Returns 'concluded' or 'fenced'.
for_farm.conclude = function(ARGV)
  local id, token, spp, results, digests, notes = ARGV[1], ARGV[2], ARGV[3], ARGV[4], ARGV[5], ARGV[6]
  if not Job.is_owned(id, token) then return 'fenced' end
  if results ~= '' then
    Job.show(id, results, spp, digests)
  else
    redis.call('HSET', job_key(id), 'results', '')
  end
  redis.call('HSET', job_key(id), 'spp', spp, 'notes', notes, 'concluded', 1)
  return 'concluded'
end

-- The owner has written the results of an ended job and cleared the rest.
-- ARGV: job, token, '1' where its last checkpoint stays, for another job to go on from
-- Returns 'finished' or 'fenced'.
for_farm.finish = function(ARGV)
  local id = ARGV[1]
  if not Job.is_owned(id, ARGV[2]) then return 'fenced' end
  redis.call('HSET', job_key(id), 'finished_at', now())
  if ARGV[3] ~= '1' then redis.call('HDEL', job_key(id), 'checkpoint') end
  redis.call('SREM', UNFINISHED, id)
  redis.call('DEL', job_key(id, 'owner'), job_key(id, 'seeds'))
  Outbox.announce(id, 'finished', '{}')
  return 'finished'
end

-- Redis has lost the job's hash, or its state in it, as by an eviction: no monitor has work with the job
-- any more, and nothing of it is leased. What else there is of it stays.
-- ARGV: job, token
-- Returns 'abandoned', 'kept' (its state is there) or 'fenced'.
for_farm.abandon = function(ARGV)
  local id = ARGV[1]
  if not Job.is_owned(id, ARGV[2]) then return 'fenced' end
  if redis.call('HEXISTS', job_key(id), 'state') == 1 then return 'kept' end
  Job.withdraw(id)
  redis.call('UNLINK', job_key(id))  -- counters that were written since, which would be taken for a job
  redis.call('ZREM', OPEN, id)
  redis.call('SREM', UNFINISHED, id)
  redis.call('DEL', job_key(id, 'owner'))
  redis.call('PUBLISH', WAKE_WORKERS, 'ended ' .. id)
  Waiting.file_all_anew()  -- where it waited is not known any more
  return 'abandoned'
end
