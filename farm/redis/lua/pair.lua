-- Give Redis the id that it shares with its blob store, unless it has one.
-- ARGV: an id, '1' where the blob store is marked with it, or ''
-- Returns the id that Redis has now.
redis.call('HSETNX', STORE, 'id', ARGV[1])
if ARGV[2] == '1' then redis.call('HSET', STORE, 'paired', 1) end
return redis.call('HGET', STORE, 'id')
