-- An API is alive.
-- ARGV: API, description (JSON) or '' where it signs off, ms after which it is taken for dead
-- Returns an error where it does not speak what the farm does.
return note_member(APIS, api_member_key(ARGV[1]), ARGV[1], ARGV[2], ARGV[3])
