-- Begin a sweep of the farm, unless one was begun less than so long ago.
-- ARGV: ms
-- Returns 1, or nil.
return redis.call('SET', SWEPT, '1', 'NX', 'PX', ARGV[1]) and 1
