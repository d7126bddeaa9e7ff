-- Note that a process was refused, for those who look why it is not there: the last one of a machine
-- and role, for an hour.
-- ARGV: machine and role, what is known of it (JSON, without its time)
redis.call('HSET', REFUSED, ARGV[1], '{"at":' .. now() .. ',' .. string.sub(ARGV[2], 2))
redis.call('EXPIRE', REFUSED, 3600)
