-- Give the farm a secret to sign webhooks with, unless it has one.
-- ARGV: a secret
-- Returns {the farm's secret, those before it that sign still, with blanks between}.
redis.call('SET', WEBHOOK_SECRET, ARGV[1], 'NX')
return {redis.call('GET', WEBHOOK_SECRET), redis.call('GET', OLD_WEBHOOK_SECRET) or ''}
