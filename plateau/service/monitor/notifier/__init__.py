"""Tells others of ended jobs, and of troubles. The reasons are in docs/decisions/notices.md."""
