-- Runs the command that ARGV names, with what it is given as JSON; the answer is JSON, too. A process that
-- is older or newer than the data, whenever it wakes up, changes nothing. What a command did is filed and
-- told when it is done, wherever it returned; after its answer it may return an error.
local layout = redis.call('GET', SCHEMA)
if layout and layout ~= LAYOUT then return redis.error_reply('WRONGLAYOUT ' .. layout) end
local command = for_workers[ARGV[1]]
if not command then
  -- Workers may not touch this key, so Redis refuses a worker here, whatever the command is.
  redis.call('EXISTS', MONITORS)
  for _, define in ipairs(subjects) do define() end
  command = for_farm[ARGV[1]]
end
if not command then return redis.error_reply('ERR Plateau has no command ' .. tostring(ARGV[1])) end
local answer, refused = command(cjson.decode(ARGV[2]))
Waiting.file_changed()
Outbox.fill()
return refused or cjson.encode(answer)
