"""Who may receive notices: the API checks it when a job asks, and the monitor when it sends."""
