-- Runs the command that ARGV names. A process that is older or newer than the data, whenever it wakes
-- up, changes nothing. What a command did is filed and told when it is done, wherever it returned.
local layout = redis.call('GET', SCHEMA)
if layout and layout ~= LAYOUT then return redis.error_reply('WRONGLAYOUT ' .. layout) end
local name = table.remove(ARGV, 1)
local command = for_workers[name]
if not command then
  -- Workers may not touch this key, so Redis refuses a worker here, whatever the command is.
  redis.call('EXISTS', MONITORS)
  command = for_farm[name]
end
if not command then return redis.error_reply('ERR Plateau has no command ' .. tostring(name)) end
local answer = command(ARGV)
Waiting.file_changed()
Outbox.fill()
return answer
