-- Note that a sweep was done just now.
redis.call('HSET', TOTALS, 'swept at', string.format('%.0f', now()))
