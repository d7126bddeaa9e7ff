-- Runs the command that ARGV names, with its arguments as JSON; the answer is JSON, too. A process of
-- another version than the data changes nothing. After any end of a command, changed jobs are filed.
local layout = redis.call('GET', SCHEMA)
if layout and layout ~= LAYOUT then return redis.error_reply('WRONGLAYOUT ' .. layout) end
local command = for_workers[ARGV[1]]
if not command then
  -- This key is forbidden to workers, so Redis refuses any such command of a worker here.
  redis.call('EXISTS', MONITORS)
  for _, define in ipairs(subjects) do define() end
  command = for_farm[ARGV[1]]
end
if not command then return redis.error_reply('ERR Plateau has no command ' .. tostring(ARGV[1])) end
local answer = command(cjson.decode(ARGV[2]))
Waiting.file_changed()
return cjson.encode(answer)
