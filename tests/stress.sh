#!/usr/bin/env bash
# stress.sh RUNS LOAD PYTEST...: run the tests again and again, in random order, every second time
# beside LOAD busy processes. At the end, say how each run went, and which tests failed how often.
runs=$1 load=$2
shift 2
log=$(mktemp)
trap 'kill $(jobs -p) 2> /dev/null; rm -f "$log"' EXIT
trap 'exit 130' INT
red() { grep "$@" '^FAILED\|^ERROR' "$log"; }
rows='run, busy processes, red, seconds' green=true
for run in $(seq "$runs"); do
  busy=$((run % 2 ? 0 : load)) before=$(red -c) SECONDS=0
  for _ in $(seq "$busy"); do yes > /dev/null & done
  CI=true "$@" --file-order "$run" | tee -a "$log"
  [ "${PIPESTATUS[0]}" = 0 ] || green=false
  kill $(jobs -p) 2> /dev/null
  rows+=$'\n'"$run, $busy, $(($(red -c) - before)), $SECONDS"
done
echo "$rows"
red | cut -d ' ' -f 2 | sort | uniq -c | sort -rn
$green
