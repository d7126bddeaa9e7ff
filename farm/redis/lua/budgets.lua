-- Budgets: core hours that the jobs of a batch may cost, a single job, or those of an API key in a week (from
-- Monday, UTC). What jobs with a budget cost is counted by group: "batch NAME" or "key ID WEEK".

local HOUR_MS, WEEK_MS = 3600000, 7 * 86400000
-- The first Monday after the epoch, which was a Thursday.
local MONDAY_MS = 4 * 86400000

-- The budgets of a job: their core hours, words, and groups; a single job has none.
local function budgets_of(id)
  local party, weekly, batch, most = unpack(
    redis.call('HMGET', job_key(id), 'party', 'key_budget', 'batch', 'budget'))
  local found = {}
  if most and (batch or '') ~= '' then
    found[1] = {most = most, words = "its batch's budget of %.6g core hours", group = 'batch ' .. batch}
  elseif most then
    found[1] = {most = most, words = 'its budget of %.6g core hours'}
  end
  if party and weekly then
    local week = math.floor((now() - MONDAY_MS) / WEEK_MS)
    found[#found + 1] = {most = weekly, words = "its key's budget of %.6g core hours a week",
                         group = string.format('key %s %d', party, week),
                         over = string.format('key %s %d', party, week - 1)}
  end
  return found
end

-- Count what a try of a slice has cost.
function Budget.spend(id, core_ms)
  for _, budget in ipairs(budgets_of(id)) do
    if budget.group then redis.call('HINCRBY', SPENT, budget.group, string.format('%.0f', core_ms)) end
    if budget.over then redis.call('HDEL', SPENT, budget.over) end
  end
end

-- The first budget of a job that is used up, in words; '' if none is.
function Budget.used(id)
  local own = redis.call('HMGET', job_key(id), 'machine_ms', 'further_core_ms')
  for _, budget in ipairs(budgets_of(id)) do
    local spent = budget.group and redis.call('HGET', SPENT, budget.group) or 0
    if not budget.group then spent = (own[1] or 0) + (own[2] or 0) end
    if spent - budget.most * HOUR_MS >= 0 then return string.format(budget.words, budget.most) end
  end
  return ''
end
