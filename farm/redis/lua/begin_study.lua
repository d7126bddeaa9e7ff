-- From now on the pictures of a study may be put, for so long.
-- ARGV: study, ms
redis.call('SET', study_key(ARGV[1], 'making'), '1', 'PX', ARGV[2])
