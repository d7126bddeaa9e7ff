-- Give the farm another secret to sign webhooks with; the newest of those before it go on signing.
-- ARGV: the secret, ms for which the others sign, how many of them
local former = (redis.call('GET', WEBHOOK_SECRET) or '') .. ' ' .. (redis.call('GET', OLD_WEBHOOK_SECRET) or '')
local kept = {}
for secret in string.gmatch(former, '%S+') do
  if #kept < tonumber(ARGV[3]) then kept[#kept + 1] = secret end
end
redis.call('SET', OLD_WEBHOOK_SECRET, table.concat(kept, ' '), 'PX', ARGV[2])
redis.call('SET', WEBHOOK_SECRET, ARGV[1])
