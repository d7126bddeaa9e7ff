-- A monitor takes a job that nobody owns.
-- Returns the fencing token, or nothing.
function for_farm.own(it)
  local id = it.job
  if redis.call('EXISTS', job_key(id, 'owner')) == 1 then return nil end
  if redis.call('SISMEMBER', UNFINISHED, id) == 0 then return nil end
  local token = tostring(redis.call('HINCRBY', job_key(id, 'sealed'), 'fence', 1))
  redis.call('SET', job_key(id, 'owner'), token, 'PX', it.lease_ms)
  return token
end

-- A monitor renews its ownership of jobs.
-- Returns the jobs that it has lost.
function for_farm.renew(it)
  local lost = {}
  for _, one in ipairs(it.owned) do
    if Job.is_owned(one.job_id, one.token) then
      redis.call('PEXPIRE', job_key(one.job_id, 'owner'), it.lease_ms)
    else
      lost[#lost + 1] = one.job_id
    end
  end
  return lost
end

-- A monitor gives jobs back, so that another need not wait for its lease to run out.
function for_farm.disown(it)
  for _, one in ipairs(it.owned) do
    if Job.is_owned(one.job_id, one.token) then
      redis.call('DEL', job_key(one.job_id, 'owner'))
      redis.call('PUBLISH', WAKE_MONITORS, FREE .. one.job_id)
    end
  end
end

-- Plan the slices up to, not including, `stop`; a repeated call plans nothing twice. A slice enters the
-- job's stream with its lease, so planning many costs no more than planning one.
-- Returns 'planned', 'fenced' or 'ended'.
function for_farm.plan(it)
  local id = it.job
  if not Job.is_owned(id, it.token) then return 'fenced' end
  if not Job.is_open(id) then return 'ended' end
  local planned = tonumber(redis.call('HGET', job_key(id), 'planned'))
  if it.expected_spp then redis.call('HSET', job_key(id), 'expected_spp', it.expected_spp) end
  if it.stop > planned then
    redis.call('HSET', job_key(id), 'planned', it.stop)
    redis.call('HINCRBY', job_key(id), 'ready', it.stop - planned)
    changed[id], has_more[id] = true, true
  end
  return 'planned'
end

-- Append a point to the curve, once for each spp, and with it the round that its image decides, if any;
-- tell if it is the last. Returns 'appended', 'known' or 'fenced'.
function for_farm.append_point(it)
  local id = it.job
  if not Job.is_owned(id, it.token) then return 'fenced' end
  local last = redis.call('XREVRANGE', job_key(id, 'curve'), '+', '-', 'COUNT', 1)[1]
  if last and tonumber(string.match(last[1], '^%d+')) >= it.spp then return 'known' end
  if it.round then redis.call('ZADD', job_key(id, 'rounds'), it.round.first, it.round.json) end
  Job.append_point(id, it.spp, now(), it.point)
  if it.is_last then Outbox.announce(id, 'rendered', '{}') end
  return 'appended'
end

-- The partial of a committed slice is lost or spoiled: the slice leaves the ledger and is planned again.
-- Returns how often that has happened to the slice; 0 where the ledger has another blob, or none, or the
-- job has ended; nothing where the owner is fenced.
function for_farm.reject(it)
  local id, index = it.job, it.index
  if not Job.is_owned(id, it.token) then return nil end
  local job, record = job_key(id), Slice.record(id, index)
  if not record or not Job.is_open(id) or record.blob ~= it.blob then return 0 end
  redis.call('HDEL', job_key(id, 'ledger'), index)
  redis.call('ZREM', job_key(id, 'seeds'), Slice.seeds(record))
  redis.call('HINCRBY', job, 'committed', -1)
  local film = redis.call('HMGET', job, 'width', 'height')
  Slice.count_samples(id, -Slice.samples(id, index, record.spp, film[1], film[2]))
  redis.call('XADD', job_key(id, 'slices'), '*', 'index', index)
  redis.call('HINCRBY', job, 'ready', 1)
  local prefix = redis.call('HGET', job, 'prefix')
  if prefix and index < tonumber(prefix) then redis.call('HSET', job, 'prefix', index) end
  changed[id], has_more[id] = true, true
  Outbox.announce(id, 'trouble', {index = index, worker = record.worker, cause = it.cause})
  Slice.note_try(id, index, record.worker, 'rejected', it.cause, '', '')
  return redis.call('HINCRBY', job_key(id, 'deaths'), index .. ' spoiled', 1)
end

-- The owner shows a set of results; the first is announced.
-- Returns 'shown' or 'fenced'.
function for_farm.show(it)
  if not Job.is_owned(it.job, it.token) then return 'fenced' end
  Job.show(it.job, it.results, it.spp, it.digests)
  return 'shown'
end

-- The owner notes the SHA-256 of a blob before it puts it, or forgets one.
-- Returns 'noted' or 'fenced'.
function for_farm.note_blob(it)
  if not Job.is_owned(it.job, it.token) then return 'fenced' end
  put(job_key(it.job, 'digests'), it.blob, it.sha256)
  return 'noted'
end

-- The owner notes the job's last checkpoint, and that the job waits with it for a look at its shot.
-- Returns 'saved' or 'fenced'.
function for_farm.save(it)
  if not Job.is_owned(it.job, it.token) then return 'fenced' end
  redis.call('HSET', job_key(it.job), 'checkpoint', it.checkpoint)
  if it.waits then redis.call('HSET', job_key(it.job), 'shot_waits', it.waits) end
  return 'saved'
end

-- The owner has written the results of an ended job: its other blobs may go.
-- Returns 'concluded' or 'fenced'.
function for_farm.conclude(it)
  local id = it.job
  if not Job.is_owned(id, it.token) then return 'fenced' end
  if it.results ~= '' then Job.show(id, it.results, it.spp, it.digests) end
  redis.call('HSET', job_key(id), 'results', it.results, 'spp', it.spp, 'notes', it.notes, 'concluded', 1)
  if it.spp_range then redis.call('HSET', job_key(id), 'spp_min', it.spp_range[1], 'spp_max', it.spp_range[2]) end
  return 'concluded'
end

-- The owner has written the results of an ended job and cleared the rest.
-- Returns 'finished' or 'fenced'.
function for_farm.finish(it)
  local id = it.job
  if not Job.is_owned(id, it.token) then return 'fenced' end
  redis.call('HSET', job_key(id), 'finished_at', now())
  if not it.keeps_sums then redis.call('HDEL', job_key(id), 'checkpoint') end
  redis.call('SREM', UNFINISHED, id)
  redis.call('DEL', job_key(id, 'owner'), job_key(id, 'seeds'))
  Outbox.announce(id, 'finished', {})
  Outbox.fill(id)
  After.settle(id)
  return 'finished'
end

-- Redis has lost the job's hash, or its state in it, as by an eviction: the job needs no monitor any more,
-- and none of its slices is leased. Its other records stay.
-- Returns 'abandoned', 'kept' (its state is there) or 'fenced'.
function for_farm.abandon(it)
  local id = it.job
  if not Job.is_owned(id, it.token) then return 'fenced' end
  if redis.call('HEXISTS', job_key(id), 'state') == 1 then return 'kept' end
  Job.withdraw(id)
  redis.call('UNLINK', job_key(id))  -- later counters, which would look like a job
  redis.call('ZREM', OPEN, id)
  redis.call('SREM', UNFINISHED, id)
  redis.call('DEL', job_key(id, 'owner'))
  redis.call('PUBLISH', WAKE_WORKERS, 'ended ' .. id)
  After.settle(id)
  Waiting.file_all_anew()  -- the job's queue is unknown
  return 'abandoned'
end
